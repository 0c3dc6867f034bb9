//! Do the wheels turn as they should?

use super::check::{Check, Outcome, failed, judge_trial, not_measured, outcome};
use crate::host::board_check::evidence::{Evidence, MotorStep, StepResult};

const EXPECTED: &str = "the owner saw these wheels turn this way, and no other (docs/hardware.md)";
const ADVICE: &str = "Compare the motor plugs with docs/hardware.md: a plug turned round reverses its wheel, two plugs swapped \
                      turn another one.";

const fn check(name: &'static str, judge: fn(&Evidence) -> Outcome) -> Check {
    Check {
        name,
        measures: "a step of 2 s at up to 40 % of full power, wheels up",
        expected: EXPECTED,
        advice: ADVICE,
        judge,
    }
}

pub(super) const LEFT_AHEAD: Check = check(MotorStep::LeftAhead.name(), |evidence| {
    judge(evidence, MotorStep::LeftAhead)
});
pub(super) const RIGHT_AHEAD: Check = check(MotorStep::RightAhead.name(), |evidence| {
    judge(evidence, MotorStep::RightAhead)
});
pub(super) const LEFT_BACK: Check = check(MotorStep::LeftBack.name(), |evidence| {
    judge(evidence, MotorStep::LeftBack)
});
pub(super) const RIGHT_BACK: Check = check(MotorStep::RightBack.name(), |evidence| {
    judge(evidence, MotorStep::RightBack)
});

fn judge(evidence: &Evidence, step: MotorStep) -> Outcome {
    judge_trial(&evidence.motors, "--motors", |results| {
        let result = results.iter().find(|(of, _)| *of == step);
        result.map_or(not_measured("not turned"), |(_, result)| judge_step(result, step))
    })
}

fn judge_step(result: &StepResult, step: MotorStep) -> Outcome {
    let name = step.name();
    match result {
        StepResult::Confirmed => outcome("confirmed", None::<String>),
        StepResult::Denied => failed("denied", format!("Not as expected: {name}.")),
        StepResult::Unanswered => not_measured("the owner did not answer"),
        StepResult::NotArmed(reasons) => {
            failed("not armed", format!("The rover could not be armed: {reasons}."))
        }
        StepResult::Interrupted => failed("port lost", "The port was lost while the wheels turned."),
    }
}
