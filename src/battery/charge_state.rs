//! How much is left, in steps.

use super::failsafe::ArmState;
use super::faults::Faults;
use super::{ChargeState, FailsafeLevel, PackStatus};

/// Below so many percent a pack is low, critical, an emergency: PX4's `BAT_LOW_THR`, `BAT_CRIT_THR`, `BAT_EMERGEN_THR`.
const LOW_PCT: f32 = 15.0;
const CRITICAL_PCT: f32 = 7.0;
const EMERGENCY_PCT: f32 = 5.0;

/// A better state needs so much more, in percent.
const HYSTERESIS_PCT: f32 = 3.0;

/// A new state has to last before it is told, in seconds: neither a spike nor the end of a climb makes it flap.
const SETTLING_S: f32 = 3.0;

/// A pack of a disarmed rover is being charged when this share of its capacity flows in per hour, or this current, in
/// amperes, while the capacity is not known. What braking motors return is no charging.
const CHARGING_RATE_PER_H: f32 = 0.02;
const CHARGING_A: f32 = 0.1;

/// What the charge state follows from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Signs {
    pub status: PackStatus,
    pub faults: Faults,
    pub failsafe: FailsafeLevel,
    pub remaining_pct: Option<f32>,
    pub arm_state: ArmState,
    pub current_a: Option<f32>,
    pub capacity_mah: Option<f32>,
}

/// Follows the signs with hysteresis.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ChargeStateMachine {
    state: ChargeState,
    /// The state by the remaining charge alone.
    by_charge: ChargeState,
    pending: ChargeState,
    pending_s: f32,
}

impl ChargeStateMachine {
    pub fn update(&mut self, dt_s: f32, signs: &Signs) -> ChargeState {
        self.by_charge = by_charge(self.by_charge, signs.remaining_pct);
        let wanted = self.wanted(signs);
        let by_failsafe = by_failsafe(signs.failsafe);
        if self.state != ChargeState::Charging && can_hover(self.state) && wanted >= by_failsafe {
            // It has had a timer of its own.
            self.state = self.state.max(by_failsafe);
        }
        if wanted == self.state {
            self.pending_s = 0.0;
            return self.state;
        }
        if wanted != self.pending {
            self.pending = wanted;
            self.pending_s = 0.0;
        } else {
            self.pending_s += dt_s;
        }
        // Sensors and faults have settled already.
        if !(can_hover(self.state) && can_hover(wanted)) || self.pending_s >= SETTLING_S {
            self.state = wanted;
            self.pending_s = 0.0;
        }
        self.state
    }

    fn wanted(&self, signs: &Signs) -> ChargeState {
        match signs.status {
            PackStatus::Disabled | PackStatus::Unknown | PackStatus::NotConnected => {
                return ChargeState::Undefined;
            }
            PackStatus::Unhealthy => return ChargeState::Unhealthy,
            PackStatus::Healthy => {}
        }
        if signs.faults.contains(Faults::CELL_FAIL) {
            return ChargeState::Failed;
        }
        if signs
            .faults
            .intersects(Faults::INCOMPATIBLE_VOLTAGE | Faults::OVER_TEMPERATURE | Faults::SPIKES)
        {
            return ChargeState::Unhealthy;
        }
        if is_charging(signs) {
            return ChargeState::Charging;
        }
        let by_faults = if signs.faults.contains(Faults::DEEP_DISCHARGE) {
            ChargeState::Emergency
        } else {
            ChargeState::Ok
        };
        self.by_charge.max(by_failsafe(signs.failsafe)).max(by_faults)
    }
}

/// A pack is at least as low as its failsafe level says.
fn by_failsafe(level: FailsafeLevel) -> ChargeState {
    match level {
        FailsafeLevel::None | FailsafeLevel::Unhealthy => ChargeState::Ok,
        FailsafeLevel::Low => ChargeState::Low,
        FailsafeLevel::Critical => ChargeState::Critical,
    }
}

/// Whether a state follows from a value that may hover about a threshold.
fn can_hover(state: ChargeState) -> bool {
    match state {
        ChargeState::Undefined | ChargeState::Unhealthy | ChargeState::Failed => false,
        ChargeState::Ok
        | ChargeState::Low
        | ChargeState::Critical
        | ChargeState::Emergency
        | ChargeState::Charging => true,
    }
}

fn by_charge(before: ChargeState, remaining_pct: Option<f32>) -> ChargeState {
    let Some(remaining_pct) = remaining_pct else {
        // A pack that was low has not become fuller by being unknown.
        return before.max(ChargeState::Ok);
    };
    let worst = |margin_pct: f32| {
        if remaining_pct < EMERGENCY_PCT + margin_pct {
            ChargeState::Emergency
        } else if remaining_pct < CRITICAL_PCT + margin_pct {
            ChargeState::Critical
        } else if remaining_pct < LOW_PCT + margin_pct {
            ChargeState::Low
        } else {
            ChargeState::Ok
        }
    };
    // Worse at the thresholds, better only above them by the hysteresis.
    before.min(worst(HYSTERESIS_PCT)).max(worst(0.0))
}

