//! Settings of a pack, and thresholds for one whose owner has set none.

use super::{BatteryState, Chemistry, ReportedVoltage, Visibility};
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, MonitorKind, Parameters, PartKind};

/// Settings of a pack, from its parameters. `None` is not set or disabled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PackSettings {
    /// Cell chemistry (`BATT_CHEM`).
    pub chemistry: Chemistry,
    /// Cells in series (`BATT_CELLS`); `None` detects them.
    pub cell_count: Option<u8>,
    /// Full capacity (`BATT_CAPACITY`), in milliampere-hours; millilitres of fuel.
    pub capacity_mah: Option<f32>,
    /// The parameter that scales the measured current, if there is one: `BATT_AMP_PERVLT`, `BATT_SHUNT` or `BATT_CURR_MULT`.
    pub current_scale: Option<BatteryParameter>,
    /// Load that is a fault, in watts: a tenth above `BATT_WATT_MAX`, so that limiting the motors to it is none.
    pub overload_w: Option<f32>,
    /// Serial number (`BATT_SERIAL_NUM`).
    pub serial_number: Option<i32>,
    /// The voltage reported to ground stations (`BATT_OPTIONS` bit 6).
    pub reported_voltage: ReportedVoltage,
    /// Whether the pack is reported to ground stations (`BATT_OPTIONS` bit 8).
    pub visibility: Visibility,
    /// Limits of the charge states.
    pub charge_limits: ChargeLimits,
    /// Thresholds of the failsafe.
    pub failsafe: FailsafeSettings,
    /// Minimum for arming (`BATT_ARM_VOLT` and `BATT_ARM_MAH`).
    pub arming: Thresholds,
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

impl ChargeLimits {
    /// The limit at which the failsafe level *critical* is reached: it has no *emergency*.
    fn highest_critical_pct(&self) -> Option<f32> {
        match (self.critical_pct, self.emergency_pct) {
            (Some(critical_pct), Some(emergency_pct)) => Some(critical_pct.max(emergency_pct)),
            (critical_pct, emergency_pct) => critical_pct.or(emergency_pct),
        }
    }
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
    pub(super) fn is_in_force(&self, thresholds: &Thresholds, state: &BatteryState) -> bool {
        let measures_voltage = self.voltage_source != VoltageSource::NotMeasured;
        let by_voltage = thresholds.voltage_v.is_some() && self.timer_s.is_some() && measures_voltage;
        let by_charge = thresholds.remaining_mah.is_some() && !state.lacks_capacity();
        by_voltage || by_charge || thresholds.usable_pct.is_some()
    }

    /// The parameter to set, unless a threshold can act on a pack in this state.
    pub fn missing_parameter(&self, state: &BatteryState) -> Option<BatteryParameter> {
        if !self.is_disabled(state) {
            return None;
        }
        match self.low.remaining_mah.or(self.critical.remaining_mah) {
            Some(_) => Some(BatteryParameter::Capacity),
            None => self.missing_voltage_parameter(),
        }
    }

