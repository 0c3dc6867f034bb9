//! Sending datagrams.

use core::net::SocketAddrV4;
use core::task::Poll;

use embassy_futures::poll_once;
use embassy_net::Stack;
use embassy_net::udp::UdpSocket;
use embassy_time::{Duration, with_timeout};

use super::memory::PacketQueue;
use super::until::until;

/// So long a datagram waits for the radio, or for the hardware address of who gets it, before it is lost.
const PATIENCE: Duration = Duration::from_millis(100);

/// A datagram could not be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DatagramLost;

/// A socket that only sends, one datagram at a time.
pub(super) struct Sender<'d> {
    socket: UdpSocket<'d>,
    port: u16,
}

impl<'d> Sender<'d> {
    /// A sender from this port. Another socket that was there before it gets what comes to the port.
    pub fn new<const BYTES: usize>(
        stack: Stack<'d>,
        port: u16,
        queue: &'d mut PacketQueue<1, BYTES>,
    ) -> Self {
        let mut socket = UdpSocket::new(stack, &mut [], &mut [], &mut queue.packets, &mut queue.bytes);
        // It is not bound yet, and no port is 0.
        let _ = socket.bind(port);
        Self { socket, port }
    }

    /// Hands `datagram` over, or loses it when there is no room for it in time.
    ///
    /// # Errors
    /// It is lost.
    pub async fn send(&mut self, datagram: &[u8], to: SocketAddrV4) -> Result<(), DatagramLost> {
        let room = until(|| self.socket.may_send());
        if with_timeout(PATIENCE, room).await.is_err() {
            self.discard();
            return Err(DatagramLost);
        }
        self.hand_over(datagram, to)
    }

    /// The same, but what is there before it is lost for it.
    ///
    /// # Errors
    /// It is lost.
    pub fn send_at_once(&mut self, datagram: &[u8], to: SocketAddrV4) -> Result<(), DatagramLost> {
        if !self.socket.may_send() {
            self.discard();
        }
        self.hand_over(datagram, to)
    }

    fn hand_over(&mut self, datagram: &[u8], to: SocketAddrV4) -> Result<(), DatagramLost> {
        match poll_once(self.socket.send_to(datagram, to)) {
            Poll::Ready(Ok(())) => Ok(()),
            _ => Err(DatagramLost),
        }
    }

    /// Empties the queue. What waits for a hardware address that does not come would stay there for good.
    fn discard(&mut self) {
        self.socket.close();
        let _ = self.socket.bind(self.port);
    }
}
