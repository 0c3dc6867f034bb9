//! Packs on the I2C bus: power monitors and smart batteries, at SDA GP14 and SCL GP15.

mod faults;

use std::cell::RefCell;
use std::rc::Rc;

use emulator::I2cDevice;
use workbench::bench::{Bench, TestedVehicle};
use workbench::i2c_bus::BUS;

/// A board whose second pack is measured by `device`, of this kind and at this address, with these parameters.
pub fn with_second_pack<D: I2cDevice + 'static>(
    mut bench: Bench,
    (kind, address): (f32, u8),
    device: &Rc<RefCell<D>>,
    parameters: &[(&str, f32)],
) -> Bench {
    bench.i2c(BUS).attach(address, Box::new(Rc::clone(device)));
    bench.set_all(&[("BATT2_MONITOR", kind), ("SR0_EXTRA1", 10.0)]);
    bench.set_all(parameters);
    bench.reboot();
    bench
}
