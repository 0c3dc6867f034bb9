//! The state of a pack.

use crate::{
    Amount, CellVoltages, ChargeState, Chemistry, Contents, CurrentRange, Extremes, Faults, PackDetails,
    ReadError, Reported, Thermometer,
};

/// Standard deviations from an estimated charge to its bounds.
pub const BOUND_SIGMAS: f32 = 2.0;

/// Failsafe levels in increasing severity, with ArduPilot's numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum FailsafeLevel {
    /// No failsafe.
    #[default]
    None = 0,
    /// No healthy reading any more, or the pack reports that it is FAILED or UNHEALTHY.
    Unhealthy = 1,
    /// Below `BATT_LOW_VOLT` or `BATT_LOW_MAH`.
    Low = 2,
    /// Below `BATT_CRT_VOLT` or `BATT_CRT_MAH`.
    Critical = 3,
}

/// The timer of a threshold in volts or percent, up to its level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FailsafeTimer {
    /// Nothing is below, or it does not count: with the load off, without a timer, or the level is reached by the charge.
    #[default]
    Stopped = 0,
    /// The voltage or the percentage is below.
    Running = 1,
    /// It was below for longer than the timer: until the load is off, or a battery reset.
    Expired = 2,
}

/// The timers of a pack's failsafe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FailsafeTimers {
    /// Of the level low.
    pub low: FailsafeTimer,
    /// Of the level critical.
    pub critical: FailsafeTimer,
}

impl FailsafeTimers {
    /// None runs.
    pub const STOPPED: Self = Self {
        low: FailsafeTimer::Stopped,
        critical: FailsafeTimer::Stopped,
    };

    /// The levels with a timer that is not as `before`, and that timer.
    pub fn changes(self, before: Self) -> impl Iterator<Item = (FailsafeLevel, FailsafeTimer)> {
        let low = (self.low != before.low).then_some((FailsafeLevel::Low, self.low));
        let critical = (self.critical != before.critical).then_some((FailsafeLevel::Critical, self.critical));
        low.into_iter().chain(critical)
    }
}

/// Whether a pack is connected and its sensor works.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PackStatus {
    /// The pack is not monitored (`BATT_MONITOR` is 0).
    Disabled,
    /// No reading yet.
    #[default]
    Unknown,
    /// The sensor works, but no pack is connected: the board is powered by USB.
    NotConnected,
    /// The pack is connected and its sensor works.
    Healthy,
    /// The sensor has failed repeatedly; the values are the last valid ones.
    Unhealthy,
}

/// Source of a state of charge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChargeSource {
    /// Estimated from voltage and current.
    #[default]
    Estimated,
    /// The pack's own fuel gauge.
    Gauge,
    /// Reported by the sensor, without a capacity.
    Reported,
}

/// The voltage to report (`BATT_OPTIONS` bit 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReportedVoltage {
    /// The terminal voltage.
    #[default]
    Terminal,
    /// The voltage without load; the terminal voltage while that is unknown.
    Resting,
}

/// Whether a pack is to be reported (`BATT_OPTIONS` bit 8).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Visibility {
    /// Reported, in a BATTERY_STATUS of its own.
    #[default]
    Reported,
    /// Internal use only.
    Internal,
}

