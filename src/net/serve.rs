//! Starts everything that runs on the network.

use core::future::pending;
use core::pin::pin;

use embassy_futures::join::{join, join3, join5};
use embassy_futures::select::{Either, select};
use embassy_net::driver::Driver;
use embassy_net::udp::UdpSocket;
use embassy_net::{Runner, Stack, StackResources};
use heapless::Vec;

use super::address::{NetReport, Role, report_address};
use super::browsers::serve_browsers;
use super::dhcp::{give_addresses, now_ms};
use super::discovery::send_heartbeats;
use super::ingress_filter::IngressFilter;
use super::memory::NetMemory;
use super::paced::Paced;
use super::sender::Sender;
use super::service::Service;
use super::tcp::serve_clients;
use super::udp::{PORT, receive, serve_stations};
use crate::mavlink::LinkId;

/// Serves MAVLink on `device` until it is dropped; `memory` can be used again then. `seed` is a random number.
///
/// It does not wait for the device's link: as an access point some never say that theirs is up.
pub async fn serve<D: Driver>(
    device: D,
    role: Role,
    seed: u64,
    memory: &mut NetMemory,
    service: &Service<'_>,
    report: impl FnMut(NetReport),
) -> ! {
    let (links, leases) = (&memory.links, &memory.leases);
    let own_leases = match role {
        Role::AccessPoint => Some(leases),
        Role::Station => None,
    };
    let device = Paced::new(device, IngressFilter::new(own_leases));
    let (stack, mut runner) = start(device, role, seed, &mut memory.stack);
    links.reset();
    // The one that receives comes first: all have the same port.
    let queue = &mut memory.udp.received;
    let received = UdpSocket::new(stack, &mut queue.packets, &mut queue.bytes, &mut [], &mut []);
    let heartbeat = Sender::new(stack, PORT, &mut memory.udp.heartbeat);
    let [slot_1, slot_2] = &mut memory.udp.slots;
    let sender_1 = Sender::new(stack, PORT, &mut slot_1.sent);
    let sender_2 = Sender::new(stack, PORT, &mut slot_2.sent);
    let [tcp_1, tcp_2] = &mut memory.tcp;
    let dhcp = &mut memory.dhcp;
    let give_addresses = async {
        match role {
            Role::AccessPoint => give_addresses(stack, dhcp, leases).await,
            Role::Station => pending().await,
        }
    };
    let clients = || own_leases.map_or_else(Vec::new, |leases| leases.borrow().clients(now_ms()));
    // Pinned where they are built: moved, they may be built on the stack, which has no room for them.
    let members = pin!(join5(
        join(report_address(stack, report), give_addresses),
        receive(received, links),
        send_heartbeats(stack, heartbeat, links, clients, service),
        join(
            serve_stations(0, LinkId::Udp1, sender_1, &mut slot_1.datagram, links, service),
            serve_stations(1, LinkId::Udp2, sender_2, &mut slot_2.datagram, links, service),
        ),
        join3(
            serve_clients(LinkId::Tcp1, stack, tcp_1, service),
            serve_clients(LinkId::Tcp2, stack, tcp_2, service),
            serve_browsers(stack, &mut memory.browsers, service),
        ),
    ));
    match select(runner.run(), members).await {
        Either::First(never) => never,
        Either::Second((_, never, ..)) => never,
    }
}

#[inline(never)]
fn start<'d, D: Driver, const SOCKETS: usize>(
    device: D,
    role: Role,
    seed: u64,
    resources: &'d mut StackResources<SOCKETS>,
) -> (Stack<'d>, Runner<'d, D>) {
    embassy_net::new(device, role.config(), resources, seed)
}
