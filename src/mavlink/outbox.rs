//! Messages that wait for the wire.

use heapless::Deque;

use super::{Message, Stream};
use crate::battery::MAX_PACKS;

/// Streams each pack has: BATTERY_STATUS, BATTERY_STATUS_V2, BATTERY_INFO, SMART_BATTERY_INFO, FUEL_STATUS.
const STREAMS_OF_A_PACK: usize = 5;

/// Every stream there is: HEARTBEAT, SYS_STATUS and those of each pack.
const STREAMS: usize = 2 + STREAMS_OF_A_PACK * MAX_PACKS;

/// Answers that can wait. Ground stations ask for a few things at a time and repeat what is not answered.
const REPLIES: usize = 16;

/// What became of a stream that was posted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Posted {
    /// It waits for its turn.
    Queued,
    /// It waits already: of the two messages that were to be sent, one is dropped.
    Replaced,
    /// There is no place for its stream: it is dropped.
    Refused,
}

/// There is no room for another answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct NoRoom;

/// What waits for the wire: answers, and streams whose message is due.
///
/// HEARTBEAT goes first, then answers in the order they came, then the streams in turn, always in the same order. An
/// answer waits as it was built. A stream waits by its name alone: whoever takes it builds its message at that moment.
/// So every stream gets the same share of a link that is too slow, none starves, and what arrives is fresh.
#[derive(Debug)]
pub struct Outbox {
    replies: Deque<Message, REPLIES>,
    /// The streams that wait, each at its own place.
    streams: [Option<Stream>; STREAMS],
    /// The place whose turn it is.
    turn: usize,
}

const HEARTBEAT_PLACE: usize = 0;

/// Where `stream` waits; `None` if it is of a pack that can't be.
fn place(stream: Stream) -> Option<usize> {
    match stream {
        Stream::Heartbeat => Some(HEARTBEAT_PLACE),
        Stream::SysStatus => Some(1),
        Stream::BatteryStatus(instance) => place_of_pack(0, instance),
        Stream::BatteryStatusV2(instance) => place_of_pack(1, instance),
        Stream::BatteryInfo(instance) => place_of_pack(2, instance),
        Stream::SmartBatteryInfo(instance) => place_of_pack(3, instance),
        Stream::FuelStatus(instance) => place_of_pack(4, instance),
    }
}

/// The places of one message of all packs are side by side, whatever the message's number.
fn place_of_pack(message: usize, instance: u8) -> Option<usize> {
    let instance = usize::from(instance);
    (instance < MAX_PACKS).then_some(2 + message * MAX_PACKS + instance)
}

impl Outbox {
    /// An empty outbox.
    pub fn new() -> Self {
        Self {
            replies: Deque::new(),
            streams: [None; STREAMS],
            turn: HEARTBEAT_PLACE,
        }
    }

    /// Has the next message of `stream` wait, and says what was dropped for it, if anything.
    pub fn post(&mut self, stream: Stream) -> Posted {
        let Some(place) = place(stream).and_then(|place| self.streams.get_mut(place)) else {
            return Posted::Refused;
        };
        match place.replace(stream) {
            None => Posted::Queued,
            Some(_) => Posted::Replaced,
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

    /// Takes out the HEARTBEAT, which has to leave before anything else.
    pub fn take_heartbeat(&mut self) -> Option<Stream> {
        self.streams[HEARTBEAT_PLACE].take()
    }

    /// Takes out the oldest answer.
    pub fn take_reply(&mut self) -> Option<Message> {
        self.replies.pop_front()
    }

    /// Takes out the stream whose turn it is.
    pub fn take_stream(&mut self) -> Option<Stream> {
        (0..STREAMS).find_map(|_| {
            let place = self.turn;
            self.turn = if place + 1 == STREAMS { 0 } else { place + 1 };
            self.streams.get_mut(place)?.take()
        })
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.replies.is_empty() && self.streams.iter().all(Option::is_none)
    }
}

impl Default for Outbox {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::super::status_texts;
    use super::*;
    use crate::mavlink::dialect::MavSeverity;
    use proptest::prelude::*;

    const BATTERY: Stream = Stream::BatteryStatus(0);
    const OF_A_PACK: [fn(u8) -> Stream; STREAMS_OF_A_PACK] = [
        Stream::BatteryStatus,
        Stream::BatteryStatusV2,
        Stream::BatteryInfo,
        Stream::SmartBatteryInfo,
        Stream::FuelStatus,
    ];

    fn answer(text: &str) -> Message {
        let severity = MavSeverity::MAV_SEVERITY_INFO;
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
        assert_eq!(outbox.reply(answer("one")), Ok(()));
        assert_eq!(outbox.post(Stream::Heartbeat), Posted::Queued);
        assert_eq!(outbox.reply(answer("two")), Ok(()));
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

    #[test]
    fn each_stream_has_its_turn_however_often_all_are_posted() {
        let mut outbox = Outbox::new();
        let mut taken = Vec::new();
        for round in 0..40 {
            for stream in streams() {
                outbox.post(stream);
            }
            // Another number each time, so that a round ends anywhere.
            taken.extend((0..1 + round % 4).filter_map(|_| outbox.take_stream()));
        }
        let in_turn: Vec<_> = streams().cycle().take(100).collect();
        assert_eq!(taken, in_turn);
    }

    /// Those that take turns: all but HEARTBEAT.
    fn streams() -> impl Iterator<Item = Stream> + Clone {
        let packs = OF_A_PACK
            .into_iter()
            .flat_map(|stream| (0..MAX_PACKS as u8).map(stream));
        std::iter::once(Stream::SysStatus).chain(packs)
    }

    #[test]
    fn no_room_is_said() {
        let mut outbox = Outbox::new();
        assert_eq!(outbox.room_for_replies(), REPLIES);
        for _ in 0..REPLIES {
            assert_eq!(outbox.reply(answer("x")), Ok(()));
        }
        assert_eq!(outbox.reply(answer("y")), Err(NoRoom));
        assert_eq!(outbox.room_for_replies(), 0);
        for stream in streams() {
            assert_eq!(outbox.post(stream), Posted::Queued);
        }
        for stream in OF_A_PACK {
            assert_eq!(outbox.post(stream(MAX_PACKS as u8)), Posted::Refused);
        }
    }

    fn any_stream() -> impl Strategy<Value = Stream> {
        prop_oneof![
            Just(Stream::Heartbeat),
            Just(Stream::SysStatus),
            (prop::sample::select(&OF_A_PACK[..]), 0u8..9).prop_map(|(stream, instance)| stream(instance))
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
                dropped += usize::from(outbox.post(stream) != Posted::Queued);
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
