//! PING (4), TIMESYNC (111) and SYSTEM_TIME (2).

use super::Context;
use crate::mavlink::dialect::{PING_DATA, TIMESYNC_DATA};
use crate::mavlink::event::Event;
use crate::mavlink::signing::Access;
use crate::mavlink::{Message, Peer};
use crate::time::Utc;

const NANOSECONDS_PER_MICROSECOND: i64 = 1000;

/// The clock of a sender that is before 2020 was not set.
const EARLIEST: Utc = Utc::from_micros(1_577_836_800_000_000);

/// The target of a PING that is a request.
const NOT_ADDRESSED: Peer = Peer {
    system_id: 0,
    component_id: 0,
};

/// Answers a PING: the same back to its sender. One that has a target is an answer itself.
pub fn ping(time_us: u64, sequence: u32, target: Peer, from: Peer, context: &mut Context<'_>) -> Event {
    if target == NOT_ADDRESSED {
        context.outbox.answer(Message::Ping(PING_DATA {
            time_usec: time_us,
            seq: sequence,
            target_system: from.system_id,
            target_component: from.component_id,
        }));
    }
    Event::Answered
}

/// Answers a TIMESYNC with the time since boot. One that has a time of its own is an answer itself.
pub fn timesync(answered_ns: i64, asked_ns: i64, from: Peer, context: &mut Context<'_>) -> Event {
    if answered_ns == 0 {
        context.outbox.answer(Message::Timesync(TIMESYNC_DATA {
            tc1: (context.now.as_micros() as i64).saturating_mul(NANOSECONDS_PER_MICROSECOND),
            ts1: asked_ns,
            target_system: from.system_id,
            target_component: from.component_id,
        }));
    }
    Event::Answered
}

/// Takes the time of a ground station. Vehicles and cameras near by say theirs to everyone, too. Both of its clocks show the age
/// of the page's own commands.
pub fn system_time(unix_us: u64, boot_ms: u32, from: Peer, context: &mut Context<'_>) -> Event {
    if context.access == Access::Page {
        context.clocks.state(from, boot_ms, unix_us, context.now);
    }
    let utc = Utc::from_micros(unix_us);
    let is_plausible = utc >= EARLIEST && utc.seconds().is_some();
    if is_plausible && context.stations.knows(from, context.now) {
        Event::TimeHeard(utc)
    } else {
        Event::Ignored
    }
}
