//! INA226: 16-bit power monitor with an external shunt (SBOS547).
//!
//! Left out: alerts, and the calibration. Current and power read zero, as they do without one.

use super::super::super::clock::Cycle;
use super::register_map::{RegisterMap, Registers};
use super::{Load, TEXAS_INSTRUMENTS, conversion_of_ina226, field_of, signed_code, unsigned_code};

const CONFIGURATION: u8 = 0x00;
const SHUNT_VOLTAGE: u8 = 0x01;
const BUS_VOLTAGE: u8 = 0x02;
const MANUFACTURER_ID: u8 = 0xfe;
const DIE_ID: u8 = 0xff;

const CONFIGURATION_RESET: u16 = 0x4127;
const RESET: u16 = 1 << 15;
const SHUNT_LSB_V: f64 = 2.5e-6;
const BUS_LSB_V: f64 = 1.25e-3;

pub struct Ina226 {
    shunt_ohm: f64,
    load: Load,
    configuration: u16,
}

impl Ina226 {
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self::unmapped(shunt_ohm))
    }

    /// Its registers alone, for parts that have them too.
    pub(super) fn unmapped(shunt_ohm: f64) -> Self {
        Self {
            shunt_ohm,
            load: Load::default(),
            configuration: CONFIGURATION_RESET,
        }
    }

    /// It measures no temperature.
    pub fn set(&mut self, volts: f64, amperes: f64) {
        self.load = Load {
            volts,
            amperes,
            ..self.load
        };
    }

    pub fn configuration(&self) -> u16 {
        self.configuration
    }
}

impl Registers for Ina226 {
    fn read(&self, pointer: u8) -> u64 {
        let Load { volts, amperes, .. } = self.load;
        match pointer {
            CONFIGURATION => self.configuration.into(),
            SHUNT_VOLTAGE => field_of(signed_code(amperes * self.shunt_ohm, SHUNT_LSB_V, 16), 16),
            // Of its 16 bits the highest is always 0.
            BUS_VOLTAGE => field_of(unsigned_code(volts, BUS_LSB_V, 15), 16),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DIE_ID => 0x2260,
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
    fn the_datasheets_example_reads_as_it_says() {
        // Table 1: 10 A through 2 mOhm, 11.98 V.
        let mut device = Ina226::new(0.002);
        device.set(11.98, 10.0);
        for (pointer, value) in [
            (CONFIGURATION, 0x4127),
            (SHUNT_VOLTAGE, 0x1f40),
            (BUS_VOLTAGE, 0x2570),
            (MANUFACTURER_ID, 0x5449),
            (DIE_ID, 0x2260),
        ] {
            assert_eq!(read(&mut device, pointer, 2), value, "{pointer:#x}");
        }
    }

    #[test]
    fn a_current_the_other_way_is_negative_and_out_of_range_is_held() {
        let mut device = Ina226::new(0.002);
        device.set(11.98, -10.0);
        assert_eq!(read(&mut device, SHUNT_VOLTAGE, 2), 0x1_0000 - 0x1f40);
        // 81.92 mV and 40.96 V at the most.
        device.set(50.0, 100.0);
        let values = [SHUNT_VOLTAGE, BUS_VOLTAGE].map(|pointer| read(&mut device, pointer, 2));
        assert_eq!(values, [0x7fff; 2]);
    }
}
