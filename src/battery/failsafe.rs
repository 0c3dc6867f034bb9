//! When a pack is too low to go on.

use super::BatteryState;
use super::settings::{FailsafeSettings, Thresholds, VoltageSource};

/// A pack that its sensor has not seen for longer is unhealthy, in microseconds: ArduPilot's 5 s.
const UNHEALTHY_AFTER_US: u64 = 5_000_000;

/// How urgent it is, in ArduPilot's order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum FailsafeLevel {
    /// Nothing.
    #[default]
    None = 0,
    /// The sensor no longer delivers.
    Unhealthy = 1,
    /// Below `BATT_LOW_VOLT` or `BATT_LOW_MAH`.
    Low = 2,
    /// Below `BATT_CRT_VOLT` or `BATT_CRT_MAH`.
    Critical = 3,
}

/// Whether the rover may move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ArmState {
    /// The motors are off.
    #[default]
    Disarmed,
    /// The motors may turn.
    Armed,
}

/// Decides the failsafe level of a pack: it only ever rises, until the battery is reset.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Failsafe {
    level: FailsafeLevel,
    low: Timer,
    critical: Timer,
}

/// How long a condition has lasted.
#[derive(Clone, Copy, Debug, Default)]
struct Timer {
    since_us: Option<u64>,
}

impl Timer {
    /// Whether the condition has lasted for more than `limit_s`.
    fn has_run_out(&mut self, now_us: u64, condition: bool, limit_s: f32) -> bool {
        if !condition {
            self.since_us = None;
            return false;
        }
        let since_us = *self.since_us.get_or_insert(now_us);
        now_us.saturating_sub(since_us) > (limit_s * 1e6) as u64
    }
}

impl Failsafe {
    pub fn level(&self) -> FailsafeLevel {
        self.level
    }

    /// The level this tick raises it to, if it does.
    pub fn update(
        &mut self,
        now_us: u64,
        last_healthy_us: Option<u64>,
        arm_state: ArmState,
        state: &BatteryState,
        settings: &FailsafeSettings,
    ) -> Option<FailsafeLevel> {
        if arm_state == ArmState::Disarmed {
            // A dip before disarming must not count when the rover is armed again.
            self.low = Timer::default();
            self.critical = Timer::default();
            return None;
        }
        let level = self.evaluate(now_us, last_healthy_us, state, settings);
        (level > self.level).then(|| {
            self.level = level;
            level
        })
    }

    /// The battery was reset.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    fn evaluate(
        &mut self,
        now_us: u64,
        last_healthy_us: Option<u64>,
        state: &BatteryState,
        settings: &FailsafeSettings,
    ) -> FailsafeLevel {
        let is_low_voltage =
            |thresholds: &Thresholds| is_below(voltage_v(state, settings), thresholds.voltage_v);
        let is_low_charge =
            |thresholds: &Thresholds| is_below(remaining_mah(state), thresholds.remaining_mah);
        let (low, critical) = (&settings.low, &settings.critical);
        let (low_voltage, critical_voltage) = match settings.timer_s {
            Some(timer_s) => (
                self.low.has_run_out(now_us, is_low_voltage(low), timer_s),
                self.critical
                    .has_run_out(now_us, is_low_voltage(critical), timer_s),
            ),
            None => (false, false),
        };
        if critical_voltage || is_low_charge(critical) {
            FailsafeLevel::Critical
        } else if low_voltage || is_low_charge(low) {
            FailsafeLevel::Low
        } else if now_us.saturating_sub(last_healthy_us.unwrap_or(0)) > UNHEALTHY_AFTER_US {
            FailsafeLevel::Unhealthy
        } else {
            FailsafeLevel::None
        }
    }
}

/// Whether both are known and the value lies below the threshold.
pub(super) fn is_below(value: Option<f32>, threshold: Option<f32>) -> bool {
    value
        .zip(threshold)
        .is_some_and(|(value, threshold)| value < threshold)
}

/// The voltage the thresholds are compared with.
pub(super) fn voltage_v(state: &BatteryState, settings: &FailsafeSettings) -> Option<f32> {
    match settings.voltage_source {
        VoltageSource::Terminal => state.voltage_v,
        VoltageSource::Resting => state.resting_or_terminal_voltage_v(),
    }
}

