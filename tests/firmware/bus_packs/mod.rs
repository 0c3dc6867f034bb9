//! Packs on the I2C bus: power monitors and smart batteries, at SDA GP14 and SCL GP15.

mod bq76952;
mod faults;
mod found;
mod messages;
mod more_parts;
mod nine;
mod values;
mod variants;

use std::cell::RefCell;
use std::rc::Rc;

use emulator::I2cDevice;
use support::frames::{BatteryStatus, last_of, texts_of};
use workbench::bench::{Bench, DIVIDER_CODE, SECOND};
use workbench::i2c_bus::{BUS, shared};

/// How the second pack is measured, and where.
pub struct Second {
    pub kind: f32,
    pub address: u8,
}

impl Second {
    /// Puts `device` on the bus and sets the parameters.
    pub fn configure<D: I2cDevice + 'static>(
        &self,
        bench: &mut Bench,
        device: &Rc<RefCell<D>>,
        parameters: &[(&str, f32)],
    ) {
        bench.i2c(BUS).attach(self.address, Box::new(Rc::clone(device)));
        bench.set("BATT2_MONITOR", self.kind);
        bench.set("SR0_EXTRA1", 10.0);
        bench.set_all(parameters);
        bench.reboot();
    }
}

/// A board whose second pack is measured by `device`, of this kind, with these parameters.
pub fn with_second_pack<D: I2cDevice + 'static>(
    kind: f32,
    address: u8,
    device: &Rc<RefCell<D>>,
    parameters: &[(&str, f32)],
) -> Bench {
    let mut bench = Bench::running(DIVIDER_CODE);
    Second { kind, address }.configure(&mut bench, device, parameters);
    bench
}

/// Runs for a second and shows what was reported of the second pack last.
pub fn after_a_second<R>(bench: &mut Bench, look: impl FnOnce(BatteryStatus<'_>) -> R) -> R {
    bench.run_for(SECOND);
    let frames = bench.frames();
    look(last_of(&frames, 1))
}

/// Unplugging the second pack's part is announced once, and so is plugging it in again.
pub fn assert_survives_unplugging<D: I2cDevice + 'static>(
    bench: &mut Bench,
    address: u8,
    part: &Rc<RefCell<D>>,
    lose_supply: impl FnOnce(&mut D),
) {
    bench.run_for(SECOND);
    bench.i2c(BUS).detach(address);
    bench.run_for(3 * SECOND);
    lose_supply(&mut part.borrow_mut());
    bench.i2c(BUS).attach(address, Box::new(Rc::clone(part)));
    bench.run_for(7 * SECOND);
    let announced = texts_of(&bench.frames());
    let of_pack: Vec<_> = announced.iter().filter(|text| text.contains("healthy")).collect();
    assert_eq!(
        of_pack,
        ["Battery 2 unhealthy: no answer", "Battery 2 healthy again"]
    );
}
