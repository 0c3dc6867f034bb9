//! Datagrams that wait in a socket.

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