/// What is left by the state of charge; if that is not known, what is left if the pack was full.
pub(super) fn remaining_mah(state: &BatteryState) -> Option<f32> {
    let capacity_mah = state.capacity_mah?;
    // As in ArduPilot, thresholds of charge are for packs whose current is measured.
    let consumed_mah = state.consumed_mah?;
    Some(match state.remaining_pct {
        Some(remaining_pct) => capacity_mah * remaining_pct / 100.0,
        None => capacity_mah - consumed_mah,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_US: u64 = 100_000;

    fn settings() -> FailsafeSettings {
        FailsafeSettings {
            timer_s: Some(10.0),
            voltage_source: VoltageSource::Terminal,
            low: Thresholds {
                voltage_v: Some(10.5),
                remaining_mah: Some(400.0),
            },
            critical: Thresholds {
                voltage_v: Some(9.9),
                remaining_mah: Some(200.0),
            },
        }
    }

    fn at_voltage(voltage_v: f32) -> BatteryState {
        BatteryState {
            voltage_v: Some(voltage_v),
            ..BatteryState::default()
        }
    }

    /// Lets `seconds` of ticks pass and returns the seconds after which a level was reached.
    fn run(
        failsafe: &mut Failsafe,
        from_s: u64,
        seconds: u64,
        arm_state: ArmState,
        state: &BatteryState,
    ) -> Vec<(u64, FailsafeLevel)> {
        let mut raised = Vec::new();
        for tick in 0..seconds * 10 {
            let now_us = from_s * 1_000_000 + tick * TICK_US;
            if let Some(level) = failsafe.update(now_us, Some(now_us), arm_state, state, &settings()) {
                raised.push((tick / 10, level));
            }
        }
        raised
    }

    #[test]
    fn a_voltage_has_to_stay_below_for_longer_than_the_timer() {
        let mut failsafe = Failsafe::default();
        assert_eq!(run(&mut failsafe, 0, 10, ArmState::Armed, &at_voltage(10.4)), []);
        assert_eq!(run(&mut failsafe, 10, 1, ArmState::Armed, &at_voltage(11.0)), []);
        let raised = run(&mut failsafe, 11, 30, ArmState::Armed, &at_voltage(10.4));
        assert_eq!(raised, [(10, FailsafeLevel::Low)]);
    }

    #[test]
    fn it_rises_and_never_falls_until_the_battery_is_reset() {
        let mut failsafe = Failsafe::default();
        run(&mut failsafe, 0, 20, ArmState::Armed, &at_voltage(9.0));
        assert_eq!(failsafe.level(), FailsafeLevel::Critical);
        assert_eq!(run(&mut failsafe, 20, 60, ArmState::Armed, &at_voltage(12.0)), []);
        assert_eq!(failsafe.level(), FailsafeLevel::Critical);
        failsafe.clear();
        assert_eq!(failsafe.level(), FailsafeLevel::None);
    }

    #[test]
    fn a_dip_before_disarming_does_not_count_when_armed_again() {
        let mut failsafe = Failsafe::default();
        run(&mut failsafe, 0, 5, ArmState::Armed, &at_voltage(10.4));
        run(&mut failsafe, 5, 30, ArmState::Disarmed, &at_voltage(10.4));
        let raised = run(&mut failsafe, 35, 20, ArmState::Armed, &at_voltage(10.4));
        assert_eq!(raised, [(10, FailsafeLevel::Low)]);
    }

    #[test]
    fn a_charge_below_its_threshold_counts_at_once() {
        let charge = |remaining_pct| BatteryState {
            capacity_mah: Some(1000.0),
            consumed_mah: Some(0.0),
            remaining_pct: Some(remaining_pct),
            ..at_voltage(12.0)
        };
        let mut failsafe = Failsafe::default();
        assert_eq!(run(&mut failsafe, 0, 1, ArmState::Armed, &charge(40.0)), []);
        let raised = run(&mut failsafe, 1, 1, ArmState::Armed, &charge(39.9));
        assert_eq!(raised, [(0, FailsafeLevel::Low)]);
        let raised = run(&mut failsafe, 2, 1, ArmState::Armed, &charge(19.9));
        assert_eq!(raised, [(0, FailsafeLevel::Critical)]);
    }

    #[test]
    fn a_sensor_that_is_silent_for_more_than_five_seconds_is_unhealthy() {
        let mut failsafe = Failsafe::default();
        let mut at =
            |now_us| failsafe.update(now_us, Some(0), ArmState::Armed, &at_voltage(12.0), &settings());
        assert_eq!(at(5_000_000), None);
        assert_eq!(at(5_100_000), Some(FailsafeLevel::Unhealthy));
    }

    #[test]
    fn sag_does_not_count_when_the_resting_voltage_is_compared() {
        let sagging = BatteryState {
            resting_voltage_v: Some(11.0),
            ..at_voltage(10.0)
        };
        let resting = FailsafeSettings {
            voltage_source: VoltageSource::Resting,
            ..settings()
        };
        let mut failsafe = Failsafe::default();
        for tick in 0..300 {
            let now_us = tick * TICK_US;
            assert_eq!(
                failsafe.update(now_us, Some(now_us), ArmState::Armed, &sagging, &resting),
                None
            );
        }
    }
}
