//! Links to ground stations: what is sent and received, and what a request leads to.

use core::mem;

use super::announcement::Notice;
use super::broadcast::{Announced, Next};
use super::recording::is_on;
use super::start::ParameterLoad;
use super::stores::FlashStore;
use super::{Autopilot, Work, with_borrowed};
use crate::announce::{ANNOUNCEMENT_BYTES, Announce, Severity, announced_text};
use crate::battery::{
    FailsafeLevel, MissingSetting, PackEvent, PackNotice, PackStatus, SuggestedThresholds, SupplyEvent,
};
use crate::log::{info, warn};
use crate::mavlink::{
    Action, Changeable, Endpoint, Event, Framer, LinkKind, LogRead, Message, STATION_SILENCE_US, Stream,
};
use crate::memory::flash_chip::RegisterWear;
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, ParameterId, VehicleParameter};
use crate::sensor::Admission;
use crate::time::Instant;
use crate::vehicle::FailsafeAction;

/// A station that is heard this soon has opened the link itself, and has had its notices.
const OPENED_BY_STATION_US: u64 = 200_000;

/// Sent to the first ground station of a link, and to one that reads all parameters.
const BANNER: &str = concat!("rover-battmon ", env!("CARGO_PKG_VERSION"));

impl Autopilot {
    /// A link has been opened: sends what every ground station has to know. Announcements follow from now on.
    pub fn open(&mut self, endpoint: &mut Endpoint) {
        endpoint.set_number(self.next_link_number());
        endpoint.position = self.broadcast.end();
        self.changes.open(self.opened_links);
        self.send_levels(endpoint);
        self.send_notices(endpoint);
    }

    /// A number that no open link has. They begin again after the last one, and some links stay open for days.
    fn next_link_number(&mut self) -> u16 {
        loop {
            self.opened_links = self.opened_links.wrapping_add(1);
            if !self.changes.is_open(self.opened_links) {
                return self.opened_links;
            }
        }
    }

    /// A link has been closed: its stations drive no more.
    // Not inlined: each link has its own task.
    #[inline(never)]
    pub fn close(&mut self, endpoint: &Endpoint) {
        self.vehicle.close_link(endpoint.number());
        self.changes.close(endpoint.number());
        self.work |= Work::DRIVE;
    }

    /// The first station of a link: one that listens since the link was opened has had the other notices.
    fn greet(&self, endpoint: &mut Endpoint, now: Instant) {
        if mem::replace(&mut endpoint.is_greeted, true) {
            return;
        }
        endpoint.say(Severity::Info, BANNER);
        if now.us_since(endpoint.levels_reported_at) >= OPENED_BY_STATION_US {
            self.notify_of_interruption(endpoint);
        }
    }

    /// Sends what interrupted the last run on this link only.
    fn notify_of_interruption(&self, endpoint: &mut Endpoint) {
        let running = self.identity().firmware_hash;
        self.last_run
            .report(running, &mut |notice| notify(endpoint, notice));
    }

    /// Notices for a ground station that connects: about the start, and about what can't be saved or trusted now.
    fn send_notices(&self, endpoint: &mut Endpoint) {
        self.notify_of_interruption(endpoint);
        if self.parameter_load != ParameterLoad::Loaded {
            notify(endpoint, &self.parameter_load);
        }
        notify_any(endpoint, self.can.impossible);
        notify_any(endpoint, self.parameters.trouble());
        notify_any(endpoint, self.parameters.save_failure());
        notify_any(endpoint, self.signing.trouble());
        for store in [FlashStore::Learnt, FlashStore::Wifi] {
            let failure = self.save_failure(store);
            notify_any(endpoint, failure.map(|error| Notice::NotSaved(store, error)));
        }
        notify_any(endpoint, self.wifi.trouble());
        notify_any(endpoint, self.can.trouble());
        notify_any(endpoint, self.log_wears_flash().then_some(Notice::LogWearsFlash));
        notify_any(endpoint, self.missing_threshold().map(Notice::FailsafesOff));
        for pack in Pack::ALL {
            if self.packs.not_found.contains(pack) {
                let event = SupplyEvent::NotFound {
                    address: self.packs.part_addresses[pack as usize],
                    answering: self.packs.answering,
                };
                notify(endpoint, &PackNotice(pack, &event));
            }
            notify_any(endpoint, self.suggestion(pack));
        }
    }

    /// Whether a register of the flash chip is stored with each page of the log.
    fn log_wears_flash(&self) -> bool {
        self.flash_wear == RegisterWear::EachPage && is_on(&self.parameters)
    }

