//! Evaluation of a pack's state: faults, failsafe level and charge state, and their announcements.

use crate::charge_state::{ChargeStateMachine, Inputs};
use crate::diagnosis::{AtRest, Diagnosis};
use crate::event::push;
use crate::failsafe::{Failsafe, Observation, ReachedLevels};
use crate::reporters::ChargeReporter;
use crate::settings::PackSettings;
use crate::swap::Replacement;
use crate::time::Instant;
use crate::{BatteryState, FailsafeLevel, Faults, LoadState, PackEvent, PackEvents, Tick};

/// Evaluates the state of one pack after every tick.
#[derive(Clone, Debug, Default)]
pub struct Evaluation {
    pub(super) diagnosis: Diagnosis,
    pub(super) failsafe: Failsafe,
    charge_state: ChargeStateMachine,
    charge_reporter: ChargeReporter,
}

/// Inputs of a tick's evaluation, beside the state.
#[derive(Clone, Copy, Debug)]
pub struct Basis {
    pub tick: Tick,
    /// Since the tick before, in microseconds.
    pub dt_us: u64,
    /// The same, in seconds.
    pub dt_s: f32,
    /// Whether the state shows this tick's reading.
    pub is_fresh: bool,
    pub last_healthy: Option<Instant>,
    /// The latest voltage while connected, in volts.
    pub last_voltage_v: Option<f32>,
    /// Whether the detected cells may be fewer than there are.
    pub cells_are_doubtful: bool,
    pub at_rest: AtRest,
}

impl Evaluation {
    /// Sets faults, failsafe level and charge state of `state`. Returns the failsafe levels that were reached. A failed read counts, too.
    pub fn update(
        &mut self,
        basis: &Basis,
        state: &mut BatteryState,
        settings: &PackSettings,
        events: &mut PackEvents,
    ) -> ReachedLevels {
        let Basis { tick, dt_s, .. } = *basis;
        if basis.is_fresh {
            state.readings.faults = self.diagnosis.update(dt_s, state, &basis.at_rest, settings);
            if basis.cells_are_doubtful {
                state.readings.faults |= Faults::CELLS_CONFIGURATION;
            }
        }
        let reached = self.update_failsafe(basis, state, settings, events);
        state.failsafe = self.failsafe.level();
        state.failsafe_timers = self.failsafe.timers();
        let is_improving = self.update_charge_state(dt_s, tick.load_state, state, settings);
        self.charge_reporter
            .update(dt_s, tick.load_state, state, is_improving, events);
        reached
    }

    /// Returns whether the charge state is about to improve.
    fn update_charge_state(
        &mut self,
        dt_s: f32,
        load_state: LoadState,
        state: &mut BatteryState,
        settings: &PackSettings,
    ) -> bool {
        let inputs = Inputs {
            status: state.status,
            faults: state.readings.faults,
            reported: state.readings.reported.charge_state,
            failsafe: state.failsafe,
            usable_pct: state.readings.usable_pct,
            remaining_pct: state.readings.remaining_pct,
            limits: settings.charge_limits,
            load_state,
            current_a: state.readings.current_a,
            capacity_mah: state.capacity_mah(),
        };
        state.charge_state = self.charge_state.update(dt_s, &inputs);
        state.without_reserve = self.charge_state.without_reserve(&inputs);
        self.charge_state.is_improving(&inputs)
    }

    fn update_failsafe(
        &mut self,
        basis: &Basis,
        state: &BatteryState,
        settings: &PackSettings,
        events: &mut PackEvents,
    ) -> ReachedLevels {
        let observation = Observation {
            tick: basis.tick,
            dt_us: u32::try_from(basis.dt_us).unwrap_or(u32::MAX),
            last_healthy: basis.last_healthy,
            state: basis.is_fresh.then_some(state),
            resting_v: basis.at_rest.voltage_v,
        };
        let reached = self.failsafe.update(&observation, &settings.failsafe);
        if let Some(parameter) = self
            .failsafe
            .find_inert_percentage(&observation, &settings.failsafe)
        {
            push(events, PackEvent::PercentagesInert(parameter));
        }
        // A state that the pack reports is announced as such.
        let is_by_report =
            |level: &&FailsafeLevel| **level == FailsafeLevel::Unhealthy && observation.is_healthy();
        for level in reached.iter().filter(|level| !is_by_report(level)) {
            push(events, PackEvent::failsafe(*level, basis.last_voltage_v, state));
        }
        reached
    }

    /// The pack was swapped: the failsafe level stays latched until the new one disproves it.
    pub fn replace_pack(&mut self, replacement: Replacement) {
        self.failsafe.replace_pack(replacement);
        self.diagnosis = Diagnosis::default();
        self.charge_state = ChargeStateMachine::default();
    }

    /// The pack has another serial number: its charge is announced from the start.
    pub fn restart_charge_reports(&mut self) {
        self.charge_reporter = ChargeReporter::default();
    }

    /// See [`BatteryMonitor::release_unhealthy`](super::BatteryMonitor::release_unhealthy).
    pub fn release_unhealthy(&mut self) {
        self.failsafe.release_unhealthy();
    }

    /// Battery reset: clears failsafe level and charge state.
    pub fn reset(&mut self, state: &mut BatteryState, load_state: LoadState, settings: &PackSettings) {
        self.charge_state = ChargeStateMachine::default();
        self.charge_reporter = ChargeReporter::default();
        self.failsafe.clear();
        state.failsafe = self.failsafe.level();
        state.failsafe_timers = self.failsafe.timers();
        let _ = self.update_charge_state(0.0, load_state, state, settings);
    }
}
