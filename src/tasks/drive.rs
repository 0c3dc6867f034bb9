//! Drives the rover's motors, lamps and buzzer.

use embassy_futures::select::select;
use embassy_time::{Duration, Instant, Ticker};

use super::{Shared, mark};
use crate::liveness::CheckIn;
use crate::log::info;
use crate::mavlink::vehicle_announcement;
use crate::vehicle::{Indicators, Motors, VehicleEvent, VehicleSettings, VehicleStatus};

/// 50 Hz, the rate of ArduPilot Rover's throttle output.
const INTERVAL: Duration = Duration::from_millis(20);

/// Sets `motors` and `indicators` to the vehicle's outputs, every 20 ms and at once when it was commanded or a
/// failsafe has acted. Says what the vehicle does on its own.
pub async fn drive(
    mut motors: impl Motors,
    mut indicators: impl Indicators,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    let mut ticks = Ticker::every(INTERVAL);
    let mut before = VehicleStatus::default();
    loop {
        let now_us = Instant::now().as_micros();
        let settings = shared.with_parameters(|parameters| VehicleSettings::from_parameters(parameters));
        let event = shared.with_vehicle(|vehicle| {
            let event = vehicle.update(now_us, &settings);
            motors.drive(vehicle.drives());
            indicators.show(vehicle.indication(now_us));
            event
        });
        if let Some(event) = event {
            say(event, shared);
        }
        before = log_change(before, shared);
        mark(check_in);
        select(ticks.next(), shared.to_drive.wait()).await;
    }
}

/// Announces what the vehicle does on its own.
pub(super) fn say(event: VehicleEvent, shared: &Shared) {
    let (severity, text) = vehicle_announcement(event);
    info!("{}", text.as_str());
    shared.announce(severity, &text);
}

fn log_change(before: VehicleStatus, shared: &Shared) -> VehicleStatus {
    let now = shared.with_vehicle(|vehicle| vehicle.status());
    if now != before {
        info!(
            "rover: {:?}, {:?}, alert {:?}",
            now.arm_state, now.mode, now.alert
        );
    }
    now
}
