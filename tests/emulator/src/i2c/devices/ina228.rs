//! INA228: 20-bit power, energy and charge monitor with an external shunt (SLYS021).
//!
//! Left out: CONFIG but its reset and the narrow range, the temperature coefficient, current and power, alerts.

use super::super::super::clock::{CLK_SYS_HZ, Cycle};
use super::register_map::{RegisterMap, Registers};
use super::{
    CONFIG, CONFIG_RESET, Load, TEXAS_INSTRUMENTS, conversion_of_ina228, field_of, shunt_step, signed_code,
    unsigned_code,
};

const ADC_CONFIG: u8 = 0x01;
const SHUNT_CAL: u8 = 0x02;
const VSHUNT: u8 = 0x04;
const VBUS: u8 = 0x05;
const DIETEMP: u8 = 0x06;
const ENERGY: u8 = 0x09;
const CHARGE: u8 = 0x0a;
const MANUFACTURER_ID: u8 = 0x3e;
const DEVICE_ID: u8 = 0x3f;

const ADC_CONFIG_RESET: u16 = 0xfb68;
const SHUNT_CAL_RESET: u16 = 0x1000;

const SHUNT_LSB_V: f64 = 312.5e-9;
const BUS_LSB_V: f64 = 195.3125e-6;
const TEMPERATURE_LSB_C: f64 = 7.8125e-3;
/// SHUNT_CAL = 13107.2e6 x CURRENT_LSB x RSHUNT (equation 2).
const CALIBRATION: f64 = 13107.2e6;
/// Steps of energy in steps of current (equations 5 and 6).
const ENERGY_STEPS: f64 = 16.0 * 3.2;
const ACCUMULATOR_BITS: u32 = 40;

pub struct Ina228 {
    shunt_ohm: f64,
    load: Load,
    config: u16,
    adc_config: u16,
    shunt_cal: u16,
    /// Since the accumulators were reset: what was measured, in joules and coulombs.
    energy_j: f64,
    charge_c: f64,
    /// `None`: from the moment it is addressed next.
    accumulated_until: Option<Cycle>,
}

impl Ina228 {
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self::after_reset(shunt_ohm, Load::default(), Some(0)))
    }

    fn after_reset(shunt_ohm: f64, load: Load, now: Option<Cycle>) -> Self {
        Self {
            shunt_ohm,
            load,
            config: 0,
            adc_config: ADC_CONFIG_RESET,
            shunt_cal: SHUNT_CAL_RESET,
            energy_j: 0.0,
            charge_c: 0.0,
            accumulated_until: now,
        }
    }

    /// The accumulators take this load from the moment it was addressed last.
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

    fn shunt_step_v(&self) -> f64 {
        shunt_step(self.config, SHUNT_LSB_V)
    }

    fn shunt_code(&self) -> i64 {
        signed_code(self.load.amperes * self.shunt_ohm, self.shunt_step_v(), 20)
    }

    /// The current as the shunt shows it, no more than its range, nor than CURRENT's 20 bits.
    fn current_a(&self) -> f64 {
        let by_shunt_a = self.shunt_code() as f64 * self.shunt_step_v() / self.shunt_ohm;
        let limit_a = self.current_lsb_a() * f64::from(1 << 19);
        by_shunt_a.clamp(-limit_a, limit_a)
    }

    fn current_lsb_a(&self) -> f64 {
        f64::from(self.shunt_cal) / (CALIBRATION * self.shunt_ohm)
    }

    /// Energy and charge overflow and start again from 0. "If SHUNT_CAL is zero, the current value is also zero", and so is
    /// what follows from it.
    fn accumulator(&self, value: f64, steps: f64) -> u64 {
        match self.shunt_cal {
            0 => 0,
            _ => field_of(
                (value / (steps * self.current_lsb_a())).round() as i64,
                ACCUMULATOR_BITS,
            ),
        }
    }
}

impl Registers for Ina228 {
    fn size(&self, pointer: u8) -> usize {
        match pointer {
            VSHUNT | VBUS => 3,
            ENERGY | CHARGE => 5,
            _ => 2,
        }
    }

    /// The 20-bit registers have their value from bit 4 on.
    fn read(&self, pointer: u8) -> u64 {
        match pointer {
            CONFIG => self.config.into(),
            ADC_CONFIG => self.adc_config.into(),
            SHUNT_CAL => self.shunt_cal.into(),
            VSHUNT => field_of(self.shunt_code(), 20) << 4,
            VBUS => field_of(unsigned_code(self.load.volts, BUS_LSB_V, 19), 20) << 4,
            DIETEMP => field_of(signed_code(self.load.celsius, TEMPERATURE_LSB_C, 16), 16),
            ENERGY => self.accumulator(self.energy_j, ENERGY_STEPS),
            CHARGE => self.accumulator(self.charge_c, 1.0),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DEVICE_ID => 0x2281,
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIG if value & CONFIG_RESET != 0 => self.reset(),
            CONFIG => self.config = value,
            ADC_CONFIG => self.adc_config = value,
            SHUNT_CAL => self.shunt_cal = value & 0x7fff,
            _ => {}
        }
    }

