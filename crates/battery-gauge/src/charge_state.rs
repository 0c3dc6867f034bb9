//! The charge state, with hysteresis and debouncing.

use crate::reported::Faults;
use crate::settings::ChargeLimits;
use crate::{ChargeState, FailsafeLevel, LoadState, PackStatus};

/// Hysteresis towards a better state, in percent.
const HYSTERESIS_PCT: f32 = 3.0;

/// Debounce time of a new state, in seconds.
const DEBOUNCE_S: f32 = 3.0;

/// Charging current with the load off, in capacities per hour, or in amperes while the capacity is unknown.
/// Regenerative braking is not charging.
const CHARGING_RATE_PER_H: f32 = 0.02;
const AH_PER_MAH: f32 = 0.001;
const CHARGING_A: f32 = 0.1;

/// Share of that current down to which charging goes on: a charger lowers it at the end.
const CHARGING_HYSTERESIS: f32 = 0.5;

/// The inputs of the charge state.
#[derive(Clone, Copy, Debug)]
pub struct Inputs {
    pub status: PackStatus,
    pub faults: Faults,
    /// State as reported by the pack.
    pub reported: Option<ChargeState>,
    pub failsafe: FailsafeLevel,
    pub usable_pct: Option<f32>,
    pub remaining_pct: Option<f32>,
    pub limits: ChargeLimits,
    pub load_state: LoadState,
    pub current_a: Option<f32>,
    pub capacity_mah: Option<f32>,
}

/// The charge state of one pack.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChargeStateMachine {
    state: ChargeState,
    /// The states by the usable charge alone, and, where they are bad, by the remaining one, with their hysteresis.
    by_charge: ChargeState,
    by_remaining: ChargeState,
    pending: ChargeState,
    pending_s: f32,
}

