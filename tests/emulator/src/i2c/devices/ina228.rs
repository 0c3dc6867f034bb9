//! INA228: 20-bit power, energy and charge monitor with an external shunt (SLYS021).

use super::super::super::clock::{CLK_SYS_HZ, Cycle};
use super::register_map::{RegisterMap, Registers};
use super::{Load, TEXAS_INSTRUMENTS, field_of, signed_code, unsigned_code};

const CONFIG: u8 = 0x00;
const ADC_CONFIG: u8 = 0x01;
const SHUNT_CAL: u8 = 0x02;
const SHUNT_TEMPCO: u8 = 0x03;
const VSHUNT: u8 = 0x04;
const VBUS: u8 = 0x05;
const DIETEMP: u8 = 0x06;
const CURRENT: u8 = 0x07;
const POWER: u8 = 0x08;
const ENERGY: u8 = 0x09;
const CHARGE: u8 = 0x0a;
const DIAG_ALRT: u8 = 0x0b;
const MANUFACTURER_ID: u8 = 0x3e;
const DEVICE_ID: u8 = 0x3f;

const ADC_CONFIG_RESET: u16 = 0xfb68;
const SHUNT_CAL_RESET: u16 = 0x1000;
const RST: u16 = 1 << 15;
const RSTACC: u16 = 1 << 14;
const ADCRANGE: u16 = 1 << 4;
/// DIAG_ALRT: the memory's checksum is right, a conversion is ready.
const MEMSTAT_AND_CNVRF: u64 = 0b11;

const SHUNT_LSB_V: f64 = 312.5e-9;
const NARROW_SHUNT_LSB_V: f64 = 78.125e-9;
const BUS_LSB_V: f64 = 195.3125e-6;
const TEMPERATURE_LSB_C: f64 = 7.8125e-3;
/// SHUNT_CAL = 13107.2e6 x CURRENT_LSB x RSHUNT (equation 2), four times that in the narrow range.
const CALIBRATION: f64 = 13107.2e6;
const NARROW_FACTOR: f64 = 4.0;
/// Steps of power and energy in steps of current (equations 5 and 6).
const POWER_STEPS: f64 = 3.2;
const ENERGY_STEPS: f64 = 16.0 * POWER_STEPS;
const ACCUMULATOR_BITS: u32 = 40;

pub struct Ina228 {
    shunt_ohm: f64,
    load: Load,
    config: u16,
    adc_config: u16,
    shunt_cal: u16,
    shunt_tempco: u16,
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
            shunt_tempco: 0,
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

    fn is_narrow(&self) -> bool {
        self.config & ADCRANGE != 0
    }

    fn shunt_lsb_v(&self) -> f64 {
        if self.is_narrow() {
            NARROW_SHUNT_LSB_V
        } else {
            SHUNT_LSB_V
        }
    }

    fn shunt_code(&self) -> i64 {
        signed_code(self.load.amperes * self.shunt_ohm, self.shunt_lsb_v(), 20)
    }

    /// The current as the shunt shows it: no more than its range.
    fn current_a(&self) -> f64 {
        self.shunt_code() as f64 * self.shunt_lsb_v() / self.shunt_ohm
    }

    /// The step of the current register that SHUNT_CAL makes; `None`: "if SHUNT_CAL is zero, the
    /// current value is also zero", and so is what follows from it.
    fn current_lsb_a(&self) -> Option<f64> {
        let factor = if self.is_narrow() { NARROW_FACTOR } else { 1.0 };
        let lsb = f64::from(self.shunt_cal) / (CALIBRATION * self.shunt_ohm * factor);
        (self.shunt_cal != 0).then_some(lsb)
    }

    fn in_current_steps(&self, code: impl Fn(f64) -> i64) -> i64 {
        self.current_lsb_a().map_or(0, code)
    }

    fn power_w(&self) -> f64 {
        self.current_a().abs() * self.load.volts
    }

    /// Energy and charge overflow and start again from 0.
    fn accumulator(&self, value: f64, steps: f64) -> u64 {
        let code = self.in_current_steps(|lsb| (value / (steps * lsb)).round() as i64);
        field_of(code, ACCUMULATOR_BITS)
    }

    fn reset_accumulators(&mut self) {
        self.energy_j = 0.0;
        self.charge_c = 0.0;
    }

    fn configure(&mut self, value: u16) {
        if value & RSTACC != 0 {
            self.reset_accumulators();
        }
        self.config = value & 0x3ff0;
        if value & RST != 0 {
            *self = Self::after_reset(self.shunt_ohm, self.load, self.accumulated_until);
        }
    }
}

impl Registers for Ina228 {
    fn size(&self, pointer: u8) -> usize {
        match pointer {
            VSHUNT | VBUS | CURRENT | POWER => 3,
            ENERGY | CHARGE => 5,
            _ => 2,
        }
    }

