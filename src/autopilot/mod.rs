//! The core: owns parameters, packs, vehicle and signing, and takes every decision between them.
//!
//! [`Autopilot`] does no I/O and reads no clock. Tasks (or a program with one loop, or a test) hand it times, readings
//! and received bytes; it hands out pins to read, motor outputs, messages and values to save. What other tasks have to do
//! after a call is in [`Work`].

mod announcement;
mod announcement_limit;
mod broadcast;
mod can_watch;
mod driving;
mod last_run;
mod learnt;
mod links;
mod packs;
mod recording;
mod sampling;
mod saving;
mod start;
mod stores;
mod wifi;
mod wifi_state;
mod wiring;

pub use announcement::{CrashLine, Notice};
pub use driving::Outputs;
pub use recording::{LOG_FULL, LogFailure, LogStep};
pub use sampling::{SAMPLING_INTERVAL_US, SAMPLING_RESOLUTION_US, SamplingProgress, SamplingTick};
pub use start::{ParameterLoad, Start};
pub use stores::{FlashJob, FlashResult, FlashStore, PackIdentity};
pub use wiring::Wiring;

use bitflags::bitflags;

use crate::announce::{Announce, AnnouncementText, announced_text};
use crate::battery::{BatteryState, PackEvent, PackNotice, SupplyEvent};
use crate::log::info;
use crate::mavlink::{BroadcastCommand, Signing, SigningChange};
use crate::memory::flash_chip::RegisterWear;
use crate::memory::identity::{FirmwareHash, Identity};
use crate::memory::in_place::in_place;
use crate::memory::save_state::SaveState;
use crate::numbers::text;
use crate::pack::Pack;
use crate::parameter::Parameters;
use crate::recorder::LogFile;
use crate::recorder::dataflash::ModeReason;
use crate::sensor::ChargerPower;
use crate::system::SystemState;
use crate::time::Instant;
use crate::vehicle::{ArmState, Vehicle, VehicleEvent, VehicleStatus};
use announcement_limit::AnnouncementLimit;
use broadcast::{Announced, Broadcast, Changes};
use can_watch::CanWatch;
use last_run::LastRun;
use packs::Packs;
use recording::Recording;
use stores::SaveReports;
use wifi_state::WifiState;

/// The autopilot without its hardware, links and clock.
#[derive(Debug)]
pub struct Autopilot {
    parameters: Parameters,
    packs: Packs,
    /// A battery reset has to be retained with the next tick.
    was_reset: bool,
    vehicle: Vehicle,
    signing: Signing,
    /// Load, identity and readiness by the latest arming checks, which run once a second.
    own_state: SystemState<'static>,
    flash_wear: RegisterWear,
    /// To be known by every ground station that connects, unless loaded.
    parameter_load: ParameterLoad,
    limit: AnnouncementLimit,
    broadcast: Broadcast,
    changes: Changes,
    /// Failures to write to each [`FlashStore`].
    save_states: [SaveState; FlashStore::ALL.len()],
    save_reports: SaveReports,
    /// To announce once it is in flash.
    signing_change: Option<SigningChange>,
    /// Since when the vehicle has been armed, as far as the signing time has to be ahead of it.
    armed_since: Option<Instant>,
    wifi: WifiState,
    can: CanWatch,
    /// To be done by the CAN task: a ground station switches the solar chargers.
    charger_switch: Option<ChargerPower>,
    recording: Recording,
    last_run: LastRun,
    /// The watchdog has the time-out of this state.
    watched_as: ArmState,
    /// Why the mode changes next, if it does.
    mode_reason: ModeReason,
    /// The vehicle's status when it was last driven.
    known_status: VehicleStatus,
    work: Work,
    /// Number of links that were opened, modulo 65536.
    opened_links: u16,
}

impl Autopilot {
    /// The autopilot at boot; nothing has been measured yet.
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(start: &Start) -> Self {
        start.log();
        Self {
            parameter_load: start.parameter_load,
            signing: in_place(|| start.signing.clone()),
            parameters: in_place(|| start.parameters.clone()),
            vehicle: in_place(Vehicle::new),
            was_reset: false,
            own_state: in_place(|| SystemState {
                identity: start.identity,
                ..SystemState::default()
            }),
            flash_wear: start.flash_wear,
            save_states: Default::default(),
            save_reports: SaveReports::default(),
            signing_change: None,
            armed_since: None,
            wifi: in_place(|| WifiState::new(start)),
            can: CanWatch::new(start),
            charger_switch: None,
            recording: in_place(|| Recording::new(start.has_crashed)),
            last_run: in_place(|| LastRun::new(start)),
            watched_as: ArmState::Disarmed,
            mode_reason: ModeReason::Command,
            known_status: in_place(VehicleStatus::default),
            work: Work::empty(),
            opened_links: 0,
            limit: AnnouncementLimit::default(),
            broadcast: Broadcast::new(),
            changes: Changes::default(),
            packs: Packs::new(&start.parameters),
        }
    }