    /// The failsafe levels that were latched, and the power limits that began, before the link was opened.
    fn send_levels(&self, endpoint: &mut Endpoint) {
        for (pack, state) in Pack::ALL.into_iter().zip(self.packs.bank.states()) {
            if state.failsafe != FailsafeLevel::None {
                let event = PackEvent::failsafe(state.failsafe, state.readings.voltage_v, state);
                notify(endpoint, &PackNotice(pack, &event));
            }
            if let limit @ Some(_) = self.vehicle.power_limit_w(pack) {
                notify(endpoint, &PackNotice(pack, &SupplyEvent::PowerLimited(limit)));
            }
        }
    }

    /// Sends the levels to a station that was away, unless they were reported on its link since.
    fn repeat_levels(&self, endpoint: &mut Endpoint, now: Instant) {
        if now.us_since(endpoint.levels_reported_at) >= STATION_SILENCE_US {
            endpoint.levels_reported_at = now;
            self.send_levels(endpoint);
        }
    }

    /// The parameter to set if packs are monitored and none of them has a failsafe threshold in effect: a timer or
    /// capacity that is missing, else a threshold of the first.
    fn missing_threshold(&self) -> Option<ParameterId> {
        let is_monitored = |pack: &Pack| self.battery(*pack).status != PackStatus::Disabled;
        let mut found = None;
        for pack in Pack::ALL.into_iter().filter(is_monitored) {
            let settings = self.parameters.pack(pack).settings_of_kind(self.packs.kind(pack));
            let missing = settings.failsafe.missing_setting(self.battery(pack))?;
            let completes_another = matches!(missing, MissingSetting::Timer | MissingSetting::Capacity);
            if found.is_none() || completes_another {
                found = Some(BatteryParameter::from(missing).of(pack));
            }
        }
        found
    }

    /// Thresholds for a pack that has none.
    pub(super) fn suggestion(&self, pack: Pack) -> Option<Notice> {
        let settings = self.parameters.pack(pack).settings();
        let suggested = SuggestedThresholds::of(self.battery(pack), &settings)?;
        Some(Notice::Suggestion(pack, suggested))
    }

    /// Has every link except that of `except` report the parameters that have changed.
    pub(super) fn report_changes(&mut self, except: Option<u16>) {
        let mut changed = self.parameters.take_changed();
        // Its PARAM_VALUE would come from another system than the others.
        changed.remove(VehicleParameter::SysidThismav.into());
        if !changed.is_empty() {
            self.changes.add(&changed, except);
            self.work |= Work::ANNOUNCED;
        }
    }

    /// Posts what was announced, what has changed, and every stream that is due at `now`.
    pub fn post_due(&mut self, endpoint: &mut Endpoint, now: Instant) {
        self.post_announcements(endpoint);
        if let Some(changed) = self.changes.take(endpoint.number()) {
            endpoint.report_parameters(&changed, now);
        }
        let state = self.system_state(now);
        let dropped = endpoint.post_due(now, &state, &self.parameters);
        if let Some(stream) = dropped
            && endpoint.drop_log.take(now)
        {
            warn!(
                "{}: link too slow, dropped {:?}, {} messages so far",
                endpoint.name(),
                stream,
                endpoint.statistics().dropped
            );
        }
    }

    /// Posts the next urgent announcement once the one before has left.
    fn post_urgent(&self, endpoint: &mut Endpoint) {
        if endpoint.outbox.has_room_for_urgent()
            && let Some((severity, text)) = self.broadcast.next_urgent(&mut endpoint.position)
        {
            endpoint.outbox.say_urgently(severity, &text);
        }
    }

    /// Announcements for which there is no room wait for the next call.
    fn post_announcements(&self, endpoint: &mut Endpoint) {
        self.post_urgent(endpoint);
        while endpoint.outbox.has_room_to_announce(ANNOUNCEMENT_BYTES) {
            match self.broadcast.next(&mut endpoint.position) {
                Some(Next::Announced(Announced::Text(severity, text))) => {
                    endpoint.say(*severity, text);
                }
                Some(Next::Announced(Announced::Command(command))) => {
                    endpoint.outbox.answer(Message::BroadcastCommand(*command));
                }
                Some(Next::Lost(lost)) => {
                    warn!("{}: busy, {} announcements were not sent", endpoint.name(), lost);
                }
                None => return,
            }
        }
    }

    /// The next read of the log for a download, if one is needed: see [`Endpoint::next_read`].
    ///
    /// [`Endpoint::next_read`]: crate::mavlink::Endpoint::next_read
    pub fn next_read(&self, endpoint: &mut Endpoint, now: Instant) -> Option<LogRead> {
        endpoint.next_read(&self.system_state(now), &self.parameters)
    }

