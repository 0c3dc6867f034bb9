//! Reports what befalls a pack, once when it begins: sensor faults and lost contacts, which are also reported when they end,
//! charge states and faults.

use crate::charge_state::by_failsafe;
use crate::consumption::Gap;
use crate::event::push;
use crate::time::Lasting;
use crate::{
    BatteryState, ChargeState, Faults, LessonObstacle, LoadState, PackEvent, PackEvents, PackStatus,
    ReadError, Reported,
};

/// A condition that is reported once.
#[derive(Clone, Copy, Debug, Default)]
enum Condition {
    /// Not reported, or its end was.
    #[default]
    Absent,
    /// Its beginning was reported; it has been absent since for this long.
    Reported(Lasting),
}

/// Evidence of a condition in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Evidence {
    Present,
    /// Neither enough to report it, nor its end.
    Ambiguous,
    Absent,
}

impl Evidence {
    fn of(is_present: bool) -> Self {
        if is_present { Self::Present } else { Self::Absent }
    }
}

/// Outcome of an observation: the report that is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    Begins,
    Ends,
}

impl Condition {
    /// Takes the evidence of a tick, `dt_s` seconds after the one before. The condition ends after an absence of
    /// `recovery_s` seconds.
    fn update(&mut self, dt_s: f32, evidence: Evidence, recovery_s: f32) -> Option<Change> {
        match (&mut *self, evidence) {
            (Self::Absent, Evidence::Present) => {
                *self = Self::Reported(Lasting::default());
                Some(Change::Begins)
            }
            (Self::Absent, _) => None,
            (Self::Reported(absent), _) => {
                let has_ended = absent.reaches(recovery_s, dt_s, evidence == Evidence::Absent);
                has_ended.then(|| {
                    *self = Self::Absent;
                    Change::Ends
                })
            }
        }
    }
}

/// A sensor has to work for this long before its recovery is reported, in seconds: intermittent failures must not flood
/// the link.
const SENSOR_RECOVERY_S: f32 = 5.0;

/// A contact has to hold for this long before its recovery is reported, in seconds: while driving a loose wire may hold for
/// longer than a sensor works.
const CONTACT_RECOVERY_S: f32 = 30.0;

/// A current has to be measured for this long before its recovery is reported, in seconds: its sensor may have a loose wire,
/// too.
const CURRENT_RECOVERY_S: f32 = 30.0;

/// The reported faults of one pack.
#[derive(Clone, Copy, Debug, Default)]
pub struct HealthReporter {
    sensor: Condition,
    contact: Condition,
    current: Condition,
}

impl HealthReporter {
    /// Updates the sensor's fault after `dt_s` seconds, with the read error of this tick.
    pub fn sensor(&mut self, dt_s: f32, status: PackStatus, error: Option<ReadError>) -> Option<PackEvent> {
        let evidence = match (error, status) {
            (Some(_), PackStatus::Unhealthy) => Evidence::Present,
            (Some(_), _) => Evidence::Ambiguous,
            (None, _) => Evidence::Absent,
        };
        Some(match self.sensor.update(dt_s, evidence, SENSOR_RECOVERY_S)? {
            Change::Begins => PackEvent::SensorFailed(error?),
            Change::Ends => PackEvent::SensorRecovered,
        })
    }

    /// Updates the fault of a current that a healthy pack has lost, or has not.
    pub fn current(&mut self, dt_s: f32, status: PackStatus, is_lost: bool) -> Option<PackEvent> {
        let evidence = match (status, is_lost) {
            (PackStatus::Healthy, is_lost) => Evidence::of(is_lost),
            _ => Evidence::Ambiguous,
        };
        let change = self.current.update(dt_s, evidence, CURRENT_RECOVERY_S)?;
        (change == Change::Begins).then_some(PackEvent::CurrentLost)
    }

