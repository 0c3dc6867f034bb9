//! All that runs on the network.

use embassy_futures::join::{join, join3};
use embassy_futures::select::{Either, select};
use embassy_net::driver::Driver;
use embassy_net::udp::UdpSocket;
use embassy_net::{Runner, Stack, StackResources};
use heapless::Vec;

use super::address::{NetReport, Role, report_address};
use super::discovery::be_found;
use super::memory::{NetMemory, PacketQueue};
use super::paced::Paced;
use super::udp::{receive, serve_stations};
use crate::liveness::CheckIn;
use crate::mavlink::LinkId;
use crate::recorder::LogSource;
use crate::tasks::Shared;

/// Serves MAVLink on `device` until it is dropped; `memory` can be used again then. `seed` is a random number.
///
/// It does not wait for the device's link: as an access point some never say that theirs is up.
#[expect(clippy::too_many_arguments, reason = "what the firmware wires together")]
pub async fn serve<D: Driver>(
    device: D,
    role: Role,
    seed: u64,
    memory: &mut NetMemory,
    shared: &Shared,
    logs: &dyn LogSource,
    check_in: &CheckIn,
    report: impl FnMut(NetReport),
) -> ! {
    let NetMemory { stack, udp, links } = memory;
    let (stack, mut runner) = start(device, role, seed, stack);
    links.reset();
    let [first, second] = &mut udp.sent;
    // What receives is asked first: all have the same port.
    let received = UdpSocket::new(
        stack,
        &mut udp.received.packets,
        &mut udp.received.bytes,
        &mut [],
        &mut [],
    );
    let heartbeat = sender(stack, &mut udp.heartbeat);
    let (first, second) = (sender(stack, first), sender(stack, second));
    let members = join3(
        report_address(stack, report),
        join(
            receive(received, links),
            be_found(stack, heartbeat, links, Vec::new, shared, check_in),
        ),
        join(
            serve_stations(0, LinkId::Udp1, first, links, shared, logs, check_in),
            serve_stations(1, LinkId::Udp2, second, links, shared, logs, check_in),
        ),
    );
    match select(runner.run(), members).await {
        Either::First(never) => never,
        Either::Second((never, ..)) => never,
    }
}

#[inline(never)]
fn start<'d, D: Driver, const SOCKETS: usize>(
    device: D,
    role: Role,
    seed: u64,
    resources: &'d mut StackResources<SOCKETS>,
) -> (Stack<'d>, Runner<'d, Paced<D>>) {
    embassy_net::new(Paced::new(device), role.config(), resources, seed)
}

/// A socket that only sends.
fn sender<'d, const PACKETS: usize, const BYTES: usize>(
    stack: Stack<'d>,
    queue: &'d mut PacketQueue<PACKETS, BYTES>,
) -> UdpSocket<'d> {
    UdpSocket::new(stack, &mut [], &mut [], &mut queue.packets, &mut queue.bytes)
}
