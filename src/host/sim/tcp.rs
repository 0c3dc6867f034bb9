//! TCP links: one per client, so a client that stops reading does not block others.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream};

use embassy_time::Timer;
use embedded_io_async::{ErrorType, Write};

use crate::tasks::{ByteSource, ReceiveError};

/// Poll interval of sockets, in milliseconds of simulated time.
pub(super) const POLL_MS: u64 = 5;

/// Listener for clients.
pub struct Clients {
    listener: TcpListener,
}

/// A connected client.
pub struct Client {
    /// Its address.
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
    /// The address can't be bound, for example because the port is in use.
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

    /// The next client, if one is waiting.
    pub fn try_next(&self) -> Option<Client> {
        // A client that has disconnected already is skipped.
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

/// Transmitter to a client.
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

/// Receiver from a client.
pub struct TcpReceiver(TcpStream);

impl TcpReceiver {
    /// Closes the connection, and discards what the client has sent.
    pub fn refuse(mut self) {
        const DISCARDED_BYTES: usize = 65_536;
        // Closing a socket with unread data resets the connection, and the client may lose the reason of the refusal.
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
