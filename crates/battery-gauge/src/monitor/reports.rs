//! Reports of a pack, or of a sum of packs, about itself.

use super::counting::{GaugeState, has_timed_out};
use crate::event::push;
use crate::settings::PackSettings;
use crate::swap::{Replacement, SerialNumber};
use crate::time::Instant;
use crate::{BatteryState, Measurement, PackEvent, PackEvents, ReadError, Supply, Tick};

/// The reports of one pack.
#[derive(Clone, Debug)]
pub struct Reports {
    /// The pack's own fuel gauge.
    pub gauge: GaugeState,
    pub serial_number: SerialNumber,
    supply: Supply,
    /// Time since which a member of the sum has been lost.
    incomplete_since: Option<Instant>,
    /// Full capacity of a sum's members, and how far apart they rest.
    members_capacity_mah: Option<f32>,
    pub members_spread: Option<f32>,
}

impl Reports {
    pub fn new() -> Self {
        Self {
            gauge: GaugeState::Absent,
            serial_number: SerialNumber::default(),
            supply: Supply::On,
            incomplete_since: None,
            members_capacity_mah: None,
            members_spread: None,
        }
    }

    /// Whether the pack has another serial number, which was confirmed.
    pub fn replacement(&mut self, tick: Tick, measurement: &Measurement) -> Option<Replacement> {
        self.serial_number
            .update(measurement.details.serial_number, tick.load_state)
    }

    /// Takes over what a reading says. Details with a new serial number are ignored until the number is confirmed.
    pub fn update(
        &mut self,
        tick: Tick,
        measurement: &Measurement,
        state: &mut BatteryState,
        events: &mut PackEvents,
    ) {
        if self.serial_number.matches(measurement.details.serial_number) {
            state.details = measurement.details;
        }
        if self.supply != measurement.supply && measurement.supply == Supply::PoweringOff {
            push(events, PackEvent::PoweringOff);
        }
        self.supply = measurement.supply;
        state.contents = measurement.contents;
        let left = state.members & !measurement.members;
        if left != 0 {
            push(events, PackEvent::MembersLeft(left));
        }
        state.members = measurement.members;
        let since = self.incomplete_since.unwrap_or(tick.now);
        self.incomplete_since = (measurement.lost_members != 0).then_some(since);
        state.cells = measurement.cells;
        self.members_capacity_mah = measurement.members_capacity_mah;
        self.members_spread = measurement.members_spread;
        self.gauge.update(tick.now, measurement.gauge);
    }

    /// Whether a member of the sum is lost.
    pub fn is_incomplete(&self) -> bool {
        self.incomplete_since.is_some()
    }

    /// Cause of an unknown charge, whatever is estimated: its counter has been silent for too long.
    pub fn charge_time_out(&self, now: Instant) -> Option<ReadError> {
        let is_incomplete = self
            .incomplete_since
            .is_some_and(|since| has_timed_out(since, now));
        match self.gauge {
            GaugeState::TimedOut { .. } => Some(ReadError::GaugeTimeout),
            _ => is_incomplete.then_some(ReadError::LostMember),
        }
    }

    /// The owner's settings, overridden by what a smart battery reports, if it does; a cell count that is set wins,
    /// and so does the capacity of a sum.
    pub fn settings(&self, state: &BatteryState, settings: &PackSettings) -> Option<PackSettings> {
        let details = &state.details;
        let cells = state.cells.number();
        if details.chemistry.is_none()
            && details.serial_number.is_none()
            && self.gauge.full_mah().is_none()
            && self.members_capacity_mah.is_none()
            && cells.is_none()
        {
            return None;
        }
        Some(PackSettings {
            chemistry: details.chemistry.unwrap_or(settings.chemistry),
            cell_count: settings.cell_count.or(cells),
            capacity_mah: self
                .gauge
                .full_mah()
                .or(settings.capacity_mah)
                .or(self.members_capacity_mah),
            serial_number: details.serial_number.or(settings.serial_number),
            ..*settings
        })
    }
}
