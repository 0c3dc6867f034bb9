//! Is the voltage steady?

use super::check::{Check, Outcome, not_measured, outcome};
use crate::board_check::evidence::{Evidence, mean};

const WORST_DEVIATION_V: f32 = 0.02;

pub(super) const CHECK: Check = Check {
    name: "voltage noise",
    measures: "standard deviation and span of the first pack's voltage, standing still",
    expected: "at most 20 mV: 8.7 effective bits behind the divider are 31 mV in one conversion, a quarter of that in the \
               mean of 16",
    advice: "Let the rover stand still, without a charger; check ground and plugs.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let voltages_v = evidence.voltages_v();
    let Some(mean_v) = mean(&voltages_v) else {
        return not_measured("no pack is connected");
    };
    let squares: Vec<_> = voltages_v.iter().map(|v| (v - mean_v).powi(2)).collect();
    let deviation_v = mean(&squares).unwrap_or(0.0).sqrt();
    let (lowest_v, highest_v) = voltages_v
        .iter()
        .fold((f32::MAX, f32::MIN), |(lowest, highest), v| {
            (lowest.min(*v), highest.max(*v))
        });
    outcome(
        format!(
            "{:.1} mV, span {:.0} mV",
            deviation_v * 1e3,
            (highest_v - lowest_v) * 1e3
        ),
        (deviation_v > WORST_DEVIATION_V).then_some("The voltage is noisy."),
    )
}
