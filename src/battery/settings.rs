//! What the owner has set for a pack.

use super::{Chemistry, ReportedVoltage, Visibility};

/// What the owner has set for a pack. `None` is what is not set or turned off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PackSettings {
    /// What the cells are made of (`BATT_CHEM`).
    pub chemistry: Chemistry,
    /// Cells in series (`BATT_CELLS`); `None` has them detected.
    pub cell_count: Option<u8>,
    /// Charge of the full pack (`BATT_CAPACITY`), in milliampere-hours.
    pub capacity_mah: Option<f32>,
    /// The largest load the pack is made for (`BATT_WATT_MAX`), in watts.
    pub power_limit_w: Option<f32>,
    /// Serial number (`BATT_SERIAL_NUM`).
    pub serial_number: Option<i32>,
    /// Which voltage ground stations are sent (`BATT_OPTIONS` bit 6).
    pub reported_voltage: ReportedVoltage,
    /// Whether ground stations are told of the pack (`BATT_OPTIONS` bit 8).
    pub visibility: Visibility,
    /// When the pack counts as low.
    pub failsafe: FailsafeSettings,
}

/// When a pack counts as low or critical. `None` is off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FailsafeSettings {
    /// How long the voltage has to stay below (`BATT_LOW_TIMER`), in seconds; `None` turns the voltage thresholds off.
    pub timer_s: Option<f32>,
    /// Which voltage is compared (`BATT_FS_VOLTSRC`).
    pub voltage_source: VoltageSource,
    /// In volts (`BATT_LOW_VOLT`, `BATT_LOW_MAH`).
    pub low: Thresholds,
    /// In milliampere-hours (`BATT_CRT_VOLT`, `BATT_CRT_MAH`).
    pub critical: Thresholds,
}

/// Below what a pack counts as low or critical. `None` is off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thresholds {
    /// In volts.
    pub voltage_v: Option<f32>,
    /// Charge that is left, in milliampere-hours.
    pub remaining_mah: Option<f32>,
}

/// Which voltage the thresholds are compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VoltageSource {
    /// The voltage between the terminals.
    #[default]
    Terminal,
    /// The resting voltage as far as it is known, else the one between the terminals.
    Resting,
}
