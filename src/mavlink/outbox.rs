//! Messages that wait for the wire.

use heapless::Deque;

use super::{Message, Stream};

/// What became of a message that was posted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Posted {
    /// It waits for its turn.
    Queued,
    /// It took the turn of an older message of its stream that had not been sent yet; the older one is dropped.
    Replaced(Stream),
    /// There was no room: it is dropped.
    Refused(Stream),
}

/// Messages that wait for the wire, at most one of each stream, first come first served.
///
/// When the wire is slower than the streams, a newer message takes the place of the older one of its stream and keeps
/// its turn. So every stream gets the same share of a link that is too slow, none starves, and what arrives is fresh.
#[derive(Debug)]
pub struct Outbox<const CAPACITY: usize> {
    waiting: Deque<Message, CAPACITY>,
}

impl<const CAPACITY: usize> Outbox<CAPACITY> {
    /// An empty outbox.
    pub const fn new() -> Self {
        Self {
            waiting: Deque::new(),
        }
    }

    /// Posts `message` and says what was dropped for it, if anything.
    pub fn post(&mut self, message: Message) -> Posted {
        let stream = message.stream();
        if let Some(older) = self.waiting.iter_mut().find(|m| m.stream() == stream) {
            *older = message;
            return Posted::Replaced(stream);
        }
        match self.waiting.push_back(message) {
            Ok(()) => Posted::Queued,
            Err(_) => Posted::Refused(stream),
        }
    }

    /// Takes out the message whose turn it is.
    pub fn take(&mut self) -> Option<Message> {
        self.waiting.pop_front()
    }
}

impl<const CAPACITY: usize> Default for Outbox<CAPACITY> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::super::SystemState;
    use super::*;
    use proptest::prelude::*;

    fn battery_status(voltage_v: f32) -> Message {
        let mut state = SystemState::default();
        state.battery.voltage_v = Some(voltage_v);
        Stream::BatteryStatus(0).build(&state)
    }

    #[test]
    fn messages_leave_in_the_order_they_came() {
        let mut outbox = Outbox::<4>::new();
        let heartbeat = Stream::Heartbeat.build(&SystemState::default());
        assert_eq!(outbox.post(heartbeat.clone()), Posted::Queued);
        assert_eq!(outbox.post(battery_status(11.0)), Posted::Queued);
        assert_eq!(outbox.take(), Some(heartbeat));
        assert_eq!(outbox.take(), Some(battery_status(11.0)));
        assert_eq!(outbox.take(), None);
    }

    #[test]
    fn a_newer_message_replaces_the_older_of_its_stream_and_keeps_its_turn() {
        let mut outbox = Outbox::<4>::new();
        outbox.post(battery_status(11.0));
        outbox.post(Stream::SysStatus.build(&SystemState::default()));
        assert_eq!(
            outbox.post(battery_status(10.0)),
            Posted::Replaced(Stream::BatteryStatus(0))
        );
        assert_eq!(outbox.take(), Some(battery_status(10.0)));
        assert_eq!(outbox.take().map(|m| m.stream()), Some(Stream::SysStatus));
        assert_eq!(outbox.take(), None);
    }

    #[test]
    fn no_room_for_another_stream_is_said() {
        let mut outbox = Outbox::<1>::new();
        outbox.post(battery_status(11.0));
        let heartbeat = Stream::Heartbeat.build(&SystemState::default());
        assert_eq!(outbox.post(heartbeat), Posted::Refused(Stream::Heartbeat));
        assert_eq!(outbox.take(), Some(battery_status(11.0)));
    }

    fn any_stream() -> impl Strategy<Value = Stream> {
        prop_oneof![
            Just(Stream::Heartbeat),
            Just(Stream::SysStatus),
            (0u8..9).prop_map(Stream::BatteryStatus),
        ]
    }

    proptest! {
        /// Each post is accounted for: what came in has left, waits, or was reported as dropped.
        #[test]
        fn nothing_is_lost_unsaid(steps in prop::collection::vec((any_stream(), 0u8..3), 0..200)) {
            let mut outbox = Outbox::<4>::new();
            let (mut posted, mut dropped, mut taken) = (0, 0, 0);
            for (stream, takes) in steps {
                posted += 1;
                if outbox.post(stream.build(&SystemState::default())) != Posted::Queued {
                    dropped += 1;
                }
                for _ in 0..takes {
                    taken += usize::from(outbox.take().is_some());
                }
            }
            while outbox.take().is_some() {
                taken += 1;
            }
            prop_assert_eq!(posted, dropped + taken);
        }
    }
}
