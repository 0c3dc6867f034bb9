//! Sampling without interrupts: the task that reads the pins and the one that samples the packs, on one executor.

use embassy_futures::join::join;
use rover_battmon::battery::RetainedMemory;
use rover_battmon::sensor::AnalogIn;
use rover_battmon::tasks::{self, CheckIn, SampledPins, Shared, read_pins};

/// Reads the packs' pins from `input` every 100 ms, and samples the packs.
pub async fn sample_batteries(
    input: impl AnalogIn,
    memory: &mut RetainedMemory,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    let pins = SampledPins::new();
    let sampling = tasks::sample_batteries(&pins, memory, shared, check_in);
    join(read_pins(input, &pins), sampling).await.0
}
