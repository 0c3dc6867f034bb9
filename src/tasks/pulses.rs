//! Follows the pulses on a pin.

use core::convert::Infallible;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer, with_timeout};
use embedded_hal_async::digital::Wait;

use super::{CheckIn, LONGEST_SLEEP, Shared, idle, mark, now};
use crate::sensor::Pulses;

/// Between two looks at a pin. One that never rests must leave the others their turn, and pulses come up to 1000 times a second.
const PAUSE: Duration = Duration::from_micros(100);

/// Timed pulses, between an interrupt and the other tasks.
pub type SeenPulses = Signal<CriticalSectionRawMutex, Pulses>;

/// The pin's next level.
#[derive(Clone, Copy)]
enum Awaited {
    High,
    Low,
}

/// Notes each change of `pin` in `seen`. It belongs into an interrupt: a turn of the other tasks can take longer than a pulse
/// and the pause behind it.
///
/// It waits for levels: a pulse that has ended before this task has its turn still counts, while an edge would be lost.
pub async fn watch_pulses(mut pin: impl Wait<Error = Infallible>, seen: &SeenPulses) -> ! {
    let mut pulses = Pulses::NONE;
    // The start of a pulse that is high at the start is unknown.
    let mut awaited = Awaited::Low;
    loop {
        let Ok(()) = match awaited {
            Awaited::High => pin.wait_for_high().await,
            Awaited::Low => pin.wait_for_low().await,
        };
        awaited = note(awaited, &mut pulses);
        seen.signal(pulses);
        Timer::after(PAUSE).await;
    }
}

/// Hands what was seen of the pulses to the battery task. Without a pin there is nothing to do.
pub async fn hand_over_pulses(seen: Option<&SeenPulses>, shared: &Shared, check_in: &CheckIn) -> ! {
    let Some(seen) = seen else { idle(check_in).await };
    loop {
        if let Ok(pulses) = with_timeout(LONGEST_SLEEP, seen.wait()).await {
            shared.with(|autopilot| autopilot.set_pulses(pulses));
        }
        mark(check_in);
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
