//! The monitors of all packs, their sum, and the most urgent of them.

use super::conditions::has_failed;
use super::{
    BatteryMonitor, BatteryState, ChargeState, Consumed, Contents, Counted, FailsafeLevel, LoadState,
    Measurement, PackMemory, PackSettings, PackSource, PackStatus, PackUpdate, ReadError, Tick,
};
use crate::memory::in_place::in_place;
use crate::numbers::mean;
use crate::pack::{MAX_PACKS, Pack, PackSet};
use crate::parameter::{BatteryParameter, PackParameters};
use crate::vehicle::BatteryAlert;

/// All packs: their states, and their monitors.
#[derive(Clone, Debug, Default)]
pub struct BatteryBank {
    monitors: [BatteryMonitor; MAX_PACKS],
    states: [BatteryState; MAX_PACKS],
}

impl BatteryBank {
    /// Without any reading yet. A pack that is not monitored is disabled.
    pub fn new(is_monitored: impl Fn(Pack) -> bool) -> Self {
        Self {
            monitors: in_place(Default::default),
            states: in_place(|| {
                let mut states = [BatteryState::UNKNOWN; MAX_PACKS];
                for pack in Pack::ALL {
                    if !is_monitored(pack) {
                        // By a reference, they would be on the stack first.
                        states[pack as usize].status = PackStatus::Disabled;
                    }
                }
                states
            }),
        }
    }

    /// The states of all packs, by their instance.
    pub fn states(&self) -> &[BatteryState; MAX_PACKS] {
        &self.states
    }

    /// The state of a pack.
    pub fn state(&self, pack: Pack) -> &BatteryState {
        &self.states[pack as usize]
    }

    /// The monitor of a pack.
    pub fn monitor(&self, pack: Pack) -> &BatteryMonitor {
        &self.monitors[pack as usize]
    }

    /// The monitor of a pack, and the state that it updates.
    pub fn get_mut(&mut self, pack: Pack) -> (&mut BatteryMonitor, &mut BatteryState) {
        (&mut self.monitors[pack as usize], &mut self.states[pack as usize])
    }

    /// Power drawn from a pack, in watts, if its latest reading was valid and knows it: a reversed current does not.
    pub fn power_w(&self, pack: Pack) -> Option<f32> {
        let monitor = self.monitor(pack);
        let is_known = monitor.failed_reads() == 0 && !monitor.is_current_reversed();
        self.state(pack).power_w().filter(|_| is_known)
    }

    /// All monitors, with their packs.
    pub fn monitors(&self) -> impl Iterator<Item = (Pack, &BatteryMonitor)> {
        Pack::ALL.into_iter().zip(&self.monitors)
    }

    /// Processes one reading of a pack: see [`BatteryMonitor::update`].
    pub fn update(
        &mut self,
        pack: Pack,
        tick: Tick,
        reading: Result<Measurement, ReadError>,
        settings: &PackSettings,
    ) -> PackUpdate {
        let (monitor, state) = self.get_mut(pack);
        monitor.update(state, tick, reading, settings)
    }