    /// The live parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The live parameters, for a program that sets them itself.
    pub fn parameters_mut(&mut self) -> &mut Parameters {
        &mut self.parameters
    }

    /// The vehicle.
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// The state of a pack.
    pub fn battery(&self, pack: Pack) -> &BatteryState {
        self.packs.bank.state(pack)
    }

    /// Sampling ticks so far, modulo 2^32.
    pub fn samples(&self) -> u32 {
        self.packs.ticks
    }

    /// Busy share of the processor over the last second, in tenths of a percent.
    pub fn load_permille(&self) -> u16 {
        self.own_state.load_permille
    }

    /// Sets the busy share of the processor over the last second, in tenths of a percent.
    pub fn set_load(&mut self, load_permille: u16) {
        self.own_state.load_permille = load_permille;
    }

    /// Sets the program's hash, which is known a moment after the start.
    pub fn set_firmware_hash(&mut self, hash: FirmwareHash) {
        self.own_state.identity.firmware_hash = Some(hash);
    }

    /// The log files, oldest first.
    pub fn logs(&self) -> &[LogFile] {
        self.recording.files()
    }

    /// Identity of board and program.
    pub fn identity(&self) -> &Identity {
        &self.own_state.identity
    }

    /// Everything telemetry reports at `now`, apart from a link's own counters.
    pub fn system_state(&self, now: Instant) -> SystemState<'_> {
        with_borrowed(self.own_state_at(now), &self.packs, &self.recording)
    }

    /// The part of the [`system_state`](Self::system_state) that is not borrowed.
    fn own_state_at(&self, now: Instant) -> SystemState<'static> {
        SystemState {
            vehicle: self.vehicle.status(),
            armings: self.vehicle.armings(),
            now,
            ..self.own_state
        }
    }

    /// Announces an event to all connected ground stations at `now`, once. One that is repeated too often is left out.
    pub fn announce(&mut self, event: &dyn Announce, now: Instant) {
        self.announce_limited(event, now);
    }

    /// Announces an event, unless it is repeated too often; returns whether it was announced.
    fn announce_limited(&mut self, event: &dyn Announce, now: Instant) -> bool {
        let limit = event.limit();
        let text = match self.limit.count(limit, now) {
            // The next one of a state says how things are now.
            Ok(left_out) if left_out > 0 && limit.at_once > 1 => {
                text(format_args!("{event} (+{left_out} left out)"))
            }
            Ok(_) => announced_text(event),
            Err(before) => {
                if before == 0 {
                    info!("too often, left out: {}", announced_text(event).as_str());
                }
                return false;
            }
        };
        self.broadcast
            .add(Announced::Text(event.severity(), text.clone()));
        self.note_announced(&text);
        true
    }

    /// Announces an event of a pack. A failsafe level has a place of its own, without a limit; an obstacle to learning is for
    /// the log alone.
    pub fn announce_pack(&mut self, pack: Pack, event: &PackEvent, now: Instant) {
        match event {
            PackEvent::Failsafe { .. } => self.broadcast.set_level(pack, *event),
            PackEvent::NotLearnt(_) => {}
            _ => {
                let mut rest = Some(*event);
                while let Some(event) = rest {
                    let (event, further) = PackNotice(pack, &event).split();
                    rest = further;
                    // A companion computer may act on the command.
                    if self.announce_limited(&PackNotice(pack, &event), now)
                        && event == PackEvent::PoweringOff
                    {
                        let command = BroadcastCommand::power_off_initiated(pack);
                        self.broadcast.add(Announced::Command(command));
                    }
                }
                return;
            }
        }
        self.note_announced(&announced_text(&PackNotice(pack, event)));
    }

    /// Announces an event of a pack's supply.
    pub fn announce_supply(&mut self, pack: Pack, event: &SupplyEvent, now: Instant) {
        if let SupplyEvent::NotFound { answering, .. } = event {
            self.packs.not_found.insert(pack);
            self.packs.answering = *answering;
        }
        self.announce_limited(&PackNotice(pack, event), now);
    }

    /// Announces a change of the vehicle's state, which has a place of its own, without a limit.
    fn announce_vehicle(&mut self, event: VehicleEvent) {
        self.broadcast.set_mode(event);
        self.note_announced(&announced_text(&event));
    }

    fn note_announced(&mut self, text: &AnnouncementText) {
        info!("announced: {}", text.as_str());
        self.recording.add_text(text);
        self.work |= Work::ANNOUNCED;
    }

    /// Work of other tasks since the last call.
    pub fn take_work(&mut self) -> Work {
        core::mem::take(&mut self.work)
    }
}

