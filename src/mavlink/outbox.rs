//! Messages that wait for the wire.

use heapless::{Deque, Vec};

use super::{Message, Stream};
use crate::battery::MAX_PACKS;

/// Every stream there is: HEARTBEAT, SYS_STATUS and BATTERY_STATUS of each pack.
const STREAMS: usize = 2 + MAX_PACKS;

/// Answers that can wait. Ground stations ask for a few things at a time and repeat what is not answered.
const REPLIES: usize = 16;

/// What became of a message of a stream that was posted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Posted {
    /// It waits for its turn.
    Queued,
    /// It took the turn of an older message of its stream that had not been sent yet; the older one is dropped.
    Replaced,
    /// There was no room: it is dropped.
    Refused,
}

/// There is no room for another answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct NoRoom;

/// Messages that wait for the wire: answers, and at most one message of each stream.
///
/// HEARTBEAT goes first, then answers in the order they came, then the streams in turn. When the wire is slower than the
/// streams, a newer message takes the place of the older one of its stream and keeps its turn. So every stream gets the
/// same share of a link that is too slow, none starves, and what arrives is fresh.
#[derive(Debug, Default)]
pub struct Outbox {
    replies: Deque<Message, REPLIES>,
    streams: Vec<(Stream, Message), STREAMS>,
}

impl Outbox {
    /// An empty outbox.
    pub fn new() -> Self {
        Self::default()
    }

    /// Posts the next message of `stream` and says what was dropped for it, if anything.
    pub fn post(&mut self, stream: Stream, message: Message) -> Posted {
        if let Some((_, older)) = self.streams.iter_mut().find(|(other, _)| *other == stream) {
            *older = message;
            return Posted::Replaced;
        }
        match self.streams.push((stream, message)) {
            Ok(()) => Posted::Queued,
            Err(_) => Posted::Refused,
        }
    }

    /// Posts an answer.
    ///
    /// # Errors
    /// There is no room; the answer is dropped, and whoever asked will ask again.
    pub fn reply(&mut self, message: Message) -> Result<(), NoRoom> {
        self.replies.push_back(message).map_err(|_| NoRoom)
    }

    /// How many more answers there is room for.
    pub fn room_for_replies(&self) -> usize {
        REPLIES - self.replies.len()
    }

    /// Takes out what has to leave before anything else: a HEARTBEAT, else the oldest answer.
    pub fn take_urgent(&mut self) -> Option<Message> {
        let heartbeat = self
            .streams
            .iter()
            .position(|(stream, _)| *stream == Stream::Heartbeat);
        match heartbeat {
            Some(place) => Some(self.streams.remove(place).1),
            None => self.replies.pop_front(),
        }
    }

    /// Takes out the message of the stream whose turn it is.
    pub fn take_stream(&mut self) -> Option<Message> {
        if self.streams.is_empty() {
            None
        } else {
            Some(self.streams.remove(0).1)
        }
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.replies.is_empty() && self.streams.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{SystemState, status_texts};
    use super::*;
    use crate::battery::BatteryState;
    use crate::mavlink::dialect::MavSeverity;
    use proptest::prelude::*;

    const BATTERY: Stream = Stream::BatteryStatus(0);

    fn build(stream: Stream) -> Message {
        stream.build(&SystemState::default())
    }

    fn battery_status(voltage_v: f32) -> Message {
        let batteries = [BatteryState {
            voltage_v: Some(voltage_v),
            ..BatteryState::default()
        }];
        BATTERY.build(&SystemState {
            batteries: &batteries,
            ..SystemState::default()
        })
    }

    fn answer(text: &str) -> Message {
        let severity = MavSeverity::MAV_SEVERITY_INFO;
        Message::StatusText(
            status_texts(severity, text, 1)
                .next()
                .expect("a text has a chunk"),
        )
    }

    fn take(outbox: &mut Outbox) -> Option<Message> {
        outbox.take_urgent().or_else(|| outbox.take_stream())
    }

    #[test]
    fn heartbeat_goes_first_then_answers_then_streams_in_turn() {
        let mut outbox = Outbox::new();
        assert_eq!(
            outbox.post(Stream::SysStatus, build(Stream::SysStatus)),
            Posted::Queued
        );
        assert_eq!(outbox.post(BATTERY, battery_status(11.0)), Posted::Queued);
        assert_eq!(outbox.reply(answer("one")), Ok(()));
        assert_eq!(
            outbox.post(Stream::Heartbeat, build(Stream::Heartbeat)),
            Posted::Queued
        );
        assert_eq!(outbox.reply(answer("two")), Ok(()));
        assert_eq!(take(&mut outbox), Some(build(Stream::Heartbeat)));
        assert_eq!(take(&mut outbox), Some(answer("one")));
        assert_eq!(take(&mut outbox), Some(answer("two")));
        assert_eq!(take(&mut outbox), Some(build(Stream::SysStatus)));
        assert_eq!(take(&mut outbox), Some(battery_status(11.0)));
        assert_eq!(take(&mut outbox), None);
    }

    #[test]
    fn a_newer_message_replaces_the_older_of_its_stream_and_keeps_its_turn() {
        let mut outbox = Outbox::new();
        outbox.post(BATTERY, battery_status(11.0));
        outbox.post(Stream::SysStatus, build(Stream::SysStatus));
        assert_eq!(outbox.post(BATTERY, battery_status(10.0)), Posted::Replaced);
        assert_eq!(take(&mut outbox), Some(battery_status(10.0)));
        assert_eq!(take(&mut outbox), Some(build(Stream::SysStatus)));
        assert_eq!(take(&mut outbox), None);
    }

    #[test]
    fn no_room_is_said() {
        let mut outbox = Outbox::new();
        for _ in 0..REPLIES {
            assert_eq!(outbox.reply(answer("x")), Ok(()));
        }
        assert_eq!(outbox.reply(answer("y")), Err(NoRoom));
        for instance in 0..STREAMS as u8 {
            outbox.post(Stream::BatteryStatus(instance), battery_status(11.0));
        }
        assert_eq!(
            outbox.post(Stream::SysStatus, build(Stream::SysStatus)),
            Posted::Refused
        );
    }

    fn any_stream() -> impl Strategy<Value = Stream> {
        prop_oneof![
            Just(Stream::Heartbeat),
            Just(Stream::SysStatus),
            (0u8..9).prop_map(Stream::BatteryStatus)
        ]
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
                dropped += usize::from(outbox.post(stream, build(stream)) != Posted::Queued);
                dropped += usize::from(reply && outbox.reply(answer("x")).is_err());
                for _ in 0..takes {
                    taken += usize::from(take(&mut outbox).is_some());
                }
            }
            while take(&mut outbox).is_some() {
                taken += 1;
            }
            prop_assert!(outbox.is_empty());
            prop_assert_eq!(posted, dropped + taken);
        }
    }
}