    /// The sum of the packs that are `named` (`BATT_SUM_MASK`) and among the `summable` ones, by their latest states. If none is
    /// named, all packs after `own` are meant. A sum never includes itself. A pack that is unplugged while disarmed is no member
    /// until it measures again.
    ///
    /// # Errors
    /// No member is healthy.
    pub fn sum(
        &self,
        own: Pack,
        named: PackSet,
        summable: PackSet,
        voltage: SumVoltage,
        load_state: LoadState,
    ) -> Result<Measurement, ReadError> {
        let mut chosen = if named.is_empty() {
            summable.iter().filter(|pack| *pack > own).collect()
        } else {
            summable & named
        };
        chosen.remove(own);
        let before = PackSet::from_bits(self.state(own).members);
        let (mut members, mut lost_members) = (PackSet::NONE, PackSet::NONE);
        let mut summed = heapless::Vec::<Pack, MAX_PACKS>::new();
        for (pack, state) in Pack::ALL.into_iter().zip(&self.states) {
            let is_present = match state.status {
                PackStatus::Healthy | PackStatus::Unhealthy => true,
                PackStatus::NotConnected => load_state == LoadState::On && before.contains(pack),
                PackStatus::Unknown | PackStatus::Disabled => false,
            };
            if !is_present || !chosen.contains(pack) || state.contents != Contents::Charge {
                continue;
            }
            members.insert(pack);
            if !supplies(state) {
                lost_members.insert(pack);
            }
            // There is room for all.
            let _ = summed.push(pack);
        }
        let states = || summed.iter().map(|pack| self.state(*pack));
        let monitors = || summed.iter().map(|pack| self.monitor(*pack));
        let measurement = sum(states(), voltage)?;
        let counted = consumed(states(), monitors().map(BatteryMonitor::consumed));
        let drawn_mah = summed.iter().map(|pack| self.drawn_mah(*pack)).sum();
        Ok(Measurement {
            counted: counted.map(|consumed| Counted::Members { consumed, drawn_mah }),
            members: members.bits(),
            lost_members: lost_members.bits(),
            members_capacity_mah: states().map(BatteryState::full_capacity).sum(),
            members_spread: spread(monitors().map(BatteryMonitor::resting_v)),
            doubtful_cells: monitors().filter_map(BatteryMonitor::doubtful_cells).max(),
            exchanges: self.exchanges(chosen),
            ..measurement
        })
    }

    /// Exchanges of these packs, whether or not they are connected (wraps).
    fn exchanges(&self, packs: PackSet) -> u8 {
        let chosen = self.monitors().filter(|(pack, _)| packs.contains(*pack));
        chosen.fold(0, |sum, (_, monitor)| sum.wrapping_add(monitor.exchanges()))
    }

    /// Charge drawn from a member, in milliampere-hours, if it is counted now.
    fn drawn_mah(&self, member: Pack) -> Option<f32> {
        let state = self.state(member);
        let is_counted = supplies(state) && state.consumed.is_some();
        is_counted.then(|| self.monitor(member).drawn_mah())
    }

    /// The packs that have a failsafe level.
    pub fn at_a_level(&self) -> PackSet {
        let packs = Pack::ALL.into_iter().zip(&self.states);
        let at_a_level = packs.filter(|(_, state)| state.failsafe != FailsafeLevel::None);
        at_a_level.map(|(pack, _)| pack).collect()
    }

    /// The most urgent alert of all packs.
    pub fn most_urgent_alert(&self) -> BatteryAlert {
        let alerts = self.states.iter().map(alert_of);
        alerts.max().unwrap_or_default()
    }

    /// The parts to retain over a reset of the processor, of packs that are read from these sources.
    pub fn memory(&self, sources: &[PackSource; MAX_PACKS]) -> [PackMemory; MAX_PACKS] {
        let mut memory = [PackMemory::default(); MAX_PACKS];
        for ((memory, (pack, monitor)), source) in memory.iter_mut().zip(self.monitors()).zip(sources) {
            *memory = monitor.memory(self.state(pack).status, *source);
        }
        memory
    }

    /// Continues with what was retained over a reset of the processor of each pack that is still read from the same
    /// source.
    pub fn restore(&mut self, memory: &[PackMemory; MAX_PACKS], sources: &[PackSource; MAX_PACKS]) {
        for ((monitor, pack), source) in self.monitors.iter_mut().zip(memory).zip(sources) {
            if pack.source == *source {
                monitor.restore(pack);
            }
        }
    }
}

/// Whether the member's current is measured: it is healthy, or only its voltage is missing.
fn supplies(state: &BatteryState) -> bool {
    let has_current = state.status == PackStatus::NotConnected && state.readings.current_a.is_some();
    state.status == PackStatus::Healthy || has_current
}

/// By how much the highest of these voltages exceeds the lowest, relative to it; `None` unless all are known.
fn spread(voltages: impl Iterator<Item = Option<f32>> + Clone) -> Option<f32> {
    let lowest_v = voltages.clone().try_fold(f32::INFINITY, |lowest_v, voltage_v| {
        Some(lowest_v.min(voltage_v?))
    })?;
    let highest_v = voltages.flatten().fold(0.0, f32::max);
    (highest_v >= lowest_v).then(|| highest_v / lowest_v - 1.0)
}

