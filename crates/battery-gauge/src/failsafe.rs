//! The battery failsafe: its levels, thresholds and timers.

use core::mem;

use crate::basis::Basis;
use crate::settings::{FailsafeSettings, Thresholds};
use crate::swap::Replacement;
use crate::time::Instant;
use crate::{
    BatteryState, ChargeSource, ChargeState, FailsafeLevel, FailsafeTimer, FailsafeTimers, Faults, LoadState,
    MissingSetting,
};

/// A pack without a healthy reading for longer is unhealthy, in microseconds: ArduPilot's 5 s.
const UNHEALTHY_AFTER_US: u64 = 5_000_000;

/// After healthy readings for this long, in microseconds, the next loss acts again, and *unhealthy* may be released.
const HEALTHY_AGAIN_US: u32 = 5_000_000;

/// A pack that has reported FAILED or UNHEALTHY for longer is unhealthy, in microseconds: as one that is lost.
const REPORTED_FOR_US: u32 = 5_000_000;

/// The levels that are reached in one tick, in increasing severity: *critical* carries *low* if it skips it.
pub type ReachedLevels = heapless::Vec<FailsafeLevel, 3>;

/// The failsafe level of a pack. It latches: it only rises until a battery reset, or until another pack disproves it.
/// *Unhealthy* alone is released once readings, and what the pack reports of itself, are good again.
#[derive(Clone, Copy, Debug, Default)]
pub struct Failsafe {
    level: FailsafeLevel,
    /// The previous pack reached the level; the present one has neither been under load nor lost contact since the swap.
    is_of_pack_before: bool,
    /// The loss of the pack was reported, and it has not been healthy for long enough since.
    has_reported_loss: bool,
    /// The pack reports FAILED or UNHEALTHY; for how long it has reported that or not, in microseconds (saturating).
    reports_unfit: bool,
    reported_us: u32,
    /// *Unhealthy* was reached by that report, and the pack has not reported better for long enough since.
    has_acted_on_report: bool,
    percentages: PercentageCheck,
    /// Time with healthy readings, in microseconds (saturating).
    healthy_us: u32,
    low: Watch,
    critical: Watch,
}

/// Observation of the thresholds of one level.
#[derive(Clone, Copy, Debug, Default)]
struct Watch {
    voltage: Timer,
    usable: Timer,
    /// This pack has reached the level, since the last battery reset.
    is_reached: bool,
    /// The timer as others see it.
    shown: FailsafeTimer,
}

/// A value that has been below its threshold for this long still counts as below while unknown, in microseconds. A
/// breaking wire passes through any voltage, but faster.
const HOLD_WHILE_UNKNOWN_US: u32 = 1_000_000;

/// By how much the charge that may remain can exceed a percentage that acts, in percent: an estimate that is less certain
/// never ends a drive.
const MOST_ABOVE_PCT: f32 = 20.0;

/// A percentage that has been passed and does not act for this long after its timer is reported, in microseconds.
const LATE_US: u32 = 60_000_000;

/// A charge that has been unknown for this long is not awaited any more, in microseconds: a load may begin before the
/// first estimate.
const ESTIMATED_WITHIN_US: u32 = 3_000_000;

/// Whether percentages that can't act were reported since arming.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PercentageCheck {
    /// They are checked at arming. For how long the charge has been unknown, in microseconds (saturating).
    AtArming(u32),
    /// They could act at arming.
    WhenPassed,
    Reported,
}

impl Default for PercentageCheck {
    fn default() -> Self {
        Self::AtArming(0)
    }
}

/// Time below a threshold.
#[derive(Clone, Copy, Debug, Default)]
struct Timer {
    below_us: Option<u32>,
}

/// Comparison of a value with a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Comparison {
    Unknown,
    Below,
    NotBelow,
}

impl Comparison {
    /// No value is below a threshold that is off.
    fn of(value: Option<f32>, threshold: Option<f32>) -> Self {
        match (value, threshold) {
            (_, None) => Self::NotBelow,
            (None, Some(_)) => Self::Unknown,
            (Some(value), Some(threshold)) if value < threshold => Self::Below,
            (Some(_), Some(_)) => Self::NotBelow,
        }
    }
}

/// The values of one tick that are compared with the thresholds. All are unknown in a tick without a reading.
#[derive(Clone, Copy, Debug, Default)]
struct Values<'a> {
    state: Option<&'a BatteryState>,
    voltage_v: Option<f32>,
    remaining_mah: Option<f32>,
    usable_pct: Option<f32>,
}

impl<'a> Values<'a> {
    fn of(state: &'a BatteryState, settings: &FailsafeSettings) -> Self {
        let (low, critical) = (&settings.low, &settings.critical);
        // Without a threshold its arithmetic is spared.
        let needs_remaining = low.remaining_mah.or(critical.remaining_mah).is_some();
        let needs_usable = low.usable_pct.or(critical.usable_pct).is_some();
        Self {
            state: Some(state),
            voltage_v: settings.compared_voltage_v(state),
            remaining_mah: if needs_remaining {
                most_remaining(state)
            } else {
                None
            },
            usable_pct: if needs_usable {
                credible_usable_pct(state)
            } else {
                None
            },
        }
    }
}