    /// Updates the contact's fault. With the load off there may be no pack.
    pub fn contact(
        &mut self,
        dt_s: f32,
        status: PackStatus,
        error: Option<ReadError>,
        load_state: LoadState,
    ) -> Option<PackEvent> {
        let evidence = match (error, status, load_state) {
            (None, PackStatus::NotConnected, LoadState::On) => Evidence::Present,
            (None, PackStatus::Healthy, _) => Evidence::Absent,
            _ => Evidence::Ambiguous,
        };
        Some(match self.contact.update(dt_s, evidence, CONTACT_RECOVERY_S)? {
            Change::Begins => PackEvent::ContactLost,
            Change::Ends => PackEvent::ContactRestored,
        })
    }
}

/// Time of absence after which a condition is reported again, in seconds: a load that comes and goes
/// must not flood the link.
const RECOVERY_S: f32 = 30.0;

/// After this long without a pack, in seconds, with the load off there may be another one: what is reported then is news.
const UNPLUGGED_S: f32 = 1.0;

/// Nothing is reported for this long after a pack was plugged in, in seconds: until it has rested and is known to be
/// another one, its charge is that of the pack before.
const SETTLING_S: f32 = 3.0;

/// The gaps in the readings of one pack: those that follow one another, as with a loose wire, are reported as one.
#[derive(Clone, Copy, Debug, Default)]
pub struct GapReporter {
    pending: Option<Gap>,
    /// For how long none has been reported, in seconds, unless that is long.
    silent_s: Option<f32>,
}

impl GapReporter {
    /// Takes the gap before a reading, if there was one, and returns what is to be reported.
    pub fn update(&mut self, dt_s: f32, gap: Option<Gap>) -> Option<Gap> {
        let Some(silent_s) = self.silent_s else {
            self.silent_s = gap.map(|_| 0.0);
            return gap;
        };
        self.pending = match (self.pending, gap) {
            (Some(before), Some(gap)) => Some(before.and(gap)),
            (before, gap) => gap.or(before),
        };
        self.silent_s = Some(silent_s + dt_s).filter(|silent_s| *silent_s < RECOVERY_S);
        if self.silent_s.is_some() {
            return None;
        }
        let pending = self.pending.take();
        self.silent_s = pending.map(|_| 0.0);
        pending
    }
}

/// Reports why a drive has taught nothing of its pack.
#[derive(Clone, Copy, Debug, Default)]
pub enum LessonReporter {
    #[default]
    NotDriven,
    Driven,
    Reported(LessonObstacle),
}

impl LessonReporter {
    pub fn follow(&mut self, load_state: LoadState) {
        if load_state == LoadState::On {
            *self = Self::Driven;
        }
    }

    /// Takes what is in the way of a lesson when the drive or its rest ends, if anything is. Returns it once.
    pub fn report(&mut self, obstacle: LessonObstacle) -> Option<PackEvent> {
        let is_news = match *self {
            Self::NotDriven => false,
            Self::Driven => true,
            Self::Reported(before) => before != obstacle,
        };
        is_news.then(|| {
            *self = Self::Reported(obstacle);
            PackEvent::NotLearnt(obstacle)
        })
    }
}

/// The reported charge state and faults of one pack.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChargeReporter {
    /// The worst charge state, UNDEFINED to EMERGENCY, that has not been better since for [`RECOVERY_S`].
    worst: ChargeState,
    better: Lasting,
    /// Time without a pack with the load off, in seconds.
    unplugged_s: f32,
    /// Time until something may be reported, in seconds.
    settling_s: f32,
    charging: Condition,
    faults: AnnouncedFaults,
    /// Faults that the pack reports itself.
    reported: AnnouncedFaults,
}

/// Faults that were announced, and the charge state FAILED or UNHEALTHY.
#[derive(Clone, Copy, Debug, Default)]
struct AnnouncedFaults {
    faults: Faults,
    /// The worst state of those, as [`badness`].
    badness: u8,
    some_absent: Lasting,
}

/// 2 of FAILED, 1 of UNHEALTHY.
fn badness(state: Option<ChargeState>) -> u8 {
    match state {
        Some(ChargeState::Failed) => 2,
        Some(ChargeState::Unhealthy) => 1,
        _ => 0,
    }
}

