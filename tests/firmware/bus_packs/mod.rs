//! Packs on the I2C bus: power monitors and smart batteries, at SDA GP14 and SCL GP15.

mod faults;

use std::cell::RefCell;
use std::rc::Rc;

use emulator::I2cDevice;
use workbench::bench::{Bench, DIVIDER_CODE, TestedVehicle};
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