impl Timer {
    /// Whether the value has been below for more than `limit_us`, as far as it is known.
    fn has_lasted(&self, limit_us: u32) -> bool {
        self.below_us.is_some_and(|below_us| below_us > limit_us)
    }

    /// Whether the value has been below for more than `limit_us`. Only a known value starts the timer, lets it expire or
    /// resets it.
    // Inlined, the code would be repeated for each threshold.
    #[inline(never)]
    fn expires(&mut self, dt_us: u32, comparison: Comparison, limit_us: Option<u32>) -> bool {
        self.below_us = match (comparison, self.below_us) {
            (Comparison::NotBelow, _) => None,
            (Comparison::Below, None) => Some(0),
            (Comparison::Unknown, Some(below_us)) if below_us >= HOLD_WHILE_UNKNOWN_US => {
                Some(below_us.saturating_add(dt_us))
            }
            (Comparison::Below, Some(below_us)) => Some(below_us.saturating_add(dt_us)),
            (Comparison::Unknown, before) => before,
        };
        limit_us.is_some_and(|limit_us| self.has_lasted(limit_us)) && comparison == Comparison::Below
    }
}

impl Watch {
    /// Takes one tick's values. Returns whether the level is reached by one of its thresholds, and was not before.
    fn update(
        &mut self,
        dt_us: u32,
        values: &Values<'_>,
        thresholds: &Thresholds,
        limit_us: Option<u32>,
    ) -> bool {
        let by_voltage = Comparison::of(values.voltage_v, thresholds.voltage_v);
        let by_usable = Comparison::of(values.usable_pct, thresholds.usable_pct);
        let voltage_expires = self.voltage.expires(dt_us, by_voltage, limit_us);
        let usable_expires = self.usable.expires(dt_us, by_usable, limit_us);
        if self.is_reached {
            return false;
        }
        // Without LOW_TIMER a percentage acts at once.
        let is_usable_low = usable_expires || limit_us.is_none() && by_usable == Comparison::Below;
        let has_expired = voltage_expires
            || is_usable_low
                && values
                    .state
                    .is_some_and(|state| is_certain(state, thresholds.usable_pct));
        self.is_reached = has_expired || is_below(values.remaining_mah, thresholds.remaining_mah);
        let is_running = limit_us.is_some() && self.voltage.below_us.or(self.usable.below_us).is_some();
        self.shown = match (is_running, has_expired, self.is_reached) {
            (true, true, _) => FailsafeTimer::Expired,
            (true, false, false) => FailsafeTimer::Running,
            _ => FailsafeTimer::Stopped,
        };
        self.is_reached
    }

    /// A higher level is reached, which carries this one. Returns whether it was not reached before.
    fn carry(&mut self) -> bool {
        if self.is_reached {
            return false;
        }
        self.is_reached = true;
        self.shown = FailsafeTimer::Stopped;
        true
    }

    /// The load is off.
    fn stop(&mut self) {
        self.voltage = Timer::default();
        self.usable = Timer::default();
        self.shown = FailsafeTimer::Stopped;
    }
}

impl Failsafe {
    pub fn level(&self) -> FailsafeLevel {
        self.level
    }

    pub fn timers(&self) -> FailsafeTimers {
        FailsafeTimers {
            low: self.low.shown,
            critical: self.critical.shown,
        }
    }

    /// Processes one tick, and returns the levels that are reached. That the pack is unhealthy is also returned at a higher
    /// level: no threshold can be reached from then on.
    pub fn update(
        &mut self,
        basis: &Basis,
        state: &BatteryState,
        settings: &FailsafeSettings,
    ) -> ReachedLevels {
        self.healthy_us = if basis.is_healthy() {
            self.healthy_us.saturating_add(basis.dt_us)
        } else {
            0
        };
        let is_unfit = self.is_unfit_by_report(basis, state);
        if basis.tick.load_state == LoadState::Off {
            // A dip before the load was switched off must not count once it is on again.
            self.low.stop();
            self.critical.stop();
            self.has_reported_loss = false;
            self.has_acted_on_report = false;
            if !matches!(self.percentages, PercentageCheck::AtArming(_)) {
                self.percentages = PercentageCheck::default();
            }
            self.release(basis, state, settings);
            return ReachedLevels::new();
        }
        self.is_of_pack_before = false;
        let is_lost = self.is_lost(basis);
        let [is_low, is_critical] = if is_lost {
            [false; 2]
        } else {
            self.evaluate(basis, state, settings)
        };
        let mut reached = ReachedLevels::new();
        let acts_on_report = is_unfit && !mem::replace(&mut self.has_acted_on_report, true);
        for (is_reached, level) in [
            (is_lost || acts_on_report, FailsafeLevel::Unhealthy),
            (is_low, FailsafeLevel::Low),
            (is_critical, FailsafeLevel::Critical),
        ] {
            if is_reached {
                self.level = self.level.max(level);
                // There is room for each.
                let _ = reached.push(level);
            }
        }
        reached
    }