impl AnnouncedFaults {
    /// The new faults and the state if it is worse, `dt_s` seconds after the ones before.
    fn update(
        &mut self,
        dt_s: f32,
        faults: Faults,
        state: Option<ChargeState>,
    ) -> (Faults, Option<ChargeState>) {
        let badness = badness(state);
        let new = faults - self.faults;
        let worse = state.filter(|_| badness > self.badness);
        self.faults |= faults;
        self.badness = self.badness.max(badness);
        let is_some_absent = faults != self.faults || badness != self.badness;
        if self.some_absent.reaches(RECOVERY_S, dt_s, is_some_absent) {
            (self.faults, self.badness) = (faults, badness);
        }
        (new, worse)
    }
}

impl ChargeReporter {
    /// Adds to `events` what begins with this state, `dt_s` seconds after the one before. `is_improving`: its charge state is about to
    /// be left for a better one.
    pub fn update(
        &mut self,
        dt_s: f32,
        load_state: LoadState,
        state: &BatteryState,
        is_improving: bool,
        events: &mut PackEvents,
    ) {
        if load_state == LoadState::Off && state.status == PackStatus::NotConnected {
            self.unplugged_s += dt_s;
        } else if core::mem::take(&mut self.unplugged_s) >= UNPLUGGED_S {
            *self = Self {
                settling_s: SETTLING_S,
                ..Self::default()
            };
        }
        if self.settling_s > 0.0 {
            self.settling_s -= dt_s;
            return;
        }
        if let Some(event) = self.charge(dt_s, state, is_improving) {
            push(events, event);
        }
        if self.begins_to_charge(dt_s, state) {
            push(events, PackEvent::Charging);
        }
        // A sensor that has failed does not end a fault.
        if state.status == PackStatus::Healthy {
            self.add_faults(dt_s, state, events);
        }
    }

    fn add_faults(&mut self, dt_s: f32, state: &BatteryState, events: &mut PackEvents) {
        let (faults, _) = self.faults.update(dt_s, state.readings.faults, None);
        if !faults.is_empty() {
            push(events, PackEvent::Faults(faults));
        }
        let Reported {
            faults: cause,
            charge_state,
            ..
        } = state.readings.reported;
        match self.reported.update(dt_s, cause, charge_state) {
            (_, Some(state)) => push(events, PackEvent::ReportedState { state, cause }),
            (faults, None) if !faults.is_empty() => push(events, PackEvent::ReportedFaults(faults)),
            _ => {}
        }
    }

    fn charge(&mut self, dt_s: f32, state: &BatteryState, is_improving: bool) -> Option<PackEvent> {
        let present = state.charge_state;
        if present > ChargeState::Emergency || present == ChargeState::Undefined {
            // Neither better nor worse.
            return None;
        }
        let is_better = present < self.worst;
        if self.better.reaches(RECOVERY_S, dt_s, is_better) {
            self.worst = present;
        }
        // A better state that has to last for a while yet: after another pack was put in, for example.
        if is_better || is_improving {
            return None;
        }
        let before = core::mem::replace(&mut self.worst, present);
        // A failsafe level that is reached is announced as such.
        let is_news = present > before && present > by_failsafe(state.failsafe);
        // The voltage of a deep discharge contradicts any charge.
        let is_by_voltage = state.readings.faults.contains(Faults::DEEP_DISCHARGE);
        let is_reported = state.readings.reported.charge_state == Some(present);
        if is_news && is_reported && !is_by_voltage {
            // Its faults are announced on their own.
            return Some(PackEvent::ReportedState {
                state: present,
                cause: Faults::empty(),
            });
        }
        is_news.then_some(PackEvent::Charge {
            state: present,
            remaining_pct: state.readings.remaining_pct.filter(|_| !is_by_voltage),
            usable_pct: state.readings.usable_pct,
            voltage_v: state.readings.voltage_v,
        })
    }

    fn begins_to_charge(&mut self, dt_s: f32, state: &BatteryState) -> bool {
        let evidence = Evidence::of(state.charge_state == ChargeState::Charging);
        self.charging.update(dt_s, evidence, RECOVERY_S) == Some(Change::Begins)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BusError, FailsafeLevel};

