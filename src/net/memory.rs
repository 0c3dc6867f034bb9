//! Memory of the network's sockets.

use core::cell::RefCell;

use embassy_net::StackResources;

use super::browsers::{BrowserMemory, CONNECTIONS};
use super::dhcp::DhcpMemory;
use super::leases::Leases;
use super::retained_leases::RetainedLeases;
use super::socket::PacketQueue;
use super::stations::SLOTS;
use super::tcp::{CLIENTS, TcpMemory};
use super::udp::{SlotMemory, UdpLinks};

/// UDP: one that receives, one that looks for ground stations, one for each of two stations; TCP: one for each of two clients,
/// those for browsers, and one that answers 503; and two of the DHCP server, or one of the DHCP client.
const SOCKETS: usize = 9 + CONNECTIONS;

/// A little more than a link's queue, so that what is lost there is counted.
const RECEIVED_BYTES: usize = 832;

/// A HEARTBEAT has 34 bytes with its signature.
const HEARTBEAT_BYTES: usize = 64;

/// The memory of the network. It is large: build it in a static.
pub struct NetMemory {
    pub(super) stack: StackResources<SOCKETS>,
    pub(super) udp: UdpMemory,
    pub(super) links: UdpLinks,
    pub(super) tcp: [TcpMemory; CLIENTS],
    pub(super) browsers: BrowserMemory,
    pub(super) dhcp: DhcpMemory,
    pub(super) leases: RefCell<Leases>,
}

/// The queues of the UDP sockets of MAVLink.
pub(super) struct UdpMemory {
    pub received: PacketQueue<4, RECEIVED_BYTES>,
    pub heartbeat: PacketQueue<1, HEARTBEAT_BYTES>,
    pub slots: [SlotMemory; SLOTS],
}

impl NetMemory {
    /// Memory that is not in use. `retained` has the leases from before the last reset.
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(retained: &'static RetainedLeases) -> Self {
        Self {
            stack: StackResources::new(),
            udp: UdpMemory {
                received: PacketQueue::new(),
                heartbeat: PacketQueue::new(),
                slots: [const { SlotMemory::new() }; SLOTS],
            },
            links: UdpLinks::new(),
            tcp: [const { TcpMemory::new() }; CLIENTS],
            browsers: BrowserMemory::new(),
            dhcp: DhcpMemory::new(),
            leases: RefCell::new(Leases::new(retained)),
        }
    }
}
