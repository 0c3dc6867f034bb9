//! INA226: 16-bit power monitor with an external shunt (SBOS547).

use super::register_map::{RegisterMap, Registers};
use super::{Load, TEXAS_INSTRUMENTS, field_of, signed_code, unsigned_code};

const CONFIGURATION: u8 = 0x00;
const SHUNT_VOLTAGE: u8 = 0x01;
const BUS_VOLTAGE: u8 = 0x02;
const POWER: u8 = 0x03;
const CURRENT: u8 = 0x04;
const CALIBRATION: u8 = 0x05;
const MASK_ENABLE: u8 = 0x06;
const ALERT_LIMIT: u8 = 0x07;
const MANUFACTURER_ID: u8 = 0xfe;
const DIE_ID: u8 = 0xff;

const CONFIGURATION_RESET: u16 = 0x4127;
const RESET: u16 = 1 << 15;
/// Mask/Enable: a conversion is ready.
const CVRF: u64 = 1 << 3;
const SHUNT_LSB_V: f64 = 2.5e-6;
const BUS_LSB_V: f64 = 1.25e-3;

pub struct Ina226 {
    shunt_ohm: f64,
    load: Load,
    configuration: u16,
    calibration: u16,
    mask: u16,
    limit: u16,
}

impl Ina226 {
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self::unmapped(shunt_ohm))
    }

    /// Its registers alone, for parts that have them too.
    pub(super) fn unmapped(shunt_ohm: f64) -> Self {
        Self::after_reset(shunt_ohm, Load::default())
    }

    fn after_reset(shunt_ohm: f64, load: Load) -> Self {
        Self {
            shunt_ohm,
            load,
            configuration: CONFIGURATION_RESET,
            calibration: 0,
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

    pub fn configuration(&self) -> u16 {
        self.configuration
    }

    pub fn calibration(&self) -> u16 {
        self.calibration
    }

    fn shunt_code(&self) -> i64 {
        signed_code(self.load.amperes * self.shunt_ohm, SHUNT_LSB_V, 16)
    }

    /// Of its 16 bits the highest is always 0.
    fn bus_code(&self) -> i64 {
        unsigned_code(self.load.volts, BUS_LSB_V, 15)
    }

    /// Current = shunt voltage x calibration / 2048 (equation 3).
    fn current_code(&self) -> i64 {
        let current = self.shunt_code() * i64::from(self.calibration) / 2048;
        current.clamp(i16::MIN.into(), i16::MAX.into())
    }

    /// Power = current x bus voltage / 20000 (equation 4).
    fn power_code(&self) -> i64 {
        (self.current_code().abs() * self.bus_code() / 20_000).min(u16::MAX.into())
    }
}

impl Registers for Ina226 {
    fn read(&self, pointer: u8) -> u64 {
        match pointer {
            CONFIGURATION => self.configuration.into(),
            SHUNT_VOLTAGE => field_of(self.shunt_code(), 16),
            BUS_VOLTAGE => field_of(self.bus_code(), 16),
            POWER => field_of(self.power_code(), 16),
            CURRENT => field_of(self.current_code(), 16),
            CALIBRATION => self.calibration.into(),
            MASK_ENABLE => u64::from(self.mask) | CVRF,
            ALERT_LIMIT => self.limit.into(),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DIE_ID => 0x2260,
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIGURATION if value & RESET != 0 => self.reset(),
            CONFIGURATION => self.configuration = value,
            CALIBRATION => self.calibration = value & 0x7fff,
            MASK_ENABLE => self.mask = value & 0xfc03,
            ALERT_LIMIT => self.limit = value,
            _ => {}
        }
    }

    fn reset(&mut self) {
        *self = Self::after_reset(self.shunt_ohm, self.load);
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{read, write};
    use super::*;

    #[test]
    fn the_datasheets_example_reads_as_it_says() {
        // Table 1: 10 A through 2 mOhm, 11.98 V, a current LSB of 1 mA.
        let mut device = Ina226::new(0.002);
        device.set(11.98, 10.0);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x4127);
        assert_eq!(read(&mut device, SHUNT_VOLTAGE, 2), 0x1f40);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 0x2570);
        assert_eq!(read(&mut device, CURRENT, 2), 0, "not calibrated");
        write(&mut device, CALIBRATION, 0xa00);
        assert_eq!(read(&mut device, CALIBRATION, 2), 0xa00);
        assert_eq!(read(&mut device, CURRENT, 2), 0x2710);
        assert_eq!(read(&mut device, POWER, 2), 0x12b8);
        assert_eq!(read(&mut device, MANUFACTURER_ID, 2), 0x5449);
        assert_eq!(read(&mut device, DIE_ID, 2), 0x2260);
    }

    #[test]
    fn a_current_the_other_way_is_negative_and_out_of_range_is_held() {
        let mut device = Ina226::new(0.002);
        write(&mut device, CALIBRATION, 0xa00);
        device.set(11.98, -10.0);
        assert_eq!(read(&mut device, CURRENT, 2), 0x1_0000 - 0x2710);
        assert_eq!(read(&mut device, POWER, 2), 0x12b8);
        device.set(50.0, 100.0);
        assert_eq!(
            read(&mut device, SHUNT_VOLTAGE, 2),
            0x7fff,
            "81.92 mV at the most"
        );
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 0x7fff, "40.96 V at the most");
    }

    #[test]
    fn bit_15_of_the_configuration_resets_everything() {
        let mut device = Ina226::new(0.002);
        device.set(12.0, 1.0);
        write(&mut device, CALIBRATION, 0xa00);
        write(&mut device, CONFIGURATION, 0x4527);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x4527);
        write(&mut device, CONFIGURATION, RESET);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x4127);
        assert_eq!(read(&mut device, CALIBRATION, 2), 0);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 9600);
    }

    #[test]
    fn a_power_cycle_forgets_what_was_written_not_what_is_measured() {
        let mut device = Ina226::new(0.002);
        device.set(12.0, 1.0);
        write(&mut device, CALIBRATION, 0xa00);
        write(&mut device, CONFIGURATION, 0x4527);
        write(&mut device, ALERT_LIMIT, 0x1234);
        device.power_cycle();
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x4127);
        assert_eq!(read(&mut device, CALIBRATION, 2), 0);
        assert_eq!(read(&mut device, ALERT_LIMIT, 2), 0);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 9600);
    }
}
