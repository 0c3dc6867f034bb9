//! INA231: an INA226 without identification (SBOS644).

use std::ops::{Deref, DerefMut};

use super::Ina226;
use super::register_map::{RegisterMap, Registers};

const CONFIGURATION: u8 = 0x00;
const ALERT_LIMIT: u8 = 0x07;

const RESET: u16 = 1 << 15;
/// Bits 14 to 12 of the configuration read as 100.
const FIXED: u16 = 0x7000;
const FIXED_VALUE: u16 = 0x4000;

pub struct Ina231 {
    registers: Ina226,
    unassigned: u16,
}

impl Ina231 {
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self {
            registers: Ina226::unmapped(shunt_ohm),
            unassigned: 0,
        })
    }

    /// What a read gives where there is no register; what silicon gives is not known.
    pub fn set_unassigned(&mut self, word: u16) {
        self.unassigned = word;
    }
}

impl Deref for Ina231 {
    type Target = Ina226;

    fn deref(&self) -> &Ina226 {
        &self.registers
    }
}

impl DerefMut for Ina231 {
    fn deref_mut(&mut self) -> &mut Ina226 {
        &mut self.registers
    }
}

impl Registers for Ina231 {
    fn read(&self, pointer: u8) -> u64 {
        match pointer {
            CONFIGURATION..=ALERT_LIMIT => self.registers.read(pointer),
            _ => self.unassigned.into(),
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        let value = match pointer {
            CONFIGURATION if value & RESET == 0 => value & !FIXED | FIXED_VALUE,
            _ => value,
        };
        self.registers.write(pointer, value);
    }

    fn reset(&mut self) {
        self.registers.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{read, write};
    use super::*;

    const MANUFACTURER_ID: u8 = 0xfe;

    #[test]
    fn it_measures_like_an_ina226_and_does_not_say_what_it_is() {
        // The INA226's example: 10 A through 2 mOhm, 11.98 V, a current LSB of 1 mA.
        let mut device = Ina231::new(0.002);
        device.set(11.98, 10.0);
        write(&mut device, 0x05, 0xa00);
        let values = [0, 1, 2, 3, 4, 5].map(|pointer| read(&mut device, pointer, 2));
        assert_eq!(values, [0x4127, 0x1f40, 0x2570, 0x12b8, 0x2710, 0xa00]);
        for pointer in [0x08, MANUFACTURER_ID, 0xff] {
            assert_eq!(read(&mut device, pointer, 2), 0, "{pointer:#x}");
        }
        device.set_unassigned(0xffff);
        assert_eq!(read(&mut device, MANUFACTURER_ID, 2), 0xffff);
    }

    #[test]
    fn three_bits_of_the_configuration_are_fixed_and_it_resets() {
        let mut device = Ina231::new(0.002);
        write(&mut device, CONFIGURATION, 0x3527);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x4527);
        write(&mut device, CONFIGURATION, RESET);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x4127);
    }

    #[test]
    fn a_power_cycle_forgets_what_was_written_not_what_is_measured() {
        let mut device = Ina231::new(0.002);
        device.set(12.0, 1.0);
        write(&mut device, 0x05, 0xa00);
        device.power_cycle();
        assert_eq!(read(&mut device, 0x05, 2), 0);
        assert_eq!(read(&mut device, 0x02, 2), 9600);
    }
}
