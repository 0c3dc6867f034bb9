//! MAV_BATTERY_CHARGE_STATE.

pub const OK: u8 = 1;
pub const FAILED: u8 = 5;
pub const UNHEALTHY: u8 = 6;
