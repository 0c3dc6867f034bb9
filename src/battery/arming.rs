//! Arming checks of a pack.

use super::conditions::{ArmingFailure, refusals};
use super::{BatteryState, PackSettings, PackStatus, Thresholds, is_below};
use crate::parameter::{BatteryParameter, PackParameters};

impl PackParameters<'_> {
    /// The least with which a pack may be armed (`BATT_ARM_VOLT` and `BATT_ARM_MAH`).
    pub fn arming_thresholds(self) -> Thresholds {
        Thresholds {
            voltage_v: self.above_zero(BatteryParameter::ArmVolt),
            remaining_mah: self.above_zero(BatteryParameter::ArmMah),
            usable_pct: None,
        }
    }
}

/// All failed checks of a pack, by its present values without any timer, and the one that was found elsewhere. A pack that is
/// not monitored passes, and so does an unknown value.
///
/// A latched failsafe level fails as one of voltage, unless the charge is below its threshold now.
pub fn arming_failures(
    state: &BatteryState,
    settings: &PackSettings,
    arming: &Thresholds,
    found: Option<ArmingFailure>,
) -> impl Iterator<Item = ArmingFailure> + use<> {
    let failing = match state.status {
        PackStatus::Disabled => 0,
        _ => failing(state, settings, arming) | found.map_or(0, ArmingFailure::bit),
    };
    let all = ArmingFailure::ALL.into_iter();
    all.filter(move |failure| failing & failure.bit() != 0)
}

/// The failed checks, a bit each.
fn failing(state: &BatteryState, settings: &PackSettings, arming: &Thresholds) -> u32 {
    let failsafe = &settings.failsafe;
    let (low, critical) = (&failsafe.low, &failsafe.critical);
    let voltage_v = failsafe.compared_voltage_v(state);
    let (low_capacity, critical_capacity) = (low.lacks_charge(state), critical.lacks_charge(state));
    let latched = refusals(state).filter(|failure| match failure {
        ArmingFailure::LowVoltage => !low_capacity,
        ArmingFailure::CriticalVoltage => !critical_capacity,
        _ => true,
    });
    let needs_capacity = [low, critical, arming]
        .iter()
        .any(|thresholds| thresholds.remaining_mah.is_some());
    let by_thresholds = [
        (
            is_below(state.readings.voltage_v, arming.voltage_v),
            ArmingFailure::BelowArmingVoltage,
        ),
        (arming.lacks_charge(state), ArmingFailure::BelowArmingCapacity),
        (is_below(voltage_v, low.voltage_v), ArmingFailure::LowVoltage),
        (low_capacity, ArmingFailure::LowCapacity),
        (
            is_below(voltage_v, critical.voltage_v),
            ArmingFailure::CriticalVoltage,
        ),
        (critical_capacity, ArmingFailure::CriticalCapacity),
        (
            needs_capacity && state.lacks_capacity(),
            ArmingFailure::NoCapacity,
        ),
        (
            is_inverted(low.remaining_mah, critical.remaining_mah),
            ArmingFailure::CapacityOrder,
        ),
        (
            is_inverted(low.usable_pct, critical.usable_pct),
            ArmingFailure::PercentageOrder,
        ),
        (
            is_inverted(low.voltage_v, critical.voltage_v),
            ArmingFailure::VoltageOrder,
        ),
        (!settings.is_curve_possible(), ArmingFailure::CurveOrder),
    ];
    let thresholds = by_thresholds.into_iter().filter(|(fails, _)| *fails);
    latched
        .chain(thresholds.map(|(_, failure)| failure))
        .fold(0, |failing, failure| failing | failure.bit())
}

