//! UDP for a wire: datagrams to where a ground station listens, and back.

use std::convert::Infallible;
use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::ops::Range;

use embassy_time::Timer;
use embedded_io_async::{ErrorType, Write};

use crate::tasks::{ByteSource, ReceiveError};

/// How often the socket is asked for datagrams, in milliseconds of simulated time.
const POLL_MS: u64 = 5;

/// No datagram of MAVLink is longer than a few frames.
const DATAGRAM_BYTES: usize = 2048;

/// The wire to one address. Whether anybody listens there makes no difference, as with a radio.
pub struct UdpWire(UdpSocket);

impl UdpWire {
    /// A wire to `address`, from any port of this machine.
    ///
    /// # Errors
    /// No socket can be had, or the address can't be reached from it.
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

    /// Both directions.
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

/// To whoever listens.
pub struct UdpTransmitter<'a>(&'a UdpSocket);

impl ErrorType for UdpTransmitter<'_> {
    type Error = Infallible;
}

impl Write for UdpTransmitter<'_> {
    /// Sends `bytes`, a whole frame, as one datagram.
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        // A datagram that can't be sent is lost, like one that nobody receives.
        let _ = self.0.send(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// From whoever listens.
pub struct UdpReceiver<'a> {
    socket: &'a UdpSocket,
    datagram: [u8; DATAGRAM_BYTES],
    /// What of the datagram has not been handed on yet.
    rest: Range<usize>,
}

impl ByteSource for UdpReceiver<'_> {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        while self.rest.is_empty() {
            match self.socket.recv(&mut self.datagram) {
                Ok(received) => self.rest = 0..received,
                // Nothing has come, or nobody listens at present.
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
