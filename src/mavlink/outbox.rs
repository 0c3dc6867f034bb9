//! Messages that wait for the wire.

use core::mem;

use heapless::Deque;

use super::dialect::{MavResult, STATUSTEXT_DATA};
use super::messages::chunks_of;
use super::{CommandAck, DefaultRate, Message, Peer, Stream, StreamKind, status_texts};
use crate::announce::Severity;
use crate::pack::{Pack, PackSet};
use crate::system::ArmingObstacle;

/// Answers that can wait. Ground stations ask for a few things at a time and repeat what is not answered.
const REPLIES: usize = 16;

/// Part of them that announcements leave free.
const FOR_ANSWERS: usize = 8;

/// Messages of one urgent text.
const URGENT: usize = 2;

/// Result of posting a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Posted {
    /// It waits for its turn.
    Queued,
    /// It waits already: of the two messages that were to be sent, one is dropped.
    Replaced,
}

/// The queue for the wire: answers, and streams whose message is due.
///
/// HEARTBEAT goes first, then an urgent text, answers in the order they came, then the streams in turn, always in the order of their table
/// and of the packs. An answer waits as it was built. A stream waits by its name alone: its message is built when it is
/// taken. So every stream gets the same share of a link that is too slow, none starves, and what arrives is fresh.
#[derive(Debug, Default)]
pub struct Outbox {
    /// The rest of an urgent text.
    urgent: Deque<STATUSTEXT_DATA, URGENT>,
    /// Why arming was refused last, until that is the urgent text.
    refused_arming: Option<ArmingObstacle>,
    replies: Deque<Message, REPLIES>,
    /// The packs whose stream of each message waits, in the order of [`StreamKind::ALL`]. One of the vehicle is as that of the
    /// first pack.
    waiting: [PackSet; StreamKind::COUNT],
    /// The kind, by its place in [`StreamKind::ALL`], and the instance of the first pack whose turn it is.
    turn: (usize, u8),
    /// Messages of the link that were dropped.
    dropped: u32,
    /// Long texts so far, of which each has a number.
    texts: u16,
    /// Of the last acknowledgement.
    result: MavResult,
}

impl Outbox {
    /// An empty outbox.
    pub fn new() -> Self {
        Self::default()
    }

    /// Has the next message of `stream` wait, and says what was dropped for it, if anything.
    pub fn post(&mut self, stream: Stream) -> Posted {
        let waiting = &mut self.waiting[stream.kind() as usize];
        if waiting.insert(stream.pack().unwrap_or(Pack::First)) {
            Posted::Queued
        } else {
            Posted::Replaced
        }
    }

    /// Has the messages wait that say what `pack` is. One that waits already says the same, so nothing is dropped for it.
    pub fn post_details(&mut self, pack: Pack) {
        let kinds = StreamKind::ALL.into_iter();
        for kind in kinds.filter(|kind| kind.default_rate() == DefaultRate::OnChange) {
            self.post(kind.of(pack));
        }
    }

    /// The result that was acknowledged last.
    pub fn latest_result(&self) -> MavResult {
        self.result
    }

    /// Posts an answer. One for which there is no room is dropped and counted: its sender will ask again.
    pub fn answer(&mut self, message: Message) {
        if self.replies.push_back(message).is_err() {
            self.count_dropped(1);
        }
    }

    /// Posts an answer if there is one.
    pub fn answer_any(&mut self, message: Option<Message>) {
        if let Some(message) = message {
            self.answer(message);
        }
    }

    /// Acknowledges a command to its sender.
    pub fn acknowledge(&mut self, command: u16, result: MavResult, to: Peer) {
        self.result = result;
        self.answer(Message::CommandAck(CommandAck {
            command,
            result,
            target_system: to.system_id,
            target_component: to.component_id,
        }));
    }