/// Whether both are set and the critical threshold is not below the low one.
fn is_inverted(low: Option<f32>, critical: Option<f32>) -> bool {
    low.zip(critical).is_some_and(|(low, critical)| critical >= low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::consequences;
    use crate::battery::{
        Amount, ChargeSource, ChargeState, Consequences, FailsafeLevel, FailsafeSettings, Faults, Readings,
        VoltageSource,
    };

    fn thresholds(voltage_v: f32, remaining_mah: f32) -> Thresholds {
        Thresholds {
            voltage_v: Some(voltage_v),
            remaining_mah: Some(remaining_mah),
            usable_pct: None,
        }
    }

    #[test]
    fn pack_with_another_number_of_cells_or_an_unclear_one_fails() {
        for (cell_count, failure) in [
            (Some(3), ArmingFailure::WrongCells),
            (None, ArmingFailure::UnclearCells),
        ] {
            let state = BatteryState {
                status: PackStatus::Healthy,
                readings: Readings {
                    faults: Faults::CELLS_CONFIGURATION,
                    ..Readings::NONE
                },
                cell_count,
                ..BatteryState::default()
            };
            let failures: Vec<_> =
                arming_failures(&state, &PackSettings::default(), &Thresholds::default(), None).collect();
            assert_eq!(failures, [failure]);
        }
    }

    /// The failures of a healthy pack without thresholds.
    fn failures_of(state: BatteryState) -> Vec<ArmingFailure> {
        let state = BatteryState {
            status: PackStatus::Healthy,
            cell_count: Some(3),
            ..state
        };
        arming_failures(&state, &PackSettings::default(), &Thresholds::default(), None).collect()
    }

    #[test]
    // Requirement: AP-17
    fn which_faults_fail_by_their_origin() {
        for faults in Faults::all() {
            let by = |found, reported_faults| {
                let mut state = BatteryState::UNKNOWN;
                state.readings.faults = found;
                state.readings.reported.faults = reported_faults;
                failures_of(state)
            };
            let found = match faults {
                Faults::CELL_FAIL => Some(ArmingFailure::Failed),
                Faults::CELLS_CONFIGURATION => Some(ArmingFailure::WrongCells),
                Faults::CONTRADICTED_CHARGE => Some(ArmingFailure::ContradictedCharge),
                Faults::OVER_TEMPERATURE => Some(ArmingFailure::TooHot),
                _ => None,
            };
            let reported = match faults {
                Faults::CELL_FAIL | Faults::BAD_BATTERY => Some(ArmingFailure::Failed),
                _ => None,
            };
            assert_eq!(by(faults, Faults::empty()), Vec::from_iter(found), "{faults:?}");
            assert_eq!(
                by(Faults::empty(), faults),
                Vec::from_iter(reported),
                "{faults:?}"
            );
        }
    }

    #[test]
    // Requirement: AP-17
    fn which_states_fail_that_a_pack_reports_however_it_is_charged() {
        for (reported, expected) in [
            (ChargeState::Ok, None),
            (ChargeState::Low, None),
            (ChargeState::Critical, None),
            (ChargeState::Emergency, Some("is nearly empty")),
            (ChargeState::Failed, Some("has failed")),
            (ChargeState::Unhealthy, Some("unhealthy: its own report")),
            (ChargeState::Charging, None),
        ] {
            for charge_state in [ChargeState::Ok, ChargeState::Low, ChargeState::Charging] {
                let mut state = BatteryState::UNKNOWN;
                state.charge_state = charge_state;
                state.readings.reported.charge_state = Some(reported);
                let is_not_ready = consequences(&state).contains(Consequences::NOT_READY);
                assert_eq!(is_not_ready, expected.is_some(), "{reported:?}");
                let failures = failures_of(state).into_iter().map(|failure| failure.to_string());
                assert!(failures.eq(expected), "{reported:?}");
            }
        }
    }

    #[test]
    fn a_failed_cell_of_a_low_pack_fails() {
        let mut state = BatteryState::UNKNOWN;
        state.charge_state = ChargeState::Low;
        state.readings.faults = Faults::CELL_FAIL;
        assert_eq!(failures_of(state), [ArmingFailure::Failed]);
    }

    #[test]
    fn pack_that_failed_or_is_nearly_empty_fails_without_thresholds() {
        for (charge_state, expected) in [
            (ChargeState::Critical, None),
            (ChargeState::Emergency, Some(ArmingFailure::Emergency)),
            (ChargeState::Failed, Some(ArmingFailure::Failed)),
        ] {
            let mut state = BatteryState::UNKNOWN;
            state.charge_state = charge_state;
            assert_eq!(failures_of(state), Vec::from_iter(expected), "{charge_state:?}");
        }
    }

    /// Of a pack, and of arming.
    #[derive(Default)]
    struct Settings {
        pack: PackSettings,
        arming: Thresholds,
    }

    fn settings() -> Settings {
        Settings {
            arming: thresholds(11.0, 500.0),
            pack: PackSettings {
                failsafe: FailsafeSettings {
                    low: thresholds(10.5, 400.0),
                    critical: thresholds(9.9, 200.0),
                    ..FailsafeSettings::default()
                },
                ..PackSettings::default()
            },
        }
    }

    /// A pack of 1000 mAh.
    fn pack(voltage_v: f32, remaining_pct: f32) -> BatteryState {
        BatteryState {
            status: PackStatus::Healthy,
            readings: Readings {
                voltage_v: Some(voltage_v),
                remaining_pct: Some(remaining_pct),
                ..Readings::NONE
            },
            capacity: Some(Amount::Mah(1000.0)),
            consumed: Some(Amount::Mah(0.0)),
            ..BatteryState::default()
        }
    }

    fn failures(state: &BatteryState, settings: &Settings) -> Vec<String> {
        arming_failures(state, &settings.pack, &settings.arming, None)
            .map(|failure| failure.to_string())
            .collect()
    }

    const OF_LITTLE_CHARGE: [&str; 2] = ["below minimum arming capacity", "low capacity failsafe"];

    #[test]
    fn full_pack_passes() {
        assert!(failures(&pack(12.6, 100.0), &settings()).is_empty());
        assert!(failures(&pack(11.0, 50.0), &settings()).is_empty());
    }

    #[test]
    // Requirement: AP-17, PX-4
    fn failures_have_ardupilots_words_and_order() {
        let mut settings = settings();
        settings.pack.failsafe.critical = thresholds(10.5, 400.0);
        let state = BatteryState {
            status: PackStatus::Unhealthy,
            ..pack(9.0, 10.0)
        };
        assert_eq!(
            failures(&state, &settings),
            [
                "unhealthy",
                "below minimum arming voltage",
                "below minimum arming capacity",
                "critical voltage failsafe",
                "critical capacity failsafe",
                "low voltage failsafe",
                "low capacity failsafe",
                "capacity failsafe critical >= low",
                "voltage failsafe critical >= low",
            ]
        );
    }

    #[test]
    fn inverted_percentages_have_a_text_of_their_own() {
        for (low_pct, critical_pct, expected) in [
            (Some(20.0), Some(19.9), None),
            (
                Some(20.0),
                Some(20.0),
                Some("percentage failsafe critical >= low"),
            ),
            (None, Some(20.0), None),
            (Some(20.0), None, None),
        ] {
            let mut settings = Settings::default();
            settings.pack.failsafe.low.usable_pct = low_pct;
            settings.pack.failsafe.critical.usable_pct = critical_pct;
            let found = failures(&pack(12.6, 100.0), &settings);
            assert_eq!(found, Vec::from_iter(expected), "{low_pct:?} {critical_pct:?}");
        }
    }

    #[test]
    fn disabled_thresholds_and_unknown_values_pass() {
        assert!(failures(&pack(3.0, 0.0), &Settings::default()).is_empty());
        let unknown = BatteryState {
            status: PackStatus::Healthy,
            capacity: Some(Amount::Mah(1000.0)),
            ..BatteryState::default()
        };
        assert!(failures(&unknown, &settings()).is_empty());
        assert!(failures(&BatteryState::disabled(), &settings()).is_empty());
    }

    #[test]
    // Requirement: AP-17
    fn a_threshold_in_mah_needs_a_capacity() {
        let without = BatteryState {
            capacity: None,
            ..pack(12.6, 100.0)
        };
        let learnt = BatteryState {
            learnt_capacity_mah: Some(900.0),
            ..without
        };
        let mut awaited = BatteryState {
            charge_source: ChargeSource::Gauge,
            ..without
        };
        awaited.readings.remaining_pct = None;
        let mah = |remaining_mah| Thresholds {
            remaining_mah,
            ..Thresholds::default()
        };
        for (low, critical, arming) in [
            (Some(400.0), None, None),
            (None, Some(200.0), None),
            (None, None, Some(500.0)),
        ] {
            let mut settings = Settings {
                arming: mah(arming),
                ..Settings::default()
            };
            (settings.pack.failsafe.low, settings.pack.failsafe.critical) = (mah(low), mah(critical));
            assert_eq!(failures(&without, &settings), ["no capacity set"]);
            assert!(failures(&learnt, &settings).is_empty());
            assert!(failures(&awaited, &settings).is_empty());
        }
        assert!(failures(&without, &Settings::default()).is_empty());
    }

    #[test]
    // Requirement: AP-17, PX-3
    fn percentages_refuse_by_the_rule_by_which_they_act() {
        let mut settings = Settings::default();
        settings.pack.failsafe.low.usable_pct = Some(60.0);
        settings.pack.failsafe.critical.usable_pct = Some(45.0);
        let both = ["critical capacity failsafe", "low capacity failsafe"];
        for (remaining_pct, sigma_pct, expected) in [
            (34.0, Some(9.0), &both[..]),
            (34.0, Some(16.0), &both[1..]),
            (34.0, Some(25.0), &[]),
            (44.9, None, &both),
            (0.0, Some(33.0), &both[1..]),
            (60.0, Some(1.0), &[]),
        ] {
            let mut state = pack(12.0, remaining_pct);
            state.readings.usable_pct = Some(remaining_pct);
            state.readings.remaining_sigma_pct = sigma_pct;
            let failures = failures(&state, &settings);
            assert_eq!(failures, expected, "{remaining_pct} ± {sigma_pct:?}");
        }
    }

    #[test]
    fn the_charge_is_checked_without_a_current_sensor() {
        let state = BatteryState {
            consumed: None,
            ..pack(12.0, 30.0)
        };
        assert_eq!(failures(&state, &settings()), OF_LITTLE_CHARGE);
    }

    #[test]
    fn the_charge_is_of_what_the_pack_holds_now() {
        let learnt = BatteryState {
            learnt_capacity_mah: Some(700.0),
            ..pack(12.0, 55.0)
        };
        assert_eq!(failures(&learnt, &settings()), OF_LITTLE_CHARGE);
        let gauged = BatteryState {
            charge_source: ChargeSource::Gauge,
            ..learnt
        };
        assert!(failures(&gauged, &settings()).is_empty());
    }

    #[test]
    fn sag_fails_only_checks_of_the_terminal_voltage() {
        let mut sagging = pack(10.4, 100.0);
        sagging.readings.resting_voltage_v = Some(11.5);
        let mut settings = settings();
        let both = ["below minimum arming voltage", "low voltage failsafe"];
        assert_eq!(failures(&sagging, &settings), both);
        settings.pack.failsafe.voltage_source = VoltageSource::Resting;
        assert_eq!(failures(&sagging, &settings), both[..1]);
    }

    #[test]
    fn latched_failsafe_level_fails() {
        for (level, expected) in [
            (FailsafeLevel::Unhealthy, "unhealthy"),
            (FailsafeLevel::Low, "low voltage failsafe"),
            (FailsafeLevel::Critical, "critical voltage failsafe"),
        ] {
            let latched = BatteryState {
                failsafe: level,
                ..pack(12.6, 100.0)
            };
            assert_eq!(failures(&latched, &settings()), [expected]);
        }
        let by_charge = BatteryState {
            failsafe: FailsafeLevel::Low,
            ..pack(12.6, 30.0)
        };
        assert_eq!(failures(&by_charge, &settings()), OF_LITTLE_CHARGE);
    }
}