    /// The three 20-bit registers have their value from bit 4 on.
    fn read(&self, pointer: u8) -> u64 {
        let current = |lsb| signed_code(self.current_a(), lsb, 20);
        let power = |lsb| unsigned_code(self.power_w(), POWER_STEPS * lsb, 24);
        match pointer {
            CONFIG => self.config.into(),
            ADC_CONFIG => self.adc_config.into(),
            SHUNT_CAL => self.shunt_cal.into(),
            SHUNT_TEMPCO => self.shunt_tempco.into(),
            VSHUNT => field_of(self.shunt_code(), 20) << 4,
            VBUS => field_of(unsigned_code(self.load.volts, BUS_LSB_V, 19), 20) << 4,
            DIETEMP => field_of(signed_code(self.load.celsius, TEMPERATURE_LSB_C, 16), 16),
            CURRENT => field_of(self.in_current_steps(current), 20) << 4,
            POWER => field_of(self.in_current_steps(power), 24),
            ENERGY => self.accumulator(self.energy_j, ENERGY_STEPS),
            CHARGE => self.accumulator(self.charge_c, 1.0),
            DIAG_ALRT => MEMSTAT_AND_CNVRF,
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DEVICE_ID => 0x2281,
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIG => self.configure(value),
            ADC_CONFIG => self.adc_config = value,
            SHUNT_CAL => self.shunt_cal = value & 0x7fff,
            SHUNT_TEMPCO => self.shunt_tempco = value & 0x3fff,
            _ => {}
        }
    }

    fn note_time(&mut self, now: Cycle) {
        let before = self.accumulated_until.replace(now).unwrap_or(now);
        let seconds = (now - before) as f64 / CLK_SYS_HZ as f64;
        self.energy_j += self.power_w() * seconds;
        self.charge_c += self.current_a() * seconds;
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

    fn assert_near(value: u64, expected: u64, tolerance: u64) {
        assert!(value.abs_diff(expected) <= tolerance, "{value} is not {expected}");
    }

    #[test]
    fn the_typical_application_reads_as_the_equations_say() {
        // Its figures are from memory, not confirmed; each agrees with the equation of its register.
        assert!((CALIBRATION * EXAMPLE_LSB * RSHUNT - 4050.0).abs() < 0.1);
        let mut device = example();
        assert_eq!(read(&mut device, VSHUNT, 3), 311_040 << 4, "97.2 mV");
        assert_eq!(read(&mut device, VBUS, 3), 245_760 << 4, "48 V");
        assert_eq!(read(&mut device, DIETEMP, 2), 3200, "25 °C");
        assert_near(read(&mut device, CURRENT, 3) >> 4, 314_572, 10);
        assert_near(read(&mut device, POWER, 3), 4_718_604, 150);
    }

    #[test]
    fn energy_and_charge_are_those_of_the_time_that_has_passed() {
        let mut device = example();
        let energy = read_at(&mut device, ENERGY, 5, HOUR);
        assert_near(energy, 1_061_683_200, 30_000);
        assert_near(read_at(&mut device, CHARGE, 5, HOUR), 1_132_462_080, 30_000);
        device.set(48.0, -12.0, 25.0);
        assert_eq!(
            read_at(&mut device, CHARGE, 5, 2 * HOUR) >> 39,
            1,
            "the charge is signed"
        );
        Registers::write(&mut *device, CONFIG, RSTACC);
        assert_eq!(read_at(&mut device, CHARGE, 5, 2 * HOUR), 0);
        assert_eq!(read_at(&mut device, CONFIG, 2, 2 * HOUR), 0, "clears itself");
    }

    #[test]
    fn the_narrow_range_has_steps_a_quarter_as_large() {
        let mut device = Ina228::new(0.001);
        device.set(12.0, -10.0, -5.0);
        write(&mut device, CONFIG, ADCRANGE);
        // A CURRENT_LSB of 100 uA.
        write(&mut device, SHUNT_CAL, 5243);
        assert_eq!(
            read(&mut device, VSHUNT, 3) >> 4,
            (1 << 20) - 128_000,
            "-10 mV in 78.125 nV"
        );
        assert_near(read(&mut device, CURRENT, 3) >> 4, (1 << 20) - 100_000, 10);
        assert_eq!(read(&mut device, DIETEMP, 2), 0x1_0000 - 640);
        device.set(12.0, 100.0, 25.0);
        assert_eq!(
            read(&mut device, VSHUNT, 3) >> 4,
            0x7_ffff,
            "40.96 mV at the most"
        );
    }

    #[test]
    fn it_says_what_it_is_and_resets() {
        let mut device = example();
        assert_eq!(read(&mut device, MANUFACTURER_ID, 2), 0x5449);
        assert_eq!(read(&mut device, DEVICE_ID, 2), 0x2281);
        write(&mut device, SHUNT_CAL, 0);
        assert_eq!(read(&mut device, CURRENT, 3), 0);
        write(&mut device, CONFIG, RST);
        assert_eq!(read(&mut device, SHUNT_CAL, 2), 0x1000);
        assert_eq!(read(&mut device, ADC_CONFIG, 2), 0xfb68);
        assert_eq!(read(&mut device, VBUS, 3), 245_760 << 4);
    }

    #[test]
    fn a_power_cycle_sets_the_accumulators_to_zero_and_forgets_the_calibration() {
        let mut device = example();
        assert_near(read_at(&mut device, CHARGE, 5, HOUR), 1_132_462_080, 30_000);
        device.power_cycle();
        assert_eq!(read_at(&mut device, SHUNT_CAL, 2, 2 * HOUR), 0x1000);
        Registers::write(&mut *device, SHUNT_CAL, 4050);
        assert_eq!(read_at(&mut device, CHARGE, 5, 2 * HOUR), 0);
        assert_eq!(read_at(&mut device, ENERGY, 5, 2 * HOUR), 0);
        assert_eq!(read_at(&mut device, VBUS, 3, 2 * HOUR), 245_760 << 4);
        assert_near(read_at(&mut device, CHARGE, 5, 3 * HOUR), 1_132_462_080, 30_000);
    }
}