    /// The frame of the message that leaves next, signed if there is a key.
    pub fn next_frame<'a>(
        &mut self,
        endpoint: &mut Endpoint,
        framer: &'a mut Framer,
        now: Instant,
    ) -> Option<&'a [u8]> {
        self.post_urgent(endpoint);
        let message = endpoint.next_message(&self.system_state(now), &self.parameters);
        // By reference: a message is large, and each move copies it.
        let message = message.as_ref()?;
        let system_id = self.parameters.system_id();
        let frame = framer.signed_frame(message, system_id, &mut self.signing, endpoint.kind(), now);
        endpoint.count_bytes(frame);
        Some(frame)
    }

    /// The frame of a HEARTBEAT for stations that have no link yet, by which ground stations find the vehicle; signed if there is a key.
    pub fn heartbeat_frame<'a>(&mut self, framer: &'a mut Framer, kind: LinkKind, now: Instant) -> &'a [u8] {
        let heartbeat = Stream::Heartbeat.build(&self.system_state(now));
        let system_id = self.parameters.system_id();
        framer.signed_frame(&heartbeat, system_id, &mut self.signing, kind, now)
    }

    /// Handles the next frame of what was pushed; `None` when there is none. It can't have been received before
    /// `received_at`: received bytes may have waited on their way. What has waited for longer than `FS_TIMEOUT` does not
    /// move the rover.
    pub fn handle_next(
        &mut self,
        endpoint: &mut Endpoint,
        now: Instant,
        received_at: Instant,
    ) -> Option<Event> {
        let state = with_borrowed(self.own_state_at(now), &self.packs, &self.recording);
        let mut command = None;
        let event = endpoint.handle_next(
            now,
            received_at,
            &state,
            Changeable {
                parameters: &mut self.parameters,
                vehicle: &mut self.vehicle,
                signing: &mut self.signing,
                wifi: &mut self.wifi.credentials,
                command: &mut command,
            },
        )?;
        if let Some(command) = &command {
            self.recording.add_command(command, now);
            self.work |= Work::LOG;
        }
        if endpoint.kind() == LinkKind::Wifi {
            self.wifi.heard_at = Some(now);
        }
        self.react(&event, endpoint, now, received_at);
        let has_own = matches!(event, Event::ParameterSet(_) | Event::ParametersSet);
        self.report_changes(has_own.then(|| endpoint.number()));
        Some(event)
    }

    /// Acts on a handled frame.
    fn react(&mut self, event: &Event, endpoint: &mut Endpoint, now: Instant, received_at: Instant) {
        let link = endpoint.name();
        match *event {
            Event::Ignored | Event::Answered | Event::GroundStationHeard => {}
            Event::GroundStationIntroduced => {
                self.greet(endpoint, now);
                self.repeat_levels(endpoint, now);
            }
            Event::ListRequested => {
                endpoint.say(Severity::Info, BANNER);
                self.send_notices(endpoint);
            }
            Event::TimeHeard(utc) => self.recording.set_time(utc, now),
            Event::Driven => self.work |= Work::DRIVE,
            Event::Command(action) => {
                info!("{}: {:?}", link, action);
                self.act(action, link, now);
            }
            Event::ParameterSet(id) => {
                self.announce_late_action(id, now);
                self.parameter_set(id, link);
            }
            Event::ParametersSet => {
                info!("{}: parameters set by a file", link);
                self.all_parameters_set();
            }
            Event::Triggered(id) => self.trigger(id, endpoint, now),
            Event::SigningSetUp(change) => {
                info!("{}: signing: {:?}", link, change);
                self.save_signing(change);
            }
            Event::WifiSetUp(mode) => {
                info!("{}: Wi-Fi: {:?}", link, mode);
                self.parameter_set(VehicleParameter::WifiMode.into(), link);
                self.wifi_set_up();
            }
            Event::LogsErased => {
                self.recording.erase_all();
                self.announce(&Notice::LogsErased { link }, now);
            }
            Event::Measured {
                component_id,
                ref report,
            } => {
                if let Some(admission) = self.add_external_report(component_id, report, received_at, now) {
                    log_admission(admission, component_id, report.pack(), endpoint, now);
                }
            }
            Event::Unauthorized { count } => self.announce(&Notice::Unauthorized { link, count }, now),
            Event::TooOld => self.announce_too_old(link, now),
            Event::ParameterRefused(id, why) => self.announce(&Notice::ParameterRefused { id, why }, now),
            Event::CommandRefused(command) => {
                // Some ground stations repeat for as long as they run what this rover does not have.
                if endpoint.refused_command.has_changed(Some(command)) {
                    warn!("{}: refused: {:?}", link, *event);
                }
            }
            Event::ParameterUnknown
            | Event::ControlTooLate
            | Event::SigningRefused(_)
            | Event::WifiRefused(_) => {
                if endpoint.refusal_log.take(now) {
                    warn!("{}: refused: {:?}", link, *event);
                }
            }
        }
    }

    /// Announces that signed messages are too old: because another sender with their ids has signed later ones, if that is so.
    fn announce_too_old(&mut self, link: &'static str, now: Instant) {
        if let Some(ids) = self.signing.overtaken() {
            self.announce(&Notice::SharedIds { link, ids }, now);
        } else if self.signing.reports_old() {
            self.announce(&Notice::TooOld { link }, now);
        }
    }

    fn parameter_set(&mut self, id: ParameterId, link: &'static str) {
        let value = self.parameters.get(id);
        info!("{}: {} set to {}", link, id.name().as_str(), value);
        self.recording.add_parameter(id, &self.parameters);
        self.parameters_changed();
    }

    fn all_parameters_set(&mut self) {
        self.recording.add_all_parameters();
        self.parameters_changed();
    }

    fn parameters_changed(&mut self) {
        self.follow_wifi_parameters();
        self.work |= Work::SAVE;
    }

    /// Announces that a failsafe action was chosen too late to act now: the pack has reached its level before.
    fn announce_late_action(&mut self, id: ParameterId, now: Instant) {
        let ParameterId::Battery(pack, parameter) = id else {
            return;
        };
        let reached = FailsafeAction::level_of(parameter, self.battery(pack).failsafe);
        let Some(level) = reached.filter(|_| self.parameters.has_changed(id)) else {
            return;
        };
        let action = FailsafeAction::from_parameters(self.parameters.pack(pack), &[level]);
        if self.vehicle.would_act(action) {
            self.announce_supply(pack, &SupplyEvent::ActionTooLate(level), now);
        }
    }

    /// Does what a parameter triggers.
    fn trigger(&mut self, id: ParameterId, endpoint: &mut Endpoint, now: Instant) {
        let link = endpoint.name();
        info!("{}: {}", link, id.name().as_str());
        match id {
            ParameterId::Battery(pack, BatteryParameter::LrnErase) => {
                self.erase_learnt(pack);
                self.announce(&Notice::LearntErased { link, pack }, now);
            }
            ParameterId::Vehicle(VehicleParameter::WifiShow) => self.show_wifi(endpoint),
            ParameterId::Vehicle(VehicleParameter::ParamChecked) => {
                self.parameters.confirm();
                // There may be another one.
                notify_any(endpoint, self.parameters.trouble());
                self.work |= Work::SAVE;
            }
            _ => {}
        }
    }

    fn act(&mut self, action: Action, link: &'static str, now: Instant) {
        match action {
            Action::Restart(_) => self.work |= Work::RESTART,
            Action::ResetParameters => {
                self.parameters.reset();
                self.announce(&Notice::ParametersReset, now);
                self.all_parameters_set();
            }
            Action::SwitchChargers(power) => self.charger_switch = Some(power),
            Action::ResetBatteries { packs, percent } => {
                self.packs
                    .reset(packs, percent, &self.parameters, self.vehicle.arm_state());
                self.update_vehicle();
                self.was_reset = true;
                self.announce(&Notice::BatteriesReset { link, packs, percent }, now);
                self.work |= Work::DRIVE;
            }
        }
    }
}

fn notify_any(endpoint: &mut Endpoint, notice: Option<impl Announce>) {
    if let Some(notice) = notice {
        notify(endpoint, &notice);
    }
}

/// Sends `notice` on this link only.
fn notify(endpoint: &mut Endpoint, notice: &dyn Announce) {
    let text = announced_text(notice);
    info!("{}: {}", endpoint.name(), text.as_str());
    endpoint.say(notice.severity(), &text);
}

fn log_admission(admission: Admission, component_id: u8, pack: Pack, endpoint: &mut Endpoint, now: Instant) {
    let number = pack.number();
    match admission {
        Admission::Known | Admission::LessComplete => {}
        Admission::New | Admission::Successor => {
            info!("battery {}: measured by component {}", number, component_id)
        }
        Admission::OtherSource | Admission::TooLate => {
            if endpoint.refusal_log.take(now) {
                let link = endpoint.name();
                warn!(
                    "{}: battery {}: component {} refused: {:?}",
                    link, number, component_id, admission
                );
            }
        }
    }
}
