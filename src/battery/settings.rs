//! Settings of a pack's monitor by its parameters.

use super::{
    ChargeLimits, CurrentScale, FailsafeSettings, MissingSetting, PackSettings, ReportedVoltage, Thresholds,
    Visibility, VoltageSource,
};
use crate::pack::PackSet;
use crate::parameter::{BatteryParameter, MonitorKind, PackParameters, PartKind};

/// Bits of `BATT_OPTIONS`, as in ArduPilot.
const SEND_RESTING_VOLTAGE: i32 = 1 << 6;
const INTERNAL_USE_ONLY: i32 = 1 << 8;

/// Load that is a fault, relative to `BATT_WATT_MAX`.
const OVERLOAD: f32 = 1.1;

/// `BATT_FS_PCT_EN`: thresholds in percent act.
const PERCENT_ACTS: i32 = 1;

/// `BATT_FS_VOLTSRC`: the resting voltage, as in ArduPilot, and the weakest cell.
const SAG_COMPENSATED: i32 = 1;
const WEAKEST_CELL: i32 = 2;

impl PackParameters<'_> {
    /// The serial number, which says whose learnt data a pack has.
    pub fn serial_number(self) -> Option<i32> {
        let number = self.get_whole(BatteryParameter::SerialNum);
        Some(number).filter(|number| *number >= 0)
    }

    /// The packs that a sum names as its members (`BATT_SUM_MASK`).
    pub fn named_members(self) -> PackSet {
        PackSet::from_bits(self.get_whole(BatteryParameter::SumMask) as u16)
    }

    /// The settings of the pack's monitor, whatever its kind.
    pub fn settings(self) -> PackSettings {
        let whole = |parameter| self.get_whole(parameter);
        let above_zero = |parameter| self.above_zero(parameter);
        let options = whole(BatteryParameter::Options);
        let charge_limits = ChargeLimits {
            low_pct: above_zero(BatteryParameter::LowPct),
            critical_pct: above_zero(BatteryParameter::CrtPct),
            emergency_pct: above_zero(BatteryParameter::EmrPct),
        };
        let percent_acts = whole(BatteryParameter::FsPctEn) == PERCENT_ACTS;
        let if_it_acts = |limit_pct: Option<f32>| limit_pct.filter(|_| percent_acts);
        PackSettings {
            chemistry: self.chemistry(),
            cell_count: u8::try_from(whole(BatteryParameter::Cells))
                .ok()
                .filter(|count| *count > 0),
            curve_v: BatteryParameter::CURVE.map(above_zero),
            capacity_mah: above_zero(BatteryParameter::Capacity),
            current_scale: None,
            overload_w: above_zero(BatteryParameter::WattMax).map(|max_w| OVERLOAD * max_w),
            serial_number: self.serial_number(),
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
                voltage_source: match whole(BatteryParameter::FsVoltsrc) {
                    SAG_COMPENSATED => VoltageSource::Resting,
                    WEAKEST_CELL => VoltageSource::WeakestCell,
                    _ => VoltageSource::Terminal,
                },
                low: Thresholds {
                    voltage_v: above_zero(BatteryParameter::LowVolt),
                    remaining_mah: above_zero(BatteryParameter::LowMah),
                    usable_pct: if_it_acts(charge_limits.low_pct),
                },
                critical: Thresholds {
                    voltage_v: above_zero(BatteryParameter::CrtVolt),
                    remaining_mah: above_zero(BatteryParameter::CrtMah),
                    usable_pct: if_it_acts(highest_critical_pct(&charge_limits)),
                },
            },
        }
    }

    /// The settings of a monitor of this kind, if that is known. The capacity of a sum is not set at the default: it is that of
    /// its members together.
    pub fn settings_of_kind(self, kind: Option<MonitorKind>) -> PackSettings {
        let mut settings = self.settings();
        let default_mah = BatteryParameter::Capacity.of(self.pack).default_value();
        if kind == Some(MonitorKind::Sum) && settings.capacity_mah == Some(default_mah) {
            settings.capacity_mah = None;
        }
        if kind.is_some_and(|kind| !kind.may_measure_voltage()) {
            settings.failsafe.voltage_source = VoltageSource::NotMeasured;
        }
        settings.current_scale = kind.and_then(current_scale);
        settings
    }
}

/// The limit at which the failsafe level *critical* is reached: it has no *emergency*.
fn highest_critical_pct(limits: &ChargeLimits) -> Option<f32> {
    match (limits.critical_pct, limits.emergency_pct) {
        (Some(critical_pct), Some(emergency_pct)) => Some(critical_pct.max(emergency_pct)),
        (critical_pct, emergency_pct) => critical_pct.or(emergency_pct),
    }
}

