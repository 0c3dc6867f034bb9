//! Queues of datagrams, and how the code of this folder waits for the network stack.

use core::future::poll_fn;
use core::task::Poll;

use embassy_net::udp::PacketMetadata;

/// Memory of a UDP socket for datagrams that wait, in one direction.
pub(super) struct PacketQueue<const PACKETS: usize, const BYTES: usize> {
    pub packets: [PacketMetadata; PACKETS],
    pub bytes: [u8; BYTES],
}

impl<const PACKETS: usize, const BYTES: usize> PacketQueue<PACKETS, BYTES> {
    pub const fn new() -> Self {
        Self {
            packets: [PacketMetadata::EMPTY; PACKETS],
            bytes: [0; BYTES],
        }
    }
}

/// Waits until `condition` holds, which is about the network stack's state: a socket, the board's address.
///
/// It registers no waker and needs none. The stack runs in this task, before everything that waits for it ([`serve`](super::serve())):
/// whenever the stack has changed something, this is polled in the same turn. embassy-net's own futures would do for another task only:
/// each of them wakes the stack when it is polled, which here means the task itself, so it would never sleep.
pub(super) async fn until(condition: impl Fn() -> bool) {
    poll_fn(|_| match condition() {
        true => Poll::Ready(()),
        false => Poll::Pending,
    })
    .await;
}
