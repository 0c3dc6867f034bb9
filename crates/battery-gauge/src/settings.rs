//! Settings of a pack, and thresholds for one whose owner has set none.

use crate::learnt::OFFSET_POINTS;
use crate::{BatteryState, Chemistry, ReportedVoltage, Visibility};

/// Settings of a pack, with the parameters that ArduPilot has for them. `None` is not set or disabled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PackSettings {
    /// Cell chemistry (`BATT_CHEM`).
    pub chemistry: Chemistry,
    /// Cells in series (`BATT_CELLS`); `None` detects them.
    pub cell_count: Option<u8>,
    /// Measured resting voltages of a cell at 10, 30, 50, 70 and 90 % of its charge (`BATT_CURVE_10` to `BATT_CURVE_90`), in volts.
    /// They are used together, while those that are known rise and are possible for the chemistry.
    pub curve_v: [Option<f32>; OFFSET_POINTS],
    /// Full capacity (`BATT_CAPACITY`), in milliampere-hours; millilitres of fuel.
    pub capacity_mah: Option<f32>,
    /// The setting that scales the measured current, if there is one: to be checked where a capacity can't be.
    pub current_scale: Option<CurrentScale>,
    /// Load that is a fault, in watts: a tenth above `BATT_WATT_MAX`, so that limiting the load to it is none.
    pub overload_w: Option<f32>,
    /// Serial number (`BATT_SERIAL_NUM`).
    pub serial_number: Option<i32>,
    /// The voltage to report (`BATT_OPTIONS` bit 6).
    pub reported_voltage: ReportedVoltage,
    /// Whether the pack is to be reported (`BATT_OPTIONS` bit 8).
    pub visibility: Visibility,
    /// Limits of the charge states.
    pub charge_limits: ChargeLimits,
    /// Thresholds of the failsafe.
    pub failsafe: FailsafeSettings,
}

impl PackSettings {
    /// Whether the measured curve, as far as it is known, rises and is possible for the chemistry.
    pub fn is_curve_possible(&self) -> bool {
        let possible_v = self.chemistry.resting_cell_voltages_v();
        let measured_v = || self.curve_v.iter().flatten();
        measured_v().all(|voltage_v| possible_v.contains(voltage_v))
            && measured_v().is_sorted_by(|lower_v, higher_v| lower_v < higher_v)
    }
}

/// A setting that scales a measured current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentScale {
    /// Amperes per volt of an analog sensor (`BATT_AMP_PERVLT`).
    AmperesPerVolt,
    /// The resistance of a shunt (`BATT_SHUNT`).
    Shunt,
    /// A factor on a current that is reported (`BATT_CURR_MULT`).
    Factor,
}

/// Remaining charge below which a charge state is entered, in percent. `None` is disabled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChargeLimits {
    /// LOW (`BATT_LOW_PCT`).
    pub low_pct: Option<f32>,
    /// CRITICAL (`BATT_CRT_PCT`).
    pub critical_pct: Option<f32>,
    /// EMERGENCY (`BATT_EMR_PCT`).
    pub emergency_pct: Option<f32>,
}

/// Settings of a pack's failsafe. `None` is disabled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FailsafeSettings {
    /// Time for which the voltage has to stay below a threshold (`BATT_LOW_TIMER`), in seconds; `None` disables voltage
    /// thresholds.
    pub timer_s: Option<f32>,
    /// The voltage that is compared (`BATT_FS_VOLTSRC`).
    pub voltage_source: VoltageSource,
    /// `BATT_LOW_VOLT` and `BATT_LOW_MAH`; `BATT_LOW_PCT` if that acts (`BATT_FS_PCT_EN`).
    pub low: Thresholds,
    /// `BATT_CRT_VOLT` and `BATT_CRT_MAH`; the higher one of `BATT_CRT_PCT` and `BATT_EMR_PCT` if they act.
    pub critical: Thresholds,
}

impl FailsafeSettings {
    /// Whether no threshold can act on a pack in this state.
    pub fn is_disabled(&self, state: &BatteryState) -> bool {
        !self.is_in_force(&self.low, state) && !self.is_in_force(&self.critical, state)
    }