/// Readings of a connected pack, and what is estimated from them. A disconnection makes all of them unknown; a failed read
/// keeps the last valid ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readings {
    /// Terminal voltage, in volts.
    pub voltage_v: Option<f32>,
    /// Voltage without load, in volts.
    pub resting_voltage_v: Option<f32>,
    /// Current drawn from the pack, in amperes; negative while charging.
    pub current_a: Option<f32>,
    /// Power drawn from the pack, in watts, where voltage and current are measured together.
    pub power_w: Option<f32>,
    /// Fuel drawn from a tank, in litres per hour.
    pub fuel_l_h: Option<f32>,
    /// Current averaged over about a minute, in amperes.
    pub average_current_a: Option<f32>,
    /// Remaining charge, in percent of a full pack (0 to 100).
    pub remaining_pct: Option<f32>,
    /// Standard deviation of [`remaining_pct`](Self::remaining_pct), in percent of a full pack, where it is estimated.
    pub remaining_sigma_pct: Option<f32>,
    /// Usable charge: how much the load can still draw, in percent of a full pack's (0 to 100): less than what remains
    /// in a cold or worn pack.
    pub usable_pct: Option<f32>,
    /// Standard deviation of the usable charge, in percent, where it is estimated here.
    pub usable_sigma_pct: Option<f32>,
    /// Time until the pack can't serve the average load any more, in seconds.
    pub time_remaining_s: Option<f32>,
    /// Present faults, as found here.
    pub faults: Faults,
    /// Condition as reported by the pack.
    pub reported: Reported,
}

impl Readings {
    /// Everything unknown.
    pub const NONE: Self = Self {
        voltage_v: None,
        resting_voltage_v: None,
        current_a: None,
        power_w: None,
        fuel_l_h: None,
        average_current_a: None,
        remaining_pct: None,
        remaining_sigma_pct: None,
        usable_pct: None,
        usable_sigma_pct: None,
        time_remaining_s: None,
        faults: Faults::empty(),
        reported: Reported::NONE,
    };

    /// Extremes of the measurement that resulted in these readings, where its means are known.
    pub fn known_extremes(&self, measured: Extremes) -> Extremes {
        Extremes {
            lowest_voltage_v: measured.lowest_voltage_v.filter(|_| self.voltage_v.is_some()),
            highest_current_a: measured.highest_current_a.filter(|_| self.current_a.is_some()),
        }
    }
}

/// The state of one pack. `None` is unknown, never zero; by default everything is unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatteryState {
    /// Whether the pack is connected and its sensor works.
    pub status: PackStatus,
    /// Error of the latest reading, also if that is not enough; `None` without one.
    pub read_error: Option<ReadError>,
    /// Electric charge or fuel.
    pub contents: Contents,
    /// Latest readings, and what is estimated from them.
    pub readings: Readings,
    /// Whether the current is within its sensor's range.
    pub current_range: CurrentRange,
    /// Internal resistance of the whole pack, in ohms, measured from load steps.
    pub resistance_ohm: Option<f32>,
    /// Charge or fuel drawn since boot or the last battery reset.
    pub consumed: Option<Amount>,
    /// Energy drawn since boot or the last battery reset, in watt-hours.
    pub consumed_wh: Option<f32>,
    /// Temperature, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Place of this temperature.
    pub thermometer: Thermometer,
    /// Charge state.
    pub charge_state: ChargeState,
    /// The charge state by what remains, if the reserve for the sag makes it worse: nothing but lamps and texts goes by the
    /// reserve alone.
    pub without_reserve: Option<ChargeState>,
    /// The failsafe level, latched until a battery reset or swap.
    pub failsafe: FailsafeLevel,
    /// The timers of its thresholds.
    pub failsafe_timers: FailsafeTimers,
    /// Cells in series, as set or detected.
    pub cell_count: Option<u8>,
    /// Cell voltages, if measured.
    pub cells: CellVoltages,
    /// Cell chemistry.
    pub chemistry: Chemistry,
    /// Full capacity.
    pub capacity: Option<Amount>,
    /// Capacity that was learnt, in milliampere-hours.
    pub learnt_capacity_mah: Option<f32>,
    /// The most that a count at the source leaves, from 0 to 1; `None` if the source does not count.
    pub left_at_most: Option<f32>,
    /// State of health, in percent, as reported by a smart battery, else as learnt.
    pub state_of_health_pct: Option<u8>,
    /// Critical voltage (`BATT_CRT_VOLT`), in volts, if set.
    pub critical_voltage_v: Option<f32>,
    /// Serial number, as reported by a smart battery, else as set.
    pub serial_number: Option<i32>,
    /// Source of the state of charge.
    pub charge_source: ChargeSource,
    /// Identity and ratings, of a smart battery.
    pub details: PackDetails,
    /// The voltage to report.
    pub reported_voltage: ReportedVoltage,
    /// Whether the pack is to be reported.
    pub visibility: Visibility,
    /// The members of a sum, a bit each, as its measurements have them; 0 for a pack with a sensor.
    pub members: u16,
    /// Changes when the pack was swapped or its cells were detected.
    pub revision: u8,
}

