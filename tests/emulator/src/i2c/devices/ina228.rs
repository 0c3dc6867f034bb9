//! INA228: 20-bit power, energy and charge monitor with an external shunt (SLYS021A: registers in table 7-3, ranges in table 8-1).
//! An INA238 has the same registers with 16 bits, and none for energy and charge (SLYS025: registers in table 7-3, ranges in table
//! 8-1).
//!
//! Energy and charge take CURRENT, and so its end, with each conversion. Left out: the conversion delay and the temperature
//! coefficient, power, alerts. The temperature is there at once.

use super::super::super::clock::{CLK_SYS_HZ, Cycle};
use super::register_map::{RegisterMap, Registers};
use super::{
    CONFIG, CONFIG_RESET, Converter, Load, RESET_ACCUMULATORS, SHUNT_CAL_RESET, TEXAS_INSTRUMENTS,
    current_code, field_of, setup_of_ina228, shunt_range, shunt_step, signed_code, unsigned_code,
};

const ADC_CONFIG: u8 = 0x01;
const SHUNT_CAL: u8 = 0x02;
const VSHUNT: u8 = 0x04;
const VBUS: u8 = 0x05;
const DIETEMP: u8 = 0x06;
const CURRENT: u8 = 0x07;
const ENERGY: u8 = 0x09;
const CHARGE: u8 = 0x0a;
const MANUFACTURER_ID: u8 = 0x3e;
const DEVICE_ID: u8 = 0x3f;

const ADC_CONFIG_RESET: u16 = 0xfb68;

/// The ADC's range; the pin must not be above 85 V.
const MOST_VOLTS: f64 = 102.4;
/// Steps of energy in steps of current (equations 5 and 6).
const ENERGY_STEPS: f64 = 16.0 * 3.2;
const ACCUMULATOR_BITS: u32 = 40;

/// Differences between the parts.
#[derive(Clone, Copy)]
struct Kind {
    device_id: u16,
    /// Of the codes of the shunt's voltage and the current; VBUS has one less, with no sign.
    bits: u32,
    shunt_lsb_v: f64,
    bus_lsb_v: f64,
    /// Upper bits of DIETEMP, which have the temperature.
    temperature_bits: u32,
    temperature_lsb_c: f64,
}

const INA228: Kind = Kind {
    device_id: 0x2281,
    bits: 20,
    shunt_lsb_v: 312.5e-9,
    bus_lsb_v: 195.3125e-6,
    temperature_bits: 16,
    temperature_lsb_c: 7.8125e-3,
};

/// Its revision is not confirmed.
const INA238: Kind = Kind {
    device_id: 0x2381,
    bits: 16,
    shunt_lsb_v: 5e-6,
    bus_lsb_v: 3.125e-3,
    temperature_bits: 12,
    temperature_lsb_c: 125e-3,
};

pub struct Ina228 {
    kind: Kind,
    shunt_ohm: f64,
    converter: Converter,
    config: u16,
    adc_config: u16,
    shunt_cal: u16,
    shunt: i64,
    bus: i64,
    /// Since the accumulators were reset, in their steps.
    energy: f64,
    charge: f64,
}

impl Ina228 {
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self::after_reset(INA228, shunt_ohm, Converter::default()))
    }

    pub fn ina238(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self::identified(INA238.device_id, shunt_ohm))
    }

    /// The registers of an INA238 that calls itself something else.
    pub fn identified(device_id: u16, shunt_ohm: f64) -> Self {
        Self::after_reset(Kind { device_id, ..INA238 }, shunt_ohm, Converter::default())
    }

    fn after_reset(kind: Kind, shunt_ohm: f64, mut converter: Converter) -> Self {
        converter.restart(0);
        Self {
            kind,
            shunt_ohm,
            converter,
            config: 0,
            adc_config: ADC_CONFIG_RESET,
            shunt_cal: SHUNT_CAL_RESET,
            shunt: 0,
            bus: 0,
            energy: 0.0,
            charge: 0.0,
        }
    }

    /// From the moment on at which it was addressed last.
    pub fn set(&mut self, volts: f64, amperes: f64, celsius: f64) {
        self.converter.set_load(Load {
            volts,
            amperes,
            celsius,
        });
    }

    /// The current flows for this share of the time, in pulses that are much shorter than a conversion.
    pub fn set_pulses(&mut self, share: f64) {
        self.converter.set_pulses(share);
    }

    pub fn shunt_calibration(&self) -> u16 {
        self.shunt_cal
    }

    fn current_code(&self) -> i64 {
        current_code(self.shunt, self.shunt_cal, self.kind.bits)
    }

    fn temperature(&self) -> u64 {
        let bits = self.kind.temperature_bits;
        let code = signed_code(self.converter.load().celsius, self.kind.temperature_lsb_c, bits);
        field_of(code, bits) << (16 - bits)
    }

    /// 20 bits are sent in three bytes, from bit 4 on.
    fn sent(&self, code: i64) -> u64 {
        match self.kind.bits {
            20 => field_of(code, 20) << 4,
            bits => field_of(code, bits),
        }
    }

    fn configure(&mut self, value: u16) {
        if value & RESET_ACCUMULATORS != 0 {
            (self.energy, self.charge) = (0.0, 0.0);
        }
        self.config = value & !RESET_ACCUMULATORS;
        self.converter.restart(0);
    }

    fn configure_adc(&mut self, value: u16) {
        self.adc_config = value;
        self.converter.restart(0);
    }

    fn reset(&mut self) {
        *self = Self::after_reset(self.kind, self.shunt_ohm, self.converter);
    }
}

