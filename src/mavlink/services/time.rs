//! PING (4) and TIMESYNC (111).

use super::context::Context;
use crate::mavlink::dialect::{PING_DATA, TIMESYNC_DATA};
use crate::mavlink::event::Event;
use crate::mavlink::outbox::Outbox;
use crate::mavlink::requests::{Ping, Timesync};
use crate::mavlink::{Message, Peer};

const NANOSECONDS_PER_MICROSECOND: i64 = 1000;

/// The target of a PING that is a request.
const NOT_ADDRESSED: Peer = Peer {
    system_id: 0,
    component_id: 0,
};

/// Answers a PING: the same back to its sender. One that has a target is an answer itself.
pub(in crate::mavlink) fn ping(ping: &Ping, from: Peer, outbox: &mut Outbox) -> Event {
    let answer = PING_DATA {
        time_usec: ping.time_us,
        seq: ping.sequence,
        target_system: from.system_id,
        target_component: from.component_id,
    };
    if ping.target == NOT_ADDRESSED {
        outbox.answer(Message::Ping(answer));
    }
    Event::Answered
}

/// Answers a TIMESYNC with the time since boot. One that has a time of its own is an answer itself.
pub(in crate::mavlink) fn timesync(timesync: &Timesync, from: Peer, context: &mut Context<'_>) -> Event {
    let answer = TIMESYNC_DATA {
        tc1: (context.now.as_micros() as i64).saturating_mul(NANOSECONDS_PER_MICROSECOND),
        ts1: timesync.asked_ns,
        target_system: from.system_id,
        target_component: from.component_id,
    };
    if timesync.answered_ns == 0 {
        context.outbox.answer(Message::Timesync(answer));
    }
    Event::Answered
}
