//! Samples the packs at 10 Hz.

use embassy_futures::yield_now;

use super::{CheckIn, Shared, mark, now, timer_at};
use crate::autopilot::{SAMPLING_INTERVAL_US, SAMPLING_RESOLUTION_US, SamplingProgress};
use crate::battery::RetainedMemory;
use crate::sensor::{AnalogIn, LATEST_READING_US};
use crate::time::{Cadence, Instant};

/// A first reading takes this long: a period of the motors' PWM.
const FIRST_READING_US: u64 = 2_000;

/// Reads the analog pins every 100 ms, and samples the packs. Missed ticks are skipped, not made up for.
pub async fn sample_batteries(
    mut pins: impl AnalogIn,
    memory: &mut RetainedMemory,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    shared.with(|autopilot| autopilot.restore_packs(memory));
    let first = now().after_us(FIRST_READING_US).as_micros();
    let first = Instant::from_micros(first.next_multiple_of(SAMPLING_RESOLUTION_US));
    let mut ticks = Cadence::starting_at(first, SAMPLING_INTERVAL_US);
    loop {
        timer_at(ticks.due()).await;
        let now = reading_end(ticks.due(), now());
        ticks.take(now);
        let wanted = shared.with(|autopilot| autopilot.wanted_readings());
        let readings = pins.read(now, wanted);
        let mut sampling = shared.with(|autopilot| {
            let sampling = autopilot.begin_sampling(now, readings);
            for (pin, pull) in autopilot.pin_pulls() {
                pins.pull(pin, pull);
            }
            sampling
        });
        yield_now().await;
        while shared.with(|autopilot| autopilot.sample_next(&mut sampling)) != SamplingProgress::Complete {
            // No other task should wait for all packs.
            yield_now().await;
        }
        yield_now().await;
        shared.with(|autopilot| autopilot.end_sampling(sampling, memory));
        mark(check_in);
    }
}

/// The end of what is read in a tick: its due time, however long other tasks have held it up, as what was converted is kept
/// for a while. So all ticks are equally long, and end with a period of the motors' PWM.
fn reading_end(due: Instant, now: Instant) -> Instant {
    if now.us_since(due) <= LATEST_READING_US {
        due
    } else {
        now
    }
}
