//! Devices to put on a bus: power monitors, a converter and a smart battery.
//!
//! Each is what its datasheet says of the registers a driver uses. Power monitors measure what a test sets as they are
//! configured: in their modes, with their averaging, and within their ranges; alert pins are left out. A test that wants to go on
//! setting values attaches an `Rc<RefCell<_>>`. Those with a [`RegisterMap`] can measure the pack of the board's circuit instead;
//! the AD7091R-5 samples it.

use super::super::clock::{Cycle, cycles};
use converter::{Converter, Setup};

mod ad7091r5;
mod bebop;
mod bq76952;
mod converter;
mod garbled;
mod ina219;
mod ina226;
mod ina228;
mod ina3221;
mod ltc2946;
mod register_map;
mod smart_battery;

pub use ad7091r5::Ad7091r5;
pub use bebop::Bebop;
pub use bq76952::Bq76952;
pub use garbled::{Garbled, Reads};
pub use ina219::Ina219;
pub use ina226::Ina226;
pub use ina228::Ina228;
pub use ina3221::Ina3221;
pub use ltc2946::Ltc2946;
#[cfg(test)]
pub use register_map::driver;
pub use register_map::{RegisterMap, Registers};
pub use smart_battery::{ADDRESS as SMART_BATTERY_ADDRESS, Pec, SmartBattery};

/// "TI", what these monitors call their manufacturer.
const TEXAS_INSTRUMENTS: u64 = 0x5449;

/// What a monitor is connected to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    pub volts: f64,
    pub amperes: f64,
    pub celsius: f64,
}

impl Load {
    /// Without a thermometer.
    pub fn of(volts: f64, amperes: f64) -> Self {
        Self {
            volts,
            amperes,
            ..Self::default()
        }
    }
}

/// The time of a number of samples of this length, as a monitor's configuration has them.
fn samples(count: u16, sample_us: u64) -> Cycle {
    const SAMPLES: [u64; 8] = [1, 4, 16, 64, 128, 256, 512, 1024];
    cycles(SAMPLES[usize::from(count & 7)] * sample_us)
}

/// The set-up by the configuration of an INA226, INA231, INA260 (SBOS547B 7.1.1, SBOS656C table 5 to 8) or INA3221 (SBOS576C
/// 7.6.2.1), which have the same bits: MODE 0 and 4 are shut down.
fn setup_of_ina226(configuration: u16, most_volts: f64, amperes: [f64; 2]) -> Setup {
    const TIMES_US: [u64; 8] = [140, 204, 332, 588, 1100, 2116, 4156, 8244];
    let has = |bit: u32| configuration >> bit & 1 != 0;
    let (measures_current, measures_voltage) = (has(0), has(1));
    let time_us = |at: u32, is_on: bool| match is_on {
        true => TIMES_US[usize::from(configuration >> at & 7)],
        false => 0,
    };
    Setup {
        result: samples(
            configuration >> 9,
            time_us(6, measures_voltage) + time_us(3, measures_current),
        ),
        measures_voltage,
        measures_current,
        is_continuous: has(2),
        most_volts,
        amperes,
    }
}

/// The set-up by ADC_CONFIG of an INA228 (SLYS021A table 7-6), INA238 or INA239, which have the same bits.
fn setup_of_ina228(adc_config: u16, most_volts: f64, amperes: [f64; 2]) -> Setup {
    const TIMES_US: [u64; 8] = [50, 84, 150, 280, 540, 1052, 2074, 4120];
    let has = |bit: u32| adc_config >> bit & 1 != 0;
    let (measures_voltage, measures_current, measures_temperature) = (has(12), has(13), has(14));
    let times = [
        (9, measures_voltage),
        (6, measures_current),
        (3, measures_temperature),
    ];
    let times_us = times.map(|(at, is_on)| match is_on {
        true => TIMES_US[usize::from(adc_config >> at & 7)],
        false => 0,
    });
    Setup {
        result: samples(adc_config, times_us.iter().sum()),
        measures_voltage,
        measures_current,
        is_continuous: has(15),
        most_volts,
        amperes,
    }
}

/// CONFIG of the INA228 and INA238: RST, RSTACC, which clear themselves, and ADCRANGE, the narrow range of the shunt's voltage in a
/// quarter of the steps (SLYS021A table 7-5).
const CONFIG: u8 = 0x00;
const CONFIG_RESET: u16 = 1 << 15;
const RESET_ACCUMULATORS: u16 = 1 << 14;
const NARROW_RANGE: u16 = 1 << 4;

/// SHUNT_CAL of both after a reset, and CURRENT in steps of the shunt's voltage times SHUNT_CAL: their scale is that of the wide
/// range (SLYS021A equations 2 and 3, SLYS025 2 and 3).
const SHUNT_CAL_RESET: u16 = 0x1000;
const CURRENT_BY_SHUNT: i64 = 4096;

/// CURRENT, "zero if SHUNT_CAL is zero", held at its ends: what an overflow gives is not documented.
fn current_code(shunt_code: i64, shunt_cal: u16, bits: u32) -> i64 {
    let limit = 1i64 << (bits - 1);
    let code = (shunt_code * CURRENT_BY_SHUNT).checked_div(shunt_cal.into());
    code.unwrap_or(0).clamp(-limit, limit - 1)
}

