//! The drivers, one file each.

pub(super) mod ina2xx;
mod ina3221;
pub(super) mod smart_battery;

pub(super) use ina2xx::Ina2xx;
pub(super) use ina3221::Ina3221;
pub(super) use smart_battery::SmartBattery;

/// `Manufacturer ID` of Texas Instruments' parts: "TI".
const TEXAS_INSTRUMENTS: u16 = 0x5449;
