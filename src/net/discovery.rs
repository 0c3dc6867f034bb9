//! Being found by ground stations.

use core::net::{Ipv4Addr, SocketAddrV4};

use embassy_net::Stack;
use embassy_net::udp::UdpSocket;
use embassy_time::{Duration, Ticker};
use heapless::Vec;

use super::address::broadcast_address;
use super::stations::Search;
use super::udp::{PORT, UdpLinks, send};
use crate::liveness::CheckIn;
use crate::mavlink::{Framer, LinkKind};
use crate::tasks::{Shared, mark, now};

/// The most addresses that are given to others.
pub(super) const MAX_CLIENTS: usize = 8;

/// Sends a HEARTBEAT each second to those who may be ground stations: to all while there is none, then to those who have an
/// address and no link yet, until no link is free. `clients` are the addresses that were given to others.
pub(super) async fn be_found(
    stack: Stack<'_>,
    mut socket: UdpSocket<'_>,
    links: &UdpLinks,
    clients: impl Fn() -> Vec<Ipv4Addr, MAX_CLIENTS>,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    let _ = socket.bind(PORT);
    let mut framer = Framer::new();
    let mut seconds = Ticker::every(Duration::from_secs(1));
    loop {
        seconds.next().await;
        mark(check_in);
        let search = links.stations.borrow().search();
        match search {
            Search::Anyone => {
                let all = broadcast_address(stack);
                greet(&mut socket, all.as_slice(), &mut framer, links, shared).await;
            }
            Search::Others => {
                let mut others = clients();
                others.retain(|client| !links.stations.borrow().has_address(*client));
                greet(&mut socket, &others, &mut framer, links, shared).await;
            }
            Search::NoOne => {}
        }
    }
}

/// Sends one HEARTBEAT to each of `addresses`.
async fn greet(
    socket: &mut UdpSocket<'_>,
    addresses: &[Ipv4Addr],
    framer: &mut Framer,
    links: &UdpLinks,
    shared: &Shared,
) {
    if addresses.is_empty() {
        return;
    }
    links.sequence.set(framer.next_sequence().wrapping_add(1));
    let heartbeat = shared.with(|autopilot| autopilot.heartbeat_frame(framer, LinkKind::Wifi, now()));
    for address in addresses {
        // Who is not there does not answer.
        let _ = send(socket, heartbeat, SocketAddrV4::new(*address, PORT)).await;
    }
}
