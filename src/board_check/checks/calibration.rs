//! Is the voltage right?

use super::check::{Check, Outcome, failed, judge_trial, not_measured, outcome};
use crate::board_check::evidence::{Calibration, Evidence};

const WORST_V: f32 = 0.2;

/// Once it is exact, noise and the multimeter's last digit remain.
const WORST_APPLIED_V: f32 = 0.05;

pub(super) const CHECK: Check = Check {
    name: "calibration",
    measures: "the voltage shown beside a multimeter's; offers the exact `BATT_VOLT_MULT`",
    expected: "within 0.2 V (docs/requirements.md), within 0.05 V with `--apply`",
    advice: "Run with `--apply`, or set the value that is offered.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    judge_trial(
        &evidence.calibration,
        "--multimeter or --voltage",
        judge_calibration,
    )
}

fn judge_calibration(calibration: &Calibration) -> Outcome {
    let Some(measured_v) = calibration.measured_v else {
        return not_measured("no voltage was given");
    };
    let (Some(shown_v), Some(old), Some(exact)) = (calibration.shown_v, calibration.old, calibration.exact())
    else {
        return not_measured("no pack is connected, or it has no BATT_VOLT_MULT");
    };
    let measured = format!(
        "{shown_v:.2} V shown, {measured_v:.2} V measured: BATT_VOLT_MULT {exact:.3} is exact, {old:.3} was set"
    );
    if let Some(applied) = calibration.applied {
        return judge_applied(
            &format!("{measured}, {applied:.3} is now"),
            calibration,
            measured_v,
        );
    }
    let is_off = (shown_v - measured_v).abs() > WORST_V;
    outcome(
        measured,
        is_off.then(|| format!("The voltage is off: set BATT_VOLT_MULT to {exact:.3}.")),
    )
}

fn judge_applied(measured: &str, calibration: &Calibration, measured_v: f32) -> Outcome {
    match calibration.shown_since_v {
        Some(shown_v) if (shown_v - measured_v).abs() <= WORST_APPLIED_V => {
            outcome(format!("{measured}, {shown_v:.2} V shown"), None::<String>)
        }
        _ => failed(measured, "The voltage is off although BATT_VOLT_MULT was set."),
    }
}
