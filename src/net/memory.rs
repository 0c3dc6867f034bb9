//! Where the network keeps its sockets.

use embassy_net::StackResources;
use embassy_net::udp::PacketMetadata;

use super::datagram::DATAGRAM_BYTES;
use super::stations::SLOTS;
use super::udp::UdpLinks;

/// One UDP socket that receives, one that looks for ground stations, and one for each of two stations.
const SOCKETS: usize = 8;

/// The largest datagram that an Ethernet frame carries has 1472 bytes.
const RECEIVED_BYTES: usize = 1536;

/// A HEARTBEAT has 34 bytes with its signature.
const HEARTBEAT_BYTES: usize = 64;

/// The memory of the network. It is large: build it in a static.
pub struct NetMemory {
    pub(super) stack: StackResources<SOCKETS>,
    pub(super) udp: UdpMemory,
    pub(super) links: UdpLinks,
}

/// The queues of the UDP sockets of MAVLink.
pub(super) struct UdpMemory {
    pub received: PacketQueue<4, RECEIVED_BYTES>,
    pub heartbeat: PacketQueue<1, HEARTBEAT_BYTES>,
    /// Room for one datagram: a second one waits at its link.
    pub sent: [PacketQueue<1, DATAGRAM_BYTES>; SLOTS],
}

/// Datagrams that wait.
pub(super) struct PacketQueue<const PACKETS: usize, const BYTES: usize> {
    pub packets: [PacketMetadata; PACKETS],
    pub bytes: [u8; BYTES],
}

impl<const PACKETS: usize, const BYTES: usize> PacketQueue<PACKETS, BYTES> {
    const fn new() -> Self {
        Self {
            packets: [PacketMetadata::EMPTY; PACKETS],
            bytes: [0; BYTES],
        }
    }
}

impl NetMemory {
    /// Memory that is not in use.
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new() -> Self {
        Self {
            stack: StackResources::new(),
            udp: UdpMemory {
                received: PacketQueue::new(),
                heartbeat: PacketQueue::new(),
                sent: [const { PacketQueue::new() }; SLOTS],
            },
            links: UdpLinks::new(),
        }
    }
}

impl Default for NetMemory {
    fn default() -> Self {
        Self::new()
    }
}
