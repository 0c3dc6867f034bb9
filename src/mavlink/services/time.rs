//! PING (4) and TIMESYNC (111).

use crate::mavlink::dialect::{PING_DATA, TIMESYNC_DATA};
use crate::mavlink::payload::Payload;
use crate::mavlink::{Message, Peer};

const NANOSECONDS_PER_MICROSECOND: i64 = 1000;

/// Answers a PING: the same back to its sender. One that is addressed to somebody is an answer itself.
pub(in crate::mavlink) fn ping(request: &Payload<'_>, from: Peer) -> Option<Message> {
    let is_request = request.u8(12) == 0 && request.u8(13) == 0;
    is_request.then(|| {
        Message::Ping(PING_DATA {
            time_usec: request.u64(0),
            seq: request.u32(8),
            target_system: from.system_id,
            target_component: from.component_id,
        })
    })
}

/// Answers a TIMESYNC with the time since boot. One that has a time of its own is an answer itself.
pub(in crate::mavlink) fn timesync(request: &Payload<'_>, from: Peer, now_us: u64) -> Option<Message> {
    let is_request = request.u64(0) == 0;
    is_request.then(|| {
        Message::Timesync(TIMESYNC_DATA {
            tc1: (now_us as i64).saturating_mul(NANOSECONDS_PER_MICROSECOND),
            ts1: request.u64(8) as i64,
            target_system: from.system_id,
            target_component: from.component_id,
        })
    })
}