impl BatteryState {
    /// Everything unknown.
    pub const UNKNOWN: Self = Self {
        status: PackStatus::Unknown,
        read_error: None,
        contents: Contents::Charge,
        readings: Readings::NONE,
        current_range: CurrentRange::Within,
        resistance_ohm: None,
        consumed: None,
        consumed_wh: None,
        temperature_c: None,
        thermometer: Thermometer::Pack,
        charge_state: ChargeState::Undefined,
        without_reserve: None,
        failsafe: FailsafeLevel::None,
        failsafe_timers: FailsafeTimers::STOPPED,
        cell_count: None,
        cells: CellVoltages::NONE,
        chemistry: Chemistry::LiPo,
        capacity: None,
        learnt_capacity_mah: None,
        left_at_most: None,
        state_of_health_pct: None,
        critical_voltage_v: None,
        serial_number: None,
        charge_source: ChargeSource::Estimated,
        details: PackDetails::NONE,
        reported_voltage: ReportedVoltage::Terminal,
        visibility: Visibility::Reported,
        members: 0,
        revision: 0,
    };

    /// A pack that is not monitored.
    pub fn disabled() -> Self {
        Self {
            status: PackStatus::Disabled,
            ..Self::UNKNOWN
        }
    }

    /// The faults to show: those found here and those that the pack reports.
    pub fn faults_to_show(&self) -> Faults {
        self.readings.faults | self.readings.reported.faults
    }

    /// Whether the pack may have more cells than its voltage is usual for: what was kept of it has more.
    pub fn has_unclear_cells(&self) -> bool {
        self.cell_count.is_none() && self.readings.faults.contains(Faults::CELLS_CONFIGURATION)
    }

    /// The charge state on which something acts.
    pub fn firm_charge_state(&self) -> ChargeState {
        self.without_reserve.unwrap_or(self.charge_state)
    }

    /// Whether the charge is estimated here.
    pub fn has_estimated_charge(&self) -> bool {
        self.charge_source == ChargeSource::Estimated && self.contents == Contents::Charge
    }

    /// Power drawn from the pack, in watts; `None` also for a tank.
    pub fn power_w(&self) -> Option<f32> {
        let Readings {
            voltage_v,
            current_a,
            power_w,
            ..
        } = self.readings;
        power_w.or(Some(voltage_v? * current_a?))
    }

    /// Amperes drawn from a pack, or litres per hour from a tank. As in ArduPilot, either is reported as a current.
    pub fn rate(&self) -> Option<f32> {
        self.readings.current_a.or(self.readings.fuel_l_h)
    }

    /// Charge drawn since boot or the last battery reset, in milliampere-hours; `None` also for a tank.
    pub fn consumed_mah(&self) -> Option<f32> {
        self.consumed?.mah()
    }

    /// Fuel used since boot or the last battery reset, in millilitres; `None` also for a pack with a charge.
    pub fn consumed_ml(&self) -> Option<f32> {
        self.consumed?.ml()
    }

    /// Full capacity, in milliampere-hours; `None` also for a tank.
    pub fn capacity_mah(&self) -> Option<f32> {
        self.capacity?.mah()
    }