    /// Looks for a percentage that can't act: by the estimate at arming, or by that of a pack which has been below it for
    /// long. Returns the setting that is missing, unless a threshold in volts acts; once after arming, behind
    /// [`update`](Self::update).
    pub fn find_inert_percentage(
        &mut self,
        basis: &Basis,
        state: &BatteryState,
        settings: &FailsafeSettings,
    ) -> Option<MissingSetting> {
        if !basis.is_fresh {
            return None;
        }
        if let PercentageCheck::AtArming(unknown_us) = &mut self.percentages {
            *unknown_us = match state.readings.usable_pct {
                Some(_) => 0,
                None => unknown_us.saturating_add(basis.dt_us),
            };
            let is_awaited = (1..ESTIMATED_WITHIN_US).contains(unknown_us);
            if is_awaited || basis.tick.load_state == LoadState::Off {
                return None;
            }
        }
        let late_us = limit_us(settings).unwrap_or(0).saturating_add(LATE_US);
        let check = self.percentages;
        let is_inert = |watch: &Watch, thresholds: &Thresholds| {
            let Some(percentage) = thresholds.usable_pct else {
                return false;
            };
            match check {
                PercentageCheck::AtArming(_) => !can_act(state, percentage),
                PercentageCheck::WhenPassed => watch.usable.has_lasted(late_us) && !watch.is_reached,
                PercentageCheck::Reported => false,
            }
        };
        let is_found = is_inert(&self.low, &settings.low) || is_inert(&self.critical, &settings.critical);
        let found = settings.missing_voltage_setting().filter(|_| is_found);
        self.percentages = match (check, found) {
            (PercentageCheck::Reported, _) | (_, Some(_)) => PercentageCheck::Reported,
            (_, None) => PercentageCheck::WhenPassed,
        };
        found
    }

    /// Clears level and timers, on a battery reset.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Clears the level *unhealthy*, and no other, of a pack that is healthy again. With the load off only: what
    /// drives has to react to what was lost.
    pub fn release_unhealthy(&mut self) {
        let reports_better = !self.reports_unfit && self.reported_us >= HEALTHY_AGAIN_US;
        if self.level == FailsafeLevel::Unhealthy && self.healthy_us >= HEALTHY_AGAIN_US && reports_better {
            self.clear();
        }
    }

    /// The pack was swapped: the new one reaches each level for itself.
    pub fn replace_pack(&mut self, replacement: Replacement) {
        self.is_of_pack_before = replacement == Replacement::Certain;
        self.low = Watch::default();
        self.critical = Watch::default();
    }

    /// Clears a level of the previous pack once the present one rests above all thresholds.
    fn release(&mut self, basis: &Basis, state: &BatteryState, settings: &FailsafeSettings) {
        if !basis.is_fresh {
            self.is_of_pack_before = false;
            return;
        }
        if !self.is_of_pack_before || basis.resting_v.is_none() {
            return;
        }
        let remaining_mah = state.remaining();
        let is_above = |thresholds: &Thresholds| {
            is_known_above(basis.resting_v, thresholds.voltage_v)
                && is_known_above(remaining_mah, thresholds.remaining_mah)
                && is_known_above(state.readings.usable_pct, thresholds.usable_pct)
        };
        if [settings.low, settings.critical].iter().all(is_above) {
            self.clear();
        }
    }

    /// Whether a loss of the pack begins: there has been no healthy reading for too long.
    fn is_lost(&mut self, basis: &Basis) -> bool {
        let last_healthy = basis.last_healthy.unwrap_or(Instant::EPOCH);
        let unhealthy_us = basis.tick.now.us_since(last_healthy);
        if self.healthy_us >= HEALTHY_AGAIN_US {
            self.has_reported_loss = false;
        }
        unhealthy_us > UNHEALTHY_AFTER_US && !mem::replace(&mut self.has_reported_loss, true)
    }

    /// Whether the pack has reported FAILED or UNHEALTHY for long enough to act on it.
    fn is_unfit_by_report(&mut self, basis: &Basis, state: &BatteryState) -> bool {
        if !basis.is_healthy() {
            return false;
        }
        let is_unfit = matches!(
            state.readings.reported.charge_state,
            Some(ChargeState::Failed | ChargeState::Unhealthy)
        );
        self.reported_us = if is_unfit == self.reports_unfit {
            self.reported_us.saturating_add(basis.dt_us)
        } else {
            0
        };
        self.reports_unfit = is_unfit;
        if !is_unfit && self.reported_us >= HEALTHY_AGAIN_US {
            self.has_acted_on_report = false;
        }
        is_unfit && self.reported_us >= REPORTED_FOR_US
    }

