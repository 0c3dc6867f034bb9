//! Our end of one link: what is received and what is sent, without the wire.

use core::iter;

use super::details_change::DetailsChangeDetector;
use super::dispatcher::{Services, dispatch};
use super::event::Event;
use super::outbox::{Outbox, Posted};
use super::parser::FrameParser;
use super::rates::Rates;
use super::sender_clocks::SenderClocks;
use super::services::LateSticksTexts;
use super::services::log_download::LogRead;
use super::services::{Changeable, Context};
use super::signing::{Access, Authenticity, LinkKind};
use super::stations::Stations;
use super::{Message, Outgoing, Stream, StreamKind};
use crate::announce::{LastAnnounced, RateLimit, Severity};
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{ParameterIdSet, Parameters, VehicleParameter};
use crate::system::{LinkStatistics, SystemState};
use crate::time::Instant;
use crate::vehicle::Presence;

/// Minimum interval between log lines about drops, and between those about refusals.
const LOG_INTERVAL_US: u64 = 1_000_000;

/// A few dropped messages may be a hiccup; this many mean a link that is too slow.
const DROPS_UNTIL_SHORTFALL: u8 = 10;

/// The announcements to all links that one link has sent, as counts modulo 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct BroadcastPosition {
    /// Failsafe levels of each pack.
    pub levels: [u32; MAX_PACKS],
    /// Changes of the mode.
    pub mode: u32,
    /// Number of the next one in the queue.
    pub next: u32,
}

/// Our end of one link. Bytes and times come in, messages and events come out; the wire is not part of it.
#[derive(Debug)]
pub struct Endpoint {
    name: &'static str,
    kind: LinkKind,
    access: Access,
    number: u16,
    bytes_per_second: u32,
    parser: FrameParser,
    rates: Rates,
    services: Services,
    /// Messages that wait for the wire.
    pub(crate) outbox: Outbox,
    details: DetailsChangeDetector,
    stations: Stations,
    clocks: SenderClocks,
    sent: u32,
    sent_bytes: u32,
    /// Messages of streams that were dropped (saturating).
    streams_dropped: u8,
    /// Received messages that were not signed as they would have to be.
    unauthorized: u32,
    shortfall_said: bool,
    late_sticks_texts: LateSticksTexts,
    /// Announcements to all links that this one has sent.
    pub(crate) position: BroadcastPosition,
    /// When latched failsafe levels were reported last; at the start, when it was opened.
    pub(crate) levels_reported_at: Instant,
    /// Whether a station was heard since it was opened.
    pub(crate) is_greeted: bool,
    pub(crate) drop_log: RateLimit<LOG_INTERVAL_US>,
    pub(crate) refusal_log: RateLimit<LOG_INTERVAL_US>,
    /// The command that was refused last.
    pub(crate) refused_command: LastAnnounced<Option<u16>>,
}

impl Endpoint {
    /// An end of a link of this kind, called `name` in the log, that carries `bytes_per_second`. Its first HEARTBEAT is due
    /// at `now`.
    pub fn new(name: &'static str, kind: LinkKind, bytes_per_second: u32, now: Instant) -> Self {
        Self {
            name,
            kind,
            access: Access::Full,
            number: 0,
            bytes_per_second,
            parser: FrameParser::new(),
            rates: Rates::new(now),
            services: Services::default(),
            outbox: Outbox::new(),
            details: DetailsChangeDetector::default(),
            stations: Stations::default(),
            clocks: SenderClocks::default(),
            sent: 0,
            sent_bytes: 0,
            streams_dropped: 0,
            unauthorized: 0,
            shortfall_said: false,
            late_sticks_texts: LateSticksTexts::default(),
            position: BroadcastPosition::default(),
            levels_reported_at: now,
            is_greeted: false,
            drop_log: RateLimit::default(),
            refusal_log: RateLimit::default(),
            refused_command: LastAnnounced::default(),
        }
    }

    /// The link's name in the log.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Sets the access of the other end, from now on.
    pub fn set_access(&mut self, access: Access) {
        self.access = access;
    }

    /// The number that distinguishes it from all that were opened before.
    pub fn number(&self) -> u16 {
        self.number
    }

    /// Sets the number that distinguishes it from all that were opened before.
    pub fn set_number(&mut self, number: u16) {
        self.number = number;
    }

    /// The kind of link.
    pub fn kind(&self) -> LinkKind {
        self.kind
    }

