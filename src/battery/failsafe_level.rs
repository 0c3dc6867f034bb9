//! Levels of the battery failsafe.

/// Failsafe levels in increasing severity, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum FailsafeLevel {
    /// No failsafe.
    #[default]
    None = 0,
    /// No healthy reading any more.
    Unhealthy = 1,
    /// Below `BATT_LOW_VOLT` or `BATT_LOW_MAH`.
    Low = 2,
    /// Below `BATT_CRT_VOLT` or `BATT_CRT_MAH`.
    Critical = 3,
}
