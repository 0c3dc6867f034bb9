//! Drives the rover's motors, lamps and buzzer.

use embassy_futures::select::select;

use super::{CheckIn, Shared, mark, now, timer_at};
use crate::time::Cadence;
use crate::vehicle::{Indicators, Motors};

/// 50 Hz, the rate of ArduPilot Rover's throttle output.
const INTERVAL_US: u64 = 20_000;

/// Sets `motors` and `indicators` to the vehicle's outputs, every 20 ms and at once when it was commanded or a failsafe
/// has acted.
pub async fn drive(
    mut motors: impl Motors,
    mut indicators: impl Indicators,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    // The packs are sampled at whole intervals from about the start on, and do not wait for this.
    let mut ticks = Cadence::starting_at(now().after_us(INTERVAL_US / 2), INTERVAL_US);
    loop {
        let outputs = shared.with(|autopilot| autopilot.drive(now()));
        motors.drive(outputs.drives);
        indicators.show(outputs.indication);
        mark(check_in);
        select(timer_at(ticks.due()), shared.to_drive.wait()).await;
        ticks.take(now());
    }
}