impl Registers for Ina228 {
    fn size(&self, pointer: u8) -> usize {
        match pointer {
            VSHUNT | VBUS | CURRENT if self.kind.bits == 20 => 3,
            ENERGY | CHARGE => 5,
            _ => 2,
        }
    }

    /// Energy and charge overflow and start again from 0.
    fn read(&self, pointer: u8) -> u64 {
        match pointer {
            CONFIG => self.config.into(),
            ADC_CONFIG => self.adc_config.into(),
            SHUNT_CAL => self.shunt_cal.into(),
            VSHUNT => self.sent(self.shunt),
            VBUS => self.sent(self.bus),
            DIETEMP => self.temperature(),
            CURRENT => self.sent(self.current_code()),
            ENERGY | CHARGE if self.kind.bits != 20 => 0,
            ENERGY => field_of(self.energy as i64, ACCUMULATOR_BITS),
            CHARGE => field_of(self.charge as i64, ACCUMULATOR_BITS),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DEVICE_ID => self.kind.device_id.into(),
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIG if value & CONFIG_RESET != 0 => self.reset(),
            CONFIG => self.configure(value),
            ADC_CONFIG => self.configure_adc(value),
            SHUNT_CAL => self.shunt_cal = value & 0x7fff,
            _ => {}
        }
    }

    fn note_time(&mut self, now: Cycle) {
        let kind = self.kind;
        let step_v = shunt_step(self.config, kind.shunt_lsb_v);
        let amperes = shunt_range(step_v, kind.bits, self.shunt_ohm);
        let setup = setup_of_ina228(self.adc_config, MOST_VOLTS, amperes);
        for results in self.converter.advance(now, &setup) {
            if setup.measures_current {
                self.shunt = signed_code(results.amperes * self.shunt_ohm, step_v, kind.bits);
            }
            if setup.measures_voltage {
                self.bus = unsigned_code(results.volts, kind.bus_lsb_v, kind.bits - 1);
            }
            let seconds = (results.count * setup.result) as f64 / CLK_SYS_HZ as f64;
            let charge = self.current_code() as f64 * seconds;
            self.charge += charge;
            self.energy += charge.abs() * self.bus as f64 * kind.bus_lsb_v / ENERGY_STEPS;
        }
    }

    fn set_load(&mut self, volts: f64, amperes: f64) {
        self.set(volts, amperes, self.converter.load().celsius);
    }

    fn power_cycle(&mut self) {
        self.converter.power_cycle();
        self.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{read, read_at, write, write_at};
    use super::*;

    const HOUR: Cycle = 3600 * CLK_SYS_HZ;
    const RSHUNT: f64 = 0.0162;
    /// SHUNT_CAL = 13107.2e6 x CURRENT_LSB x RSHUNT (equation 2).
    const CALIBRATION: f64 = 13107.2e6;
    /// 10 A / 2^19.
    const EXAMPLE_LSB: f64 = 10.0 / 524_288.0;

    /// The datasheet's typical application (8.2): 16.2 mOhm, 10 A at the most, 6 A at 48 V and 25 °C.
    fn example() -> RegisterMap<Ina228> {
        let mut device = Ina228::new(RSHUNT);
        device.set(48.0, 6.0, 25.0);
        write_at(&mut device, SHUNT_CAL, 4050, 0);
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
            // 6 A.
            (CURRENT, 3, 314_572 << 4),
            (MANUFACTURER_ID, 2, 0x5449),
            (DEVICE_ID, 2, 0x2281),
        ] {
            assert_eq!(read(&mut device, pointer, bytes), value, "{pointer:#x}");
        }
        device.set(12.0, -1.0, -5.0);
        assert_eq!(read(&mut device, VSHUNT, 3) >> 4, (1 << 20) - 51_840);
        assert_eq!(read(&mut device, DIETEMP, 2), 0x1_0000 - 640);
    }

