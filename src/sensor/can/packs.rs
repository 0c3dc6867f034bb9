//! Which battery measures which pack, and what its readings mean.

use super::NodeId;
use super::charger::{Charger, SwitchRequest};
use super::event::{CanEvent, CanNotice, ChargerPower};
use super::messages::{BatteryAux, BatteryInfo, ChargerReading, celsius};
use super::setup::{CanOptions, CanPack, CanSettings};
use crate::battery::{
    CellVoltages, ChargeState, Faults, Gauge, GaugeReading, GaugeReport, Measurement, Modes, PackDetails,
    Reported, Supply, Thermometer,
};
use crate::log::info;
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::MonitorKind;
use crate::time::Instant;
use crate::vehicle::ArmState;

/// Longest time without a reading by a node on the bus, in microseconds.
pub(super) const CAN_TIMEOUT_US: u64 = MonitorKind::Can.timeout_us();

/// For how long what BatteryInfoAux has reported is used, in microseconds: more than two of the slowest
/// period of batteries, 5 s.
const AUX_US: u64 = 12_000_000;

/// A pack that takes any battery waits for one for this long before a charger may measure it, in microseconds: two of the
/// slowest period of batteries.
const CHARGER_WAIT_US: u64 = 10_000_000;

/// Time without a critical health after which another one is announced, in microseconds, as for faults of packs: a node
/// that toggles must not flood the link.
const CRITICAL_RECOVERY_US: u64 = 30_000_000;

/// A battery on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Source {
    pub node: NodeId,
    pub battery_id: u8,
}

/// All packs, and what measures them.
#[derive(Debug)]
pub(super) struct CanPacks {
    entries: [Entry; MAX_PACKS],
    arm_state: ArmState,
    /// Counts requests to chargers.
    transfer_id: u8,
}

/// A pack.
#[derive(Debug)]
struct Entry {
    /// `None` if it is not measured by CAN.
    settings: Option<CanPack>,
    source: Option<Source>,
    /// Whether `BATT_SERIAL_NUM` was changed since it was found.
    id_is_changed: bool,
    /// When its latest reading was received; before the first, since when it may have one.
    heard: Instant,
    /// Whether its source has reported a percentage above 0.
    has_had_charge: bool,
    /// When its node last reported a critical health that was announced; `None` once it has recovered.
    critical: Option<Instant>,
    aux: Option<Heard<BatteryAux>>,
    /// The battery's nominal voltage, in volts, which does not change.
    nominal_v: Option<f32>,
    charger: Option<Charger>,
}

/// A reception and its time.
#[derive(Clone, Copy, Debug)]
struct Heard<T> {
    content: T,
    at: Instant,
}

/// A request to a charger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChargerRequest {
    pub node: NodeId,
    pub transfer_id: u8,
    pub power: ChargerPower,
}

impl CanPacks {
    /// Without any pack.
    pub const EMPTY: Self = Self {
        entries: [const { Entry::EMPTY }; MAX_PACKS],
        arm_state: ArmState::Disarmed,
        transfer_id: 0,
    };

    /// Takes over what may have changed.
    pub fn set_up(&mut self, settings: &CanSettings, now: Instant) {
        self.arm_state = settings.arm_state;
        let switched = settings.switched;
        for (entry, pack) in self.entries.iter_mut().zip(Pack::ALL) {
            let settings = settings.packs.iter().find(|settings| settings.pack == pack);
            entry.set_up(settings, now);
            if let Some((charger, power)) = entry.charger.as_mut().zip(switched) {
                charger.switch(power);
            }
        }
    }

    /// Takes a battery's reading.
    pub fn battery(
        &mut self,
        node: NodeId,
        info: &BatteryInfo,
        now: Instant,
        deliver: &mut impl FnMut(CanEvent),
    ) {
        let source = Source {
            node,
            battery_id: info.battery_id,
        };
        if let Some((entry, settings)) = self.entry_of(source, 0, now, deliver) {
            entry.heard = now;
            entry.has_had_charge |= info.state_of_charge_pct.is_some_and(|percent| percent > 0);
            deliver(CanEvent::Reading(
                settings.pack,
                measurement(info, entry, &settings, now),
            ));
        }
    }

