//! The streams that are expected, and when their messages came.

use crate::board_check::evidence::Evidence;
use crate::mavlink::dialect::MavMessage;

/// A stream and the intervals between its messages.
pub(super) struct Timing {
    pub name: &'static str,
    /// By its rate.
    pub interval_us: f64,
    /// As measured, except where the board has started anew.
    pub measured_us: Vec<f64>,
}

/// `BATT_OPTIONS`: the pack has no BATTERY_STATUS.
const INTERNAL_USE_ONLY: u32 = 1 << 8;

type IsOfStream = fn(&MavMessage) -> bool;

/// HEARTBEAT, and the streams that `SR0_EXTRA1` turns on: BATTERY_STATUS of the first pack if it is reported.
pub(super) fn timings(evidence: &Evidence) -> Vec<Timing> {
    const HEARTBEAT_HZ: f32 = 1.0;
    let battery_hz = evidence.parameter("SR0_EXTRA1").unwrap_or(0.0);
    let is_monitored = evidence.parameter("BATT_MONITOR").unwrap_or(0.0) > 0.0;
    let options = evidence.parameter("BATT_OPTIONS").unwrap_or(0.0) as u32;
    let is_reported = is_monitored && options & INTERNAL_USE_ONLY == 0;
    let streams: [(_, _, IsOfStream); 3] = [
        ("HEARTBEAT", HEARTBEAT_HZ, |message| {
            matches!(message, MavMessage::HEARTBEAT(_))
        }),
        ("SYS_STATUS", battery_hz, |message| {
            matches!(message, MavMessage::SYS_STATUS(_))
        }),
        (
            "BATTERY_STATUS",
            if is_reported { battery_hz } else { 0.0 },
            |message| matches!(message, MavMessage::BATTERY_STATUS(status) if status.id == 0),
        ),
    ];
    let expected = streams.into_iter().filter(|(_, hz, _)| *hz > 0.0);
    expected
        .map(|(name, hz, is_of)| Timing {
            name,
            interval_us: 1e6 / f64::from(hz),
            measured_us: intervals_us(evidence, is_of),
        })
        .collect()
}

fn intervals_us(evidence: &Evidence, is_of: IsOfStream) -> Vec<f64> {
    let messages = evidence.in_window().filter(|received| is_of(&received.message));
    let times: Vec<_> = messages.map(|received| received.at).collect();
    let intervals = times.iter().zip(times.iter().skip(1));
    intervals
        .filter(|(_, later)| !evidence.record.is_broken_by_start(**later))
        .map(|(earlier, later)| later.us_since(*earlier) as f64)
        .collect()
}
