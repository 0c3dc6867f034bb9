//! Follows the pulses on a pin.

use core::convert::Infallible;

use embassy_futures::yield_now;
use embassy_time::with_timeout;
use embedded_hal_async::digital::Wait;

use super::{CheckIn, LONGEST_SLEEP, Shared, idle, mark, now};
use crate::sensor::Pulses;

/// What the pin has to become next.
#[derive(Clone, Copy)]
enum Awaited {
    High,
    Low,
}

/// Notes each change of `pin` and hands what it has seen to the battery task. Without a pin there is nothing to do.
///
/// It waits for levels: a pulse that has ended before this task has its turn still counts, while an edge would be lost.
pub async fn follow_pulses(
    pin: Option<impl Wait<Error = Infallible>>,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    let Some(mut pin) = pin else { idle(check_in).await };
    let mut pulses = Pulses::NONE;
    // The start of a pulse that is high at the start is unknown.
    let mut awaited = Awaited::Low;
    loop {
        let change = async {
            match awaited {
                Awaited::High => pin.wait_for_high().await,
                Awaited::Low => pin.wait_for_low().await,
            }
        };
        if with_timeout(LONGEST_SLEEP, change).await.is_ok() {
            awaited = note(awaited, &mut pulses);
            shared.with(|autopilot| autopilot.set_pulses(pulses));
        }
        mark(check_in);
        // A pin that never rests must leave the others their turn.
        yield_now().await;
    }
}

/// Takes a change that has come just now, and returns what has to come next.
fn note(change: Awaited, pulses: &mut Pulses) -> Awaited {
    match change {
        Awaited::High => {
            pulses.rise(now());
            Awaited::Low
        }
        Awaited::Low => {
            pulses.fall(now());
            Awaited::High
        }
    }
}