    /// Takes what a battery reports beside its reading; the next reading has it.
    pub fn aux(&mut self, node: NodeId, aux: &BatteryAux, now: Instant) {
        let source = Source {
            node,
            battery_id: aux.battery_id,
        };
        if let Some(entry) = self.entry_of_aux(source) {
            entry.nominal_v = aux
                .nominal_v
                .filter(|nominal_v| *nominal_v > 0.0)
                .or(entry.nominal_v);
            entry.aux = Some(Heard {
                content: *aux,
                at: now,
            });
        }
    }

    /// Takes the health of a node. Returns what is to be announced: once for a node, whatever number of packs it measures.
    pub fn health(&mut self, node: NodeId, is_critical: bool, now: Instant) -> Option<CanNotice> {
        let (entry, pack) = self
            .entries
            .iter_mut()
            .zip(Pack::ALL)
            .find(|(entry, _)| entry.is_of(node))?;
        if !is_critical {
            let is_lasting = |at: &Instant| now.us_since(*at) < CRITICAL_RECOVERY_US;
            entry.critical = entry.critical.filter(is_lasting);
            return None;
        }
        let before = entry.critical.replace(now);
        before.is_none().then_some(CanNotice::Critical(pack, node))
    }

    /// Takes a charger's reading. Its battery id is that of its node.
    pub fn charger(
        &mut self,
        node: NodeId,
        reading: &ChargerReading,
        now: Instant,
        deliver: &mut impl FnMut(CanEvent),
    ) {
        let source = Source {
            node,
            battery_id: node.number(),
        };
        let Some((entry, settings)) = self.entry_of(source, CHARGER_WAIT_US, now, deliver) else {
            return;
        };
        entry.heard = now;
        entry
            .charger
            .get_or_insert_with(|| Charger::found(settings.options));
        deliver(CanEvent::Reading(
            settings.pack,
            charger_measurement(reading, &settings),
        ));
    }

    /// Takes a charger's answer: whether its output is on now.
    pub fn charger_answer(&mut self, node: NodeId, transfer_id: u8, power: ChargerPower) {
        for entry in self.entries.iter_mut().filter(|entry| entry.is_of(node)) {
            if let Some(charger) = &mut entry.charger {
                charger.confirm(transfer_id, power);
            }
        }
    }

    /// Sends what chargers are requested now.
    pub fn switch_chargers(
        &mut self,
        now: Instant,
        deliver: &mut impl FnMut(CanEvent),
        mut send: impl FnMut(ChargerRequest),
    ) {
        for entry in &mut self.entries {
            let Some((pack, node, request)) = entry.charger_request(self.arm_state, self.transfer_id, now)
            else {
                continue;
            };
            if !request.is_repeated {
                deliver(CanEvent::Announce(CanNotice::Charger(pack, request.power)));
            }
            send(ChargerRequest {
                node,
                transfer_id: self.transfer_id,
                power: request.power,
            });
            self.transfer_id = self.transfer_id.wrapping_add(1) & 0x1f;
        }
    }

    /// The pack that this source measures, if any: its own one, else the first of the best rank. One that takes any battery
    /// has to have been without one for `wait_us`.
    fn entry_of(
        &mut self,
        source: Source,
        wait_us: u64,
        now: Instant,
        deliver: &mut impl FnMut(CanEvent),
    ) -> Option<(&mut Entry, CanPack)> {
        let is_expected = self.entries.iter().any(|entry| entry.expects(source));
        let ranks = self.entries.iter().map(|entry| entry.rank(source, wait_us, now));
        let (index, rank) = ranks
            .enumerate()
            .filter_map(|(index, rank)| rank.map(|rank| (index, rank)))
            .filter(|(_, rank)| *rank <= Rank::Named || !is_expected)
            .min_by_key(|(_, rank)| *rank)?;
        let entry = self.entries.get_mut(index)?;
        let settings = entry.settings?;
        if rank != Rank::Own {
            entry.start_with(source, now);
            info!(
                "pack {}: CAN node {}, battery {}",
                settings.pack.number(),
                source.node.number(),
                source.battery_id
            );
            deliver(CanEvent::Announce(CanNotice::Source(settings.pack, source.node)));
        }
        Some((entry, settings))
    }