    #[test]
    fn current_ends_at_163_84_mv_and_at_its_20_bits_and_the_charge_with_it() {
        let mut device = example();
        // 10.11 A by the shunt, 10 A by CURRENT.
        for (amperes, shunt, current) in [(100.0, 0x7_ffff, 0x7_ffff), (-100.0, 0x8_0000, 0x8_0000)] {
            device.set(12.0, amperes, 25.0);
            let values = [VSHUNT, CURRENT].map(|pointer| read(&mut device, pointer, 3) >> 4);
            assert_eq!(values, [shunt, current]);
        }
        // In the narrow range a quarter of it, and four times the current unless SHUNT_CAL is, too.
        write(&mut device, CONFIG, NARROW);
        device.set(12.0, 1.0, 25.0);
        assert_eq!(read(&mut device, VSHUNT, 3) >> 4, 4 * 51_840);
        assert_eq!(read(&mut device, CURRENT, 3) >> 4, 4 * 51_840 * 4096 / 4050);
        device.set(12.0, 100.0, 25.0);
        assert_eq!(read(&mut device, VSHUNT, 3) >> 4, 0x7_ffff);
        write(&mut device, CONFIG, RESET_ACCUMULATORS);
        device.set(12.0, 20.0, 25.0);
        device.set_pulses(0.5);
        let steps = read(&mut device, CHARGE, 5) as f64;
        // 10.11 A are shown for half of the second.
        assert!((steps * EXAMPLE_LSB - 5.057).abs() < 0.05, "{steps}");
    }

    const NARROW: u16 = 1 << 4;

    #[test]
    fn energy_and_charge_are_those_of_the_time_that_has_passed() {
        let mut device = example();
        assert_near(read_at(&mut device, ENERGY, 5, HOUR), 1_061_683_200);
        assert_near(read_at(&mut device, CHARGE, 5, HOUR), 1_132_462_080);
        device.set(48.0, -12.0, 25.0);
        let charge = read_at(&mut device, CHARGE, 5, 2 * HOUR);
        assert_eq!(charge >> 39, 1, "the charge is signed");
        write_at(&mut device, SHUNT_CAL, 0, 2 * HOUR);
        assert_eq!(read_at(&mut device, CHARGE, 5, 3 * HOUR), charge);
        assert_eq!(read_at(&mut device, CURRENT, 3, 3 * HOUR), 0);
    }

    #[test]
    fn a_power_cycle_sets_the_accumulators_to_zero_and_forgets_the_calibration() {
        let mut device = example();
        assert_near(read_at(&mut device, CHARGE, 5, HOUR), 1_132_462_080);
        device.power_cycle();
        assert_eq!(read_at(&mut device, SHUNT_CAL, 2, 2 * HOUR), 0x1000);
        write_at(&mut device, SHUNT_CAL, 4050, 2 * HOUR);
        assert_eq!(read_at(&mut device, CHARGE, 5, 2 * HOUR), 0);
        assert_eq!(read_at(&mut device, ENERGY, 5, 2 * HOUR), 0);
        assert_near(read_at(&mut device, CHARGE, 5, 3 * HOUR), 1_132_462_080);
    }

    #[test]
    fn six_amperes_at_48_volts_read_as_the_equations_of_an_ina238_say() {
        let mut device = Ina228::ina238(0.0162);
        device.set(48.0, 6.0, 25.0);
        for (pointer, value) in [
            (ADC_CONFIG, 0xfb68),
            // 97.2 mV in 5 uV.
            (VSHUNT, 19_440),
            (VBUS, 15_360),
            (DIETEMP, 200 << 4),
            (MANUFACTURER_ID, 0x5449),
            (DEVICE_ID, 0x2381),
        ] {
            assert_eq!(read(&mut device, pointer, 2), value, "{pointer:#x}");
        }
    }

    #[test]
    fn negative_values_of_an_ina238_are_in_two_s_complement_and_out_of_range_is_held() {
        let mut device = Ina228::ina238(0.001);
        device.set(12.0, -10.0, -5.0);
        assert_eq!(read(&mut device, VSHUNT, 2), 0x1_0000 - 2000);
        assert_eq!(read(&mut device, DIETEMP, 2), (0x1000 - 40) << 4);
        // 163.84 mV and 102.4 V at the most.
        for (amperes, shunt) in [(200.0, 0x7fff), (-200.0, 0x8000)] {
            device.set(200.0, amperes, 25.0);
            let values = [VSHUNT, VBUS, CURRENT].map(|pointer| read(&mut device, pointer, 2));
            assert_eq!(values, [shunt, 0x7fff, shunt]);
        }
    }
}