    /// The parameter to set, unless a threshold in volts can act: of what has no voltage, the one of its charge.
    pub(super) fn missing_voltage_parameter(&self) -> Option<BatteryParameter> {
        let voltage_v = self.low.voltage_v.or(self.critical.voltage_v);
        match (self.voltage_source, voltage_v, self.timer_s) {
            (VoltageSource::NotMeasured, ..) => Some(BatteryParameter::LowMah),
            (_, None, _) => Some(BatteryParameter::LowVolt),
            (_, Some(_), None) => Some(BatteryParameter::LowTimer),
            (_, Some(_), Some(_)) => None,
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

/// The voltage that thresholds are compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VoltageSource {
    /// The terminal voltage.
    #[default]
    Terminal,
    /// The resting voltage; the terminal voltage while that is unknown.
    Resting,
    /// None: what is monitored has no voltage, such as a tank.
    NotMeasured,
}

/// Bits of `BATT_OPTIONS`, as in ArduPilot.
const SEND_RESTING_VOLTAGE: i32 = 1 << 6;
const INTERNAL_USE_ONLY: i32 = 1 << 8;

/// Load that is a fault, relative to `BATT_WATT_MAX`.
const OVERLOAD: f32 = 1.1;

/// `BATT_FS_PCT_EN`: thresholds in percent act.
const PERCENT_ACTS: i32 = 1;

/// `BATT_FS_VOLTSRC`: the resting voltage.
const SAG_COMPENSATED: i32 = 1;

impl PackSettings {
    /// The serial number alone, which says whose learnt data a pack has.
    pub fn serial_number(parameters: &Parameters, pack: Pack) -> Option<i32> {
        let number = parameters.get_whole(BatteryParameter::SerialNum.of(pack));
        Some(number).filter(|number| *number >= 0)
    }

    /// From the live parameters of a pack, whatever its kind.
    pub fn from_parameters(parameters: &Parameters, pack: Pack) -> Self {
        let value = |parameter: BatteryParameter| parameters.get(parameter.of(pack));
        let whole = |parameter: BatteryParameter| parameters.get_whole(parameter.of(pack));
        // 0 is disabled or not set.
        let above_zero = |parameter| Some(value(parameter)).filter(|value| *value > 0.0);
        let options = whole(BatteryParameter::Options);
        let charge_limits = ChargeLimits {
            low_pct: above_zero(BatteryParameter::LowPct),
            critical_pct: above_zero(BatteryParameter::CrtPct),
            emergency_pct: above_zero(BatteryParameter::EmrPct),
        };
        let percent_acts = whole(BatteryParameter::FsPctEn) == PERCENT_ACTS;
        let if_it_acts = |limit_pct: Option<f32>| limit_pct.filter(|_| percent_acts);
        Self {
            chemistry: Chemistry::from_number(whole(BatteryParameter::Chem)).unwrap_or_default(),
            cell_count: u8::try_from(whole(BatteryParameter::Cells))
                .ok()
                .filter(|count| *count > 0),
            capacity_mah: above_zero(BatteryParameter::Capacity),
            current_scale: None,
            overload_w: above_zero(BatteryParameter::WattMax).map(|max_w| OVERLOAD * max_w),
            serial_number: Self::serial_number(parameters, pack),
            reported_voltage: if options & SEND_RESTING_VOLTAGE != 0 {
                ReportedVoltage::Resting
            } else {
                ReportedVoltage::Terminal
            },
            visibility: if options & INTERNAL_USE_ONLY != 0 {
                Visibility::Internal
            } else {
                Visibility::Reported
            },
            charge_limits,
            failsafe: FailsafeSettings {
                timer_s: above_zero(BatteryParameter::LowTimer),
                voltage_source: if whole(BatteryParameter::FsVoltsrc) == SAG_COMPENSATED {
                    VoltageSource::Resting
                } else {
                    VoltageSource::Terminal
                },
                low: Thresholds {
                    voltage_v: above_zero(BatteryParameter::LowVolt),
                    remaining_mah: above_zero(BatteryParameter::LowMah),
                    usable_pct: if_it_acts(charge_limits.low_pct),
                },
                critical: Thresholds {
                    voltage_v: above_zero(BatteryParameter::CrtVolt),
                    remaining_mah: above_zero(BatteryParameter::CrtMah),
                    usable_pct: if_it_acts(charge_limits.highest_critical_pct()),
                },
            },
            arming: Thresholds {
                voltage_v: above_zero(BatteryParameter::ArmVolt),
                remaining_mah: above_zero(BatteryParameter::ArmMah),
                usable_pct: None,
            },
        }
    }

    /// The same of a pack of this kind, if that is known. The capacity of a sum is not set at the default: it is that of its members together.
    pub fn of_kind(mut self, pack: Pack, kind: Option<MonitorKind>) -> Self {
        let default_mah = BatteryParameter::Capacity.of(pack).default_value();
        if kind == Some(MonitorKind::Sum) && self.capacity_mah == Some(default_mah) {
            self.capacity_mah = None;
        }
        if kind.is_some_and(|kind| !kind.may_measure_voltage()) {
            self.failsafe.voltage_source = VoltageSource::NotMeasured;
        }
        self.current_scale = kind.and_then(current_scale);
        self
    }
}

/// The parameter that scales the current of this kind, by the board's wiring or of a node on the CAN bus.
fn current_scale(kind: MonitorKind) -> Option<BatteryParameter> {
    match kind {
        MonitorKind::AnalogVoltageAndCurrent
        | MonitorKind::AnalogCurrent
        | MonitorKind::SyntheticCurrent
        | MonitorKind::Bus(PartKind::Ad7091r5) => Some(BatteryParameter::AmpPervlt),
        MonitorKind::Bus(PartKind::Ina2xx | PartKind::Ina239 | PartKind::Ina3221 | PartKind::Ltc2946) => {
            Some(BatteryParameter::Shunt)
        }
        MonitorKind::Can => Some(BatteryParameter::CurrMult),
        _ => None,
    }
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
    use crate::battery::{Amount, ChargeSource, PackStatus};
    use crate::parameter::Range;

    #[test]
    fn defaults_disable_what_is_not_set() {
        let settings = PackSettings::from_parameters(&Parameters::defaults(), Pack::Second);
        let expected = PackSettings {
            capacity_mah: Some(3300.0),
            charge_limits: ChargeLimits {
                low_pct: Some(15.0),
                critical_pct: Some(7.0),
                emergency_pct: Some(5.0),
            },
            failsafe: FailsafeSettings {
                timer_s: Some(10.0),
                ..FailsafeSettings::default()
            },
            ..PackSettings::default()
        };
        assert_eq!(settings, expected);
    }

    /// Parameters that are no settings of the monitor: its kind since boot, sensors, sums, failsafe actions and learning read them.
    fn is_read_elsewhere(parameter: BatteryParameter) -> bool {
        use BatteryParameter::*;
        let of_sensors = [
            VoltPin, VoltMult, VltOffset, CurrPin, AmpPervlt, AmpOffset, MaxVolt, I2cBus, I2cAddr, Shunt,
            MaxAmps, Channel, FlVltMin, FlVMult, FlFltr, FlPin, FlFf, FlFs, FlFt, FlOff, CurrMult, EscMask,
        ];
        let of_others = [
            Monitor, SumMask, FsLowAct, FsCrtAct, FsUnhAct, LrnCap, LrnRes, LrnErase,
        ];
        of_sensors.contains(&parameter) || of_others.contains(&parameter)
    }

    /// Values from all over a range; of a bit mask each bit.
    fn values_of(range: Range) -> Vec<f32> {
        match range {
            Range::Between(lowest, highest) => vec![lowest, highest],
            Range::ZeroOrBetween(lowest, highest) => vec![0.0, lowest, highest],
            Range::OneOf(values) => values.iter().map(|(value, _)| *value as f32).collect(),
            Range::Bits(bits) => bits.iter().map(|(bit, _)| (1u32 << bit) as f32).collect(),
        }
    }

    #[test]
    // Requirement: AP-1
    fn every_parameter_of_the_table_changes_a_setting_or_is_read_elsewhere() {
        let defaults = Parameters::defaults();
        let before = PackSettings::from_parameters(&defaults, Pack::Third);
        for parameter in BatteryParameter::ALL {
            let changes_a_setting = values_of(parameter.row().range).into_iter().any(|value| {
                let mut parameters = defaults.clone();
                let was_set = parameters.set(parameter.of(Pack::Third), value).is_ok();
                was_set && PackSettings::from_parameters(&parameters, Pack::Third) != before
            });
            assert_eq!(changes_a_setting, !is_read_elsewhere(parameter), "{parameter:?}");
        }
    }

    #[test]
    fn the_scale_of_a_current_is_that_of_the_kind_which_measures_it() {
        for (monitor, scale) in [
            (3.0, None),
            (4.0, Some(BatteryParameter::AmpPervlt)),
            (21.0, Some(BatteryParameter::Shunt)),
            (26.0, Some(BatteryParameter::Shunt)),
            (8.0, Some(BatteryParameter::CurrMult)),
            (7.0, None),
        ] {
            let mut parameters = Parameters::defaults();
            let id = BatteryParameter::Monitor.of(Pack::Second);
            parameters.set(id, monitor).unwrap();
            let kind = parameters.monitor_kind(Pack::Second);
            let settings = PackSettings::from_parameters(&parameters, Pack::Second);
            let current_scale = settings.of_kind(Pack::Second, kind).current_scale;
            assert_eq!(current_scale, scale, "{monitor}");
        }
    }

    #[test]
    // Requirement: PX-2
    fn parameters_reach_their_settings_in_their_pack_only() {
        let mut parameters = Parameters::defaults();
        for (parameter, value) in [
            (BatteryParameter::Chem, 3.0),
            (BatteryParameter::Cells, 2.0),
            (BatteryParameter::Capacity, 5200.0),
            (BatteryParameter::WattMax, 90.0),
            (BatteryParameter::SerialNum, 7.0),
            (BatteryParameter::Options, 320.0),
            (BatteryParameter::LowPct, 30.0),
            (BatteryParameter::CrtPct, 20.0),
            (BatteryParameter::EmrPct, 25.0),
            (BatteryParameter::FsPctEn, 1.0),
            (BatteryParameter::LowTimer, 5.0),
            (BatteryParameter::FsVoltsrc, 1.0),
            (BatteryParameter::LowVolt, 6.6),
            (BatteryParameter::LowMah, 500.0),
            (BatteryParameter::CrtVolt, 6.2),
            (BatteryParameter::CrtMah, 200.0),
            (BatteryParameter::ArmVolt, 7.4),
            (BatteryParameter::ArmMah, 1000.0),
        ] {
            parameters.set(parameter.of(Pack::Third), value).unwrap();
        }
        let expected = PackSettings {
            chemistry: Chemistry::LiIon,
            cell_count: Some(2),
            capacity_mah: Some(5200.0),
            current_scale: None,
            overload_w: Some(99.0),
            serial_number: Some(7),
            reported_voltage: ReportedVoltage::Resting,
            visibility: Visibility::Internal,
            charge_limits: ChargeLimits {
                low_pct: Some(30.0),
                critical_pct: Some(20.0),
                emergency_pct: Some(25.0),
            },
            failsafe: FailsafeSettings {
                timer_s: Some(5.0),
                voltage_source: VoltageSource::Resting,
                low: Thresholds {
                    voltage_v: Some(6.6),
                    remaining_mah: Some(500.0),
                    usable_pct: Some(30.0),
                },
                critical: Thresholds {
                    voltage_v: Some(6.2),
                    remaining_mah: Some(200.0),
                    // The higher one: there is one level for both.
                    usable_pct: Some(25.0),
                },
            },
            arming: Thresholds {
                voltage_v: Some(7.4),
                remaining_mah: Some(1000.0),
                usable_pct: None,
            },
        };
        assert_eq!(PackSettings::from_parameters(&parameters, Pack::Third), expected);
        assert_eq!(
            PackSettings::from_parameters(&parameters, Pack::Fourth).cell_count,
            None
        );
    }

    #[test]
    fn failsafe_misses_a_threshold_or_what_it_is_compared_with() {
        use BatteryParameter::{Capacity, LowMah, LowTimer, LowVolt};
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
            (Thresholds::default(), Some(10.0), Terminal, known, Some(LowVolt)),
            (Thresholds::default(), None, Terminal, known, Some(LowVolt)),
            (volts, None, Terminal, known, Some(LowTimer)),
            (volts, Some(10.0), Terminal, known, None),
            (volts, Some(10.0), NotMeasured, known, Some(LowMah)),
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
            assert_eq!(of_low.missing_parameter(&state), missing, "{of_low:?}");
            assert_eq!(of_critical.missing_parameter(&state), missing, "{of_critical:?}");
        }
    }

    #[test]
    fn what_has_no_voltage_has_no_threshold_in_volts() {
        use BatteryParameter::{Capacity, LowMah, LowVolt, Monitor};
        let (terminal, not_measured) = (VoltageSource::Terminal, VoltageSource::NotMeasured);
        // Packs, a sum, and the output of a generator; a flow, levels, a current alone, a generator's tank, an engine.
        for (monitor, source) in [
            (4.0, terminal),
            (10.0, terminal),
            (17.0, terminal),
            (11.0, not_measured),
            (12.0, not_measured),
            (24.0, not_measured),
            (31.0, not_measured),
            (18.0, not_measured),
            (27.0, not_measured),
        ] {
            let failsafe = |changes: &[(BatteryParameter, f32)]| {
                let mut parameters = Parameters::defaults();
                for (parameter, value) in [(Monitor, monitor)].iter().chain(changes) {
                    parameters.set(parameter.of(Pack::Second), *value).unwrap();
                }
                let kind = parameters.monitor_kind(Pack::Second);
                let settings = PackSettings::from_parameters(&parameters, Pack::Second);
                settings.of_kind(Pack::Second, kind).failsafe
            };
            assert_eq!(failsafe(&[]).voltage_source, source, "BATT2_MONITOR {monitor}");
            let state = |capacity| BatteryState {
                status: PackStatus::Healthy,
                capacity,
                ..BatteryState::UNKNOWN
            };
            let full = state(Some(Amount::Ml(2000.0)));
            let (none, in_volts) = match source {
                VoltageSource::NotMeasured => (LowMah, Some(LowMah)),
                _ => (LowVolt, None),
            };
            for (changes, missing) in [
                (&[][..], Some(none)),
                (&[(LowVolt, 9.9)], in_volts),
                (&[(LowVolt, 9.9), (LowMah, 100.0)], None),
            ] {
                let found = failsafe(changes).missing_parameter(&full);
                assert_eq!(found, missing, "BATT2_MONITOR {monitor}, {changes:?}");
            }
            let by_charge = failsafe(&[(LowMah, 100.0)]);
            assert_eq!(by_charge.missing_parameter(&state(None)), Some(Capacity));
        }
    }
}
