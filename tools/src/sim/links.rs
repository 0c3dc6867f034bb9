//! Links to ground stations: TCP, one per client, so that a client that stops reading does not block others, and UDP.

use std::convert::Infallible;
use std::io::{self, ErrorKind, Read};
use std::net::{Ipv4Addr, Ipv6Addr, Shutdown, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::ops::Range;

use embassy_time::{Duration, Timer, with_timeout};
use embedded_io_async::{ErrorType, Write};
use rover_battmon::tasks::{ByteSource, CheckIn, ReceiveError};

/// Poll interval of sockets, in milliseconds of simulated time.
pub(super) const POLL_MS: u64 = 5;

/// Time for a client to take what was sent last and to close its side.
const FAREWELL: Duration = Duration::from_secs(1);

/// Assumed capacity of a local link: more than all streams need.
pub(super) const LINK_BYTES_PER_SECOND: u32 = 1_000_000;

/// The simulator has no watchdog that reads check-ins.
pub(super) static UNWATCHED: CheckIn = CheckIn::new("", u32::MAX);

/// Buffer for a datagram of a few MAVLink frames.
const DATAGRAM_BYTES: usize = 2048;

/// Listener for clients.
pub struct Clients {
    listener: TcpListener,
}

/// A connected client. A reference to it is both ends of its link.
pub struct Client {
    /// Its address.
    pub address: SocketAddr,
    stream: TcpStream,
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

    /// Its address.
    ///
    /// # Errors
    /// The system does not say.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
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
        Ok(Self { address, stream })
    }

    /// The address that it has connected to.
    pub fn own_address(&self) -> Option<SocketAddr> {
        self.stream.local_addr().ok()
    }

    /// Closes the connection once the client has taken what was sent, and discards what it still sends.
    pub async fn close(self) {
        let _ = self.stream.shutdown(Shutdown::Write);
        let mut receiver = &self;
        let closed = async { while receiver.receive(&mut [0; 1024]).await.is_ok() {} };
        let _ = with_timeout(FAREWELL, closed).await;
    }

    /// Closes the connection, and discards what the client has sent.
    pub fn refuse(mut self) {
        const DISCARDED_BYTES: usize = 65_536;
        // Closing a socket with unread data resets the connection, and the client may lose the reason of the refusal.
        let _ = self.stream.read(&mut [0; DISCARDED_BYTES]);
    }
}

impl ErrorType for &Client {
    type Error = io::Error;
}

impl Write for &Client {
    async fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        loop {
            match io::Write::write(&mut &self.stream, bytes) {
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

impl ByteSource for &Client {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        loop {
            match (&self.stream).read(buffer) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => Timer::after_millis(POLL_MS).await,
                Ok(0) | Err(_) => return Err(ReceiveError::Closed),
                Ok(received) => return Ok(received),
            }
        }
    }
}

/// UDP socket to one address, which need not listen. A reference to it is its transmitting end.
pub struct UdpWire(UdpSocket);

impl UdpWire {
    /// A socket to `address` from any local port.
    ///
    /// # Errors
    /// The socket can't be created or connected.
    pub fn to(address: SocketAddr) -> io::Result<Self> {
        let any: SocketAddr = match address {
            SocketAddr::V4(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
            SocketAddr::V6(_) => (Ipv6Addr::UNSPECIFIED, 0).into(),
        };
        let socket = UdpSocket::bind(any)?;
        socket.connect(address)?;
        socket.set_nonblocking(true)?;
        Ok(Self(socket))
    }

    /// Its receiving end.
    pub fn receiver(&self) -> UdpReceiver<'_> {
        UdpReceiver {
            socket: &self.0,
            datagram: [0; DATAGRAM_BYTES],
            rest: 0..0,
        }
    }
}

impl ErrorType for &UdpWire {
    type Error = Infallible;
}

impl Write for &UdpWire {
    /// Sends `bytes`, a whole frame, as one datagram.
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        // A datagram that can't be sent is lost, as any datagram may be.
        let _ = self.0.send(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Receiver of a UDP link.
pub struct UdpReceiver<'a> {
    socket: &'a UdpSocket,
    datagram: [u8; DATAGRAM_BYTES],
    /// Unread rest of the datagram.
    rest: Range<usize>,
}

impl ByteSource for UdpReceiver<'_> {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        while self.rest.is_empty() {
            match self.socket.recv(&mut self.datagram) {
                Ok(received) => self.rest = 0..received,
                // No datagram, or the remote port is closed at present.
                Err(_) => Timer::after_millis(POLL_MS).await,
            }
        }
        let taken = self.rest.len().min(buffer.len());
        let end = self.rest.start + taken;
        buffer[..taken].copy_from_slice(&self.datagram[self.rest.start..end]);
        self.rest.start = end;
        Ok(taken)
    }
}