fn is_charging(signs: &Signs) -> bool {
    let threshold_a = signs.capacity_mah.map_or(CHARGING_A, |capacity_mah| {
        CHARGING_RATE_PER_H * capacity_mah / 1000.0
    });
    signs.arm_state == ArmState::Disarmed && signs.current_a.is_some_and(|current_a| current_a < -threshold_a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn healthy(remaining_pct: f32) -> Signs {
        Signs {
            status: PackStatus::Healthy,
            faults: Faults::empty(),
            failsafe: FailsafeLevel::None,
            remaining_pct: Some(remaining_pct),
            arm_state: ArmState::Disarmed,
            current_a: Some(0.1),
            capacity_mah: Some(2200.0),
        }
    }

    fn after(machine: &mut ChargeStateMachine, seconds: f32, signs: &Signs) -> ChargeState {
        let mut state = machine.state;
        for _ in 0..(seconds * 10.0) as u32 {
            state = machine.update(0.1, signs);
        }
        state
    }

    #[test]
    fn it_falls_at_the_thresholds_and_rises_only_well_above_them() {
        let mut machine = ChargeStateMachine::default();
        for (remaining_pct, expected) in [
            (50.0, ChargeState::Ok),
            (14.9, ChargeState::Low),
            (15.1, ChargeState::Low),
            (17.9, ChargeState::Low),
            (6.9, ChargeState::Critical),
            (9.9, ChargeState::Critical),
            (4.9, ChargeState::Emergency),
            (7.9, ChargeState::Emergency),
            (8.1, ChargeState::Critical),
            (10.1, ChargeState::Low),
            (18.1, ChargeState::Ok),
        ] {
            assert_eq!(
                after(&mut machine, 4.0, &healthy(remaining_pct)),
                expected,
                "{remaining_pct} %"
            );
        }
    }

    #[test]
    fn a_charge_that_hovers_at_a_threshold_changes_it_once() {
        let mut machine = ChargeStateMachine::default();
        let mut changes = 0;
        let mut before = ChargeState::Undefined;
        for tick in 0..6000 {
            let state = machine.update(0.1, &healthy(if tick % 7 < 3 { 14.0 } else { 16.0 }));
            changes += u32::from(state != before);
            before = state;
        }
        assert!(changes <= 2, "{changes} changes");
    }

    #[test]
    fn braking_is_no_charging_but_a_charger_is() {
        let mut machine = ChargeStateMachine::default();
        let charging = Signs {
            current_a: Some(-1.0),
            ..healthy(50.0)
        };
        after(&mut machine, 1.0, &healthy(50.0));
        assert_eq!(after(&mut machine, 1.0, &charging), ChargeState::Ok);
        assert_eq!(after(&mut machine, 4.0, &charging), ChargeState::Charging);
        let driving = Signs {
            arm_state: ArmState::Armed,
            ..charging
        };
        assert_eq!(after(&mut machine, 4.0, &driving), ChargeState::Ok);
    }

    #[test]
    fn a_failed_sensor_and_a_failed_cell_are_told_at_once() {
        let mut machine = ChargeStateMachine::default();
        after(&mut machine, 1.0, &healthy(50.0));
        let unhealthy = Signs {
            status: PackStatus::Unhealthy,
            ..healthy(50.0)
        };
        assert_eq!(machine.update(0.1, &unhealthy), ChargeState::Unhealthy);
        let failed = Signs {
            faults: Faults::CELL_FAIL,
            ..healthy(50.0)
        };
        assert_eq!(machine.update(0.1, &failed), ChargeState::Failed);
    }

    #[test]
    fn a_failsafe_level_is_told_in_the_tick_that_reaches_it() {
        let mut machine = ChargeStateMachine::default();
        after(&mut machine, 1.0, &healthy(50.0));
        for (failsafe, expected) in [
            (FailsafeLevel::Low, ChargeState::Low),
            (FailsafeLevel::Critical, ChargeState::Critical),
        ] {
            let signs = Signs {
                failsafe,
                ..healthy(50.0)
            };
            assert_eq!(machine.update(0.1, &signs), expected);
        }
        // The battery was reset.
        assert_eq!(after(&mut machine, 4.0, &healthy(50.0)), ChargeState::Ok);
    }

    #[test]
    fn what_is_not_known_is_not_called_low() {
        let mut machine = ChargeStateMachine::default();
        let unknown = Signs {
            remaining_pct: None,
            ..healthy(0.0)
        };
        assert_eq!(after(&mut machine, 1.0, &unknown), ChargeState::Ok);
        // Nor does a low pack become a full one by being unknown.
        after(&mut machine, 4.0, &healthy(10.0));
        assert_eq!(after(&mut machine, 10.0, &unknown), ChargeState::Low);
        let nothing = Signs {
            status: PackStatus::NotConnected,
            ..unknown
        };
        assert_eq!(machine.update(0.1, &nothing), ChargeState::Undefined);
    }
}
