//! Memory of the network's sockets, and waits for them.

use core::future::poll_fn;
use core::task::Poll;

use embassy_net::udp::PacketMetadata;

/// Datagrams that wait.
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

/// Waits until the network has done something that makes `is_so` true.
///
/// It leaves no waker: the network runs in the same task, and the waiting code is polled after it. The sockets' own futures can't be
/// used in one task with the network: each wakes the network when it is polled, and so the task, which would never sleep.
pub(super) async fn until(is_so: impl Fn() -> bool) {
    poll_fn(|_| if is_so() { Poll::Ready(()) } else { Poll::Pending }).await;
}