    fn note_time(&mut self, now: Cycle) {
        let before = self.accumulated_until.replace(now).unwrap_or(now);
        let seconds = (now - before) as f64 / CLK_SYS_HZ as f64;
        self.energy_j += self.current_a().abs() * self.load.volts * seconds;
        self.charge_c += self.current_a() * seconds;
    }

    fn conversion(&self) -> Cycle {
        conversion_of_ina228(self.adc_config)
    }

    fn set_result(&mut self, volts: f64, amperes: f64) {
        self.set(volts, amperes, self.load.celsius);
    }

    /// The time of the reset is unknown: what flows until it is addressed is not counted.
    fn reset(&mut self) {
        *self = Self::after_reset(self.shunt_ohm, self.load, None);
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{read, read_at, write};
    use super::*;

    const HOUR: Cycle = 3600 * CLK_SYS_HZ;
    const RSHUNT: f64 = 0.0162;
    /// 10 A / 2^19.
    const EXAMPLE_LSB: f64 = 10.0 / 524_288.0;

    /// The datasheet's typical application (8.2): 16.2 mOhm, 10 A at the most, 6 A at 48 V and 25 °C.
    fn example() -> RegisterMap<Ina228> {
        let mut device = Ina228::new(RSHUNT);
        device.set(48.0, 6.0, 25.0);
        write(&mut device, SHUNT_CAL, 4050);
        device
    }

    fn assert_near(value: u64, expected: u64) {
        assert!(value.abs_diff(expected) <= 30_000, "{value} is not {expected}");
    }

    #[test]
    fn the_typical_application_reads_as_the_equations_say() {
        // Its figures are from memory, not confirmed; each agrees with the equation of its register.
        assert!((CALIBRATION * EXAMPLE_LSB * RSHUNT - 4050.0).abs() < 0.1);
        let mut device = example();
        for (pointer, bytes, value) in [
            // 97.2 mV.
            (VSHUNT, 3, 311_040 << 4),
            (VBUS, 3, 245_760 << 4),
            (DIETEMP, 2, 3200),
            (MANUFACTURER_ID, 2, 0x5449),
            (DEVICE_ID, 2, 0x2281),
        ] {
            assert_eq!(read(&mut device, pointer, bytes), value, "{pointer:#x}");
        }
        device.set(12.0, -1.0, -5.0);
        assert_eq!(read(&mut device, VSHUNT, 3) >> 4, (1 << 20) - 51_840);
        assert_eq!(read(&mut device, DIETEMP, 2), 0x1_0000 - 640);
        device.set(12.0, 100.0, 25.0);
        assert_eq!(
            read(&mut device, VSHUNT, 3) >> 4,
            0x7_ffff,
            "163.84 mV at the most"
        );
    }

    #[test]
    fn energy_and_charge_are_those_of_the_time_that_has_passed() {
        let mut device = example();
        assert_near(read_at(&mut device, ENERGY, 5, HOUR), 1_061_683_200);
        assert_near(read_at(&mut device, CHARGE, 5, HOUR), 1_132_462_080);
        device.set(48.0, -12.0, 25.0);
        let charge = read_at(&mut device, CHARGE, 5, 2 * HOUR);
        assert_eq!(charge >> 39, 1, "the charge is signed");
        Registers::write(&mut *device, SHUNT_CAL, 0);
        assert_eq!(read_at(&mut device, CHARGE, 5, 2 * HOUR), 0);
    }

    #[test]
    fn a_power_cycle_sets_the_accumulators_to_zero_and_forgets_the_calibration() {
        let mut device = example();
        assert_near(read_at(&mut device, CHARGE, 5, HOUR), 1_132_462_080);
        device.power_cycle();
        assert_eq!(read_at(&mut device, SHUNT_CAL, 2, 2 * HOUR), 0x1000);
        Registers::write(&mut *device, SHUNT_CAL, 4050);
        assert_eq!(read_at(&mut device, CHARGE, 5, 2 * HOUR), 0);
        assert_eq!(read_at(&mut device, ENERGY, 5, 2 * HOUR), 0);
        assert_near(read_at(&mut device, CHARGE, 5, 3 * HOUR), 1_132_462_080);
    }
}
