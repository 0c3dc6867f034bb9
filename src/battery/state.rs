//! What is known of a pack.

use super::{CellVoltages, Chemistry, Contents, FailsafeLevel, Faults, PackDetails};

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

/// How much is left in the pack, for people and ground stations: MAVLink's `MAV_BATTERY_CHARGE_STATE`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum ChargeState {
    /// It can't be known.
    #[default]
    Undefined = 0,
    /// Enough.
    Ok = 1,
    /// Warn the driver.
    Low = 2,
    /// Stop soon.
    Critical = 3,
    /// Stop now: the pack is being harmed.
    Emergency = 4,
    /// The pack has failed; see its faults.
    Failed = 5,
    /// The sensor has failed, or a fault makes the pack unfit; see its faults.
    Unhealthy = 6,
    /// The pack is being charged.
    Charging = 7,
}

/// Where it is known from how full a pack is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChargeSource {
    /// Estimated here, from voltage and current.
    #[default]
    Estimated,
    /// The pack has a gauge of its own.
    Gauge,
}

/// Which of a pack's voltages a ground station is sent (`BATT_OPTIONS` bit 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReportedVoltage {
    /// The voltage between the pack's terminals.
    #[default]
    Terminal,
    /// The voltage it would have without a load, as far as that is known.
    Resting,
}

/// Whether ground stations are told of a pack (`BATT_OPTIONS` bit 8).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Visibility {
    /// It has a BATTERY_STATUS of its own.
    #[default]
    Reported,
    /// It is used on board only.
    Internal,
}

/// What is known of one pack. `None` means unknown; it never stands for zero.
///
/// The default is the state at boot: everything unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatteryState {
    /// Whether the pack is there and its sensor can be trusted.
    pub status: PackStatus,
    /// What the pack holds. Charge and current of one that holds fuel are in millilitres and litres per hour.
    pub contents: Contents,
    /// Voltage between the pack's terminals, in volts.
    pub voltage_v: Option<f32>,
    /// Voltage the pack would have without a load, in volts.
    pub resting_voltage_v: Option<f32>,
    /// Current drawn from the pack, in amperes; negative while charging.
    pub current_a: Option<f32>,
    /// Current drawn from the pack, averaged over the last minute or so, in amperes.
    pub average_current_a: Option<f32>,
    /// Internal resistance of the whole pack, in ohms, once load steps have shown it.
    pub resistance_ohm: Option<f32>,
    /// Charge drawn since boot or the last battery reset, in milliampere-hours.
    pub consumed_mah: Option<f32>,
    /// Energy drawn since boot or the last battery reset, in watt-hours.
    pub consumed_wh: Option<f32>,
    /// Remaining charge, in percent of a full pack (0 to 100).
    pub remaining_pct: Option<f32>,
    /// Time until the pack is empty at the average load, in seconds.
    pub time_remaining_s: Option<f32>,
    /// Temperature of the pack, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// How much is left, in steps.
    pub charge_state: ChargeState,
    /// What is wrong with the pack.
    pub faults: Faults,
    /// The failsafe level reached since the last battery reset.
    pub failsafe: FailsafeLevel,
    /// Cells in series, as set or detected.
    pub cell_count: Option<u8>,
    /// Voltage of each cell, where the sensor measures them.
    pub cells: CellVoltages,
    /// What the cells are made of.
    pub chemistry: Chemistry,
    /// Charge of the full pack, in milliampere-hours.
    pub capacity_mah: Option<f32>,
    /// The pack's voltage that counts as critical, in volts, if the owner has set one (`BATT_CRT_VOLT`).
    pub critical_voltage_v: Option<f32>,
    /// Serial number, as set or as the pack tells.
    pub serial_number: Option<i32>,
    /// Where it is known from how full the pack is.
    pub charge_source: ChargeSource,
    /// What the pack tells of itself, if it is a smart one.
    pub details: PackDetails,
    /// Which voltage ground stations are sent.
    pub reported_voltage: ReportedVoltage,
    /// Whether ground stations are told of the pack.
    pub visibility: Visibility,
    /// The packs it is the sum of, one bit for each instance, bit 0 for the first; 0 for a pack with a sensor.
    pub members: u16,
}

impl BatteryState {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self {
        status: PackStatus::Unknown,
        contents: Contents::Charge,
        voltage_v: None,
        resting_voltage_v: None,
        current_a: None,
        average_current_a: None,
        resistance_ohm: None,
        consumed_mah: None,
        consumed_wh: None,
        remaining_pct: None,
        time_remaining_s: None,
        temperature_c: None,
        charge_state: ChargeState::Undefined,
        faults: Faults::empty(),
        failsafe: FailsafeLevel::None,
        cell_count: None,
        cells: CellVoltages::NONE,
        chemistry: Chemistry::LiPo,
        capacity_mah: None,
        critical_voltage_v: None,
        serial_number: None,
        charge_source: ChargeSource::Estimated,
        details: PackDetails::NONE,
        reported_voltage: ReportedVoltage::Terminal,
        visibility: Visibility::Reported,
        members: 0,
    };

    /// A pack that is not monitored.
    pub fn disabled() -> Self {
        Self {
            status: PackStatus::Disabled,
            ..Self::UNKNOWN
        }
    }

    /// The voltage without a load, in volts; while that is not known, the one between the terminals.
    pub fn resting_or_terminal_voltage_v(&self) -> Option<f32> {
        self.resting_voltage_v.or(self.voltage_v)
    }

    /// The voltage ground stations are sent, in volts.
    pub fn voltage_to_report_v(&self) -> Option<f32> {
        match self.reported_voltage {
            ReportedVoltage::Resting => self.resting_or_terminal_voltage_v(),
            ReportedVoltage::Terminal => self.voltage_v,
        }
    }
}

impl Default for BatteryState {
    fn default() -> Self {
        Self::UNKNOWN
    }
}