    /// Capacity of the full pack or tank as it is now, in milliampere-hours or millilitres: by its own gauge, else as learnt,
    /// else as set.
    pub fn full_capacity(&self) -> Option<f32> {
        let learnt = match self.charge_source {
            ChargeSource::Gauge => None,
            ChargeSource::Estimated | ChargeSource::Reported => self.learnt_capacity_mah,
        };
        learnt.or(self.capacity.map(Amount::number))
    }

    /// Whether the capacity is known neither to the owner nor to the pack, and is not awaited: before the first reading it
    /// may be reported, and a gauge reports it late.
    pub fn lacks_capacity(&self) -> bool {
        let is_awaited = self.status == PackStatus::Unknown
            || self.charge_source == ChargeSource::Gauge && self.readings.remaining_pct.is_none();
        self.full_capacity().is_none() && !is_awaited
    }

    /// Remaining charge or fuel by the state of charge, in milliampere-hours or millilitres.
    pub fn remaining(&self) -> Option<f32> {
        Some(self.full_capacity()? * self.readings.remaining_pct? / 100.0)
    }

    /// Remaining charge or fuel; while that is unknown, the most that the source's count leaves, or capacity minus consumption.
    pub fn remaining_or_counted(&self) -> Option<f32> {
        // A sum with a lost member has counted only a part, and a pack that is not connected may be another one.
        let is_unsure = matches!(self.status, PackStatus::Unhealthy | PackStatus::NotConnected);
        let counted = self.consumed.filter(|_| !is_unsure);
        let by_count = || {
            let (full, counted) = (self.full_capacity()?, counted?.number());
            Some(self.left_at_most.map_or(full - counted, |most| full * most))
        };
        self.remaining().or_else(by_count)
    }

    /// By how much the remaining charge may differ from its estimate, in percent of a full pack; 0 where it is not estimated.
    pub fn remaining_uncertainty_pct(&self) -> f32 {
        BOUND_SIGMAS * self.readings.remaining_sigma_pct.unwrap_or(0.0)
    }

    /// The most that may remain, in percent of a full pack.
    pub fn remaining_at_most_pct(&self) -> Option<f32> {
        Some((self.readings.remaining_pct? + self.remaining_uncertainty_pct()).min(100.0))
    }

    /// Volume of the full tank, in millilitres; `None` also for a pack with a charge.
    pub fn capacity_ml(&self) -> Option<f32> {
        self.capacity?.ml()
    }

    /// Temperature of the pack itself, in degrees Celsius, if that is measured.
    pub fn pack_temperature_c(&self) -> Option<f32> {
        self.temperature_c
            .filter(|_| self.thermometer == Thermometer::Pack)
    }

    /// The resting voltage, in volts; the terminal voltage while that is unknown.
    pub fn resting_or_terminal_voltage_v(&self) -> Option<f32> {
        self.readings.resting_voltage_v.or(self.readings.voltage_v)
    }

    /// The voltage of the weakest cell times the number of cells, in volts; `None` unless the pack is measured, and every cell.
    pub fn voltage_by_weakest_cell_v(&self) -> Option<f32> {
        self.readings.voltage_v?;
        let cells = self
            .cell_count
            .filter(|_| self.cells.number() == self.cell_count)?;
        Some(self.cells.lowest_v()? * f32::from(cells))
    }

    /// The voltage to report, in volts.
    pub fn voltage_to_report_v(&self) -> Option<f32> {
        match self.reported_voltage {
            ReportedVoltage::Resting => self.resting_or_terminal_voltage_v(),
            ReportedVoltage::Terminal => self.readings.voltage_v,
        }
    }
}

impl Default for BatteryState {
    fn default() -> Self {
        Self::UNKNOWN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_pack_that_is_not_monitored_only_that_is_known() {
        let disabled = BatteryState::disabled();
        assert_eq!(disabled.status, PackStatus::Disabled);
        let status = BatteryState::UNKNOWN.status;
        assert_eq!(BatteryState { status, ..disabled }, BatteryState::UNKNOWN);
    }
}