    /// Posts a text, in as many messages as it needs.
    pub fn say(&mut self, severity: Severity, text: &str) {
        let id = self.next_text_id();
        for message in status_texts(severity, text, id) {
            self.answer(Message::StatusText(message));
        }
    }

    /// Posts a text if room is left behind it for the acknowledgement that follows.
    pub fn explain(&mut self, severity: Severity, text: &str) {
        if self.room_for_replies() > chunks_of(text.len()) {
            self.say(severity, text);
        } else {
            self.count_dropped(1);
        }
    }

    /// The number of the next text, never 0.
    fn next_text_id(&mut self) -> u16 {
        self.texts = self.texts.wrapping_add(1).max(1);
        self.texts
    }

    /// This many messages were dropped, here or on their way to the wire.
    pub fn count_dropped(&mut self, messages: u32) {
        self.dropped = self.dropped.wrapping_add(messages);
    }

    /// Number of dropped messages. Wraps at 2^32.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    fn room_for_replies(&self) -> usize {
        REPLIES - self.replies.len()
    }

    /// Whether an announcement of this many bytes can be said now, without losing a part of it, and without taking the room
    /// that is left for answers.
    pub fn has_room_to_announce(&self, text_bytes: usize) -> bool {
        self.room_for_replies().saturating_sub(FOR_ANSWERS) >= chunks_of(text_bytes)
    }

    /// Has a refused arming wait for its place, instead of an earlier one.
    pub fn refuse_arming(&mut self, obstacle: ArmingObstacle) {
        self.refused_arming = Some(obstacle);
    }

    /// Makes the reason of a refused arming the urgent text, once there is room for it.
    pub fn say_refused_arming(&mut self) {
        if let Some(obstacle) = self.refused_arming.take_if(|_| self.urgent.is_empty()) {
            self.say_urgently(Severity::Critical, &obstacle.text("Arm"));
        }
    }

    /// Whether there is room for an urgent text.
    pub fn has_room_for_urgent(&self) -> bool {
        self.urgent.is_empty() && self.refused_arming.is_none()
    }

    /// Posts an urgent text. It has two messages at most; the rest is cut off.
    pub fn say_urgently(&mut self, severity: Severity, text: &str) {
        let id = self.next_text_id();
        for message in status_texts(severity, text, id) {
            let _ = self.urgent.push_back(message);
        }
    }

    /// Takes out the next message of the urgent text, unless another text has begun: it is not interrupted.
    pub fn take_urgent(&mut self) -> Option<Message> {
        match self.replies.front() {
            Some(Message::StatusText(text)) if text.chunk_seq > 0 => None,
            _ => self.urgent.pop_front().map(Message::StatusText),
        }
    }

    /// Takes out the HEARTBEAT, which has to leave before anything else.
    pub fn take_heartbeat(&mut self) -> Option<Stream> {
        let waiting = &mut self.waiting[StreamKind::Heartbeat as usize];
        (!mem::take(waiting).is_empty()).then_some(Stream::Heartbeat)
    }

    /// Takes out the oldest answer.
    pub fn take_reply(&mut self) -> Option<Message> {
        self.replies.pop_front()
    }

    /// Takes out the stream whose turn it is.
    pub fn take_stream(&mut self) -> Option<Stream> {
        // Once more than there are messages: the packs before the turn come last.
        (0..=StreamKind::COUNT).find_map(|_| self.take_in_turn())
    }

    /// Takes out the next stream of the message whose turn it is. If none waits, it is the next message's turn.
    fn take_in_turn(&mut self) -> Option<Stream> {
        let (place, from_instance) = self.turn;
        let kind = *StreamKind::ALL.get(place)?;
        let waiting = &mut self.waiting[kind as usize];
        let Some(pack) = waiting.iter().find(|pack| pack.instance() >= from_instance) else {
            self.turn = ((place + 1) % StreamKind::COUNT, 0);
            return None;
        };
        waiting.remove(pack);
        self.turn = (place, pack.instance() + 1);
        Some(kind.of(pack))
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.urgent.is_empty()
            && self.refused_arming.is_none()
            && self.replies.is_empty()
            && self.waiting == [PackSet::NONE; StreamKind::COUNT]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BATTERY: Stream = Stream::BatteryStatus(Pack::First);

    fn answer(text: &str) -> Message {
        let severity = Severity::Info;
        Message::StatusText(
            status_texts(severity, text, 1)
                .next()
                .expect("a text has a chunk"),
        )
    }

    #[derive(Debug, PartialEq)]
    enum Taken {
        Stream(Stream),
        Reply(Message),
    }

    fn take(outbox: &mut Outbox) -> Option<Taken> {
        let heartbeat = outbox.take_heartbeat().map(Taken::Stream);
        heartbeat
            .or_else(|| outbox.take_reply().map(Taken::Reply))
            .or_else(|| outbox.take_stream().map(Taken::Stream))
    }

    #[test]
    fn heartbeat_goes_first_then_answers_then_streams_in_turn() {
        let mut outbox = Outbox::new();
        assert_eq!(outbox.post(Stream::SysStatus), Posted::Queued);
        assert_eq!(outbox.post(BATTERY), Posted::Queued);
        outbox.answer(answer("one"));
        assert_eq!(outbox.post(Stream::Heartbeat), Posted::Queued);
        outbox.answer(answer("two"));
        assert_eq!(take(&mut outbox), Some(Taken::Stream(Stream::Heartbeat)));
        assert_eq!(take(&mut outbox), Some(Taken::Reply(answer("one"))));
        assert_eq!(take(&mut outbox), Some(Taken::Reply(answer("two"))));
        assert_eq!(take(&mut outbox), Some(Taken::Stream(Stream::SysStatus)));
        assert_eq!(take(&mut outbox), Some(Taken::Stream(BATTERY)));
        assert_eq!(take(&mut outbox), None);
    }

    #[test]
    fn a_stream_that_is_posted_twice_waits_once() {
        let mut outbox = Outbox::new();
        assert_eq!(outbox.post(BATTERY), Posted::Queued);
        assert_eq!(outbox.post(BATTERY), Posted::Replaced);
        assert_eq!(take(&mut outbox), Some(Taken::Stream(BATTERY)));
        assert_eq!(take(&mut outbox), None);
        assert_eq!(outbox.post(BATTERY), Posted::Queued);
    }

    /// Sixteen wait on each link: bytes of files, which are longer, must not be among them.
    #[test]
    fn no_message_is_longer_than_battery_info() {
        let battery_info = size_of::<crate::mavlink::dialect::BATTERY_INFO_DATA>();
        assert!(size_of::<Message>() <= battery_info + size_of::<u32>());
    }

    fn any_stream() -> impl Strategy<Value = Stream> {
        let any_of = |kind: StreamKind| prop::sample::select(kind.streams().collect::<Vec<_>>());
        prop::sample::select(&StreamKind::ALL[..]).prop_flat_map(any_of)
    }

    proptest! {
        /// Each post is accounted for: what came in has left, waits, or was reported as dropped.
        #[test]
        fn nothing_is_lost_unsaid(
            steps in prop::collection::vec((any_stream(), any::<bool>(), 0u8..4), 0..200),
        ) {
            let mut outbox = Outbox::new();
            let (mut posted, mut dropped, mut taken) = (0, 0, 0);
            for (stream, reply, takes) in steps {
                posted += 1 + usize::from(reply);
                dropped += usize::from(outbox.post(stream) != Posted::Queued);
                if reply {
                    outbox.answer(answer("x"));
                }
                for _ in 0..takes {
                    taken += usize::from(take(&mut outbox).is_some());
                }
            }
            while take(&mut outbox).is_some() {
                taken += 1;
            }
            prop_assert!(outbox.is_empty());
            prop_assert_eq!(posted, dropped + outbox.dropped() as usize + taken);
        }
    }
}