impl ChargeStateMachine {
    pub fn update(&mut self, dt_s: f32, inputs: &Inputs) -> ChargeState {
        self.by_charge = by_charge(self.by_charge, inputs.usable_pct, &inputs.limits);
        let wanted = self.wanted(inputs);
        let by_failsafe = by_failsafe(inputs.failsafe);
        if self.state != ChargeState::Charging && needs_debounce(self.state) && wanted >= by_failsafe {
            // The failsafe has debounced already, with its own timer.
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
        // Sensor health and faults are debounced at their source.
        if !(needs_debounce(self.state) && needs_debounce(wanted)) || self.pending_s >= DEBOUNCE_S {
            self.state = wanted;
            self.pending_s = 0.0;
        }
        self.state
    }

    /// Whether a better state is entered if it lasts.
    pub fn is_improving(&self, inputs: &Inputs) -> bool {
        self.wanted(inputs) < self.state
    }

    /// The state by what remains, if the reserve makes it worse: LOW at least.
    pub fn without_reserve(&mut self, inputs: &Inputs) -> Option<ChargeState> {
        if !matches!(self.state, ChargeState::Critical | ChargeState::Emergency) {
            self.by_remaining = ChargeState::Undefined;
            return None;
        }
        self.by_remaining = by_charge(self.by_remaining, inputs.remaining_pct, &inputs.limits);
        let by_level = self.by_remaining.max(worst_level(inputs)).max(ChargeState::Low);
        (self.state > by_level).then_some(by_level)
    }

    fn wanted(&self, inputs: &Inputs) -> ChargeState {
        match inputs.status {
            PackStatus::Disabled | PackStatus::Unknown | PackStatus::NotConnected => {
                return ChargeState::Undefined;
            }
            PackStatus::Unhealthy => return ChargeState::Unhealthy,
            PackStatus::Healthy => {}
        }
        let by_condition = by_condition(inputs);
        if is_charging(inputs, self.state) {
            return by_condition.unwrap_or(ChargeState::Charging);
        }
        let by_level = self.by_charge.max(worst_level(inputs));
        if by_level > ChargeState::Ok {
            // Never hidden by a fault: the driver has to know what is left.
            return by_level;
        }
        let is_reported = inputs.reported == Some(ChargeState::Charging);
        by_condition
            .or(is_reported.then_some(ChargeState::Charging))
            .unwrap_or(ChargeState::Ok)
    }
}

/// FAILED or UNHEALTHY, by the faults found here and the state that the pack reports. Faults that it reports change
/// nothing.
fn by_condition(inputs: &Inputs) -> Option<ChargeState> {
    let is_reported = |state| inputs.reported == Some(state);
    if inputs.faults.intersects(Faults::FAILING) || is_reported(ChargeState::Failed) {
        Some(ChargeState::Failed)
    } else if inputs.faults.intersects(Faults::UNFIT) || is_reported(ChargeState::Unhealthy) {
        Some(ChargeState::Unhealthy)
    } else {
        None
    }
}

/// The minimum charge state, whatever the charge.
fn worst_level(inputs: &Inputs) -> ChargeState {
    by_failsafe(inputs.failsafe)
        .max(reported_level(inputs.reported))
        .max(by_deep_discharge(inputs.faults))
}

/// The minimum charge state by what the pack reports.
fn reported_level(reported: Option<ChargeState>) -> ChargeState {
    match reported {
        Some(state @ (ChargeState::Low | ChargeState::Critical | ChargeState::Emergency)) => state,
        _ => ChargeState::Ok,
    }
}

fn by_deep_discharge(faults: Faults) -> ChargeState {
    if faults.contains(Faults::DEEP_DISCHARGE) {
        ChargeState::Emergency
    } else {
        ChargeState::Ok
    }
}

/// The minimum charge state at a failsafe level.
pub fn by_failsafe(level: FailsafeLevel) -> ChargeState {
    match level {
        FailsafeLevel::None | FailsafeLevel::Unhealthy => ChargeState::Ok,
        FailsafeLevel::Low => ChargeState::Low,
        FailsafeLevel::Critical => ChargeState::Critical,
    }
}

/// Whether a state depends on a value that may flap about a threshold.
fn needs_debounce(state: ChargeState) -> bool {
    match state {
        ChargeState::Undefined | ChargeState::Unhealthy | ChargeState::Failed => false,
        ChargeState::Ok
        | ChargeState::Low
        | ChargeState::Critical
        | ChargeState::Emergency
        | ChargeState::Charging => true,
    }
}

fn by_charge(before: ChargeState, remaining_pct: Option<f32>, limits: &ChargeLimits) -> ChargeState {
    let Some(remaining_pct) = remaining_pct else {
        // An unknown charge does not end a low state.
        return before.max(ChargeState::Ok);
    };
    let worst = |remaining_pct: f32| {
        let is_below = |limit_pct: Option<f32>| limit_pct.is_some_and(|limit_pct| remaining_pct < limit_pct);
        if is_below(limits.emergency_pct) {
            ChargeState::Emergency
        } else if is_below(limits.critical_pct) {
            ChargeState::Critical
        } else if is_below(limits.low_pct) {
            ChargeState::Low
        } else {
            ChargeState::Ok
        }
    };
    // Worsens at the threshold, improves only above it by the hysteresis.
    before
        .max(worst(remaining_pct))
        .min(worst(remaining_pct - HYSTERESIS_PCT))
}

fn is_charging(inputs: &Inputs, before: ChargeState) -> bool {
    let (LoadState::Off, Some(current_a)) = (inputs.load_state, inputs.current_a) else {
        return false;
    };
    if current_a.is_sign_positive() {
        return false;
    }
    let begins_at_a = inputs.capacity_mah.map_or(CHARGING_A, |capacity_mah| {
        CHARGING_RATE_PER_H * AH_PER_MAH * capacity_mah
    });
    let threshold_a = match before {
        ChargeState::Charging => CHARGING_HYSTERESIS * begins_at_a,
        _ => begins_at_a,
    };
    current_a < -threshold_a
}

#[cfg(test)]
mod tests {
    use super::*;

