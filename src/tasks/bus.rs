//! Reads the parts on the I2C bus.

use embassy_time::{Instant, Timer};

use super::{LONGEST_SLEEP, Shared, mark};
use crate::liveness::CheckIn;
use crate::sensor::{BusDevices, SensorBus};

/// Reads each part when it is due. A part that hangs holds up this task, and no other.
pub async fn read_bus(mut bus: impl SensorBus, shared: &Shared, check_in: &CheckIn) -> ! {
    let now_us = Instant::now().as_micros();
    let mut devices = shared.with(|autopilot| BusDevices::from_parameters(autopilot.parameters(), now_us));
    loop {
        mark(check_in);
        let wake = Instant::now() + LONGEST_SLEEP;
        let due = devices.next_due_us().map(Instant::from_micros);
        Timer::at(due.unwrap_or(wake).min(wake)).await;
        devices
            .read_next(&mut bus, Instant::now().as_micros(), |pack, reading| {
                shared.with(|autopilot| autopilot.add_bus_reading(pack, reading));
            })
            .await;
    }
}
