//! INA260: power monitor with a shunt of its own (SBOS656).

use super::register_map::{RegisterMap, Registers};
use super::{Load, TEXAS_INSTRUMENTS, field_of, signed_code, unsigned_code};

const CONFIGURATION: u8 = 0x00;
const CURRENT: u8 = 0x01;
const BUS_VOLTAGE: u8 = 0x02;
const POWER: u8 = 0x03;
const MASK_ENABLE: u8 = 0x06;
const ALERT_LIMIT: u8 = 0x07;
const MANUFACTURER_ID: u8 = 0xfe;
const DIE_ID: u8 = 0xff;

const CONFIGURATION_RESET: u16 = 0x6127;
const RESET: u16 = 1 << 15;
/// Mask/Enable: a conversion is ready.
const CVRF: u64 = 1 << 3;
const CURRENT_LSB_A: f64 = 1.25e-3;
const BUS_LSB_V: f64 = 1.25e-3;
const POWER_LSB_W: f64 = 10e-3;

pub struct Ina260 {
    load: Load,
    configuration: u16,
    mask: u16,
    limit: u16,
}

impl Ina260 {
    pub fn new() -> RegisterMap<Self> {
        RegisterMap::of(Self::after_reset(Load::default()))
    }

    fn after_reset(load: Load) -> Self {
        Self {
            load,
            configuration: CONFIGURATION_RESET,
            mask: 0,
            limit: 0,
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
}

impl Registers for Ina260 {
    fn read(&self, pointer: u8) -> u64 {
        let Load { volts, amperes, .. } = self.load;
        match pointer {
            CONFIGURATION => self.configuration.into(),
            CURRENT => field_of(signed_code(amperes, CURRENT_LSB_A, 16), 16),
            BUS_VOLTAGE => field_of(unsigned_code(volts, BUS_LSB_V, 15), 16),
            POWER => field_of(unsigned_code(volts * amperes.abs(), POWER_LSB_W, 16), 16),
            MASK_ENABLE => u64::from(self.mask) | CVRF,
            ALERT_LIMIT => self.limit.into(),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DIE_ID => 0x2270,
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIGURATION if value & RESET != 0 => self.reset(),
            CONFIGURATION => self.configuration = value,
            MASK_ENABLE => self.mask = value & 0xfc03,
            ALERT_LIMIT => self.limit = value,
            _ => {}
        }
    }

    fn reset(&mut self) {
        *self = Self::after_reset(self.load);
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{read, write};
    use super::*;

    #[test]
    fn current_voltage_and_power_have_fixed_steps() {
        let mut device = Ina260::new();
        device.set(12.0, 10.0);
        assert_eq!(read(&mut device, CURRENT, 2), 8000, "1.25 mA");
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 9600, "1.25 mV");
        assert_eq!(read(&mut device, POWER, 2), 12_000, "10 mW");
        device.set(12.0, -10.0);
        assert_eq!(read(&mut device, CURRENT, 2), 0x1_0000 - 8000);
    }

    #[test]
    fn it_says_what_it_is_and_resets() {
        // Reset values and die id from memory of the register map, not confirmed.
        let mut device = Ina260::new();
        assert_eq!(read(&mut device, MANUFACTURER_ID, 2), 0x5449);
        assert_eq!(read(&mut device, DIE_ID, 2), 0x2270);
        write(&mut device, CONFIGURATION, 0x6727);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x6727);
        write(&mut device, CONFIGURATION, RESET);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x6127);
    }

    #[test]
    fn a_power_cycle_forgets_what_was_written_not_what_is_measured() {
        let mut device = Ina260::new();
        device.set(12.0, 10.0);
        write(&mut device, CONFIGURATION, 0x6727);
        write(&mut device, ALERT_LIMIT, 0x1234);
        device.power_cycle();
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x6127);
        assert_eq!(read(&mut device, ALERT_LIMIT, 2), 0);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 9600);
    }
}
