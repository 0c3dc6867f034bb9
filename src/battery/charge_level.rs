//! Charge states.

/// Charge state, with the numbers of MAVLink's `MAV_BATTERY_CHARGE_STATE`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum ChargeState {
    /// Unknown.
    #[default]
    Undefined = 0,
    /// Sufficient.
    Ok = 1,
    /// Warn the driver.
    Low = 2,
    /// Stop soon.
    Critical = 3,
    /// Stop now to avoid damage to the pack.
    Emergency = 4,
    /// The pack has failed; see its faults.
    Failed = 5,
    /// The sensor or the pack has a fault; see its faults.
    Unhealthy = 6,
    /// The pack is being charged.
    Charging = 7,
}

impl ChargeState {
    /// The state with this number; `None` if that is unknown, or none.
    pub fn from_number(number: u8) -> Option<Self> {
        Some(match number {
            1 => Self::Ok,
            2 => Self::Low,
            3 => Self::Critical,
            4 => Self::Emergency,
            5 => Self::Failed,
            6 => Self::Unhealthy,
            7 => Self::Charging,
            _ => return None,
        })
    }
}
