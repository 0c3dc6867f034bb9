//! The charge state, with hysteresis and debouncing.

use crate::reported::Faults;
use crate::settings::ChargeLimits;
use crate::{BatteryState, ChargeState, FailsafeLevel, LoadState, PackStatus};

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
    /// Takes one tick's state, with its faults and failsafe level. Returns the charge state.
    pub fn update(
        &mut self,
        dt_s: f32,
        load_state: LoadState,
        battery: &BatteryState,
        limits: &ChargeLimits,
    ) -> ChargeState {
        self.by_charge = by_charge(self.by_charge, battery.readings.usable_pct, limits);
        let wanted = self.wanted(load_state, battery);
        let by_failsafe = by_failsafe(battery.failsafe);
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
    pub fn is_improving(&self, load_state: LoadState, battery: &BatteryState) -> bool {
        self.wanted(load_state, battery) < self.state
    }

    /// The state by what remains, if the reserve makes it worse: LOW at least.
    pub fn without_reserve(&mut self, battery: &BatteryState, limits: &ChargeLimits) -> Option<ChargeState> {
        if !matches!(self.state, ChargeState::Critical | ChargeState::Emergency) {
            self.by_remaining = ChargeState::Undefined;
            return None;
        }
        self.by_remaining = by_charge(self.by_remaining, battery.readings.remaining_pct, limits);
        let by_level = self.by_remaining.max(worst_level(battery)).max(ChargeState::Low);
        (self.state > by_level).then_some(by_level)
    }

    fn wanted(&self, load_state: LoadState, battery: &BatteryState) -> ChargeState {
        match battery.status {
            PackStatus::Disabled | PackStatus::Unknown | PackStatus::NotConnected => {
                return ChargeState::Undefined;
            }
            PackStatus::Unhealthy => return ChargeState::Unhealthy,
            PackStatus::Healthy => {}
        }
        let by_condition = by_condition(battery);
        if is_charging(self.state, load_state, battery) {
            return by_condition.unwrap_or(ChargeState::Charging);
        }
        let by_level = self.by_charge.max(worst_level(battery));
        if by_level > ChargeState::Ok {
            // Never hidden by a fault: the driver has to know what is left.
            return by_level;
        }
        let is_reported = battery.readings.reported.charge_state == Some(ChargeState::Charging);
        by_condition
            .or(is_reported.then_some(ChargeState::Charging))
            .unwrap_or(ChargeState::Ok)
    }
}

/// FAILED or UNHEALTHY, by the faults found here and the state that the pack reports. Faults that it reports change
/// nothing.
fn by_condition(battery: &BatteryState) -> Option<ChargeState> {
    let faults = battery.readings.faults;
    let is_reported = |state| battery.readings.reported.charge_state == Some(state);
    if faults.intersects(Faults::FAILING) || is_reported(ChargeState::Failed) {
        Some(ChargeState::Failed)
    } else if faults.intersects(Faults::UNFIT) || is_reported(ChargeState::Unhealthy) {
        Some(ChargeState::Unhealthy)
    } else {
        None
    }
}

