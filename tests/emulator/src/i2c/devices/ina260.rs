//! INA260: power monitor with a shunt of its own (SBOS656). Left out: power and alerts.

use super::super::super::clock::Cycle;
use super::register_map::{RegisterMap, Registers};
use super::{Load, TEXAS_INSTRUMENTS, conversion_of_ina226, field_of, signed_code, unsigned_code};

const CONFIGURATION: u8 = 0x00;
const CURRENT: u8 = 0x01;
const BUS_VOLTAGE: u8 = 0x02;
const MANUFACTURER_ID: u8 = 0xfe;
const DIE_ID: u8 = 0xff;

const CONFIGURATION_RESET: u16 = 0x6127;
const RESET: u16 = 1 << 15;
const CURRENT_LSB_A: f64 = 1.25e-3;
const BUS_LSB_V: f64 = 1.25e-3;

pub struct Ina260 {
    load: Load,
    configuration: u16,
}

impl Ina260 {
    pub fn new() -> RegisterMap<Self> {
        RegisterMap::of(Self {
            load: Load::default(),
            configuration: CONFIGURATION_RESET,
        })
    }

    /// It measures no temperature.
    pub fn set(&mut self, volts: f64, amperes: f64) {
        self.load = Load {
            volts,
            amperes,
            ..self.load
        };
    }
}

impl Registers for Ina260 {
    fn read(&self, pointer: u8) -> u64 {
        let Load { volts, amperes, .. } = self.load;
        match pointer {
            CONFIGURATION => self.configuration.into(),
            CURRENT => field_of(signed_code(amperes, CURRENT_LSB_A, 16), 16),
            BUS_VOLTAGE => field_of(unsigned_code(volts, BUS_LSB_V, 15), 16),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DIE_ID => 0x2270,
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIGURATION if value & RESET != 0 => self.reset(),
            CONFIGURATION => self.configuration = value,
            _ => {}
        }
    }

    fn conversion(&self) -> Cycle {
        conversion_of_ina226(self.configuration)
    }

    fn set_result(&mut self, volts: f64, amperes: f64) {
        self.set(volts, amperes);
    }

    fn reset(&mut self) {
        self.configuration = CONFIGURATION_RESET;
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::read;
    use super::*;

    #[test]
    fn current_and_voltage_have_fixed_steps_and_it_says_what_it_is() {
        // Reset value and die id from memory of the register map, not confirmed.
        let mut device = Ina260::new();
        device.set(12.0, -10.0);
        for (pointer, value) in [
            (CONFIGURATION, 0x6127),
            (CURRENT, 0x1_0000 - 8000),
            (BUS_VOLTAGE, 9600),
            (MANUFACTURER_ID, 0x5449),
            (DIE_ID, 0x2270),
        ] {
            assert_eq!(read(&mut device, pointer, 2), value, "{pointer:#x}");
        }
    }
}
