//! A TCP port with one client at a time, as a serial port is open in one program.

use std::io;
use std::net::{SocketAddr, TcpListener};

use emulator::host_stream::HostStream;

/// A client that comes while another one is served waits for its turn.
pub struct Port {
    listener: TcpListener,
    client: Option<HostStream>,
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
        self.client = self.listener.accept().and_then(HostStream::new).ok();
        self.is_connected()
    }

    /// At most `limit` bytes of the client. One that is gone is dropped.
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
        self.client.as_ref().map_or(0, HostStream::unwritten)
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
