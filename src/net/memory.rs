//! Where the network keeps its sockets.

use core::cell::RefCell;

use embassy_net::StackResources;
use embassy_net::udp::PacketMetadata;

use super::datagram::{DATAGRAM_BYTES, Datagram};
use super::leases::Leases;
use super::stations::SLOTS;
use super::tcp::CLIENTS;
use super::udp::UdpLinks;

/// UDP: one that receives, one that looks for ground stations, one for each of two stations; TCP: one for each of two clients;
/// and two of the DHCP server, or one of the DHCP client.
const SOCKETS: usize = 8;

/// The largest datagram that an Ethernet frame carries has 1472 bytes.
const RECEIVED_BYTES: usize = 1536;

/// A HEARTBEAT has 34 bytes with its signature.
const HEARTBEAT_BYTES: usize = 64;

/// DHCP clients send at most 576 bytes to a server that has not offered to take more.
const DHCP_REQUEST_BYTES: usize = 576;

/// Our answers have 287 bytes.
const DHCP_REPLY_BYTES: usize = 320;

/// What a client sends while its link is busy: TCP has it wait for the rest.
const TCP_RECEIVED_BYTES: usize = 512;

/// What is sent until a client confirms it.
const TCP_SENT_BYTES: usize = 1024;

/// The memory of the network. It is large: build it in a static.
pub struct NetMemory {
    pub(super) stack: StackResources<SOCKETS>,
    pub(super) udp: UdpMemory,
    pub(super) links: UdpLinks,
    pub(super) tcp: [TcpMemory; CLIENTS],
    pub(super) dhcp: DhcpMemory,
    pub(super) leases: RefCell<Leases>,
}

/// The queues of the UDP sockets of MAVLink.
pub(super) struct UdpMemory {
    pub received: PacketQueue<4, RECEIVED_BYTES>,
    pub heartbeat: PacketQueue<1, HEARTBEAT_BYTES>,
    pub slots: [SlotMemory; SLOTS],
}

/// What is sent to a station.
pub(super) struct SlotMemory {
    /// What waits for the radio.
    pub sent: PacketQueue<1, DATAGRAM_BYTES>,
    /// What is put together meanwhile. In a future it would take several times its size.
    pub datagram: Datagram,
}

/// The buffers of a TCP socket.
pub(super) struct TcpMemory {
    pub received: [u8; TCP_RECEIVED_BYTES],
    pub sent: [u8; TCP_SENT_BYTES],
}

/// The queues of the DHCP server.
pub(super) struct DhcpMemory {
    pub received: PacketQueue<2, DHCP_REQUEST_BYTES>,
    pub sent: PacketQueue<1, DHCP_REPLY_BYTES>,
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

impl SlotMemory {
    const fn new() -> Self {
        Self {
            sent: PacketQueue::new(),
            datagram: Datagram::new(),
        }
    }
}

impl TcpMemory {
    const fn new() -> Self {
        Self {
            received: [0; TCP_RECEIVED_BYTES],
            sent: [0; TCP_SENT_BYTES],
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
                slots: [const { SlotMemory::new() }; SLOTS],
            },
            links: UdpLinks::new(),
            tcp: [const { TcpMemory::new() }; CLIENTS],
            dhcp: DhcpMemory {
                received: PacketQueue::new(),
                sent: PacketQueue::new(),
            },
            leases: RefCell::new(Leases::new()),
        }
    }
}

impl Default for NetMemory {
    fn default() -> Self {
        Self::new()
    }
}
