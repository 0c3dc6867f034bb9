//! Search for a part that is not found, and the announcement of a smart battery that is.

use std::rc::Rc;

use super::{BUS, Second, shared};
use emulator::LogLevel;
use emulator::i2c_devices::{Ina226, Pec, SmartBattery};
use workbench::bench::{Bench, DIVIDER_CODE, SECOND};

#[test]
fn another_address_is_found_once_and_a_smart_battery_is_announced() {
    let mut bench = Bench::running(DIVIDER_CODE);
    let elsewhere = shared(Ina226::new(0.0005));
    for address in [0x41, 0x44] {
        bench.i2c(BUS).attach(address, Box::new(Rc::clone(&elsewhere)));
    }
    let battery = shared(SmartBattery::new(Pec::Right));
    let second = Second {
        kind: 7.0,
        address: 0x0b,
    };
    let third = [("BATT3_MONITOR", 21.0), ("BATT3_I2C_ADDR", 64.0)];
    second.configure(&mut bench, &battery, &third);
    bench.run_for(5 * SECOND);
    for announced in [
        "Battery 3 not found at 0x40: the bus answers at 0x41, 0x44",
        "Battery 2 found at 0x0b, 3 cells",
    ] {
        let lines = bench.logged(LogLevel::Info, &format!("announced: {announced}"));
        assert_eq!(lines.len(), 1, "{announced}");
    }
}
