//! Values of `BATT_MONITOR`.

pub const SMART_BATTERY: f32 = 7.0;
pub const DRONECAN: f32 = 8.0;
pub const ESC: f32 = 9.0;
pub const FUEL_FLOW: f32 = 11.0;
pub const INA2XX: f32 = 21.0;