    /// Whether *low* and *critical* are reached by the thresholds, and were not before. *Low* counts as reached where it is
    /// skipped: else the faster a voltage falls, the less is done.
    fn evaluate(&mut self, basis: &Basis, state: &BatteryState, settings: &FailsafeSettings) -> [bool; 2] {
        let (low, critical) = (&settings.low, &settings.critical);
        let limit_us = limit_us(settings);
        let values = if basis.is_fresh {
            Values::of(state, settings)
        } else {
            Values::default()
        };
        let is_critical = self.critical.update(basis.dt_us, &values, critical, limit_us);
        let mut is_low = self.low.update(basis.dt_us, &values, low, limit_us);
        if is_critical && settings.is_in_force(low, state) {
            is_low |= self.low.carry();
        }
        [is_low, is_critical]
    }
}

impl Thresholds {
    /// Whether the charge of a pack in this state is below one of them, timer aside: what is left, or its usable charge where the
    /// most that may remain is not far above.
    pub fn lacks_charge(&self, state: &BatteryState) -> bool {
        is_below(state.remaining_or_counted(), self.remaining_mah)
            || is_below(credible_usable_pct(state), self.usable_pct) && is_certain(state, self.usable_pct)
    }
}

impl FailsafeSettings {
    /// Whether a pack that is not being charged is below its critical threshold now, timer aside, or its charge is critical.
    pub fn is_below_critical(&self, state: &BatteryState) -> bool {
        match state.firm_charge_state() {
            ChargeState::Charging => false,
            ChargeState::Critical | ChargeState::Emergency => true,
            _ => {
                is_below(self.compared_voltage_v(state), self.critical.voltage_v)
                    || self.critical.lacks_charge(state)
            }
        }
    }
}

/// Whether both are known and the value is below the threshold.
pub fn is_below(value: Option<f32>, threshold: Option<f32>) -> bool {
    value
        .zip(threshold)
        .is_some_and(|(value, threshold)| value < threshold)
}

/// Whether there is no threshold, or the value is known and not below it.
fn is_known_above(value: Option<f32>, threshold: Option<f32>) -> bool {
    threshold.is_none() || value.is_some() && !is_below(value, threshold)
}

/// Remaining charge or fuel, as known; without a current sensor at most as much as may be left: an estimate from the voltage alone must not trip a
/// threshold by its error.
fn most_remaining(state: &BatteryState) -> Option<f32> {
    match state.consumed {
        Some(_) => state.remaining_or_counted(),
        None => Some(state.full_capacity()? * state.remaining_at_most_pct()? / 100.0),
    }
}

/// The usable charge, in percent; `None` where cells at rest contradict it.
fn credible_usable_pct(state: &BatteryState) -> Option<f32> {
    let is_contradicted = state.readings.faults.intersects(Faults::CONTRADICTIONS);
    state.readings.usable_pct.filter(|_| !is_contradicted)
}

/// Whether the most that may remain is not far above the percentage.
fn is_certain(state: &BatteryState, percentage: Option<f32>) -> bool {
    let limit_pct = percentage.map(|percentage| percentage + MOST_ABOVE_PCT);
    is_below(state.remaining_at_most_pct(), limit_pct)
}

/// Whether an estimate that is as uncertain as this one would act on an empty pack. A gauge's is awaited.
fn can_act(state: &BatteryState, percentage: f32) -> bool {
    let is_known = credible_usable_pct(state).is_some() || state.charge_source == ChargeSource::Gauge;
    is_known && state.remaining_uncertainty_pct() < percentage + MOST_ABOVE_PCT
}