    /// Whether one of these thresholds can act on a pack in this state: in volts where its kind measures a voltage and a timer
    /// is set, in milliampere-hours where its capacity is known or may be yet, in percent always.
    pub fn is_in_force(&self, thresholds: &Thresholds, state: &BatteryState) -> bool {
        let measures_voltage = self.voltage_source != VoltageSource::NotMeasured;
        let by_voltage = thresholds.voltage_v.is_some() && self.timer_s.is_some() && measures_voltage;
        let by_charge = thresholds.remaining_mah.is_some() && !state.lacks_capacity();
        by_voltage || by_charge || thresholds.usable_pct.is_some()
    }

    /// The setting that is missing, unless a threshold can act on a pack in this state.
    pub fn missing_setting(&self, state: &BatteryState) -> Option<MissingSetting> {
        if !self.is_disabled(state) {
            return None;
        }
        match self.low.remaining_mah.or(self.critical.remaining_mah) {
            Some(_) => Some(MissingSetting::Capacity),
            None => self.missing_voltage_setting(),
        }
    }

    /// The setting that is missing, unless a threshold in volts can act: of what has no voltage, the one of its charge.
    pub(super) fn missing_voltage_setting(&self) -> Option<MissingSetting> {
        let voltage_v = self.low.voltage_v.or(self.critical.voltage_v);
        match (self.voltage_source, voltage_v, self.timer_s) {
            (VoltageSource::NotMeasured, ..) => Some(MissingSetting::LowCharge),
            (_, None, _) => Some(MissingSetting::LowVoltage),
            (_, Some(_), None) => Some(MissingSetting::Timer),
            (_, Some(_), Some(_)) => None,
        }
    }

    /// The voltage that thresholds are compared with, in volts.
    pub fn compared_voltage_v(&self, state: &BatteryState) -> Option<f32> {
        match self.voltage_source {
            VoltageSource::Terminal => state.readings.voltage_v,
            VoltageSource::Resting => state.resting_or_terminal_voltage_v(),
            VoltageSource::WeakestCell => state.voltage_by_weakest_cell_v().or(state.readings.voltage_v),
            VoltageSource::NotMeasured => None,
        }
    }

    /// Whether a threshold compares the charge.
    pub(super) fn needs_charge(&self) -> bool {
        self.low.compares_charge() || self.critical.compares_charge()
    }
}

/// Thresholds of a failsafe level or of arming. `None` is disabled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thresholds {
    /// In volts.
    pub voltage_v: Option<f32>,
    /// Remaining charge, in milliampere-hours; millilitres of fuel.
    pub remaining_mah: Option<f32>,
    /// Usable charge, in percent.
    pub usable_pct: Option<f32>,
}

impl Thresholds {
    fn compares_charge(&self) -> bool {
        self.remaining_mah.is_some() || self.usable_pct.is_some()
    }
}

/// A setting without which no threshold can act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissingSetting {
    /// A threshold in volts (`BATT_LOW_VOLT`).
    LowVoltage,
    /// A threshold of the charge, for what has no voltage (`BATT_LOW_MAH`).
    LowCharge,
    /// The time for which a voltage has to stay below its threshold (`BATT_LOW_TIMER`).
    Timer,
    /// The capacity of which a charge is left (`BATT_CAPACITY`).
    Capacity,
}

/// The voltage that thresholds are compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VoltageSource {
    /// The terminal voltage.
    #[default]
    Terminal,
    /// The resting voltage; the terminal voltage while that is unknown.
    Resting,
    /// The voltage of a pack whose cells are all like its weakest one; the terminal voltage unless every cell is measured.
    WeakestCell,
    /// None: what is monitored has no voltage, such as a tank.
    NotMeasured,
}

/// Usual voltages under a moderate load for `BATT_LOW_VOLT` and `BATT_CRT_VOLT`, in volts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuggestedThresholds {
    /// For `BATT_LOW_VOLT`.
    pub low_v: f32,
    /// For `BATT_CRT_VOLT`.
    pub critical_v: f32,
}