/// The minimum charge state, whatever the charge.
fn worst_level(battery: &BatteryState) -> ChargeState {
    by_failsafe(battery.failsafe)
        .max(reported_level(battery.readings.reported.charge_state))
        .max(by_deep_discharge(battery.readings.faults))
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

fn is_charging(before: ChargeState, load_state: LoadState, battery: &BatteryState) -> bool {
    let (LoadState::Off, Some(current_a)) = (load_state, battery.readings.current_a) else {
        return false;
    };
    if current_a.is_sign_positive() {
        return false;
    }
    let begins_at_a = battery.capacity_mah().map_or(CHARGING_A, |capacity_mah| {
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
    use crate::Amount;

    const LIMITS: ChargeLimits = ChargeLimits {
        low_pct: Some(15.0),
        critical_pct: Some(7.0),
        emergency_pct: Some(5.0),
    };

    /// A pack of 2200 mAh with this charge.
    fn healthy(remaining_pct: f32) -> BatteryState {
        let mut battery = BatteryState::UNKNOWN;
        battery.status = PackStatus::Healthy;
        battery.capacity = Some(Amount::Mah(2200.0));
        battery.readings.usable_pct = Some(remaining_pct);
        battery.readings.remaining_pct = Some(remaining_pct);
        battery.readings.current_a = Some(0.1);
        battery
    }

    /// This pack after `change`.
    fn with(mut battery: BatteryState, change: impl Fn(&mut BatteryState)) -> BatteryState {
        change(&mut battery);
        battery
    }

    fn update(machine: &mut ChargeStateMachine, battery: &BatteryState) -> ChargeState {
        machine.update(0.1, LoadState::Off, battery, &LIMITS)
    }

    /// The state after `seconds` with the load off.
    fn after(machine: &mut ChargeStateMachine, seconds: f32, battery: &BatteryState) -> ChargeState {
        let mut state = machine.state;
        for _ in 0..(seconds * 10.0) as u32 {
            state = update(machine, battery);
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
    fn only_a_charger_counts_as_charging_until_its_current_has_fallen() {
        let mut machine = ChargeStateMachine::default();
        for (ticks, load_state, current_a, expected) in [
            (10, LoadState::Off, 0.1, ChargeState::Ok),
            (10, LoadState::Off, -0.05, ChargeState::Ok),
            (40, LoadState::Off, -0.05, ChargeState::Charging),
            (100, LoadState::Off, -0.03, ChargeState::Charging),
            (40, LoadState::Off, -0.02, ChargeState::Ok),
            (100, LoadState::Off, -0.03, ChargeState::Ok),
            (40, LoadState::Off, -1.0, ChargeState::Charging),
            // Braking.
            (40, LoadState::On, -1.0, ChargeState::Ok),
            (100, LoadState::On, -1.0, ChargeState::Ok),
        ] {
            let battery = with(healthy(50.0), |battery| {
                battery.readings.current_a = Some(current_a)
            });
            for _ in 0..ticks {
                machine.update(0.1, load_state, &battery, &LIMITS);
            }
            assert_eq!(machine.state, expected, "{current_a} A {load_state:?}");
        }
    }

    #[test]
    // Requirement: AP-23
    fn a_limit_of_zero_disables_its_state() {
        let mut machine = ChargeStateMachine::default();
        let mut after = |limits: &ChargeLimits| {
            for _ in 0..40 {
                machine.update(0.1, LoadState::Off, &healthy(3.0), limits);
            }
            machine.state
        };
        let only_critical = ChargeLimits {
            critical_pct: Some(7.0),
            ..ChargeLimits::default()
        };
        assert_eq!(after(&only_critical), ChargeState::Critical);
        assert_eq!(after(&ChargeLimits::default()), ChargeState::Ok);
    }

    #[test]
    fn a_failed_sensor_a_failed_cell_and_a_failsafe_take_effect_at_once() {
        let mut machine = ChargeStateMachine::default();
        type Change = fn(&mut BatteryState);
        let changes: [(Change, ChargeState); 4] = [
            (|battery| battery.failsafe = FailsafeLevel::Low, ChargeState::Low),
            (
                |battery| battery.failsafe = FailsafeLevel::Critical,
                ChargeState::Critical,
            ),
            (
                |battery| battery.status = PackStatus::Unhealthy,
                ChargeState::Unhealthy,
            ),
            (
                |battery| battery.readings.faults = Faults::CELL_FAIL,
                ChargeState::Failed,
            ),
        ];
        for (change, expected) in changes {
            // After a battery reset, too.
            assert_eq!(after(&mut machine, 4.0, &healthy(50.0)), ChargeState::Ok);
            assert_eq!(update(&mut machine, &with(healthy(50.0), change)), expected);
        }
    }

    #[test]
    fn which_faults_change_the_charge_state_of_a_full_pack_and_none_hides_a_low_one() {
        for fault in Faults::all() {
            let of_full = match fault {
                Faults::CELL_FAIL => ChargeState::Failed,
                Faults::CELLS_CONFIGURATION | Faults::OVER_TEMPERATURE => ChargeState::Unhealthy,
                _ => ChargeState::Ok,
            };
            for (remaining_pct, of_charge) in [
                (90.0, of_full),
                (14.0, ChargeState::Low),
                (6.5, ChargeState::Critical),
                (4.0, ChargeState::Emergency),
            ] {
                let expected = match fault {
                    Faults::DEEP_DISCHARGE => ChargeState::Emergency,
                    _ => of_charge,
                };
                let battery = with(healthy(remaining_pct), |battery| battery.readings.faults = fault);
                let mut machine = ChargeStateMachine::default();
                assert_eq!(
                    after(&mut machine, 4.0, &battery),
                    expected,
                    "{fault:?} at {remaining_pct} %"
                );
            }
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
                let battery = with(healthy(remaining_pct), |battery| {
                    battery.readings.reported.charge_state = Some(reported);
                });
                let mut machine = ChargeStateMachine::default();
                assert_eq!(after(&mut machine, 4.0, &battery), expected, "{reported:?}");
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
            let battery = with(healthy(remaining_pct), |battery| {
                battery.readings.usable_pct = Some(usable_pct);
            });
            after(&mut machine, 4.0, &battery);
            assert_eq!(
                machine.without_reserve(&battery, &LIMITS),
                expected,
                "{usable_pct} % of {remaining_pct} %"
            );
        }
        let mut machine = ChargeStateMachine::default();
        let reported = with(healthy(60.0), |battery| {
            battery.readings.usable_pct = Some(0.0);
            battery.readings.reported.charge_state = Some(ChargeState::Emergency);
        });
        after(&mut machine, 4.0, &reported);
        assert_eq!(machine.without_reserve(&reported, &LIMITS), None);
    }

    #[test]
    fn unknown_charge_is_not_low() {
        let mut machine = ChargeStateMachine::default();
        let unknown = with(healthy(0.0), |battery| {
            battery.readings.usable_pct = None;
            battery.readings.remaining_pct = None;
        });
        assert_eq!(after(&mut machine, 1.0, &unknown), ChargeState::Ok);
        // Nor does it end a low state.
        after(&mut machine, 4.0, &healthy(10.0));
        assert_eq!(after(&mut machine, 10.0, &unknown), ChargeState::Low);
        let nothing = with(unknown, |battery| battery.status = PackStatus::NotConnected);
        assert_eq!(update(&mut machine, &nothing), ChargeState::Undefined);
    }
}
