//! Samples the packs at 10 Hz.

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, with_timeout};

use super::{CheckIn, Shared, mark, now, timer_at};
use crate::autopilot::{PinsToRead, SAMPLING_INTERVAL_US, SAMPLING_RESOLUTION_US, SamplingProgress};
use crate::battery::{ReadError, RetainedMemory};
use crate::sensor::{AnalogIn, AnalogReadings, read_mean};
use crate::time::{Cadence, Instant};

/// A read that takes longer counts as failed.
const READ_TIMEOUT: Duration = Duration::from_millis(2);

/// The packs' pins, between an interrupt that reads them and the task that samples the packs.
pub struct SampledPins {
    wanted: Signal<CriticalSectionRawMutex, (Instant, PinsToRead)>,
    read: Signal<CriticalSectionRawMutex, (Instant, AnalogReadings)>,
}

impl SampledPins {
    /// Nothing is to be read yet.
    pub const fn new() -> Self {
        Self {
            wanted: Signal::new(),
            read: Signal::new(),
        }
    }

    /// Readings of `pins`, begun once `due` is over, with the time of that.
    async fn read_at(&self, due: Instant, pins: PinsToRead) -> (Instant, AnalogReadings) {
        self.wanted.signal((due, pins));
        self.read.wait().await
    }
}

impl Default for SampledPins {
    fn default() -> Self {
        Self::new()
    }
}

/// Reads the packs' pins when they are wanted. It belongs into an interrupt: a turn of the other tasks takes up to 3 ms, and
/// what is counted of a current is as exact as the intervals are.
pub async fn read_pins(mut input: impl AnalogIn, sampled: &SampledPins) -> ! {
    loop {
        let (due, pins) = sampled.wanted.wait().await;
        timer_at(due).await;
        let begun = now();
        let mut readings = AnalogReadings::NONE;
        for (pin, pull) in pins {
            input.pull(pin, pull);
            let count = with_timeout(READ_TIMEOUT, read_mean(&mut input, pin)).await;
            readings.set(pin, count.unwrap_or(Err(ReadError::Timeout)));
            // Other tasks in interrupts can't wait for all pins.
            yield_now().await;
        }
        sampled.read.signal((begun, readings));
    }
}

/// Has the packs' pins read every 100 ms, and samples the packs. Missed ticks are skipped, not made up for.
pub async fn sample_batteries(
    pins: &SampledPins,
    memory: &mut RetainedMemory,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    shared.with(|autopilot| autopilot.restore_packs(memory));
    let start = Instant::from_micros(now().as_micros().next_multiple_of(SAMPLING_RESOLUTION_US));
    let mut ticks = Cadence::starting_at(start, SAMPLING_INTERVAL_US);
    loop {
        shared.sampling_is_due(ticks.due());
        let (begun, readings) = read_needed(pins, ticks.due(), shared).await;
        ticks.take(begun);
        let mut sampling = shared.with(|autopilot| autopilot.begin_sampling(begun, readings));
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

/// Reads each pin that a pack needs; once more if a parameter has changed meanwhile which pins these are.
async fn read_needed(pins: &SampledPins, due: Instant, shared: &Shared) -> (Instant, AnalogReadings) {
    loop {
        let needed = shared.with(|autopilot| autopilot.pins_to_read());
        let read = pins.read_at(due, needed.clone()).await;
        if shared.with(|autopilot| autopilot.pins_to_read()) == needed {
            return read;
        }
    }
}