impl SuggestedThresholds {
    /// For a pack whose number of cells is known and which has no threshold.
    pub fn of(state: &BatteryState, settings: &PackSettings) -> Option<Self> {
        let none = Thresholds::default();
        if settings.failsafe.low != none || settings.failsafe.critical != none {
            return None;
        }
        let cells = f32::from(state.cell_count?);
        let cell = state.chemistry.cell();
        Some(Self {
            low_v: cell.low_v * cells,
            critical_v: cell.critical_v * cells,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Amount, CellVoltages, ChargeSource, PackStatus};

    #[test]
    fn the_weakest_cell_counts_once_every_cell_is_measured() {
        let settings = FailsafeSettings {
            voltage_source: VoltageSource::WeakestCell,
            ..FailsafeSettings::default()
        };
        for (cells_mv, cell_count, compared_v) in [
            (&[3900, 3400, 3900][..], Some(3), 10.2),
            (&[3900, 0, 3900], Some(3), 0.0),
            // One of three is unknown, or their number; none is measured.
            (&[3900, 3400], Some(3), 11.2),
            (&[3900, 3400, 3900], None, 11.2),
            (&[], Some(3), 11.2),
        ] {
            let mut state = BatteryState {
                cell_count,
                cells: CellVoltages::from_millivolts(cells_mv),
                ..BatteryState::UNKNOWN
            };
            assert_eq!(settings.compared_voltage_v(&state), None);
            state.readings.voltage_v = Some(11.2);
            let compared = settings.compared_voltage_v(&state).unwrap();
            assert!((compared - compared_v).abs() < 1e-4, "{cells_mv:?} {compared}");
        }
    }

    #[test]
    fn failsafe_misses_a_threshold_or_what_it_is_compared_with() {
        use MissingSetting::{Capacity, LowCharge, LowVoltage, Timer};
        use VoltageSource::{NotMeasured, Terminal};
        let measured = |capacity_mah: Option<f32>| BatteryState {
            status: PackStatus::Healthy,
            capacity: capacity_mah.map(Amount::Mah),
            ..BatteryState::UNKNOWN
        };
        let known = measured(Some(1000.0));
        let awaited = BatteryState {
            charge_source: ChargeSource::Gauge,
            ..measured(None)
        };
        let learnt = BatteryState {
            learnt_capacity_mah: Some(900.0),
            ..measured(None)
        };
        let volts = Thresholds {
            voltage_v: Some(9.9),
            ..Thresholds::default()
        };
        let mah = Thresholds {
            remaining_mah: Some(100.0),
            ..Thresholds::default()
        };
        let percent = Thresholds {
            usable_pct: Some(15.0),
            ..Thresholds::default()
        };
        for (low, timer_s, voltage_source, state, missing) in [
            (
                Thresholds::default(),
                Some(10.0),
                Terminal,
                known,
                Some(LowVoltage),
            ),
            (Thresholds::default(), None, Terminal, known, Some(LowVoltage)),
            (volts, None, Terminal, known, Some(Timer)),
            (volts, Some(10.0), Terminal, known, None),
            (volts, Some(10.0), NotMeasured, known, Some(LowCharge)),
            (mah, None, Terminal, known, None),
            (mah, None, Terminal, learnt, None),
            (mah, None, Terminal, awaited, None),
            (mah, None, Terminal, BatteryState::UNKNOWN, None),
            (mah, Some(10.0), Terminal, measured(None), Some(Capacity)),
            (mah, Some(10.0), NotMeasured, measured(None), Some(Capacity)),
            (percent, None, NotMeasured, measured(None), None),
        ] {
            let of_low = FailsafeSettings {
                timer_s,
                voltage_source,
                low,
                ..FailsafeSettings::default()
            };
            let of_critical = FailsafeSettings {
                low: Thresholds::default(),
                critical: low,
                ..of_low
            };
            assert_eq!(of_low.missing_setting(&state), missing, "{of_low:?}");
            assert_eq!(of_critical.missing_setting(&state), missing, "{of_critical:?}");
        }
    }
}
