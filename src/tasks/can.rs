//! Takes part in the CAN bus.

use core::future::pending;
use core::iter;

use embassy_futures::select::{Either3, select3};
use embassy_futures::yield_now;

use super::{CheckIn, Shared, idle, mark, now, timer_at};
use crate::log::warn;
use crate::sensor::{CanBus, CanFrame, DroneCan};
use crate::time::Cadence;

/// Interval of what is not a frame: time-outs, what is due to be sent, the state of the controller.
const POLL_INTERVAL_US: u64 = 100_000;

/// Frames that are taken in one turn. On a full bus at 1 Mbit/s one comes every 130 µs, and a turn of the other tasks can take
/// longer.
const FRAMES_A_TURN: usize = 32;

/// Hands what the nodes on the bus report to the battery task, and takes part in the bus as a node. Without a bus there is
/// nothing to do.
pub async fn serve_can(bus: Option<impl CanBus>, shared: &Shared, check_in: &CheckIn) -> ! {
    let setup = shared.with(|autopilot| autopilot.can_setup());
    let Some((bus, setup)) = bus.zip(setup) else {
        idle(check_in).await
    };
    let mut node = DroneCan::new(setup, now());
    let mut accepted = node.acceptance();
    bus.accept(accepted);
    let mut polls = Cadence::starting_at(now(), POLL_INTERVAL_US);
    let mut looks = bus.status().looks;
    let mut lost_transfers = 0;
    let mut to_send = None;
    mark(check_in);
    loop {
        to_send = to_send.or_else(|| node.next_frame());
        match select3(bus.receive(), send(&bus, to_send), timer_at(polls.due())).await {
            Either3::First(first) => {
                let others = iter::from_fn(|| bus.try_receive());
                for frame in iter::once(first).chain(others).take(FRAMES_A_TURN) {
                    node.receive(&frame, now(), |event| {
                        shared.with(|autopilot| autopilot.add_can_event(&event, now()));
                    });
                }
            }
            Either3::Second(()) => to_send = None,
            Either3::Third(()) => {}
        }
        if polls.take(now()) {
            let settings = shared.with(|autopilot| autopilot.can_settings());
            node.poll(&settings, now(), |event| {
                shared.with(|autopilot| autopilot.add_can_event(&event, now()));
            });
            if node.lost_transfers() != lost_transfers {
                lost_transfers = node.lost_transfers();
                warn!("CAN: {} transfers incomplete", lost_transfers);
            }
            let status = bus.status();
            shared.with(|autopilot| autopilot.set_can_status(&status, now()));
            // The controller's interrupt has no check-in of its own.
            if status.looks != looks {
                looks = status.looks;
                mark(check_in);
            }
        }
        if node.acceptance() != accepted {
            accepted = node.acceptance();
            bus.accept(accepted);
        }
        // A bus that is never idle must leave the others their turn.
        yield_now().await;
    }
}

async fn send(bus: &impl CanBus, frame: Option<CanFrame>) {
    match frame {
        Some(frame) => bus.send(frame).await,
        None => pending().await,
    }
}