/// The [`Autopilot::system_state`]. It borrows packs and log alone: what else there is changes while a request is handled.
fn with_borrowed<'a>(
    own_state: SystemState<'static>,
    packs: &'a Packs,
    recording: &'a Recording,
) -> SystemState<'a> {
    SystemState {
        batteries: packs.bank.states(),
        kinds: &packs.order,
        part_addresses: &packs.part_addresses,
        logs: recording.files(),
        log: recording.health(),
        log_readers: &recording.readers,
        ..own_state
    }
}

bitflags! {
    /// Work of other tasks after a call.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Work: u8 {
        /// The outputs may have changed: [`Autopilot::drive`](Autopilot::drive).
        const DRIVE = 1;
        /// Something was announced: [`Autopilot::post_due`](Autopilot::post_due) on every link.
        const ANNOUNCED = 1 << 1;
        /// Something has to be written to flash, or to be read from it.
        const SAVE = 1 << 2;
        /// A ground station requested a restart.
        const RESTART = 1 << 3;
        /// The log has something to write at once.
        const LOG = 1 << 4;
        /// The radio's set-up may have changed: [`Autopilot::wifi_setup`](Autopilot::wifi_setup).
        const WIFI = 1 << 5;
        /// The vehicle was armed or disarmed, so that the watchdog gets another time-out: [`Autopilot::watched`](Autopilot::watched).
        const WATCHDOG = 1 << 6;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::Faults;
    use broadcast::Next;

    #[test]
    fn faults_that_do_not_fit_one_text_follow_in_others() {
        let texts = |event| {
            let mut autopilot = Autopilot::new(&Start::default());
            let mut position = autopilot.broadcast.end();
            autopilot.announce_pack(Pack::Ninth, &event, Instant::EPOCH);
            let mut texts = Vec::new();
            while let Some(Next::Announced(Announced::Text(_, text))) =
                autopilot.broadcast.next(&mut position)
            {
                texts.push(text.as_str().to_owned());
            }
            texts
        };
        let two = Faults::NEEDS_SERVICE | Faults::SPIKES;
        assert_eq!(
            texts(PackEvent::ReportedFaults(two)),
            ["Battery 9 reports: needs service, voltage spikes"]
        );
        type OfFaults = fn(Faults) -> PackEvent;
        for (event, start) in [
            (PackEvent::ReportedFaults as OfFaults, "Battery 9 reports: "),
            (PackEvent::Faults, "Battery 9 fault: "),
        ] {
            let texts = texts(event(Faults::all()));
            assert!(texts.len() > 1, "{texts:?}");
            let names = texts.iter().flat_map(|text| {
                let names = text.strip_prefix(start).expect("each begins alike");
                names.split(", ").map(str::to_owned)
            });
            let names: Vec<_> = names.collect();
            let named = Faults::all()
                .iter()
                .map(|fault| PackNotice(Pack::Ninth, &event(fault)).to_string());
            let named = named.filter_map(|text| text.strip_prefix(start).map(str::to_owned));
            let named = named.filter(|name| !name.is_empty());
            // Each once, and whole.
            let mut expected: Vec<_> = named.collect();
            let mut sorted = names.clone();
            expected.sort();
            sorted.sort();
            assert_eq!(sorted, expected, "{texts:?}");
        }
    }

    #[test]
    fn only_a_pack_that_powers_off_is_announced_by_a_command() {
        let announced = |event| {
            let mut autopilot = Autopilot::new(&Start::default());
            let mut position = autopilot.broadcast.end();
            autopilot.announce_pack(Pack::Ninth, &event, Instant::EPOCH);
            let mut commands = Vec::new();
            while let Some(next) = autopilot.broadcast.next(&mut position) {
                if let Next::Announced(Announced::Command(command)) = next {
                    commands.push(*command);
                }
            }
            commands
        };
        let power_off = BroadcastCommand {
            number: 42000,
            param1: 9.0,
        };
        assert_eq!(announced(PackEvent::PoweringOff), [power_off]);
        for event in [PackEvent::ContactLost, PackEvent::Swapped] {
            assert_eq!(announced(event), []);
        }
    }
}