    const FAILED: (PackStatus, Option<ReadError>) =
        (PackStatus::Unhealthy, Some(ReadError::Bus(BusError::NoAnswer)));
    const WORKS: (PackStatus, Option<ReadError>) = (PackStatus::Healthy, None);

    fn sensor(
        reporter: &mut HealthReporter,
        (status, error): (PackStatus, Option<ReadError>),
        ticks: u32,
    ) -> Vec<PackEvent> {
        (0..ticks)
            .filter_map(|_| reporter.sensor(0.1, status, error))
            .collect()
    }

    fn contact(
        reporter: &mut HealthReporter,
        status: PackStatus,
        load_state: LoadState,
        ticks: u32,
    ) -> Vec<PackEvent> {
        (0..ticks)
            .filter_map(|_| reporter.contact(0.1, status, None, load_state))
            .collect()
    }

    #[test]
    fn failure_is_reported_once_and_recovery_debounced() {
        let mut reporter = HealthReporter::default();
        assert_eq!(sensor(&mut reporter, WORKS, 100), []);
        let glitch = (PackStatus::Healthy, FAILED.1);
        assert_eq!(sensor(&mut reporter, glitch, 4), []);
        let failed = [PackEvent::SensorFailed(ReadError::Bus(BusError::NoAnswer))];
        assert_eq!(sensor(&mut reporter, FAILED, 100), failed);
        assert_eq!(sensor(&mut reporter, WORKS, 45), []);
        assert_eq!(sensor(&mut reporter, FAILED, 1), [], "a loose contact");
        assert_eq!(sensor(&mut reporter, WORKS, 100), [PackEvent::SensorRecovered]);
        assert_eq!(sensor(&mut reporter, FAILED, 1).len(), 1);
    }

    #[test]
    // Requirement: L-10
    fn intermittent_contact_is_reported_once_under_load() {
        let mut reporter = HealthReporter::default();
        let mut reports = contact(&mut reporter, PackStatus::NotConnected, LoadState::Off, 100);
        for _ in 0..60 {
            for (status, ticks) in [(PackStatus::NotConnected, 1), (PackStatus::Healthy, 89)] {
                reports.extend(contact(&mut reporter, status, LoadState::On, ticks));
            }
        }
        assert_eq!(reports, [PackEvent::ContactLost]);
        let after = contact(&mut reporter, PackStatus::Healthy, LoadState::Off, 301);
        assert_eq!(after, [PackEvent::ContactRestored]);
    }

    #[test]
    fn failed_read_does_not_restore_a_contact() {
        let mut reporter = HealthReporter::default();
        contact(&mut reporter, PackStatus::NotConnected, LoadState::On, 1);
        let error = Some(ReadError::Timeout);
        for _ in 0..1000 {
            let event = reporter.contact(0.1, PackStatus::Healthy, error, LoadState::On);
            assert_eq!(event, None);
        }
    }

    fn state(charge_state: ChargeState) -> BatteryState {
        let mut state = BatteryState::UNKNOWN;
        state.status = PackStatus::Healthy;
        state.charge_state = charge_state;
        state.readings.remaining_pct = Some(14.0);
        state.readings.usable_pct = Some(14.0);
        state
    }

    fn reported(reporter: &mut ChargeReporter, seconds: u32, state: &BatteryState) -> Vec<PackEvent> {
        let mut events = Vec::new();
        for _ in 0..seconds * 10 {
            let mut of_tick = PackEvents::new();
            reporter.update(0.1, LoadState::Off, state, false, &mut of_tick);
            events.extend(of_tick);
        }
        events
    }

    fn charge(state: ChargeState) -> PackEvent {
        PackEvent::Charge {
            state,
            remaining_pct: Some(14.0),
            usable_pct: Some(14.0),
            voltage_v: None,
        }
    }

