//! When a pack is too low to go on.

use super::BatteryState;
use super::settings::{FailsafeSettings, Thresholds, VoltageSource};

/// A sensor that has not delivered for longer makes a pack unhealthy, in microseconds: ArduPilot's 5 s.
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
        last_good_us: Option<u64>,
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
        let level = self.evaluate(now_us, last_good_us, state, settings);
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
        last_good_us: Option<u64>,
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
        } else if now_us.saturating_sub(last_good_us.unwrap_or(0)) > UNHEALTHY_AFTER_US {
            FailsafeLevel::Unhealthy
        } else {
            FailsafeLevel::None
        }
    }
}

fn is_below(value: Option<f32>, threshold: Option<f32>) -> bool {
    value
        .zip(threshold)
        .is_some_and(|(value, threshold)| value < threshold)
}

fn voltage_v(state: &BatteryState, settings: &FailsafeSettings) -> Option<f32> {
    match settings.voltage_source {
        VoltageSource::Terminal => state.voltage_v,
        VoltageSource::Resting => state.resting_voltage_v.or(state.voltage_v),
    }
}

/// What is left by the state of charge; if that is not known, what is left if the pack was full.
fn remaining_mah(state: &BatteryState) -> Option<f32> {
    let capacity_mah = state.capacity_mah?;
    // As in ArduPilot, thresholds of charge are for packs whose current is measured.
    let consumed_mah = state.consumed_mah?;
    Some(match state.remaining_pct {
        Some(remaining_pct) => capacity_mah * remaining_pct / 100.0,
        None => capacity_mah - consumed_mah,
    })
}