    /// The pack that this source reports more of: one that takes it from any node, else its own.
    fn entry_of_aux(&mut self, source: Source) -> Option<&mut Entry> {
        let index = self
            .entries
            .iter()
            .position(|entry| entry.takes_aux_of(source.battery_id))
            .or_else(|| self.entries.iter().position(|entry| entry.source == Some(source)))?;
        self.entries.get_mut(index)
    }
}

/// Fit of a source to a pack, the best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    Own,
    /// The pack names this battery, and has none, or has lost one that may be replaced.
    Named,
    /// It takes any, and has lost one that may be replaced.
    Replaced,
    /// It takes any, and has none.
    Free,
}

impl Entry {
    const EMPTY: Self = Self {
        settings: None,
        source: None,
        id_is_changed: false,
        heard: Instant::EPOCH,
        has_had_charge: false,
        critical: None,
        aux: None,
        nominal_v: None,
        charger: None,
    };

    fn set_up(&mut self, settings: Option<&CanPack>, now: Instant) {
        let fits = |source: &Source| settings.is_some_and(|settings| settings.takes(source.battery_id));
        let battery_id = |settings: &CanPack| settings.battery_id;
        self.id_is_changed |= self.settings.as_ref().map(battery_id) != settings.map(battery_id);
        let is_wrong = self.source.is_some_and(|source| !fits(&source));
        if self.settings.is_none() {
            self.heard = now;
        }
        // One that still reports, and fits, stays until it is silent.
        if is_wrong || self.id_is_changed && self.is_lost(now) {
            *self = Self {
                heard: self.heard,
                ..Self::EMPTY
            };
        }
        self.settings = settings.copied();
    }

    fn start_with(&mut self, source: Source, now: Instant) {
        *self = Self {
            settings: self.settings,
            source: Some(source),
            heard: now,
            ..Self::EMPTY
        };
    }

    fn rank(&self, source: Source, wait_us: u64, now: Instant) -> Option<Rank> {
        let settings = self
            .settings
            .filter(|settings| settings.takes(source.battery_id))?;
        let is_replaced = settings.options.has(CanOptions::DYNAMIC_NODE) && self.is_lost(now);
        match self.source {
            Some(own) if own == source => Some(Rank::Own),
            Some(_) if !is_replaced => None,
            _ if settings.battery_id.is_some() => Some(Rank::Named),
            _ if now.us_since(self.heard) < wait_us => None,
            Some(_) => Some(Rank::Replaced),
            None => Some(Rank::Free),
        }
    }

    /// Whether the pack names this battery and takes it from another node once its own is lost: a battery that moves to
    /// another node has to wait for that.
    fn expects(&self, source: Source) -> bool {
        let names = |settings: &CanPack| {
            settings.options.has(CanOptions::DYNAMIC_NODE)
                && settings.battery_id == Some(source.battery_id.into())
        };
        self.settings.as_ref().is_some_and(names)
    }

    fn is_of(&self, node: NodeId) -> bool {
        self.source.is_some_and(|source| source.node == node)
    }

    /// The state of charge that the battery reports, 0 to 1. A node that knows neither this nor its energies may send 0
    /// for all of them (ArduPilot's AP_Periph): that counts once it has reported another percentage.
    fn state_of_charge(&self, info: &BatteryInfo) -> Option<f32> {
        let is_known = self.has_had_charge || [info.remaining_wh, info.full_wh] != [Some(0.0); 2];
        let percent = info.state_of_charge_pct.filter(|_| is_known)?;
        Some(f32::from(percent) / 100.0)
    }