/// `BATT_LOW_TIMER`, in microseconds, unless it is off.
fn limit_us(settings: &FailsafeSettings) -> Option<u32> {
    settings.timer_s.map(|timer_s| (timer_s * 1e6) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;
    use crate::{Amount, Tick, VoltageSource};

    const TICK_US: u32 = 100_000;

    fn settings() -> FailsafeSettings {
        FailsafeSettings {
            timer_s: Some(10.0),
            voltage_source: VoltageSource::Terminal,
            low: Thresholds {
                voltage_v: Some(10.5),
                remaining_mah: Some(400.0),
                usable_pct: None,
            },
            critical: Thresholds {
                voltage_v: Some(9.9),
                remaining_mah: Some(200.0),
                usable_pct: None,
            },
        }
    }

    fn at_voltage(voltage_v: f32) -> BatteryState {
        let mut state = BatteryState::UNKNOWN;
        state.readings.voltage_v = Some(voltage_v);
        state
    }

    /// A pack of 1000 mAh.
    fn charged(voltage_v: f32, remaining_pct: Option<f32>) -> BatteryState {
        let mut battery = at_voltage(voltage_v);
        battery.capacity = Some(Amount::Mah(1000.0));
        battery.consumed = Some(Amount::Mah(0.0));
        battery.readings.remaining_pct = remaining_pct;
        battery
    }

    /// A pack of 1000 mAh with this charge, at a voltage above all thresholds.
    fn at_charge(remaining_pct: f32) -> BatteryState {
        charged(12.0, Some(remaining_pct))
    }

    /// A tick, healthy if there is a reading.
    fn seen(load_state: LoadState, state: Option<BatteryState>) -> (Basis, BatteryState) {
        let now = Instant::EPOCH;
        let basis = Basis {
            tick: Tick { now, load_state },
            dt_us: TICK_US,
            dt_s: 0.1,
            is_fresh: state.is_some(),
            last_healthy: Some(now),
            last_voltage_v: None,
            cells_are_doubtful: false,
            resting_v: None,
            members_spread: None,
        };
        (basis, state.unwrap_or(BatteryState::UNKNOWN))
    }

    fn update(
        failsafe: &mut Failsafe,
        (basis, state): &(Basis, BatteryState),
        settings: &FailsafeSettings,
    ) -> ReachedLevels {
        failsafe.update(basis, state, settings)
    }

    /// A pack under load that was healthy at the start only.
    fn silent(now: Instant) -> (Basis, BatteryState) {
        let (mut basis, state) = seen(LoadState::On, None);
        basis.tick.now = now;
        (basis, state)
    }

    /// The levels that are reached under load in this number of ticks, with their ticks.
    fn run(
        failsafe: &mut Failsafe,
        settings: &FailsafeSettings,
        ticks: u64,
        at: impl Fn(u64) -> Option<BatteryState>,
    ) -> Vec<(u64, FailsafeLevel)> {
        let mut raised = Vec::new();
        for tick in 0..ticks {
            let reached = update(failsafe, &seen(LoadState::On, at(tick)), settings);
            raised.extend(reached.into_iter().map(|level| (tick, level)));
        }
        raised
    }

    /// The levels that a pack under load reaches within 11 s in this state.
    fn reached(
        failsafe: &mut Failsafe,
        settings: &FailsafeSettings,
        state: &BatteryState,
    ) -> Vec<FailsafeLevel> {
        let raised = run(failsafe, settings, 110, |_| Some(*state));
        raised.into_iter().map(|(_, level)| level).collect()
    }

    const BOTH: [FailsafeLevel; 2] = [FailsafeLevel::Low, FailsafeLevel::Critical];

    #[test]
    // Requirement: AP-18, L-6
    fn a_low_voltage_acts_once_it_has_lasted_for_the_timer_and_is_known() {
        type Course = fn(u64) -> Option<f32>;
        let courses: [(Course, Option<u64>); 7] = [
            (|_| Some(10.4), Some(101)),
            (|_| Some(10.5), None),
            (|tick| Some(if tick == 100 { 10.5 } else { 10.4 }), Some(202)),
            // Unknown for a tick, for long, and in nine ticks of ten: ten seconds until it counts while unknown, and ten more.
            (|tick| (tick % 90 != 50).then_some(10.4), Some(101)),
            (|tick| (!(50..300).contains(&tick)).then_some(10.4), Some(300)),
            (|tick| (tick % 10 == 0).then_some(10.4), Some(200)),
            // In the tick of a break, any voltage between the pack's and zero may be read.
            (
                |tick| match tick % 300 {
                    100 | 250 => Some(6.0),
                    101..250 => None,
                    _ => Some(12.0),
                },
                None,
            ),
        ];
        for (number, (at, expected)) in courses.into_iter().enumerate() {
            let state = |tick| at(tick).map(at_voltage);
            let raised = run(&mut Failsafe::default(), &settings(), 1000, state);
            let expected = Vec::from_iter(expected.map(|tick| (tick, FailsafeLevel::Low)));
            assert_eq!(raised, expected, "course {number}");
        }
    }

    #[test]
    fn a_timer_is_shown_until_its_level_is_reached_and_begins_again_after_disarming() {
        use FailsafeTimer::{Expired, Running, Stopped};
        let mut failsafe = Failsafe::default();
        // Six seconds each.
        for (load_state, remaining_pct, expected) in [
            (LoadState::On, 50.0, Running),
            (LoadState::Off, 50.0, Stopped),
            (LoadState::On, 50.0, Running),
            (LoadState::On, 50.0, Expired),
            (LoadState::Off, 50.0, Stopped),
            (LoadState::On, 50.0, Stopped),
        ] {
            let low = seen(load_state, Some(charged(10.4, Some(remaining_pct))));
            for _ in 0..60 {
                update(&mut failsafe, &low, &settings());
            }
            assert_eq!(failsafe.timers().low, expected);
            assert_eq!(failsafe.timers().critical, Stopped);
        }
        failsafe.clear();
        for (remaining_pct, expected) in [(50.0, Running), (39.0, Stopped)] {
            run(&mut failsafe, &settings(), 60, |_| {
                Some(charged(10.4, Some(remaining_pct)))
            });
            assert_eq!(failsafe.timers().low, expected, "the charge acts at once");
        }
    }

    #[test]
    fn no_healthy_reading_for_five_seconds_is_unhealthy() {
        let mut failsafe = Failsafe::default();
        let mut at = |us| update(&mut failsafe, &silent(at_us(us)), &settings());
        assert_eq!(at(5_000_000), []);
        assert_eq!(at(5_100_000), [FailsafeLevel::Unhealthy]);
    }

    fn lost() -> Failsafe {
        let mut failsafe = Failsafe::default();
        update(&mut failsafe, &silent(at_us(6_000_000)), &settings());
        assert_eq!(failsafe.level(), FailsafeLevel::Unhealthy);
        failsafe
    }

    /// A failsafe after eleven seconds at this voltage.
    fn after(voltage_v: f32) -> Failsafe {
        let mut failsafe = Failsafe::default();
        reached(&mut failsafe, &settings(), &at_voltage(voltage_v));
        failsafe
    }

    #[test]
    fn unhealthy_alone_is_released_after_five_seconds_of_good_readings() {
        use FailsafeLevel::{Critical, Low, Unhealthy};
        let always: fn(u64) -> bool = |_| true;
        for (mut failsafe, is_healthy, ticks, expected) in [
            (lost(), always, 49, Unhealthy),
            (lost(), always, 51, FailsafeLevel::None),
            (lost(), |tick| tick % 45 != 44, 600, Unhealthy),
            (lost(), |_| false, 600, Unhealthy),
            (after(9.0), always, 600, Critical),
            (after(10.4), always, 600, Low),
        ] {
            for tick in 0..ticks {
                let state = is_healthy(tick).then_some(at_voltage(12.0));
                update(&mut failsafe, &seen(LoadState::Off, state), &settings());
                failsafe.release_unhealthy();
            }
            assert_eq!(failsafe.level(), expected, "after {ticks} ticks");
        }
    }

    #[test]
    fn a_threshold_in_mah_acts_at_once_on_what_the_pack_holds_now() {
        let learnt = |capacity_mah, state: BatteryState| BatteryState {
            learnt_capacity_mah: Some(capacity_mah),
            ..state
        };
        let mut by_voltage = at_charge(0.0);
        by_voltage.consumed = None;
        by_voltage.readings.remaining_pct = Some(70.0);
        by_voltage.readings.remaining_sigma_pct = Some(4.0);
        let mut by_count = BatteryState {
            consumed: Some(Amount::Mah(110.0)),
            ..by_voltage
        };
        by_count.readings.remaining_pct = None;
        let gauged = BatteryState {
            charge_source: ChargeSource::Gauge,
            ..at_charge(70.0)
        };
        // 70 % of 500 mAh are 350, at most or as far as counted 390; of the gauge's 1000 mAh they are 700.
        for (state, expected) in [
            (learnt(500.0, at_charge(70.0)), &BOTH[..1]),
            (learnt(500.0, by_voltage), &BOTH[..1]),
            (learnt(500.0, by_count), &BOTH[..1]),
            (learnt(500.0, gauged), &[]),
            (at_charge(40.0), &[]),
            (at_charge(39.9), &BOTH[..1]),
            (at_charge(20.0), &BOTH[..1]),
            (at_charge(19.9), &BOTH),
            (by_voltage, &[]),
            (by_count, &[]),
        ] {
            let seen = seen(LoadState::On, Some(state));
            let reached = update(&mut Failsafe::default(), &seen, &settings());
            assert_eq!(reached, expected, "{state:?}");
        }
    }

    #[test]
    // Requirement: AP-18
    fn critical_carries_low_where_it_skips_it_and_nothing_acts_that_is_off_or_sag() {
        let below = |voltage_v| Thresholds {
            voltage_v,
            ..Thresholds::default()
        };
        let of_voltage = |low_v, critical_v| FailsafeSettings {
            low: below(low_v),
            critical: below(critical_v),
            ..settings()
        };
        let mut only_charge_is_low = settings();
        only_charge_is_low.low.voltage_v = None;
        let low_needs_the_timer = FailsafeSettings {
            timer_s: None,
            low: below(Some(10.5)),
            ..settings()
        };
        let without_timer = FailsafeSettings {
            timer_s: None,
            ..settings()
        };
        let by_resting = FailsafeSettings {
            voltage_source: VoltageSource::Resting,
            ..settings()
        };
        let mut sagging = at_voltage(9.0);
        sagging.readings.resting_voltage_v = Some(11.0);
        for (settings, state, expected) in [
            (settings(), at_voltage(9.0), &BOTH[..]),
            (settings(), at_charge(19.9), &BOTH),
            // Equal thresholds, and a charge that is unknown.
            (of_voltage(Some(9.9), Some(9.9)), at_voltage(9.8), &BOTH),
            (only_charge_is_low, at_voltage(9.0), &BOTH),
            // Nothing is skipped that has no threshold in force.
            (of_voltage(None, Some(9.9)), at_voltage(9.0), &BOTH[1..]),
            (low_needs_the_timer, at_charge(19.9), &BOTH[1..]),
            (without_timer, at_voltage(9.0), &[]),
            (by_resting, sagging, &[]),
        ] {
            let mut failsafe = Failsafe::default();
            let reached = reached(&mut failsafe, &settings, &state);
            assert_eq!(reached, expected, "{settings:?}");
            assert_eq!(failsafe.level(), expected.last().copied().unwrap_or_default());
        }
    }

    #[test]
    // Requirement: AP-18
    fn a_level_latches_and_counts_once_until_a_reset_or_another_pack() {
        let mut failsafe = Failsafe::default();
        let reached =
            |failsafe: &mut Failsafe, voltage_v| reached(failsafe, &settings(), &at_voltage(voltage_v));
        assert_eq!(reached(&mut failsafe, 10.4), BOTH[..1]);
        assert_eq!(reached(&mut failsafe, 12.0), []);
        assert_eq!(reached(&mut failsafe, 9.0), BOTH[1..]);
        assert_eq!(reached(&mut failsafe, 10.4), []);
        assert_eq!(reached(&mut failsafe, 12.0), []);
        assert_eq!(failsafe.level(), FailsafeLevel::Critical);
        failsafe.clear();
        assert_eq!(failsafe.level(), FailsafeLevel::None);
        assert_eq!(reached(&mut failsafe, 9.0), BOTH);
        failsafe.replace_pack(Replacement::Likely);
        assert_eq!(reached(&mut failsafe, 10.4), BOTH[..1]);
        assert_eq!(failsafe.level(), FailsafeLevel::Critical, "it stays");
        assert_eq!(reached(&mut failsafe, 9.0), BOTH[1..]);
    }

    #[test]
    fn a_threshold_that_is_set_while_armed_acts_like_any_other() {
        let mut settings = settings();
        (settings.low, settings.critical) = Default::default();
        let mut failsafe = Failsafe::default();
        let empty = at_voltage(9.0);
        assert_eq!(reached(&mut failsafe, &settings, &empty), []);
        settings.critical.voltage_v = Some(9.9);
        assert_eq!(reached(&mut failsafe, &settings, &empty), BOTH[1..]);
        // Critical, which was reached before, did not skip it.
        settings.low.voltage_v = Some(10.5);
        assert_eq!(reached(&mut failsafe, &settings, &empty), BOTH[..1]);
    }

    #[test]
    fn unhealthy_neither_carries_a_level_nor_is_carried() {
        let mut failsafe = lost();
        assert_eq!(reached(&mut failsafe, &settings(), &at_voltage(9.0)), BOTH);
        let reached = update(&mut failsafe, &silent(at_us(60_000_000)), &settings());
        assert_eq!(reached, [FailsafeLevel::Unhealthy]);
    }

    /// Settings that act by the percentage alone.
    fn by_percent(timer_s: Option<f32>) -> FailsafeSettings {
        let percent = |usable_pct| Thresholds {
            usable_pct: Some(usable_pct),
            ..Thresholds::default()
        };
        FailsafeSettings {
            timer_s,
            voltage_source: VoltageSource::Terminal,
            low: percent(15.0),
            critical: percent(7.0),
        }
    }

    /// A pack with this usable charge, ten percent more of which remain, with this deviation, in percent.
    fn usable(usable_pct: Option<f32>, sigma_pct: Option<f32>) -> BatteryState {
        let mut battery = at_voltage(12.0);
        battery.readings.usable_pct = usable_pct;
        battery.readings.remaining_pct = usable_pct.map(|usable_pct| usable_pct + 10.0);
        battery.readings.remaining_sigma_pct = sigma_pct;
        battery
    }

    #[test]
    // Requirement: AP-18, PX-3
    fn a_percentage_acts_once_it_is_passed_for_the_timer_by_a_charge_that_is_certain_enough() {
        let none: &[FailsafeLevel] = &[];
        let mut contradicted = usable(Some(3.0), None);
        contradicted.readings.faults = Faults::CONTRADICTED_CHARGE;
        let mut understated = usable(Some(3.0), None);
        understated.readings.faults = Faults::UNDERSTATED_CHARGE;
        for (state, expected) in [
            (usable(Some(14.9), None), &BOTH[..1]),
            (usable(Some(15.0), None), none),
            // 20 % remain, at most less than 35.
            (usable(Some(10.0), Some(7.4)), &BOTH[..1]),
            (usable(Some(10.0), Some(7.6)), none),
            // 10 % remain, at most less than 27, or than 35.
            (usable(Some(0.0), Some(8.4)), &BOTH),
            (usable(Some(0.0), Some(8.6)), &BOTH[..1]),
            (usable(Some(0.0), Some(12.6)), none),
            (usable(None, None), none),
            (contradicted, none),
            (understated, none),
        ] {
            for timer_s in [Some(10.0), None] {
                let mut failsafe = Failsafe::default();
                let reached = reached(&mut failsafe, &by_percent(timer_s), &state);
                assert_eq!(reached, expected, "{timer_s:?}: {state:?}");
            }
        }
        let low = usable(Some(10.0), None);
        for (timer_s, at) in [(Some(10.0), 101), (None, 0)] {
            let raised = run(&mut Failsafe::default(), &by_percent(timer_s), 110, |_| Some(low));
            assert_eq!(raised, [(at, FailsafeLevel::Low)]);
        }
    }

    /// The settings that are found missing from 0 s to `seconds`, with their times, under load.
    fn suggested(
        failsafe: &mut Failsafe,
        settings: &FailsafeSettings,
        seconds: u64,
        state: impl Fn(u64) -> BatteryState,
    ) -> Vec<(u64, MissingSetting)> {
        let at = |tick: u64| {
            let state = state(tick / 10);
            let seen = seen(LoadState::On, Some(state));
            let _ = update(failsafe, &seen, settings);
            let found = failsafe.find_inert_percentage(&seen.0, &seen.1, settings);
            found.map(|missing| (tick / 10, missing))
        };
        (0..seconds * 10).filter_map(at).collect()
    }

    #[test]
    // Requirement: PX-3
    fn percentages_that_cant_act_are_found_once() {
        use MissingSetting::{LowCharge, LowVoltage, Timer};
        let at_voltage = |timer_s, low_v, voltage_source| FailsafeSettings {
            timer_s,
            voltage_source,
            low: Thresholds {
                voltage_v: low_v,
                ..by_percent(timer_s).low
            },
            ..by_percent(timer_s)
        };
        let plain = by_percent(Some(10.0));
        let by_volts = at_voltage(Some(10.0), Some(10.5), VoltageSource::Terminal);
        let without_timer = at_voltage(None, Some(10.5), VoltageSource::Terminal);
        let tank = at_voltage(Some(10.0), None, VoltageSource::NotMeasured);
        let certain = usable(Some(60.0), Some(6.0));
        let uncertain = usable(Some(60.0), Some(25.0));
        let awaited = BatteryState {
            charge_source: ChargeSource::Gauge,
            ..usable(None, None)
        };
        for (settings, state, expected) in [
            (plain, uncertain, Some(LowVoltage)),
            (plain, usable(None, None), Some(LowVoltage)),
            (plain, certain, None),
            (plain, awaited, None),
            // That low can act is not enough: critical can't.
            (plain, usable(Some(60.0), Some(13.6)), Some(LowVoltage)),
            (by_volts, uncertain, None),
            (without_timer, uncertain, Some(Timer)),
            (tank, usable(None, None), Some(LowCharge)),
            (settings(), uncertain, None),
        ] {
            let mut failsafe = Failsafe::default();
            for _ in 0..2 {
                let found = suggested(&mut failsafe, &settings, 100, |_| state);
                let at_s = if state.readings.usable_pct.is_some() { 0 } else { 2 };
                assert_eq!(
                    found,
                    Vec::from_iter(expected.map(|missing| (at_s, missing))),
                    "{state:?}"
                );
                let switched_off = seen(LoadState::Off, Some(state));
                let _ = update(&mut failsafe, &switched_off, &settings);
                let (basis, state) = &switched_off;
                assert_eq!(failsafe.find_inert_percentage(basis, state, &settings), None);
            }
        }
        // It is passed at 20 s, and acts only where the charge is certain.
        for (sigma_pct, expected) in [(25.0, &[(90, LowVoltage)][..]), (3.0, &[])] {
            let becomes_empty = |second| match second {
                ..20 => certain,
                _ => usable(Some(0.0), Some(sigma_pct)),
            };
            let found = suggested(&mut Failsafe::default(), &plain, 200, becomes_empty);
            assert_eq!(found, expected);
        }
    }

    #[test]
    // Requirement: L-5, AP-18
    fn only_another_pack_that_rests_above_all_thresholds_clears_a_level_until_it_is_under_load_or_lost() {
        use FailsafeLevel::Critical;
        let certain = Some(Replacement::Certain);
        let rest = |resting_v, remaining_pct| (resting_v, charged(resting_v, remaining_pct));
        let (volts, full) = (settings(), rest(12.6, Some(100.0)));
        let percent = by_percent(Some(10.0));
        let usable = |usable_pct| (12.0, usable(usable_pct, None));
        let armed = Some(seen(LoadState::On, Some(at_voltage(12.6))));
        let unplugged = Some(seen(LoadState::Off, None));
        for (settings, replacement, between, (resting_v, state), expected) in [
            (volts, certain, None, rest(9.8, Some(90.0)), Critical),
            (volts, certain, None, rest(10.4, Some(90.0)), Critical),
            (volts, certain, None, rest(12.0, Some(30.0)), Critical),
            (volts, certain, None, rest(12.0, None), Critical),
            (volts, certain, None, rest(12.0, Some(90.0)), FailsafeLevel::None),
            (percent, certain, None, usable(None), Critical),
            (percent, certain, None, usable(Some(14.0)), Critical),
            (percent, certain, None, usable(Some(90.0)), FailsafeLevel::None),
            (volts, None, None, full, Critical),
            (volts, Some(Replacement::Likely), None, full, Critical),
            (volts, certain, armed, full, Critical),
            (volts, certain, unplugged, full, Critical),
        ] {
            let mut failsafe = after(9.0);
            if let Some(replacement) = replacement {
                failsafe.replace_pack(replacement);
            }
            if let Some(between) = between {
                update(&mut failsafe, &between, &settings);
            }
            let (mut basis, state) = seen(LoadState::Off, Some(state));
            basis.resting_v = Some(resting_v);
            failsafe.update(&basis, &state, &settings);
            assert_eq!(
                failsafe.level(),
                expected,
                "{replacement:?} {between:?} {state:?}"
            );
        }
    }
}
