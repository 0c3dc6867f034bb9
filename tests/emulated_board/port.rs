//! A TCP port with one client at a time, as a serial port is open in one program.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};

/// A client that comes while another one is served waits for its turn.
pub struct Port {
    listener: TcpListener,
    client: Option<Client>,
}

struct Client {
    stream: TcpStream,
    /// What its socket had no room for.
    unwritten: Vec<u8>,
}

impl Port {
    pub fn listen(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            client: None,
        })
    }

    pub fn is_connected(&self) -> bool {
        self.client.is_some()
    }

    /// Serves the next client, unless there is one. Returns whether one has come.
    pub fn accept(&mut self) -> bool {
        if self.is_connected() {
            return false;
        }
        self.client = self.listener.accept().and_then(Client::new).ok();
        self.is_connected()
    }

    /// At most `limit` bytes of the client. One that is gone is let go of.
    pub fn read(&mut self, limit: usize) -> Vec<u8> {
        let read = self.client.as_mut().map(|client| client.read(limit));
        self.keep_if(read)
    }

    /// Sends to the client, if there is one.
    pub fn write(&mut self, bytes: &[u8]) {
        let written = self.client.as_mut().map(|client| client.write(bytes));
        self.keep_if(written)
    }

    /// Bytes that wait for the client to read.
    pub fn unwritten(&self) -> usize {
        self.client.as_ref().map_or(0, |client| client.unwritten.len())
    }

    /// The result, or nothing, and the client is gone.
    fn keep_if<T: Default>(&mut self, done: Option<io::Result<T>>) -> T {
        match done {
            Some(Ok(result)) => result,
            Some(Err(_)) => {
                self.client = None;
                T::default()
            }
            None => T::default(),
        }
    }
}

impl Client {
    fn new((stream, _): (TcpStream, SocketAddr)) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        Ok(Self {
            stream,
            unwritten: Vec::new(),
        })
    }

    fn read(&mut self, limit: usize) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; limit];
        match self.stream.read(&mut bytes) {
            Ok(0) => return Err(ErrorKind::ConnectionReset.into()),
            Ok(length) => bytes.truncate(length),
            Err(error) if error.kind() == ErrorKind::WouldBlock => bytes.clear(),
            Err(error) => return Err(error),
        }
        Ok(bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.unwritten.extend(bytes);
        while !self.unwritten.is_empty() {
            match self.stream.write(&self.unwritten) {
                Ok(written) => drop(self.unwritten.drain(..written)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