    /// Whether another battery may take its source's place.
    fn is_lost(&self, now: Instant) -> bool {
        now.us_since(self.heard) > CAN_TIMEOUT_US
    }

    fn takes_aux_of(&self, battery_id: u8) -> bool {
        let takes = |settings: &CanPack| {
            settings.options.has(CanOptions::SPLIT_AUX) && settings.battery_id == Some(battery_id.into())
        };
        self.source.is_some() && self.settings.as_ref().is_some_and(takes)
    }

    fn charger_request(
        &mut self,
        arm_state: ArmState,
        transfer_id: u8,
        now: Instant,
    ) -> Option<(Pack, NodeId, SwitchRequest)> {
        let (settings, source) = self.settings.zip(self.source)?;
        let charger = self.charger.as_mut()?;
        let request = charger.poll(settings.options, arm_state, transfer_id, now)?;
        Some((settings.pack, source.node, request))
    }
}

fn measurement(info: &BatteryInfo, entry: &Entry, settings: &CanPack, now: Instant) -> Measurement {
    let share = entry.state_of_charge(info);
    let aux = entry.aux.as_ref().filter(|aux| now.us_since(aux.at) <= AUX_US);
    let aux = aux.map(|aux| &aux.content);
    let counts = !settings.options.has(CanOptions::IGNORE_CHARGE);
    // Unknown energies are 0.
    let full_wh = info.full_wh.filter(|full_wh| *full_wh > 0.0);
    let remaining_wh = info.remaining_wh.filter(|remaining_wh| *remaining_wh >= 0.0);
    let energies_wh = remaining_wh.zip(full_wh);
    Measurement {
        voltage_v: info.voltage_v,
        current_a: info
            .current_a
            .map(|current_a| current_a * settings.current_multiplier),
        gauge: if counts {
            GaugeReading::expected(entry.nominal_v.and_then(|nominal_v| gauge(info, nominal_v)))
        } else {
            GaugeReading::Absent
        },
        state_of_charge: share.filter(|_| counts),
        temperature_c: celsius(info.temperature_k),
        cells: aux.map_or(CellVoltages::NONE, |aux| aux.cells),
        details: PackDetails {
            device: info.model,
            cycle_count: aux.map(|aux| aux.cycle_count),
            state_of_health_pct: info.state_of_health_pct,
            ..PackDetails::NONE
        },
        reported: Reported {
            gauge: GaugeReport {
                error_pct: info.deviation_pct,
                over_discharges: aux.map(|aux| aux.over_discharges),
                energies_wh: energies_wh.map(<[f32; 2]>::from),
            },
            ..of_battery(info.flags)
        },
        supply: aux.map_or(Supply::On, |aux| aux.supply),
        ..Measurement::default()
    }
}

/// Range of capacities that are believed, in milliampere-hours.
const LEAST_CAPACITY_MAH: f32 = 10.0;
const MOST_CAPACITY_MAH: f32 = 1_000_000.0;

/// The charge that the battery counts. Nothing left is believed only if the percentage agrees: unknown energies are 0.
fn gauge(info: &BatteryInfo, nominal_v: f32) -> Option<Gauge> {
    let to_mah = 1000.0 / nominal_v;
    let gauge = Gauge {
        remaining_mah: info.remaining_wh? * to_mah,
        full_mah: info.full_wh? * to_mah,
    };
    let is_plausible = (0.0..=MOST_CAPACITY_MAH).contains(&gauge.remaining_mah)
        && (LEAST_CAPACITY_MAH..=MOST_CAPACITY_MAH).contains(&gauge.full_mah)
        && (gauge.remaining_mah > 0.0 || info.state_of_charge_pct == Some(0));
    is_plausible.then_some(gauge)
}

