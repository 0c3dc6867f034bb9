//! For how long packs may be without a reading, where that does not depend on the device.

/// What is read in each sampling tick, or reports as often, in microseconds: a tick.
pub(super) const TICK_TIMEOUT_US: u64 = 100_000;

/// Another component of the vehicle, in microseconds. Over a longer interval the current would not be integrated without a
/// gap.
pub(super) const EXTERNAL_TIMEOUT_US: u64 = 2_000_000;

/// A node on the CAN bus, in microseconds, as in ArduPilot (`AP_BATTMONITOR_UAVCAN_TIMEOUT_MICROS`).
pub(super) const CAN_TIMEOUT_US: u64 = 5_000_000;
