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

/// `Manufacturer ID` of Texas Instruments' parts: "TI".
const TEXAS_INSTRUMENTS: u16 = 0x5449;
