//! INA231: an INA226 without identification, whose pin must not be above 28 V (SBOS644D table 8-3, 6.3).

use std::ops::{Deref, DerefMut};

use super::super::super::clock::Cycle;
use super::Ina226;
use super::register_map::{RegisterMap, Registers};

const CONFIGURATION: u8 = 0x00;
const LAST_REGISTER: u8 = 0x07;

const RESET: u16 = 1 << 15;
/// Bits 14 to 12 of the configuration read as 100.
const FIXED: u16 = 0x7000;
const FIXED_VALUE: u16 = 0x4000;

pub struct Ina231 {
    registers: Ina226,
}

impl Ina231 {
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self {
            registers: Ina226::unmapped(shunt_ohm),
        })
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
            CONFIGURATION..=LAST_REGISTER => self.registers.read(pointer),
            // It is not known what silicon gives where there is no register.
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        let value = match pointer {
            CONFIGURATION if value & RESET == 0 => value & !FIXED | FIXED_VALUE,
            _ => value,
        };
        self.registers.write(pointer, value);
    }

    fn note_time(&mut self, now: Cycle) {
        self.registers.note_time(now);
    }

    fn set_load(&mut self, volts: f64, amperes: f64) {
        self.registers.set_load(volts, amperes);
    }

    fn power_cycle(&mut self) {
        self.registers.power_cycle();
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{read, write};
    use super::*;

    #[test]
    fn it_measures_like_an_ina226_and_does_not_say_what_it_is() {
        // The INA226's example: 10 A through 2 mOhm, 11.98 V.
        let mut device = Ina231::new(0.002);
        device.set(11.98, 10.0);
        let values = [0, 1, 2, 0x08, 0xfe, 0xff].map(|pointer| read(&mut device, pointer, 2));
        assert_eq!(values, [0x4127, 0x1f40, 0x2570, 0, 0, 0]);
    }

    #[test]
    fn three_bits_of_the_configuration_are_fixed() {
        let mut device = Ina231::new(0.002);
        write(&mut device, CONFIGURATION, 0x3527);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x4527);
    }
}
