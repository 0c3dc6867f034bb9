//! Reads the parts on the I2C bus.

use super::{CheckIn, LONGEST_SLEEP, Shared, mark, now, timer_at};
use crate::sensor::{BusDevices, SensorBus};

/// Reads each part when it is due. A part that hangs holds up this task, and no other.
pub async fn read_bus(mut bus: impl SensorBus, shared: &Shared, check_in: &CheckIn) -> ! {
    let mut devices = shared.with(|autopilot| BusDevices::from_parameters(autopilot.parameters(), now()));
    loop {
        mark(check_in);
        let wake = now().after_us(LONGEST_SLEEP.as_micros());
        timer_at(devices.next_due().unwrap_or(wake).min(wake)).await;
        let arm_state = shared.with(|autopilot| {
            devices.follow(autopilot.parameters());
            autopilot.vehicle().arm_state()
        });
        let finding = devices
            .read_next(&mut bus, now(), arm_state, |pack, reading| {
                shared.with(|autopilot| autopilot.add_bus_reading(pack, reading, now()));
            })
            .await;
        if let Some((pack, event)) = finding {
            shared.with(|autopilot| autopilot.announce_supply(pack, &event, now()));
        }
    }
}
