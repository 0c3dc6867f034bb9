//! What is known of a pack.

/// Whether a pack is there and its sensor can be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum PackStatus {
    /// The pack is not monitored (`BATT_MONITOR` is 0).
    Disabled,
    /// Nothing has been measured yet.
    #[default]
    Unknown,
    /// The sensor works and sees no pack: the board runs from USB.
    NotConnected,
    /// The pack is connected and its sensor works.
    Healthy,
    /// The sensor has failed repeatedly; the values are the last good ones.
    Unhealthy,
}

/// What is known of one pack. `None` means unknown; it never stands for zero.
///
/// The default is the state at boot: everything unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BatteryState {
    /// Whether the pack is there and its sensor can be trusted.
    pub status: PackStatus,
    /// Voltage between the pack's terminals, in volts.
    pub voltage_v: Option<f32>,
    /// Current drawn from the pack, in amperes; negative while charging.
    pub current_a: Option<f32>,
    /// Charge drawn since boot or the last battery reset, in milliampere-hours.
    pub consumed_mah: Option<f32>,
    /// Energy drawn since boot or the last battery reset, in watt-hours.
    pub consumed_wh: Option<f32>,
    /// Remaining charge, in percent of a full pack (0 to 100).
    pub remaining_pct: Option<f32>,
    /// Time until the pack is empty at the present load, in seconds.
    pub time_remaining_s: Option<f32>,
    /// Temperature of the pack, in degrees Celsius.
    pub temperature_c: Option<f32>,
}

impl BatteryState {
    /// A pack that is not monitored.
    pub const DISABLED: Self = Self {
        status: PackStatus::Disabled,
        voltage_v: None,
        current_a: None,
        consumed_mah: None,
        consumed_wh: None,
        remaining_pct: None,
        time_remaining_s: None,
        temperature_c: None,
    };
}