/// Combination of the members' voltages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SumVoltage {
    /// The mean, for packs in parallel.
    #[default]
    Mean,
    /// The lowest (`BATT_OPTIONS` bit 9).
    Lowest,
}

/// `BATT_OPTIONS` bit of [`SumVoltage::Lowest`].
const USE_LOWEST: i32 = 1 << 9;

impl SumVoltage {
    /// From the live parameters of the sum.
    pub fn from_parameters(pack: PackParameters<'_>) -> Self {
        if pack.get_whole(BatteryParameter::Options) & USE_LOWEST != 0 {
            Self::Lowest
        } else {
            Self::Mean
        }
    }
}

/// Combines packs into one: voltage and mean temperature of the healthy ones, the sum of all currents, and the sum of the
/// consumption of all. The current is known only if that of every pack is, and none is lost.
///
/// # Errors
/// No member is healthy.
fn sum<'a>(
    packs: impl Iterator<Item = &'a BatteryState> + Clone,
    voltage: SumVoltage,
) -> Result<Measurement, ReadError> {
    let current_a = |pack: &BatteryState| pack.readings.current_a.filter(|_| supplies(pack));
    let thermometer = |pack: &BatteryState| pack.temperature_c.map(|_| pack.thermometer);
    let healthy = packs.clone().filter(|pack| pack.status == PackStatus::Healthy);
    if healthy.clone().next().is_none() {
        return Err(ReadError::NoHealthyMember);
    }
    let voltages = healthy.clone().filter_map(|pack| pack.readings.voltage_v);
    Ok(Measurement {
        voltage_v: match voltage {
            SumVoltage::Mean => mean(voltages),
            SumVoltage::Lowest => voltages.reduce(f32::min),
        },
        current_a: packs.clone().map(current_a).sum(),
        current_range: healthy
            .clone()
            .map(|pack| pack.current_range)
            .max()
            .unwrap_or_default(),
        temperature_c: mean(healthy.clone().filter_map(|pack| pack.temperature_c)),
        thermometer: healthy.filter_map(thermometer).max().unwrap_or_default(),
        ..Measurement::default()
    })
}

/// Total consumption, including what is known of packs that are lost, or whose current is; `None` if none was ever counted.
fn consumed<'a>(
    mut packs: impl Iterator<Item = &'a BatteryState>,
    consumed: impl Iterator<Item = Consumed> + Clone,
) -> Option<Consumed> {
    let charge_mah = consumed.clone().map(|consumed| consumed.charge_mah).sum();
    let is_counted = charge_mah != 0.0 || packs.any(|pack| pack.consumed.is_some());
    is_counted.then(|| Consumed {
        charge_mah,
        energy_wh: consumed.map(|consumed| consumed.energy_wh).sum(),
    })
}

/// Indication of a pack in this state by lamps and buzzer.
fn alert_of(state: &BatteryState) -> BatteryAlert {
    let by_failsafe = match state.failsafe {
        FailsafeLevel::None => BatteryAlert::None,
        FailsafeLevel::Unhealthy | FailsafeLevel::Low => BatteryAlert::Warning,
        FailsafeLevel::Critical => BatteryAlert::Urgent,
    };
    let by_charge = match state.firm_charge_state() {
        ChargeState::Critical | ChargeState::Emergency | ChargeState::Failed => BatteryAlert::Urgent,
        _ if has_failed(state) => BatteryAlert::Urgent,
        ChargeState::Low => BatteryAlert::Warning,
        _ if !state.readings.faults.is_empty() => BatteryAlert::Warning,
        ChargeState::Charging => BatteryAlert::Charging,
        ChargeState::Undefined | ChargeState::Ok | ChargeState::Unhealthy => BatteryAlert::None,
    };
    by_failsafe.max(by_charge)
}

#[cfg(test)]
mod tests;
