//! Commands' numbers (MAV_CMD), values of their parameters, and their results (MAV_RESULT).

pub const BATTERY_RESET: u16 = 42651;
pub const PREFLIGHT_STORAGE: u16 = 245;
pub const PREFLIGHT_REBOOT_SHUTDOWN: u16 = 246;
pub const ARM_DISARM: u16 = 400;
pub const RUN_PREARM_CHECKS: u16 = 401;
pub const GET_MESSAGE_INTERVAL: u16 = 510;
pub const SET_MESSAGE_INTERVAL: u16 = 511;
pub const REQUEST_MESSAGE: u16 = 512;

/// ARM_DISARM: without checks.
pub const FORCED: f32 = 21196.0;
/// PREFLIGHT_STORAGE: all parameters back to their defaults.
pub const RESET: f32 = 2.0;

pub const ACCEPTED: u8 = 0;
pub const TEMPORARILY_REJECTED: u8 = 1;
pub const DENIED: u8 = 2;
pub const UNSUPPORTED: u8 = 3;
pub const FAILED: u8 = 4;
