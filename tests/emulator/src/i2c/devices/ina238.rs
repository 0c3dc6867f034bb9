//! INA238: 16-bit power monitor with an external shunt (SLYS025).

use super::register_map::{RegisterMap, Registers};
use super::{Load, TEXAS_INSTRUMENTS, field_of, signed_code, unsigned_code};

const CONFIG: u8 = 0x00;
const ADC_CONFIG: u8 = 0x01;
const SHUNT_CAL: u8 = 0x02;
const VSHUNT: u8 = 0x04;
const VBUS: u8 = 0x05;
const DIETEMP: u8 = 0x06;
const CURRENT: u8 = 0x07;
const POWER: u8 = 0x08;
const DIAG_ALRT: u8 = 0x0b;
const FIRST_LIMIT: u8 = 0x0c;
const LAST_LIMIT: u8 = 0x11;
const MANUFACTURER_ID: u8 = 0x3e;
const DEVICE_ID: u8 = 0x3f;

const ADC_CONFIG_RESET: u16 = 0xfb68;
const SHUNT_CAL_RESET: u16 = 0x1000;
/// SOVL, SUVL, BOVL, BUVL, TEMP_LIMIT, PWR_LIMIT; from memory, not confirmed.
const LIMITS_RESET: [u16; 6] = [0x7fff, 0x8000, 0x7fff, 0, 0x7ff0, 0xffff];
const RST: u16 = 1 << 15;
const CONVDLY_AND_ADCRANGE: u16 = 0x3fd0;
const ADCRANGE: u16 = 1 << 4;
/// DIAG_ALRT: the memory's checksum is right, a conversion is ready.
const MEMSTAT_AND_CNVRF: u64 = 0b11;

const SHUNT_LSB_V: f64 = 5e-6;
const NARROW_SHUNT_LSB_V: f64 = 1.25e-6;
const BUS_LSB_V: f64 = 3.125e-3;
const TEMPERATURE_LSB_C: f64 = 125e-3;
/// SHUNT_CAL = 819.2e6 x CURRENT_LSB x RSHUNT, four times that in the narrow range: in both of them the
/// current register is the shunt register x 4096 / SHUNT_CAL, and its step as large as the shunt's at
/// 4096.
const UNIT_CALIBRATION: f64 = 4096.0;
/// Power in steps of 0.2 x CURRENT_LSB is bus register x current register / 64.
const POWER_DIVISOR: i64 = 64;

pub struct Ina238 {
    device_id: u16,
    shunt_ohm: f64,
    load: Load,
    config: u16,
    adc_config: u16,
    shunt_cal: u16,
    limits: [u16; 6],
}

impl Ina238 {
    /// Its revision is not confirmed.
    const DEVICE_ID: u16 = 0x2381;

    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self::identified(Self::DEVICE_ID, shunt_ohm))
    }

    /// The registers of a part that calls itself something else.
    pub fn identified(device_id: u16, shunt_ohm: f64) -> Self {
        Self::after_reset(device_id, shunt_ohm, Load::default())
    }

    fn after_reset(device_id: u16, shunt_ohm: f64, load: Load) -> Self {
        Self {
            device_id,
            shunt_ohm,
            load,
            config: 0,
            adc_config: ADC_CONFIG_RESET,
            shunt_cal: SHUNT_CAL_RESET,
            limits: LIMITS_RESET,
        }
    }

    pub fn set(&mut self, volts: f64, amperes: f64, celsius: f64) {
        self.load = Load {
            volts,
            amperes,
            celsius,
        };
    }

    pub fn shunt_calibration(&self) -> u16 {
        self.shunt_cal
    }

    fn shunt_code(&self) -> i64 {
        let lsb = match self.config & ADCRANGE {
            0 => SHUNT_LSB_V,
            _ => NARROW_SHUNT_LSB_V,
        };
        signed_code(self.load.amperes * self.shunt_ohm, lsb, 16)
    }

    fn bus_code(&self) -> i64 {
        unsigned_code(self.load.volts, BUS_LSB_V, 15)
    }

    /// That without calibration the current reads zero is assumed from the INA228.
    fn current_code(&self) -> i64 {
        match self.shunt_cal {
            0 => 0,
            shunt_cal => {
                let steps = f64::from(shunt_cal) / UNIT_CALIBRATION;
                signed_code(self.shunt_code() as f64, steps, 16)
            }
        }
    }

    fn power_code(&self) -> i64 {
        self.bus_code() * self.current_code().abs() / POWER_DIVISOR
    }

    fn limit(&mut self, pointer: u8) -> &mut u16 {
        &mut self.limits[usize::from(pointer - FIRST_LIMIT)]
    }
}

impl Registers for Ina238 {
    fn size(&self, pointer: u8) -> usize {
        match pointer {
            POWER => 3,
            _ => 2,
        }
    }