    #[test]
    fn each_worse_state_is_reported_once() {
        let mut reporter = ChargeReporter::default();
        for (present, expected) in [
            (ChargeState::Undefined, None),
            (ChargeState::Ok, None),
            (ChargeState::Low, Some(ChargeState::Low)),
            (ChargeState::Critical, Some(ChargeState::Critical)),
            (ChargeState::Unhealthy, None),
            (ChargeState::Critical, None),
            (ChargeState::Undefined, None),
            (ChargeState::Critical, None),
            (ChargeState::Emergency, Some(ChargeState::Emergency)),
            (ChargeState::Failed, None),
            (ChargeState::Emergency, None),
        ] {
            let expected: Vec<_> = expected.map(charge).into_iter().collect();
            let events = reported(&mut reporter, 60, &state(present));
            assert_eq!(events, expected, "{present:?}");
        }
        let events = reported(&mut ChargeReporter::default(), 10, &state(ChargeState::Emergency));
        assert_eq!(events, [charge(ChargeState::Emergency)], "the worst alone");
    }

    #[test]
    // Requirement: AP-5
    fn a_low_or_empty_pack_is_announced_as_its_own_report_unless_its_voltage_shows_that() {
        let empty = |present, reported, faults| {
            let mut battery = state(present);
            battery.readings.reported.charge_state = Some(reported);
            battery.readings.faults = faults;
            battery
        };
        let none = Faults::empty();
        for reported_state in [ChargeState::Low, ChargeState::Critical, ChargeState::Emergency] {
            let mut reporter = ChargeReporter::default();
            let events = reported(&mut reporter, 60, &empty(reported_state, reported_state, none));
            let event = PackEvent::ReportedState {
                state: reported_state,
                cause: none,
            };
            assert_eq!(events, [event]);
        }
        for (present, reported_state, faults) in [
            (ChargeState::Emergency, ChargeState::Low, none),
            (
                ChargeState::Emergency,
                ChargeState::Emergency,
                Faults::DEEP_DISCHARGE,
            ),
        ] {
            let mut reporter = ChargeReporter::default();
            let events = reported(&mut reporter, 60, &empty(present, reported_state, faults));
            assert!(matches!(events[0], PackEvent::Charge { .. }), "{events:?}");
        }
    }

    #[test]
    // Requirement: L-10
    fn a_state_that_comes_and_goes_with_the_load_is_reported_once() {
        let mut reporter = ChargeReporter::default();
        let mut events = Vec::new();
        for _ in 0..60 {
            events.extend(reported(&mut reporter, 5, &state(ChargeState::Critical)));
            events.extend(reported(&mut reporter, 20, &state(ChargeState::Ok)));
        }
        assert_eq!(events, [charge(ChargeState::Critical)]);
        reported(&mut reporter, 31, &state(ChargeState::Ok));
        let again = reported(&mut reporter, 5, &state(ChargeState::Critical));
        assert_eq!(again, [charge(ChargeState::Critical)]);
    }

    #[test]
    fn what_a_failsafe_announces_is_not_reported_again() {
        let mut reporter = ChargeReporter::default();
        let tripped = |charge_state, failsafe| BatteryState {
            failsafe,
            ..state(charge_state)
        };
        let low = tripped(ChargeState::Low, FailsafeLevel::Low);
        assert_eq!(reported(&mut reporter, 10, &low), []);
        let nearly_empty = tripped(ChargeState::Emergency, FailsafeLevel::Low);
        let events = reported(&mut reporter, 10, &nearly_empty);
        assert_eq!(events, [charge(ChargeState::Emergency)]);
    }

    #[test]
    // Requirement: L-10
    fn charging_is_reported_once_and_a_loose_charger_does_not_repeat_it() {
        let mut reporter = ChargeReporter::default();
        let mut events = Vec::new();
        for _ in 0..20 {
            events.extend(reported(&mut reporter, 6, &state(ChargeState::Charging)));
            events.extend(reported(&mut reporter, 6, &state(ChargeState::Low)));
        }
        assert_eq!(events, [PackEvent::Charging, charge(ChargeState::Low)]);
    }

