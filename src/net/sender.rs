//! Sending datagrams.

use core::net::SocketAddrV4;
use core::task::Poll;

use embassy_futures::poll_once;
use embassy_net::Stack;
use embassy_net::udp::UdpSocket;
use embassy_time::{Duration, with_timeout};

use super::socket::{PacketQueue, until};

/// Time-out of a datagram that waits for the radio, or for the receiver's hardware address, while another one waits behind it.
const SEND_TIMEOUT: Duration = Duration::from_millis(100);

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

    /// Waits until the datagram before has left. One that does not leave in time is lost.
    ///
    /// # Errors
    /// It was lost. There is room now, too.
    pub async fn make_room(&mut self) -> Result<(), DatagramLost> {
        let room = until(|| self.socket.may_send());
        let in_time = with_timeout(SEND_TIMEOUT, room).await;
        in_time.map_err(|_| self.discard())
    }

    /// Hands `datagram` over to leave as soon as it can.
    ///
    /// # Errors
    /// It is lost: there is no room, or the board has no address.
    pub fn hand_over(&mut self, datagram: &[u8], to: SocketAddrV4) -> Result<(), DatagramLost> {
        match poll_once(self.socket.send_to(datagram, to)) {
            Poll::Ready(Ok(())) => Ok(()),
            _ => Err(DatagramLost),
        }
    }

    /// Empties the queue. What waits for a hardware address that does not come would stay there for good.
    fn discard(&mut self) -> DatagramLost {
        self.socket.close();
        let _ = self.socket.bind(self.port);
        DatagramLost
    }
}