/// The setting that scales the current of this kind, by the board's wiring or of a node on the CAN bus.
fn current_scale(kind: MonitorKind) -> Option<CurrentScale> {
    match kind {
        MonitorKind::AnalogVoltageAndCurrent
        | MonitorKind::AnalogCurrent
        | MonitorKind::SyntheticCurrent
        | MonitorKind::Bus(PartKind::Ad7091r5) => Some(CurrentScale::AmperesPerVolt),
        MonitorKind::Bus(PartKind::Ina2xx | PartKind::Ina239 | PartKind::Ina3221 | PartKind::Ltc2946) => {
            Some(CurrentScale::Shunt)
        }
        MonitorKind::Can => Some(CurrentScale::Factor),
        _ => None,
    }
}

impl From<CurrentScale> for BatteryParameter {
    fn from(scale: CurrentScale) -> Self {
        match scale {
            CurrentScale::AmperesPerVolt => Self::AmpPervlt,
            CurrentScale::Shunt => Self::Shunt,
            CurrentScale::Factor => Self::CurrMult,
        }
    }
}

impl From<MissingSetting> for BatteryParameter {
    fn from(setting: MissingSetting) -> Self {
        match setting {
            MissingSetting::LowVoltage => Self::LowVolt,
            MissingSetting::LowCharge => Self::LowMah,
            MissingSetting::Timer => Self::LowTimer,
            MissingSetting::Capacity => Self::Capacity,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::{Amount, BatteryState, Chemistry, PackStatus};
    use crate::pack::Pack;
    use crate::parameter::{Parameters, Range};

    #[test]
    fn defaults_disable_what_is_not_set() {
        let settings = Parameters::defaults().pack(Pack::Second).settings();
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

    /// Parameters that are no settings of the monitor: its kind since boot, sensors, sums, arming, failsafe actions and learning read them.
    fn is_read_elsewhere(parameter: BatteryParameter) -> bool {
        use BatteryParameter::*;
        let of_sensors = [
            VoltPin, VoltMult, VltOffset, CurrPin, AmpPervlt, AmpOffset, MaxVolt, I2cBus, I2cAddr, Shunt,
            MaxAmps, Channel, FlVltMin, FlVMult, FlFltr, FlPin, FlFf, FlFs, FlFt, FlOff, CurrMult, EscMask,
        ];
        let of_others = [
            Monitor, SumMask, ArmVolt, ArmMah, FsLowAct, FsCrtAct, FsUnhAct, LrnCap, LrnRes, LrnErase,
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
        let before = defaults.pack(Pack::Third).settings();
        for parameter in BatteryParameter::ALL {
            let changes_a_setting = values_of(parameter.row().range).into_iter().any(|value| {
                let mut parameters = defaults.clone();
                let was_set = parameters.set(parameter.of(Pack::Third), value).is_ok();
                was_set && parameters.pack(Pack::Third).settings() != before
            });
            assert_eq!(changes_a_setting, !is_read_elsewhere(parameter), "{parameter:?}");
        }
    }

    #[test]
    fn the_scale_of_a_current_is_that_of_the_kind_which_measures_it() {
        for (monitor, scale) in [
            (3.0, None),
            (4.0, Some(CurrentScale::AmperesPerVolt)),
            (21.0, Some(CurrentScale::Shunt)),
            (26.0, Some(CurrentScale::Shunt)),
            (8.0, Some(CurrentScale::Factor)),
            (7.0, None),
        ] {
            let mut parameters = Parameters::defaults();
            let id = BatteryParameter::Monitor.of(Pack::Second);
            parameters.set(id, monitor).unwrap();
            let kind = parameters.monitor_kind(Pack::Second);
            let current_scale = parameters.pack(Pack::Second).settings_of_kind(kind).current_scale;
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
            (BatteryParameter::Curve10, 3.2),
            (BatteryParameter::Curve50, 3.7),
            (BatteryParameter::Curve90, 4.1),
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
        ] {
            parameters.set(parameter.of(Pack::Third), value).unwrap();
        }
        let expected = PackSettings {
            chemistry: Chemistry::LiIon,
            cell_count: Some(2),
            curve_v: [Some(3.2), None, Some(3.7), None, Some(4.1)],
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
        };
        assert_eq!(parameters.pack(Pack::Third).settings(), expected);
        assert_eq!(parameters.pack(Pack::Fourth).settings().cell_count, None);
    }

    #[test]
    fn what_has_no_voltage_has_no_threshold_in_volts() {
        use BatteryParameter::{LowMah, LowVolt, Monitor};
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
                parameters.pack(Pack::Second).settings_of_kind(kind).failsafe
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
                let found = failsafe(changes).missing_setting(&full).map(Into::into);
                assert_eq!(found, missing, "BATT2_MONITOR {monitor}, {changes:?}");
            }
            let by_charge = failsafe(&[(LowMah, 100.0)]);
            assert_eq!(
                by_charge.missing_setting(&state(None)),
                Some(MissingSetting::Capacity)
            );
        }
    }
}