    #[test]
    // Requirement: L-10
    fn a_pack_that_is_plugged_in_is_reported_again() {
        let mut reporter = ChargeReporter::default();
        let low = state(ChargeState::Low);
        let unplugged = BatteryState {
            status: PackStatus::NotConnected,
            ..state(ChargeState::Undefined)
        };
        assert_eq!(reported(&mut reporter, 1, &low), [charge(ChargeState::Low)]);
        reported(&mut reporter, 2, &unplugged);
        assert_eq!(reported(&mut reporter, 2, &state(ChargeState::Emergency)), []);
        assert_eq!(reported(&mut reporter, 2, &low), [charge(ChargeState::Low)]);
        // The contact bounces.
        let mut events = PackEvents::new();
        for _ in 0..10 {
            reporter.update(0.1, LoadState::Off, &unplugged, false, &mut events);
            reporter.update(0.1, LoadState::Off, &low, false, &mut events);
        }
        assert!(events.is_empty());
        // A wire that is loose while driving does not mean another pack.
        for _ in 0..50 {
            reporter.update(0.1, LoadState::On, &unplugged, false, &mut events);
        }
        reporter.update(0.1, LoadState::On, &low, false, &mut events);
        assert!(events.is_empty());
    }

    #[test]
    // Requirement: L-10
    fn a_state_that_the_pack_reports_is_announced_once_with_its_cause() {
        use ChargeState::{Failed, Ok, Unhealthy};
        let with = |charge_state, faults| {
            let mut battery = state(ChargeState::Low);
            battery.readings.reported.charge_state = Some(charge_state);
            battery.readings.reported.faults = faults;
            battery
        };
        let announced = |state, cause| PackEvent::ReportedState { state, cause };
        let (hot, none) = (Faults::OVER_TEMPERATURE, Faults::empty());
        let mut reporter = ChargeReporter::default();
        assert_eq!(
            reported(&mut reporter, 5, &with(Ok, none)),
            [charge(ChargeState::Low)]
        );
        // Its cause was announced before, and is named once more.
        assert_eq!(
            reported(&mut reporter, 5, &with(Ok, hot)),
            [PackEvent::ReportedFaults(hot)]
        );
        assert_eq!(
            reported(&mut reporter, 5, &with(Unhealthy, hot)),
            [announced(Unhealthy, hot)]
        );
        assert_eq!(
            reported(&mut reporter, 5, &with(Failed, none)),
            [announced(Failed, none)]
        );
        for _ in 0..20 {
            for state in [Ok, Unhealthy, Failed] {
                assert_eq!(reported(&mut reporter, 9, &with(state, hot)), []);
            }
        }
        assert_eq!(reported(&mut reporter, 31, &with(Ok, hot)), []);
        assert_eq!(
            reported(&mut reporter, 5, &with(Failed, hot)),
            [announced(Failed, hot)]
        );
    }

    #[test]
    fn faults_that_begin_are_reported_together_and_once() {
        type Change = fn(&mut BatteryState, Faults);
        type Event = fn(Faults) -> PackEvent;
        let kinds: [(Change, Event); 2] = [
            (
                |battery, faults| battery.readings.faults = faults,
                PackEvent::Faults,
            ),
            (
                |battery, faults| battery.readings.reported.faults = faults,
                PackEvent::ReportedFaults,
            ),
        ];
        for (change, event) in kinds {
            let with = |faults| {
                let mut battery = state(ChargeState::Ok);
                change(&mut battery, faults);
                battery
            };
            let two = Faults::OVER_CURRENT | Faults::NEEDS_SERVICE;
            let mut reporter = ChargeReporter::default();
            let mut events = Vec::new();
            for _ in 0..20 {
                events.extend(reported(&mut reporter, 2, &with(two)));
                events.extend(reported(&mut reporter, 9, &with(Faults::NEEDS_SERVICE)));
            }
            assert_eq!(events, [event(two)]);
            let three = two | Faults::CELL_FAIL;
            let events = reported(&mut reporter, 2, &with(three));
            assert_eq!(events, [event(Faults::CELL_FAIL)]);
            // A sensor that fails does not end a fault.
            let mut failed = with(Faults::empty());
            failed.status = PackStatus::Unhealthy;
            reported(&mut reporter, 60, &failed);
            assert_eq!(reported(&mut reporter, 2, &with(three)), []);
            reported(&mut reporter, 31, &with(Faults::empty()));
            assert_eq!(reported(&mut reporter, 2, &with(two)), [event(two)]);
        }
    }
}
