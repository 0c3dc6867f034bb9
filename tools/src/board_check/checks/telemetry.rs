//! Whether telemetry arrives: all of it, undamaged, at its rates.

use rover_battmon::mavlink::dialect::MavMessage;

use super::check::{Check, Outcome, failed, not_measured, not_reached, outcome};
use crate::board_check::evidence::Evidence;

/// A stream and the intervals between its messages.
struct Timing {
    name: &'static str,
    /// By its rate.
    interval_us: f64,
    /// As measured, except where the board has restarted.
    measured_us: Vec<f64>,
}

/// `BATT_OPTIONS`: the pack has no BATTERY_STATUS.
const INTERNAL_USE_ONLY: u32 = 1 << 8;

type IsOfStream = fn(&MavMessage) -> bool;

/// HEARTBEAT, and the streams that `SR0_EXTRA1` turns on: BATTERY_STATUS of the first pack if it is reported.
fn timings(evidence: &Evidence) -> Vec<Timing> {
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

/// Half of it would be the clocks of the worst computer and board; a stream at half its rate is far off.
const TOLERANCE: f64 = 0.05;

/// Does telemetry come as often as it should?
pub(super) const RATES: Check = Check {
    name: "rates",
    measures: "median interval of HEARTBEAT, SYS_STATUS and the first BATTERY_STATUS, as a rate",
    expected: "1 Hz and `SR0_EXTRA1`, within 5 %",
    advice: "Another ground station on this link may have requested other rates; a slow link reduces them \
             (raise `SERIAL0_BAUD`).",
    judge: judge_rates,
};

fn judge_rates(evidence: &Evidence) -> Outcome {
    if evidence.window.is_none() {
        return not_reached();
    }
    let rates: Vec<_> = timings(evidence)
        .into_iter()
        .map(|timing| (rate_hz(&timing), timing))
        .collect();
    let measured: Vec<_> = rates
        .iter()
        .map(|(hz, timing)| match hz {
            Some(hz) => format!("{} {hz:.2} Hz", timing.name),
            None => format!("no {}", timing.name),
        })
        .collect();
    let off = rates
        .iter()
        .find(|(hz, timing)| hz.is_none_or(|hz| is_off(hz, timing)));
    let against = off.map(|(_, timing)| {
        format!(
            "{} does not come at {:.2} Hz.",
            timing.name,
            1e6 / timing.interval_us
        )
    });
    outcome(measured.join(", "), against)
}

/// The median does not mind messages that are lost.
fn rate_hz(timing: &Timing) -> Option<f64> {
    let mut intervals_us = timing.measured_us.clone();
    intervals_us.sort_by(f64::total_cmp);
    let median_us = intervals_us.get(intervals_us.len() / 2)?;
    Some(1e6 / median_us)
}

fn is_off(hz: f64, timing: &Timing) -> bool {
    (hz * timing.interval_us / 1e6 - 1.0).abs() > TOLERANCE
}

const WORST_JITTER_US: f64 = 100_000.0;

/// Does telemetry come regularly?
pub(super) const JITTER: Check = Check {
    name: "jitter",
    measures: "the largest distance of an interval from the stream's own, or a multiple where a message is missing",
    expected: "at most 100 ms: serial adapters and hosts hold bytes back for some 20 ms, a parameter's sector is erased \
               in 45 ms",
    advice: "Connect by USB or a cable; end other programs that keep the computer busy.",
    judge: judge_jitter,
};

fn judge_jitter(evidence: &Evidence) -> Outcome {
    if evidence.window.is_none() {
        return not_reached();
    }
    let jitters = timings(evidence).into_iter().flat_map(|timing| {
        let name = timing.name;
        jitters_us(&timing)
            .into_iter()
            .map(move |jitter_us| (jitter_us, name))
    });
    let Some((worst_us, name)) = jitters.max_by(|(a, _), (b, _)| a.total_cmp(b)) else {
        return not_measured("no two messages of a stream");
    };
    let against = (worst_us > WORST_JITTER_US).then(|| format!("{name} comes irregularly."));
    outcome(format!("{:.0} ms, {name}", worst_us / 1e3), against)
}

fn jitters_us(timing: &Timing) -> Vec<f64> {
    let of_interval = |interval_us: f64| {
        let count = (interval_us / timing.interval_us).round().max(1.0);
        (interval_us - count * timing.interval_us).abs()
    };
    timing.measured_us.iter().copied().map(of_interval).collect()
}

/// Does everything arrive?
pub(super) const LOST_FRAMES: Check = Check {
    name: "lost frames",
    measures: "gaps in the board's sequence numbers, except where damage explains them",
    expected: "none (the firmware numbers frames as they leave)",
    advice: "Use another cable or adapter; another program may read the same port.",
    judge: judge_lost_frames,
};

fn judge_lost_frames(evidence: &Evidence) -> Outcome {
    let gaps = evidence.record.unexplained_gaps().filter(|gap| !gap.is_damage);
    let lost: usize = gaps.map(|gap| usize::from(gap.missing)).sum();
    let received = evidence.record.received.len();
    let against = (lost > 0).then(|| format!("{lost} frames were lost on the way."));
    outcome(format!("{lost} of {}", received + lost), against)
}

/// Does everything arrive whole?
pub(super) const DAMAGED_FRAMES: Check = Check {
    name: "damaged frames",
    measures: "places with bytes that are not part of a frame with a good checksum",
    expected: "none",
    advice: "Check ground and length of the wires and the baud rate; keep them away from the motors'.",
    judge: judge_damaged_frames,
};

fn judge_damaged_frames(evidence: &Evidence) -> Outcome {
    let damaged = evidence
        .record
        .unexplained_gaps()
        .filter(|gap| gap.is_damage)
        .count();
    let against = (damaged > 0).then(|| format!("What the board sent was damaged in {damaged} places."));
    outcome(damaged.to_string(), against)
}

const WORST_MEDIAN_TRIP_US: u64 = 50_000;
const WORST_TRIP_US: u64 = 250_000;

/// Does it answer quickly?
pub(super) const ROUND_TRIPS: Check = Check {
    name: "round trips",
    measures: "TIMESYNC, twice a second, until its answer",
    expected: "all answered; median at most 50 ms, worst at most 250 ms (a cable's, at 57600 baud behind a full burst)",
    advice: "Connect by cable: a radio takes longer. By cable, look for load and lost frames.",
    judge: judge_round_trips,
};

fn judge_round_trips(evidence: &Evidence) -> Outcome {
    let Some(window) = &evidence.window else {
        return not_reached();
    };
    let record = &evidence.record;
    let is_judged = |at| window.contains(&at) && !record.is_broken_by_start(at);
    let trips = record.round_trips.iter().filter(|trip| is_judged(trip.asked_at));
    let took: Vec<_> = trips.map(|trip| trip.took_us).collect();
    let mut answered_us: Vec<_> = took.iter().flatten().copied().collect();
    answered_us.sort_unstable();
    let (Some(median_us), Some(worst_us)) = (answered_us.get(answered_us.len() / 2), answered_us.last())
    else {
        return failed("no answer", "The board answers no TIMESYNC.");
    };
    let unanswered = took.len() - answered_us.len();
    let measured = format!(
        "median {:.0} ms, worst {:.0} ms, {unanswered} of {} unanswered",
        *median_us as f64 / 1e3,
        *worst_us as f64 / 1e3,
        took.len()
    );
    let against = if *median_us > WORST_MEDIAN_TRIP_US || *worst_us > WORST_TRIP_US {
        Some("The board answers slowly.")
    } else {
        // A frame that was lost or damaged is counted as such.
        (unanswered > record.gaps.len()).then_some("The board leaves requests unanswered.")
    };
    outcome(measured, against)
}