    fn read(&self, pointer: u8) -> u64 {
        match pointer {
            CONFIG => self.config.into(),
            ADC_CONFIG => self.adc_config.into(),
            SHUNT_CAL => self.shunt_cal.into(),
            VSHUNT => field_of(self.shunt_code(), 16),
            VBUS => field_of(self.bus_code(), 16),
            DIETEMP => field_of(signed_code(self.load.celsius, TEMPERATURE_LSB_C, 12), 12) << 4,
            CURRENT => field_of(self.current_code(), 16),
            POWER => field_of(self.power_code(), 24),
            DIAG_ALRT => MEMSTAT_AND_CNVRF,
            FIRST_LIMIT..=LAST_LIMIT => self.limits[usize::from(pointer - FIRST_LIMIT)].into(),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DEVICE_ID => self.device_id.into(),
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIG if value & RST != 0 => self.reset(),
            CONFIG => self.config = value & CONVDLY_AND_ADCRANGE,
            ADC_CONFIG => self.adc_config = value,
            SHUNT_CAL => self.shunt_cal = value & 0x7fff,
            FIRST_LIMIT..=LAST_LIMIT => *self.limit(pointer) = value,
            _ => {}
        }
    }

    fn reset(&mut self) {
        *self = Self::after_reset(self.device_id, self.shunt_ohm, self.load);
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{read, write};
    use super::*;

    /// 16.2 mOhm, 10 A at the most: a CURRENT_LSB of 10 A / 2^15 and 819.2e6 times that and the shunt.
    fn example() -> RegisterMap<Ina238> {
        let mut device = Ina238::new(0.0162);
        device.set(48.0, 6.0, 25.0);
        write(&mut device, SHUNT_CAL, 4050);
        device
    }

    #[test]
    fn six_amperes_at_48_volts_read_as_the_equations_say() {
        let mut device = example();
        assert_eq!(read(&mut device, VSHUNT, 2), 19_440, "97.2 mV in 5 uV");
        assert_eq!(read(&mut device, VBUS, 2), 15_360);
        assert_eq!(read(&mut device, DIETEMP, 2), 200 << 4, "25 °C");
        assert_eq!(read(&mut device, CURRENT, 2), 19_661, "19660.8 steps of 305.2 uA");
        assert_eq!(read(&mut device, POWER, 3), 4_718_640, "288 W in 61.04 uW");
    }

    #[test]
    fn the_narrow_range_has_steps_a_quarter_as_large() {
        let mut device = Ina238::new(0.001);
        device.set(12.0, -10.0, -5.0);
        write(&mut device, CONFIG, ADCRANGE);
        // 819.2e6 x 1 mA x 1 mOhm x 4.
        write(&mut device, SHUNT_CAL, 3277);
        assert_eq!(read(&mut device, VSHUNT, 2), 0x1_0000 - 8000, "-10 mV in 1.25 uV");
        assert_eq!(
            read(&mut device, CURRENT, 2),
            0x1_0000 - 9999,
            "8000 x 4096 / 3277"
        );
        assert_eq!(read(&mut device, DIETEMP, 2), (0x1000 - 40) << 4);
        device.set(200.0, 100.0, 25.0);
        assert_eq!(read(&mut device, VSHUNT, 2), 0x7fff, "40.96 mV at the most");
        assert_eq!(read(&mut device, VBUS, 2), 0x7fff);
    }

    #[test]
    fn it_says_what_it_is_and_resets() {
        let mut device = example();
        assert_eq!(read(&mut device, MANUFACTURER_ID, 2), 0x5449);
        assert_eq!(read(&mut device, DEVICE_ID, 2), 0x2381);
        assert_eq!(read(&mut device, ADC_CONFIG, 2), 0xfb68);
        write(&mut device, SHUNT_CAL, 0);
        assert_eq!(read(&mut device, CURRENT, 2), 0);
        write(&mut device, FIRST_LIMIT, 0x1234);
        write(&mut device, CONFIG, RST | ADCRANGE);
        assert_eq!(read(&mut device, CONFIG, 2), 0, "clears itself");
        assert_eq!(read(&mut device, SHUNT_CAL, 2), 0x1000);
        assert_eq!(read(&mut device, FIRST_LIMIT, 2), 0x7fff);
        assert_eq!(
            read(&mut device, CURRENT, 2),
            19_440,
            "the shunt register, at 4096"
        );
    }

    #[test]
    fn a_power_cycle_forgets_what_was_written_not_what_is_measured() {
        let mut device = example();
        write(&mut device, ADC_CONFIG, 0xfb6a);
        device.power_cycle();
        assert_eq!(read(&mut device, ADC_CONFIG, 2), 0xfb68);
        assert_eq!(read(&mut device, SHUNT_CAL, 2), 0x1000);
        assert_eq!(read(&mut device, VBUS, 2), 15_360);
    }
}
