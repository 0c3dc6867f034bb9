//! The drivers, one file each.

mod ad7091r5;
mod bebop;
mod bq76952;
pub(super) mod ina2xx;
mod ina3221;
mod ltc2946;
pub(super) mod smart_battery;

pub(super) use ad7091r5::Ad7091r5;
pub(super) use bebop::Bebop;
pub(super) use bq76952::Bq76952;
pub(super) use ina2xx::Ina2xx;
pub(super) use ina3221::Ina3221;
pub(super) use ltc2946::Ltc2946;
pub(super) use smart_battery::SmartBattery;

use crate::battery::{CurrentRange, ReadError};

/// `Manufacturer ID` of Texas Instruments' parts: "TI".
const TEXAS_INSTRUMENTS: u16 = 0x5449;

/// Cells are those of a pack if they add up to its voltage within this share: they are read a moment later.
const CELL_SUM_TOLERANCE: f32 = 0.05;

/// For how many readings cells are counted, 15 s: a part that has just got its supply has not measured all of them yet.
const COUNTING_READINGS: u8 = 150;

/// Deviation of the sum of cells from the voltage of their pack, as a share of that.
fn deviation(pack_v: f32, sum_v: f32) -> f32 {
    (sum_v / pack_v - 1.0).abs()
}

/// A voltage that a part measures, in volts, if its code is no end of its range, nor negative.
///
/// # Errors
/// [`ReadError::Implausible`], [`ReadError::OverRange`].
fn positive_voltage(voltage_v: f32, range: CurrentRange) -> Result<f32, ReadError> {
    match range {
        _ if voltage_v < 0.0 => Err(ReadError::Implausible),
        CurrentRange::Within => Ok(voltage_v),
        _ => Err(ReadError::OverRange),
    }
}
