//! Devices to put on a bus: power monitors, a converter and a smart battery.
//!
//! Each is what its datasheet says of the registers a driver uses. They measure at once what a test
//! sets: conversion times, averaging, shut-down modes and alert pins are left out. A test that wants
//! to go on setting values attaches an `Rc<RefCell<_>>`. Those with a [`RegisterMap`] can measure the
//! pack of the board's circuit instead, with their averaging; the converter samples it.

use super::super::clock::{Cycle, cycles};

mod ad7091r5;
mod bq76952;
mod garbled;
mod ina226;
mod ina228;
mod ina231;
mod ina238;
mod ina260;
mod ina3221;
mod ltc2946;
mod register_map;
mod smart_battery;

pub use ad7091r5::Ad7091r5;
pub use bq76952::Bq76952;
pub use garbled::{Garbled, Reads};
pub use ina226::Ina226;
pub use ina228::Ina228;
pub use ina231::Ina231;
pub use ina238::Ina238;
pub use ina260::Ina260;
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

/// The time in which a monitor of Texas Instruments measures voltage and current: `samples` and the times of both, as they are
/// encoded in its configuration.
fn conversion_of(samples: u16, times: [u16; 2], times_us: [u64; 8]) -> Cycle {
    const SAMPLES: [u64; 8] = [1, 4, 16, 64, 128, 256, 512, 1024];
    let of_both = times.map(|code| times_us[usize::from(code & 7)]);
    cycles(SAMPLES[usize::from(samples & 7)] * of_both.iter().sum::<u64>())
}

/// Of the INA226, INA231, INA260 and INA3221, whose configurations have them at the same place.
fn conversion_of_ina226(configuration: u16) -> Cycle {
    const TIMES_US: [u64; 8] = [140, 204, 332, 588, 1100, 2116, 4156, 8244];
    let times = [configuration >> 6, configuration >> 3];
    conversion_of(configuration >> 9, times, TIMES_US)
}

/// Of the INA228 and INA238.
fn conversion_of_ina228(adc_config: u16) -> Cycle {
    const TIMES_US: [u64; 8] = [50, 84, 150, 280, 540, 1052, 2074, 4120];
    conversion_of(adc_config, [adc_config >> 9, adc_config >> 6], TIMES_US)
}

/// CONFIG of the INA228 and INA238: a reset, and the narrow range of the shunt's voltage, in a quarter of the steps.
const CONFIG: u8 = 0x00;
const CONFIG_RESET: u16 = 1 << 15;
const NARROW_RANGE: u16 = 1 << 4;

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

/// The same for a value that is never negative.
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
    use super::register_map::driver::{read, write};
    use super::*;

    /// The devices have their configuration at `configuration`, and the voltage at `voltage`.
    fn assert_forgets<R: Registers>(
        mut device: RegisterMap<R>,
        [configuration, voltage]: [u8; 2],
        ways: &[fn(&mut RegisterMap<R>)],
    ) {
        let registers =
            |device: &mut RegisterMap<R>| [configuration, voltage].map(|pointer| read(device, pointer, 2));
        let before = registers(&mut device);
        assert_ne!(before[1], 0);
        for way in ways {
            write(&mut device, configuration, 0x1234);
            assert_ne!(read(&mut device, configuration, 2), before[0]);
            way(&mut device);
            assert_eq!(registers(&mut device), before);
        }
    }

    #[test]
    fn a_power_cycle_and_bit_15_forget_what_was_written_not_what_is_measured() {
        fn bit_15<R: Registers>(device: &mut RegisterMap<R>) {
            write(device, 0x00, 1 << 15);
        }
        let mut ina226 = Ina226::new(0.002);
        ina226.set(12.0, 1.0);
        assert_forgets(ina226, [0x00, 0x02], &[RegisterMap::power_cycle, bit_15]);
        let mut ina231 = Ina231::new(0.002);
        ina231.set(12.0, 1.0);
        assert_forgets(ina231, [0x00, 0x02], &[RegisterMap::power_cycle, bit_15]);
        let mut ina260 = Ina260::new();
        ina260.set(12.0, 1.0);
        assert_forgets(ina260, [0x00, 0x02], &[RegisterMap::power_cycle, bit_15]);
        let mut ina3221 = Ina3221::new(0.002);
        ina3221.set(1, 12.0, 1.0);
        assert_forgets(ina3221, [0x00, 0x02], &[RegisterMap::power_cycle, bit_15]);
        let mut ina228 = Ina228::new(0.002);
        ina228.set(12.0, 1.0, 25.0);
        assert_forgets(ina228, [0x01, 0x05], &[RegisterMap::power_cycle]);
        let mut ina238 = Ina238::new(0.002);
        ina238.set(12.0, 1.0, 25.0);
        assert_forgets(ina238, [0x01, 0x05], &[RegisterMap::power_cycle]);
    }
}