/// The ends of what the shunt's voltage shows as a current, in amperes.
fn shunt_range(step_v: f64, bits: u32, shunt_ohm: f64) -> [f64; 2] {
    let most = step_v * (1u64 << (bits - 1)) as f64 / shunt_ohm;
    [-most, most]
}

/// A step of the shunt's voltage with this CONFIG, where it is `wide` in the wide range.
fn shunt_step(config: u16, wide: f64) -> f64 {
    match config & NARROW_RANGE {
        0 => wide,
        _ => wide / 4.0,
    }
}

/// A value as a two's complement code of `bits` bits, held at the ends of its range.
fn signed_code(value: f64, lsb: f64, bits: u32) -> i64 {
    let limit = (1i64 << (bits - 1)) as f64;
    (value / lsb).round().clamp(-limit, limit - 1.0) as i64
}

/// A value that is never negative as a code of `bits` bits, held at the ends of its range.
fn unsigned_code(value: f64, lsb: f64, bits: u32) -> i64 {
    let limit = (1i64 << bits) as f64;
    (value / lsb).round().clamp(0.0, limit - 1.0) as i64
}

/// The low `bits` bits of a code, as they are sent.
fn field_of(code: i64, bits: u32) -> u64 {
    code as u64 & ((1 << bits) - 1)
}

#[cfg(test)]
mod tests {
    use super::register_map::driver::{now, read, read_at, write};
    use super::*;

    /// The devices have their configuration at `configuration`, and the voltage at `voltage`.
    fn assert_forgets<R: Registers>(
        mut device: RegisterMap<R>,
        [configuration, voltage]: [u8; 2],
        ways: &[fn(&mut RegisterMap<R>)],
    ) {
        let at_reset = read(&mut device, configuration, 2);
        let volts = read(&mut device, voltage, 2);
        assert_ne!(volts, 0);
        for way in ways {
            write(&mut device, configuration, at_reset as u16 ^ 1 << 9);
            assert_ne!(read(&mut device, configuration, 2), at_reset);
            way(&mut device);
            let now = now();
            assert_eq!(read_at(&mut device, voltage, 2, now), 0, "not converted yet");
            assert_eq!(read_at(&mut device, configuration, 2, now), at_reset);
            assert_eq!(read(&mut device, voltage, 2), volts);
        }
    }

    fn set<R: Registers>(mut device: RegisterMap<R>) -> RegisterMap<R> {
        device.set_load(12.0, 1.0);
        device
    }

    fn bit_15<R: Registers>(device: &mut RegisterMap<R>) {
        write(device, 0x00, 1 << 15);
    }

    #[test]
    fn a_power_cycle_and_bit_15_forget_what_was_written_and_converted_not_what_is_measured() {
        let of_ina226 = [Ina226::new(0.002), Ina226::ina231(0.002), Ina226::ina260()];
        for device in of_ina226 {
            assert_forgets(set(device), [0, 2], &[RegisterMap::power_cycle, bit_15]);
        }
        assert_forgets(
            set(Ina219::new(0.002)),
            [0, 2],
            &[RegisterMap::power_cycle, bit_15],
        );
        assert_forgets(
            set(Ina3221::new(0.002)),
            [0, 2],
            &[RegisterMap::power_cycle, bit_15],
        );
        for device in [Ina228::new(0.002), Ina228::ina238(0.002)] {
            assert_forgets(set(device), [1, 5], &[RegisterMap::power_cycle, bit_15]);
        }
    }

    #[test]
    fn modes_select_what_is_converted_how_often_and_how_long_that_takes() {
        let ina226 = |configuration| setup_of_ina226(configuration, 40.96, [-1.0, 1.0]);
        let ina228 = |adc_config| setup_of_ina228(adc_config, 102.4, [-1.0, 1.0]);
        for (setup, result_us, measures, is_continuous) in [
            // After a reset: 1.1 ms of each; SBOS547B table 7-6.
            (ina226(0x4127), 2_200, [true, true], true),
            // 16 times 588 us of each; of the current alone; of the voltage, once; none.
            (ina226(0x44df), 18_816, [true, true], true),
            (ina226(0x44dd), 9_408, [false, true], true),
            (ina226(0x44da), 9_408, [true, false], false),
            (ina226(0x44dc), 0, [false, false], true),
            (ina226(0x44d8), 0, [false, false], false),
            // After a reset: 1052 us of voltage, current and temperature; SLYS021A table 7-6.
            (ina228(0xfb68), 3_156, [true, true], true),
            // 16 times 540 us of voltage and current; once; of the temperature alone; none.
            (ina228(0xb92a), 17_280, [true, true], true),
            (ina228(0x392a), 17_280, [true, true], false),
            (ina228(0xc92a), 16 * 1_052, [false, false], true),
            (ina228(0x892a), 0, [false, false], true),
        ] {
            assert_eq!(setup.result, cycles(result_us), "{setup:?}");
            assert_eq!([setup.measures_voltage, setup.measures_current], measures);
            assert_eq!(setup.is_continuous, is_continuous);
        }
    }
}
