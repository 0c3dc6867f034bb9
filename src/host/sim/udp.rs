//! UDP link to a listening ground station.

use std::convert::Infallible;
use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::ops::Range;

use embassy_time::Timer;
use embedded_io_async::{ErrorType, Write};

use crate::tasks::{ByteSource, ReceiveError};

/// Poll interval of the socket, in milliseconds of simulated time.
const POLL_MS: u64 = 5;

/// Buffer for a datagram of a few MAVLink frames.
const DATAGRAM_BYTES: usize = 2048;

/// UDP socket to one address, which need not listen.
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

    /// Transmitter and receiver.
    pub fn split(&self) -> (UdpTransmitter<'_>, UdpReceiver<'_>) {
        (
            UdpTransmitter(&self.0),
            UdpReceiver {
                socket: &self.0,
                datagram: [0; DATAGRAM_BYTES],
                rest: 0..0,
            },
        )
    }
}

/// Transmitter of a UDP link.
pub struct UdpTransmitter<'a>(&'a UdpSocket);

impl ErrorType for UdpTransmitter<'_> {
    type Error = Infallible;
}

impl Write for UdpTransmitter<'_> {
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
