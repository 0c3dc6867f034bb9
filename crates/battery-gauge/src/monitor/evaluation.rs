//! Evaluation of a pack's state: faults, failsafe level and charge state, and their announcements.

use crate::basis::Basis;
use crate::charge_state::ChargeStateMachine;
use crate::diagnosis::Diagnosis;
use crate::event::push;
use crate::failsafe::{Failsafe, ReachedLevels};
use crate::reporters::ChargeReporter;
use crate::settings::PackSettings;
use crate::swap::Replacement;
use crate::{BatteryState, FailsafeLevel, Faults, LoadState, PackEvent, PackEvents};

/// Evaluates the state of one pack after every tick.
#[derive(Clone, Debug, Default)]
pub struct Evaluation {
    pub(super) diagnosis: Diagnosis,
    pub(super) failsafe: Failsafe,
    charge_state: ChargeStateMachine,
    charge_reporter: ChargeReporter,
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
            state.readings.faults = self.diagnosis.update(basis, state, settings);
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
        let limits = &settings.charge_limits;
        state.charge_state = self.charge_state.update(dt_s, load_state, state, limits);
        state.without_reserve = self.charge_state.without_reserve(state, limits);
        self.charge_state.is_improving(load_state, state)
    }

    fn update_failsafe(
        &mut self,
        basis: &Basis,
        state: &BatteryState,
        settings: &PackSettings,
        events: &mut PackEvents,
    ) -> ReachedLevels {
        let reached = self.failsafe.update(basis, state, &settings.failsafe);
        if let Some(parameter) = self
            .failsafe
            .find_inert_percentage(basis, state, &settings.failsafe)
        {
            push(events, PackEvent::PercentagesInert(parameter));
        }
        for level in &reached {
            // A state that the pack reports is announced as such.
            let is_by_report = *level == FailsafeLevel::Unhealthy && basis.is_healthy();
            if !is_by_report {
                push(events, PackEvent::failsafe(*level, basis.last_voltage_v, state));
            }
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
