//! Discovery: HEARTBEATs by which ground stations find the board.

use core::net::{Ipv4Addr, SocketAddrV4};

use embassy_net::Stack;
use embassy_time::{Duration, Ticker};
use heapless::Vec;

use super::address::{MAX_CLIENTS, broadcast_address};
use super::sender::Sender;
use super::service::Service;
use super::stations::{Discovery, Search};
use super::udp::{PORT, UdpLinks};
use crate::mavlink::{Framer, LinkKind};
use crate::tasks::{mark, now};

/// Sends a HEARTBEAT each second to possible ground stations. While there is none, to all by broadcast, and every other
/// time to each address that was given away, since a phone may take no broadcasts; a phone that takes both counts no loss. Then to
/// those that have an address and no link yet, until no link is free. `clients` returns the addresses of the DHCP clients.
pub(super) async fn send_heartbeats(
    stack: Stack<'_>,
    mut sender: Sender<'_>,
    links: &UdpLinks,
    clients: impl Fn() -> Vec<Ipv4Addr, MAX_CLIENTS>,
    service: &Service<'_>,
) -> ! {
    let mut framer = Framer::new();
    let mut seconds = Ticker::every(Duration::from_secs(1));
    let mut turn: usize = 0;
    loop {
        seconds.next().await;
        turn = turn.wrapping_add(1);
        mark(service.check_in);
        // Before the choice of addresses: a station that gets a link meanwhile is not among them.
        let _ = sender.make_room().await;
        let search = links.stations.borrow().search();
        let mut others = clients();
        others.retain(|client| !links.stations.borrow().has_address(*client));
        let all = broadcast_address(stack);
        let addresses: &[Ipv4Addr] = match search {
            Search::Anyone if turn % 2 == 1 || others.is_empty() => all.as_slice(),
            Search::Anyone | Search::Others => &others,
            Search::NoOne => &[],
        };
        // Addresses behind one that does not answer are not reached in the same turn.
        let first = turn / 2 % addresses.len().max(1);
        send_heartbeat(
            &mut sender,
            addresses,
            first,
            &mut framer,
            &links.discovery,
            service,
        )
        .await;
    }
}

/// Sends one HEARTBEAT to each of `addresses`. Where `first` is another one each time, none is always the last.
async fn send_heartbeat(
    sender: &mut Sender<'_>,
    addresses: &[Ipv4Addr],
    first: usize,
    framer: &mut Framer,
    discovery: &Discovery,
    service: &Service<'_>,
) {
    if addresses.is_empty() {
        return;
    }
    let in_turn = addresses.iter().cycle().skip(first).take(addresses.len());
    discovery.begin(framer.next_sequence(), in_turn.copied());
    let shared = service.shared;
    let heartbeat = shared.with(|autopilot| autopilot.heartbeat_frame(framer, LinkKind::Wifi, now()));
    while !discovery.is_done() {
        // A lost one comes again in a second.
        let _ = sender.make_room().await;
        if let Some(address) = discovery.next_address() {
            let _ = sender.hand_over(heartbeat, SocketAddrV4::new(address, PORT));
        }
    }
}
