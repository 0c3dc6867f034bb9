//! TCP for a wire: each client is a link of its own, so one that stops reading holds up nobody else.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream};

use embassy_time::Timer;
use embedded_io_async::{ErrorType, Write};

/// How often a socket that was not ready is asked again, in milliseconds of simulated time. The simulator polls its few
/// sockets instead of running an event loop for them.
const POLL_MS: u64 = 5;

/// Clients that have connected and wait for a link.
pub struct Clients {
    listener: TcpListener,
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
    pub async fn next(&self) -> TcpWire {
        loop {
            match self.listener.accept().and_then(TcpWire::new) {
                Ok(wire) => return wire,
                // A client that is gone before it was served is no reason to stop.
                Err(_) => Timer::after_millis(POLL_MS).await,
            }
        }
    }
}

/// The wire to one client.
pub struct TcpWire {
    stream: TcpStream,
    peer: SocketAddr,
}

impl TcpWire {
    fn new((stream, peer): (TcpStream, SocketAddr)) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        Ok(Self { stream, peer })
    }

    /// Who is at the other end.
    pub fn peer(&self) -> SocketAddr {
        self.peer
    }
}

impl ErrorType for TcpWire {
    type Error = io::Error;
}

impl Write for TcpWire {
    async fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        loop {
            match io::Write::write(&mut self.stream, bytes) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    Timer::after_millis(POLL_MS).await;
                }
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                done => return done,
            }
        }
    }

    async fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
