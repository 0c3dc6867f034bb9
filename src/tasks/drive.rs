//! Drives the rover's motors, lamps and buzzer.

use embassy_futures::select::select;
use embassy_time::{Duration, Ticker};

use super::{CheckIn, Shared, mark, now};
use crate::vehicle::{Indicators, Motors};

/// 50 Hz, the rate of ArduPilot Rover's throttle output.
const INTERVAL: Duration = Duration::from_millis(20);

/// Sets `motors` and `indicators` to the vehicle's outputs, every 20 ms and at once when it was commanded or a failsafe
/// has acted.
pub async fn drive(
    mut motors: impl Motors,
    mut indicators: impl Indicators,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    let mut ticks = Ticker::every(INTERVAL);
    loop {
        let outputs = shared.with(|autopilot| autopilot.drive(now()));
        motors.drive(outputs.drives);
        indicators.show(outputs.indication);
        mark(check_in);
        select(ticks.next(), shared.to_drive.wait()).await;
    }
}
