//! Devices to put on a bus: power monitors, a converter and a smart battery.
//!
//! Each is what its datasheet says of the registers a driver uses. They measure at once what a test
//! sets: conversion times, averaging, shut-down modes and alert pins are left out. A test that wants
//! to go on setting values attaches an `Rc<RefCell<_>>`.

mod ad7091r5;
mod bebop;
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

pub use ad7091r5::{Ad7091r5, Reference};
pub use bebop::Bebop;
pub use bq76952::{Access, Bq76952, Protection};
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
pub use smart_battery::{ADDRESS as SMART_BATTERY_ADDRESS, Pec, SmartBattery, crc8};

/// "TI", what these monitors call their manufacturer.
const TEXAS_INSTRUMENTS: u64 = 0x5449;

/// What a monitor is connected to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    pub volts: f64,
    pub amperes: f64,
    pub celsius: f64,
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
