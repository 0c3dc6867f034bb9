//! The DHCP server of the access point.

use core::cell::RefCell;

use embassy_futures::yield_now;
use embassy_net::Stack;
use embassy_net::udp::UdpSocket;

use super::leases::Leases;
use super::sender::Sender;
use super::socket::{PacketQueue, until};
use crate::tasks::now;

const SERVER_PORT: u16 = 67;

/// DHCP clients send packets of at most 576 bytes to a server that has not offered to take more, which includes the headers of
/// IP and UDP.
const DHCP_REQUEST_BYTES: usize = 576 - 28;

/// Our longest answer.
pub(super) const DHCP_REPLY_BYTES: usize = 280;

/// The queues of the DHCP server.
pub(super) struct DhcpMemory {
    received: PacketQueue<2, DHCP_REQUEST_BYTES>,
    sent: PacketQueue<1, DHCP_REPLY_BYTES>,
}

impl DhcpMemory {
    /// Empty queues.
    pub const fn new() -> Self {
        Self {
            received: PacketQueue::new(),
            sent: PacketQueue::new(),
        }
    }
}

/// Answers one request a turn.
pub(super) async fn give_addresses(stack: Stack<'_>, memory: &mut DhcpMemory, leases: &RefCell<Leases>) -> ! {
    let received = &mut memory.received;
    let mut requests = UdpSocket::new(
        stack,
        &mut received.packets,
        &mut received.bytes,
        &mut [],
        &mut [],
    );
    let _ = requests.bind(SERVER_PORT);
    let mut sender = Sender::new(stack, SERVER_PORT, &mut memory.sent);
    loop {
        until(|| requests.may_recv()).await;
        // A client that gets no answer asks again.
        let _ = sender.make_room().await;
        // The network is in use until the request is read.
        let reply = requests
            .recv_from_with(|request, _| leases.borrow_mut().answer(request, now_ms()))
            .await;
        if let Some(reply) = reply {
            let _ = sender.hand_over(reply.bytes(), reply.destination());
        }
        yield_now().await;
    }
}

/// Milliseconds since boot.
pub(super) fn now_ms() -> u64 {
    now().as_micros() / 1_000
}
