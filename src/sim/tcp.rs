//! TCP for a wire: each client is a link of its own, so one that stops reading holds up nobody else.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream};

use embassy_time::Timer;
use embedded_io_async::{ErrorType, Write};

use crate::tasks::{ByteSource, ReceiveError};

/// How often a socket that was not ready is asked again, in milliseconds of simulated time. The simulator polls its few
/// sockets instead of running an event loop for them.
const POLL_MS: u64 = 5;

/// Clients that have connected and wait for a link.
pub struct Clients {
    listener: TcpListener,
}

/// A client, and both directions of the wire to it.
pub struct Client {
    /// Where it has connected from.
    pub address: SocketAddr,
    /// To the client.
    pub transmitter: TcpTransmitter,
    /// From the client.
    pub receiver: TcpReceiver,
}

impl Clients {
    /// Listens on `address`.
    ///
    /// # Errors
    /// The address can't be listened on, for example because the port is taken.
    pub fn listen(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener })
    }

    /// Waits for the next client.
    pub async fn next(&self) -> Client {
        loop {
            match self.listener.accept().and_then(Client::new) {
                Ok(client) => return client,
                // A client that is gone before it was served is no reason to stop.
                Err(_) => Timer::after_millis(POLL_MS).await,
            }
        }
    }
}

impl Client {
    fn new((stream, address): (TcpStream, SocketAddr)) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let receiver = TcpReceiver(stream.try_clone()?);
        Ok(Self {
            address,
            transmitter: TcpTransmitter(stream),
            receiver,
        })
    }
}

/// The wire to one client.
pub struct TcpTransmitter(TcpStream);

impl ErrorType for TcpTransmitter {
    type Error = io::Error;
}

impl Write for TcpTransmitter {
    async fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        loop {
            match io::Write::write(&mut self.0, bytes) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => Timer::after_millis(POLL_MS).await,
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                done => return done,
            }
        }
    }

    async fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The wire from one client.
pub struct TcpReceiver(TcpStream);

impl ByteSource for TcpReceiver {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        loop {
            match io::Read::read(&mut self.0, buffer) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => Timer::after_millis(POLL_MS).await,
                Ok(0) | Err(_) => return Err(ReceiveError::Closed),
                Ok(received) => return Ok(received),
            }
        }
    }
}
