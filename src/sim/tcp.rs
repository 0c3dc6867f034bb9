//! TCP for a wire: each client is a link of its own, so one that stops reading holds up nobody else.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream};

use embassy_time::Timer;
use embedded_io_async::{ErrorType, Write};

use crate::tasks::{ByteSource, ReceiveError};

/// How often a socket that was not ready is asked again, in milliseconds of simulated time. The simulator polls its few
/// sockets instead of running an event loop for them.
pub(super) const POLL_MS: u64 = 5;

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
            if let Some(client) = self.try_next() {
                return client;
            }
            Timer::after_millis(POLL_MS).await;
        }
    }

    /// The next client, if one has connected.
    pub fn try_next(&self) -> Option<Client> {
        // A client that is gone before it was served is no reason to stop.
        self.listener.accept().and_then(Client::new).ok()
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

impl TcpReceiver {
    /// Ends the connection. What the client has sent by now is never handled.
    pub fn refuse(mut self) {
        const DISCARDED_BYTES: usize = 65_536;
        // Closed with something unread, a connection is reset, and with it goes what the client has not read yet. One that
        // sends more than this only loses the reason.
        let _ = io::Read::read(&mut self.0, &mut [0; DISCARDED_BYTES]);
    }
}

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
