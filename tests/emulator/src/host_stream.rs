//! A TCP connection with a program on the host, which never waits.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};

pub struct HostStream {
    stream: TcpStream,
    /// What its socket had no room for.
    unwritten: Vec<u8>,
}

impl HostStream {
    /// What a listener has accepted.
    pub fn new((stream, _): (TcpStream, SocketAddr)) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        Ok(Self {
            stream,
            unwritten: Vec::new(),
        })
    }

    /// At most `limit` bytes, which has to be more than 0. An error: the program has closed the connection.
    pub fn read(&mut self, limit: usize) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; limit];
        match self.stream.read(&mut bytes) {
            Ok(0) => return Err(ErrorKind::ConnectionReset.into()),
            Ok(length) => bytes.truncate(length),
            Err(error) if error.kind() == ErrorKind::WouldBlock => bytes.clear(),
            Err(error) => return Err(error),
        }
        Ok(bytes)
    }

    /// Writes what there is room for; the rest waits for the next call.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
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

    /// Bytes that wait for the program to read.
    pub fn unwritten(&self) -> usize {
        self.unwritten.len()
    }
}