fn charger_measurement(reading: &ChargerReading, settings: &CanPack) -> Measurement {
    let side = if settings.options.has(CanOptions::CHARGER_INPUT) {
        reading.input
    } else {
        reading.output
    };
    Measurement {
        voltage_v: side.voltage_v,
        current_a: side
            .current_a
            .map(|current_a| current_a * settings.current_multiplier),
        temperature_c: Some(reading.temperature_c),
        thermometer: Thermometer::Device,
        reported: of_charger(reading.faults),
        ..Measurement::default()
    }
}

/// `STATUS_FLAG_CHARGING` of `uavcan.equipment.power.BatteryInfo`.
const CHARGING: u16 = 1 << 1;

/// `STATUS_FLAG_CHARGED`: charging is complete, and the charger is still connected.
const CHARGED: u16 = 1 << 2;

/// The fault that goes with each of its other flags: hot, cold, overload, bad battery, service needed, and an error of its
/// management system.
const OF_BATTERIES: [(u32, Faults); 6] = [
    (1 << 3, Faults::OVER_TEMPERATURE),
    (1 << 4, Faults::UNDER_TEMPERATURE),
    (1 << 5, Faults::OVER_CURRENT),
    (1 << 6, Faults::BAD_BATTERY),
    (1 << 7, Faults::NEEDS_SERVICE),
    (1 << 8, Faults::NEEDS_SERVICE),
];

/// The fault that goes with each bit of `fault_flags` in `mppt.Stream`: too much and too little voltage, overcurrent, too
/// hot. Too little is the sun's, at dusk.
const OF_CHARGERS: [(u32, Faults); 4] = [
    (1 << 0, Faults::INCOMPATIBLE_VOLTAGE),
    (1 << 1, Faults::INCOMPATIBLE_VOLTAGE),
    (1 << 2, Faults::OVER_CURRENT),
    (1 << 3, Faults::OVER_TEMPERATURE),
];

/// From `status_flags` of BatteryInfo.
fn of_battery(flags: u16) -> Reported {
    Reported {
        faults: Faults::of_flags(flags.into(), &OF_BATTERIES),
        charge_state: (flags & (CHARGING | CHARGED) != 0).then_some(ChargeState::Charging),
        modes: match flags & CHARGED {
            0 => Modes::empty(),
            _ => Modes::FULL,
        },
        ..Reported::NONE
    }
}

/// From `fault_flags` of `mppt.Stream`.
fn of_charger(flags: u8) -> Reported {
    Reported {
        faults: Faults::of_flags(flags.into(), &OF_CHARGERS),
        ..Reported::NONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_of_a_battery_is_its_fault_or_state() {
        let charging = Reported {
            charge_state: Some(ChargeState::Charging),
            ..Reported::NONE
        };
        let charged = Reported {
            modes: Modes::FULL,
            ..charging
        };
        let fault = |faults| Reported {
            faults,
            ..Reported::NONE
        };
        let all = Faults::OVER_TEMPERATURE
            | Faults::UNDER_TEMPERATURE
            | Faults::OVER_CURRENT
            | Faults::BAD_BATTERY
            | Faults::NEEDS_SERVICE;
        // As the constants of 1092.BatteryInfo.uavcan.
        for (flags, expected) in [
            (0, Reported::NONE),
            (1, Reported::NONE),
            (2, charging),
            (4, charged),
            (8, fault(Faults::OVER_TEMPERATURE)),
            (16, fault(Faults::UNDER_TEMPERATURE)),
            (32, fault(Faults::OVER_CURRENT)),
            (64, fault(Faults::BAD_BATTERY)),
            (128, fault(Faults::NEEDS_SERVICE)),
            (256, fault(Faults::NEEDS_SERVICE)),
            (512, Reported::NONE),
            (1024, Reported::NONE),
            (
                0x7ff,
                Reported {
                    faults: all,
                    ..charged
                },
            ),
        ] {
            assert_eq!(of_battery(flags), expected, "{flags}");
        }
    }
}