    /// The link's counters.
    pub fn statistics(&self) -> LinkStatistics {
        LinkStatistics {
            sent: self.sent,
            sent_bytes: self.sent_bytes,
            dropped: self.outbox.dropped(),
            unauthorized: self.unauthorized,
            received: self.parser.statistics(),
        }
    }

    /// Posts everything that is due at `now`, and says what was dropped for it, if anything. What the messages say is
    /// decided when they leave.
    pub fn post_due(
        &mut self,
        now: Instant,
        state: &SystemState<'_>,
        parameters: &Parameters,
    ) -> Option<Stream> {
        self.rates.follow(parameters, now);
        self.services.list.release(
            now,
            parameters.get(VehicleParameter::Sr0Params),
            self.bytes_per_second,
        );
        let mut dropped = None;
        while let Some(kind) = self.rates.scheduler.poll(now) {
            dropped = self.post(kind, state).or(dropped);
        }
        self.post_changes(state);
        self.report_shortfall();
        dropped
    }

    /// Posts all streams of a message. A pack that is not reported has none, and its due time passes.
    fn post(&mut self, kind: StreamKind, state: &SystemState<'_>) -> Option<Stream> {
        kind.reported_in(state)
            .filter_map(|stream| self.post_stream(stream))
            .last()
    }

    /// Posts the messages that are sent when a pack is another one or more is known of it.
    fn post_changes(&mut self, state: &SystemState<'_>) {
        for pack in state.described() {
            if self.details.has_changed(pack, &state.battery(pack).details) {
                self.outbox.post_details(pack);
            }
        }
        if !self.details.has_described() {
            return;
        }
        for pack in state.reported() {
            if self.details.is_outdated(pack, state.battery(pack).revision) {
                self.outbox.post_details(pack);
            }
        }
    }

    /// Posts the next message of `stream`, and answers the stream if one was dropped for it. While a download leaves streams
    /// only a share of the link, what waits for its turn is not dropped: it is sent less often.
    fn post_stream(&mut self, stream: Stream) -> Option<Stream> {
        if self.outbox.post(stream) == Posted::Queued || self.services.downloads.is_running() {
            return None;
        }
        self.outbox.count_dropped(1);
        self.streams_dropped = self.streams_dropped.saturating_add(1);
        Some(stream)
    }

    /// Reports once that the link carries less than was requested.
    fn report_shortfall(&mut self) {
        if !self.shortfall_said && self.streams_dropped >= DROPS_UNTIL_SHORTFALL {
            self.shortfall_said = true;
            self.say(
                Severity::Warning,
                "Link too slow for its rates: telemetry reduced",
            );
        }
    }

    /// When [`Self::post_due`] has to be called next.
    pub fn next_due(&self) -> Instant {
        let streams = self.rates.scheduler.next_due();
        self.services
            .list
            .next_due()
            .map_or(streams, |list| list.min(streams))
    }

    /// The read of the log that a download's next message needs, if one is needed. [`Self::supply`] takes what
    /// was read; until then it is asked for again. One message may need several reads, so this is called until it returns
    /// `None`, before each [`Self::next_message`].
    pub fn next_read(&mut self, state: &SystemState<'_>, parameters: &Parameters) -> Option<LogRead> {
        self.services.downloads.next_read(state, parameters)
    }

    /// Takes the bytes that were read: fewer than requested where the file is gone or can't be read, which ends its download. What
    /// is not wanted any more is ignored.
    pub fn supply(&mut self, read: LogRead, bytes: &[u8]) {
        if let Err(refusal) = self.services.downloads.supply(read, bytes) {
            self.say(Severity::Warning, refusal.text());
        }
    }

    /// Counts the bytes of a frame that leaves.
    pub(crate) fn count_bytes(&mut self, frame: &[u8]) {
        self.sent_bytes = self.sent_bytes.wrapping_add(frame.len() as u32);
    }

    /// Takes out the message that leaves next, and counts it as sent. Telemetry is built now, from `state` and the link's own
    /// counters.
    pub fn next_message(&mut self, state: &SystemState<'_>, parameters: &Parameters) -> Option<Outgoing> {
        // Messages that need no read are sent without a caller that reads.
        let _ = self.next_read(state, parameters);
        self.outbox.say_refused_arming();
        let state = SystemState {
            link: self.statistics(),
            ..*state
        };
        let message = self.take_by_priority(&state, parameters);
        self.sent = self.sent.wrapping_add(u32::from(message.is_some()));
        message
    }

