//! Samples the packs at 10 Hz.

use embassy_futures::yield_now;
use embassy_time::{Duration, with_timeout};

use super::{CheckIn, Shared, mark, now, timer_at};
use crate::autopilot::{SAMPLING_INTERVAL_US, SAMPLING_RESOLUTION_US, SamplingProgress};
use crate::battery::{ReadError, RetainedMemory};
use crate::sensor::{AnalogIn, AnalogReadings, read_mean};
use crate::time::{Cadence, Instant};

/// A read that takes longer counts as failed.
const READ_TIMEOUT: Duration = Duration::from_millis(2);

/// Reads the packs' pins every 100 ms and samples the packs. Missed ticks are skipped, not made up for.
pub async fn sample_batteries(
    mut input: impl AnalogIn,
    memory: &mut RetainedMemory,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    shared.with(|autopilot| autopilot.restore_packs(memory));
    let start = Instant::from_micros(now().as_micros().next_multiple_of(SAMPLING_RESOLUTION_US));
    let mut ticks = Cadence::starting_at(start, SAMPLING_INTERVAL_US);
    loop {
        shared.sampling_is_due(ticks.due());
        timer_at(ticks.due()).await;
        let now = now();
        ticks.take(now);
        let readings = read_pins(&mut input, shared).await;
        let mut sampling = shared.with(|autopilot| autopilot.begin_sampling(now, readings));
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

/// Reads each pin that a pack needs.
async fn read_pins(input: &mut impl AnalogIn, shared: &Shared) -> AnalogReadings {
    let mut readings = AnalogReadings::NONE;
    for pin in shared.with(|autopilot| autopilot.pins_to_read()) {
        let count = with_timeout(READ_TIMEOUT, read_mean(input, pin)).await;
        readings.set(pin, count.unwrap_or(Err(ReadError::Timeout)));
    }
    readings
}