    fn healthy(remaining_pct: f32) -> Inputs {
        Inputs {
            status: PackStatus::Healthy,
            faults: Faults::empty(),
            reported: None,
            failsafe: FailsafeLevel::None,
            usable_pct: Some(remaining_pct),
            remaining_pct: Some(remaining_pct),
            limits: ChargeLimits {
                low_pct: Some(15.0),
                critical_pct: Some(7.0),
                emergency_pct: Some(5.0),
            },
            load_state: LoadState::Off,
            current_a: Some(0.1),
            capacity_mah: Some(2200.0),
        }
    }

    fn after(machine: &mut ChargeStateMachine, seconds: f32, inputs: &Inputs) -> ChargeState {
        let mut state = machine.state;
        for _ in 0..(seconds * 10.0) as u32 {
            state = machine.update(0.1, inputs);
        }
        state
    }

    #[test]
    // Requirement: PX-3
    fn state_has_hysteresis_at_each_threshold() {
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
    fn charge_flapping_at_a_threshold_changes_state_once() {
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
    fn only_a_charger_counts_as_charging_not_braking() {
        let mut machine = ChargeStateMachine::default();
        let charging = Inputs {
            current_a: Some(-1.0),
            ..healthy(50.0)
        };
        after(&mut machine, 1.0, &healthy(50.0));
        assert_eq!(after(&mut machine, 1.0, &charging), ChargeState::Ok);
        assert_eq!(after(&mut machine, 4.0, &charging), ChargeState::Charging);
        let driving = Inputs {
            load_state: LoadState::On,
            ..charging
        };
        assert_eq!(after(&mut machine, 4.0, &driving), ChargeState::Ok);
    }

    #[test]
    fn charging_goes_on_while_the_charger_lowers_the_current() {
        let mut machine = ChargeStateMachine::default();
        let charged_by = |amperes: f32| Inputs {
            current_a: Some(-amperes),
            ..healthy(50.0)
        };
        after(&mut machine, 4.0, &charged_by(0.05));
        assert_eq!(machine.state, ChargeState::Charging);
        assert_eq!(
            after(&mut machine, 10.0, &charged_by(0.03)),
            ChargeState::Charging
        );
        assert_eq!(after(&mut machine, 4.0, &charged_by(0.02)), ChargeState::Ok);
        assert_eq!(after(&mut machine, 10.0, &charged_by(0.03)), ChargeState::Ok);
    }

    #[test]
    // Requirement: AP-23
    fn a_limit_of_zero_disables_its_state() {
        let mut machine = ChargeStateMachine::default();
        let inputs = Inputs {
            limits: ChargeLimits {
                critical_pct: Some(7.0),
                ..ChargeLimits::default()
            },
            ..healthy(3.0)
        };
        assert_eq!(after(&mut machine, 4.0, &inputs), ChargeState::Critical);
        let none = Inputs {
            limits: ChargeLimits::default(),
            ..inputs
        };
        assert_eq!(after(&mut machine, 4.0, &none), ChargeState::Ok);
    }

    #[test]
    fn failed_sensor_and_failed_cell_take_effect_at_once() {
        let mut machine = ChargeStateMachine::default();
        after(&mut machine, 1.0, &healthy(50.0));
        let unhealthy = Inputs {
            status: PackStatus::Unhealthy,
            ..healthy(50.0)
        };
        assert_eq!(machine.update(0.1, &unhealthy), ChargeState::Unhealthy);
        let failed = Inputs {
            faults: Faults::CELL_FAIL,
            ..healthy(50.0)
        };
        assert_eq!(machine.update(0.1, &failed), ChargeState::Failed);
    }

    #[test]
    fn failsafe_level_takes_effect_at_once() {
        let mut machine = ChargeStateMachine::default();
        after(&mut machine, 1.0, &healthy(50.0));
        for (failsafe, expected) in [
            (FailsafeLevel::Low, ChargeState::Low),
            (FailsafeLevel::Critical, ChargeState::Critical),
        ] {
            let inputs = Inputs {
                failsafe,
                ..healthy(50.0)
            };
            assert_eq!(machine.update(0.1, &inputs), expected);
        }
        // After a battery reset.
        assert_eq!(after(&mut machine, 4.0, &healthy(50.0)), ChargeState::Ok);
    }

    #[test]
    fn faults_never_hide_that_a_pack_is_low_critical_or_nearly_empty() {
        for (remaining_pct, expected) in [
            (14.0, ChargeState::Low),
            (6.5, ChargeState::Critical),
            (4.0, ChargeState::Emergency),
        ] {
            for faults in Faults::all() {
                let inputs = Inputs {
                    faults: faults - Faults::DEEP_DISCHARGE,
                    ..healthy(remaining_pct)
                };
                let mut machine = ChargeStateMachine::default();
                assert_eq!(after(&mut machine, 4.0, &inputs), expected, "{faults:?}");
            }
        }
    }

    #[test]
    fn which_faults_change_the_charge_state_of_a_full_pack() {
        for fault in Faults::all() {
            let expected = match fault {
                Faults::CELL_FAIL => ChargeState::Failed,
                Faults::DEEP_DISCHARGE => ChargeState::Emergency,
                Faults::CELLS_CONFIGURATION | Faults::OVER_TEMPERATURE => ChargeState::Unhealthy,
                _ => ChargeState::Ok,
            };
            let inputs = Inputs {
                faults: fault,
                ..healthy(90.0)
            };
            let mut machine = ChargeStateMachine::default();
            assert_eq!(after(&mut machine, 4.0, &inputs), expected, "{fault:?}");
        }
    }

    #[test]
    fn a_reported_state_is_the_worse_of_both() {
        use ChargeState::{Charging, Critical, Emergency, Failed, Low, Ok, Undefined, Unhealthy};
        for (reported, at_90_pct, at_14_pct) in [
            (Undefined, Ok, Low),
            (Ok, Ok, Low),
            (Low, Low, Low),
            (Critical, Critical, Critical),
            (Emergency, Emergency, Emergency),
            (Failed, Failed, Low),
            (Unhealthy, Unhealthy, Low),
            (Charging, Charging, Low),
        ] {
            for (remaining_pct, expected) in [(90.0, at_90_pct), (14.0, at_14_pct)] {
                let inputs = Inputs {
                    reported: Some(reported),
                    ..healthy(remaining_pct)
                };
                let mut machine = ChargeStateMachine::default();
                assert_eq!(after(&mut machine, 4.0, &inputs), expected, "{reported:?}");
            }
        }
    }

    #[test]
    // Requirement: PX-3
    fn what_only_the_reserve_makes_worse_is_low() {
        for (usable_pct, remaining_pct, expected) in [
            (0.0, 60.0, Some(ChargeState::Low)),
            (6.0, 60.0, Some(ChargeState::Low)),
            (10.0, 60.0, None),
            (0.0, 6.0, Some(ChargeState::Critical)),
            (0.0, 4.0, None),
        ] {
            let mut machine = ChargeStateMachine::default();
            let inputs = Inputs {
                usable_pct: Some(usable_pct),
                ..healthy(remaining_pct)
            };
            after(&mut machine, 4.0, &inputs);
            assert_eq!(
                machine.without_reserve(&inputs),
                expected,
                "{usable_pct} % of {remaining_pct} %"
            );
        }
        let mut machine = ChargeStateMachine::default();
        let reported = Inputs {
            usable_pct: Some(0.0),
            reported: Some(ChargeState::Emergency),
            ..healthy(60.0)
        };
        after(&mut machine, 4.0, &reported);
        assert_eq!(machine.without_reserve(&reported), None);
    }

    #[test]
    fn unknown_charge_is_not_low() {
        let mut machine = ChargeStateMachine::default();
        let unknown = Inputs {
            usable_pct: None,
            remaining_pct: None,
            ..healthy(0.0)
        };
        assert_eq!(after(&mut machine, 1.0, &unknown), ChargeState::Ok);
        // Nor does it end a low state.
        after(&mut machine, 4.0, &healthy(10.0));
        assert_eq!(after(&mut machine, 10.0, &unknown), ChargeState::Low);
        let nothing = Inputs {
            status: PackStatus::NotConnected,
            ..unknown
        };
        assert_eq!(machine.update(0.1, &nothing), ChargeState::Undefined);
    }
}