    /// HEARTBEAT, urgent texts, answers, the share of a parameter list; then downloads and telemetry in turn.
    fn take_by_priority(&mut self, state: &SystemState<'_>, parameters: &Parameters) -> Option<Outgoing> {
        if let Some(heartbeat) = self.outbox.take_heartbeat() {
            return Some(Outgoing::Message(heartbeat.build(state)));
        }
        if let Some(text) = self.outbox.take_urgent() {
            return Some(Outgoing::Message(text));
        }
        if let Some(answer) = self.outbox.take_reply() {
            if let Message::BatteryInfo(info) = &answer {
                self.note_described(Pack::from_instance(info.id), state);
            }
            return Some(Outgoing::Message(answer));
        }
        if let Some(value) = self.services.list.take(parameters) {
            return Some(Outgoing::Message(value));
        }
        self.take_in_turn(state)
    }

    /// The next message of a download or of a stream. If there is none of whose turn it is, the other one's.
    fn take_in_turn(&mut self, state: &SystemState<'_>) -> Option<Outgoing> {
        if self.services.downloads.are_next()
            && let Some(message) = self.services.downloads.take()
        {
            return Some(message);
        }
        match self.take_telemetry(state) {
            Some(stream) => {
                self.services.downloads.stream_taken();
                Some(Outgoing::Message(stream.build(state)))
            }
            None => self.services.downloads.take(),
        }
    }

    /// The stream whose turn it is. One of a pack that has gone while it waited has nothing to say any more.
    fn take_telemetry(&mut self, state: &SystemState<'_>) -> Option<Stream> {
        let mut waiting = iter::from_fn(|| self.outbox.take_stream());
        let stream = waiting.find(|stream| stream.is_reported_in(state))?;
        if stream.kind() == StreamKind::BatteryInfo {
            self.note_described(stream.pack(), state);
        }
        Some(stream)
    }

    /// A BATTERY_INFO of a pack leaves: it has to be corrected once it is outdated.
    fn note_described(&mut self, pack: Option<Pack>, state: &SystemState<'_>) {
        if let Some(pack) = pack {
            self.details.describe(pack, state.battery(pack).revision);
        }
    }

    /// Whether everything that was asked for has left.
    pub fn is_idle(&self) -> bool {
        self.outbox.is_empty()
    }

    /// Sends a text, in as many messages as it needs.
    pub fn say(&mut self, severity: Severity, text: &str) {
        self.outbox.say(severity, text);
    }

    /// Reports the values of these parameters, which have changed, in the share that lists have of the link. `now` is the
    /// present moment.
    pub fn report_parameters(&mut self, changed: &ParameterIdSet, now: Instant) {
        self.services.list.report(changed, now);
    }

    /// Takes as many of the received `bytes` as there is room for, and says how many; at least one after
    /// [`Self::handle_next`] has answered `None`.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        self.parser.push(bytes)
    }

    /// Bytes were lost before they could be pushed.
    pub fn count_overrun(&mut self) {
        self.parser.count_overrun();
    }

    /// The sender has paused for too long to complete what it began.
    pub fn give_up_waiting(&mut self) {
        self.parser.give_up_waiting();
    }

    /// Handles the next frame of what was pushed; `None` when there is none. It can't have been received before `received_at`:
    /// bytes that come may have waited on their way. Nothing that has waited for longer than `FS_TIMEOUT` moves the rover.
    pub fn handle_next(
        &mut self,
        now: Instant,
        received_at: Instant,
        state: &SystemState<'_>,
        changeable: Changeable<'_>,
    ) -> Option<Event> {
        let link = self.statistics();
        let frame = self.parser.next_frame()?;
        let state = SystemState { link, ..*state };
        let mut context = Context {
            now,
            received_at,
            age_ms: None,
            authenticity: Authenticity::Unproven,
            presence: Presence::Unknown,
            state: &state,
            changeable,
            rates: &mut self.rates,
            stations: &mut self.stations,
            clocks: &mut self.clocks,
            link: self.kind,
            access: self.access,
            link_number: self.number,
            unauthorized: &mut self.unauthorized,
            late_sticks_texts: &mut self.late_sticks_texts,
            outbox: &mut self.outbox,
        };
        Some(dispatch(&frame, &mut self.services, &mut context))
    }
}
