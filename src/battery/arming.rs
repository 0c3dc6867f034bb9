//! What keeps a pack from driving the rover, before it is armed.

use core::fmt;

use super::failsafe::{FailsafeLevel, is_below, remaining_mah, voltage_v};
use super::{BatteryState, PackSettings, PackStatus};

/// Why a pack is not fit to drive. The words are ArduPilot's, in the order in which it looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ArmingFailure {
    /// There is no pack, or its sensor does not deliver, or it did not for too long while the rover was armed.
    Unhealthy,
    /// The terminals' voltage is below `BATT_ARM_VOLT`.
    BelowArmingVoltage,
    /// The charge that is left is below `BATT_ARM_MAH`.
    BelowArmingCapacity,
    /// The voltage is below `BATT_LOW_VOLT`, or the pack was low before.
    LowVoltage,
    /// The charge that is left is below `BATT_LOW_MAH`.
    LowCapacity,
    /// The voltage is below `BATT_CRT_VOLT`, or the pack was critical before.
    CriticalVoltage,
    /// The charge that is left is below `BATT_CRT_MAH`.
    CriticalCapacity,
    /// `BATT_CRT_MAH` is not below `BATT_LOW_MAH`.
    CapacityOrder,
    /// `BATT_CRT_VOLT` is not below `BATT_LOW_VOLT`.
    VoltageOrder,
}

impl fmt::Display for ArmingFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unhealthy => "unhealthy",
            Self::BelowArmingVoltage => "below minimum arming voltage",
            Self::BelowArmingCapacity => "below minimum arming capacity",
            Self::LowVoltage => "low voltage failsafe",
            Self::LowCapacity => "low capacity failsafe",
            Self::CriticalVoltage => "critical voltage failsafe",
            Self::CriticalCapacity => "critical capacity failsafe",
            Self::CapacityOrder => "capacity failsafe critical >= low",
            Self::VoltageOrder => "voltage failsafe critical >= low",
        })
    }
}

/// Everything that keeps a pack from driving the rover at this moment, without any timer. A pack that is not monitored
/// keeps nobody from anything, and what is not known is below no threshold.
///
/// A failsafe level that was reached stays one until the battery is reset. It is told as one of voltage, unless it is
/// the charge that is below its threshold now.
pub fn arming_failures(
    state: &BatteryState,
    settings: &PackSettings,
) -> impl Iterator<Item = ArmingFailure> + use<> {
    let (low, critical) = (&settings.failsafe.low, &settings.failsafe.critical);
    let voltage_v = voltage_v(state, &settings.failsafe);
    let remaining_mah = remaining_mah(state);
    let low_capacity = is_below(remaining_mah, low.remaining_mah);
    let critical_capacity = is_below(remaining_mah, critical.remaining_mah);
    let was = |level| state.failsafe == level;
    let checks = [
        (
            state.status != PackStatus::Healthy || was(FailsafeLevel::Unhealthy),
            ArmingFailure::Unhealthy,
        ),
        (
            is_below(state.voltage_v, settings.arming.voltage_v),
            ArmingFailure::BelowArmingVoltage,
        ),
        (
            is_below(remaining_mah, settings.arming.remaining_mah),
            ArmingFailure::BelowArmingCapacity,
        ),
        (
            is_below(voltage_v, low.voltage_v) || was(FailsafeLevel::Low) && !low_capacity,
            ArmingFailure::LowVoltage,
        ),
        (low_capacity, ArmingFailure::LowCapacity),
        (
            is_below(voltage_v, critical.voltage_v) || was(FailsafeLevel::Critical) && !critical_capacity,
            ArmingFailure::CriticalVoltage,
        ),
        (critical_capacity, ArmingFailure::CriticalCapacity),
        (
            is_upside_down(low.remaining_mah, critical.remaining_mah),
            ArmingFailure::CapacityOrder,
        ),
        (
            is_upside_down(low.voltage_v, critical.voltage_v),
            ArmingFailure::VoltageOrder,
        ),
    ];
    let is_monitored = state.status != PackStatus::Disabled;
    checks
        .into_iter()
        .filter(move |(fails, _)| is_monitored && *fails)
        .map(|(_, failure)| failure)
}

/// Both are set, and the critical one would come first or at the same time.
fn is_upside_down(low: Option<f32>, critical: Option<f32>) -> bool {
    low.zip(critical).is_some_and(|(low, critical)| critical >= low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::{FailsafeSettings, Thresholds, VoltageSource};

    fn thresholds(voltage_v: f32, remaining_mah: f32) -> Thresholds {
        Thresholds {
            voltage_v: Some(voltage_v),
            remaining_mah: Some(remaining_mah),
        }
    }

    fn settings() -> PackSettings {
        PackSettings {
            arming: thresholds(11.0, 500.0),
            failsafe: FailsafeSettings {
                low: thresholds(10.5, 400.0),
                critical: thresholds(9.9, 200.0),
                ..FailsafeSettings::default()
            },
            ..PackSettings::default()
        }
    }

    /// A pack of 1000 mAh.
    fn pack(voltage_v: f32, remaining_pct: f32) -> BatteryState {
        BatteryState {
            status: PackStatus::Healthy,
            voltage_v: Some(voltage_v),
            capacity_mah: Some(1000.0),
            consumed_mah: Some(0.0),
            remaining_pct: Some(remaining_pct),
            ..BatteryState::default()
        }
    }

    fn failures(state: &BatteryState, settings: &PackSettings) -> Vec<String> {
        arming_failures(state, settings)
            .map(|failure| failure.to_string())
            .collect()
    }

    #[test]
    fn a_full_pack_keeps_nobody_from_driving() {
        assert!(failures(&pack(12.6, 100.0), &settings()).is_empty());
        assert!(failures(&pack(11.0, 50.0), &settings()).is_empty());
    }

    #[test]
    fn every_failure_is_told_in_ardupilots_words_and_order() {
        let mut settings = settings();
        settings.failsafe.critical = thresholds(10.5, 400.0);
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
                "low voltage failsafe",
                "low capacity failsafe",
                "critical voltage failsafe",
                "critical capacity failsafe",
                "capacity failsafe critical >= low",
                "voltage failsafe critical >= low",
            ]
        );
    }

    #[test]
    fn what_is_off_or_not_known_fails_no_check() {
        assert!(failures(&pack(3.0, 0.0), &PackSettings::default()).is_empty());
        let unknown = BatteryState {
            status: PackStatus::Healthy,
            ..BatteryState::default()
        };
        assert!(failures(&unknown, &settings()).is_empty());
        assert!(failures(&BatteryState::disabled(), &settings()).is_empty());
    }

    #[test]
    fn sag_counts_for_arming_and_for_a_threshold_only_if_it_looks_at_the_terminals() {
        let sagging = BatteryState {
            resting_voltage_v: Some(11.5),
            ..pack(10.4, 100.0)
        };
        let mut settings = settings();
        let both = ["below minimum arming voltage", "low voltage failsafe"];
        assert_eq!(failures(&sagging, &settings), both);
        settings.failsafe.voltage_source = VoltageSource::Resting;
        assert_eq!(failures(&sagging, &settings), both[..1]);
    }

    #[test]
    fn a_level_that_was_reached_refuses_until_the_battery_is_reset() {
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
        assert_eq!(
            failures(&by_charge, &settings()),
            ["below minimum arming capacity", "low capacity failsafe"]
        );
    }
}
