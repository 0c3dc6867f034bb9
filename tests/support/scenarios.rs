//! Scenarios of a whole vehicle, in stepped time or on an emulated board, as `tests/host/stories.rs` and
//! `tests/firmware/stories.rs` have them.

use crate::time::SECOND;
use crate::vehicle::{TestedVehicle, Wire};

/// A parameter that is set by either wire is in force at once, after a restart and after the power was off.
pub fn parameters_are_kept<V: TestedVehicle>() {
    let mut vehicle = V::configured(&[("BATT_CAPACITY", 777.0)]);
    assert_eq!(vehicle.parameter("BATT_CAPACITY"), 777.0);
    vehicle.use_wire(Wire::Usb);
    vehicle.set("BATT_VOLT_MULT", 4.5);
    assert_eq!(vehicle.parameter("BATT_VOLT_MULT"), 4.5);
    vehicle.run_for(SECOND);
    vehicle.power_cycle();
    vehicle.run_for(SECOND);
    vehicle.use_wire(Wire::Uart);
    let kept = ["BATT_CAPACITY", "BATT_VOLT_MULT"].map(|name| vehicle.parameter(name));
    assert_eq!(kept, [777.0, 4.5]);
}
