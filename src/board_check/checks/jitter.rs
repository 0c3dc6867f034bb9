//! Does telemetry come regularly?

use super::check::{Check, Outcome, not_measured, not_reached, outcome};
use super::streams::{Timing, timings};
use crate::board_check::evidence::Evidence;

const WORST_US: f64 = 100_000.0;

pub(super) const CHECK: Check = Check {
    name: "jitter",
    measures: "the largest distance of an interval from the stream's own, or a multiple where a message is missing",
    expected: "at most 100 ms: serial adapters and hosts hold bytes back for some 20 ms, a parameter's sector is erased \
               in 45 ms",
    advice: "Connect by USB or a cable; end other programs that keep the computer busy.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
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
    let against = (worst_us > WORST_US).then(|| format!("{name} comes irregularly."));
    outcome(format!("{:.0} ms, {name}", worst_us / 1e3), against)
}

fn jitters_us(timing: &Timing) -> Vec<f64> {
    let of_interval = |interval_us: f64| {
        let count = (interval_us / timing.interval_us).round().max(1.0);
        (interval_us - count * timing.interval_us).abs()
    };
    timing.measured_us.iter().copied().map(of_interval).collect()
}
