//! Does telemetry come as often as it should?

use super::check::{Check, Outcome, not_reached, outcome};
use super::streams::{Timing, timings};
use crate::board_check::evidence::Evidence;

/// Half of it would be the clocks of the worst computer and board; a stream at half its rate is far off.
const TOLERANCE: f64 = 0.05;

pub(super) const CHECK: Check = Check {
    name: "rates",
    measures: "median interval of HEARTBEAT, SYS_STATUS and the first BATTERY_STATUS, as a rate",
    expected: "1 Hz and `SR0_EXTRA1`, within 5 %",
    advice: "Another ground station on this link may have requested other rates; a slow link reduces them \
             (raise `SERIAL0_BAUD`).",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
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
