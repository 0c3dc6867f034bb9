//! Spans of time in µs.

pub const SECOND: u64 = 1_000_000;
pub const MINUTE_US: u64 = 60 * SECOND;
