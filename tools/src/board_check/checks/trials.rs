//! Trials of the board: its parameters are read and set, a fault is provoked, the wheels turn.

use rover_battmon::mavlink::dialect::MavMessage;

use super::check::{Check, Outcome, failed, judge_trial, not_measured, not_reached, outcome, passed};
use super::faults::CRASH;
use crate::board_check::evidence::{
    Evidence, FaultTrial, KeptTrial, Load, LoadWindows, MotorStep, Restarted, StepResult, first_pack_a,
    first_pack_v, mean,
};

/// Do all parameters arrive?
pub(super) const PARAMETER_LIST: Check = Check {
    name: "parameter list",
    measures: "parameters received, of those the board says it has",
    expected: "all",
    advice: "Run the check again by USB; with a signing key set, allow requests on this link.",
    judge: judge_parameter_list,
};

fn judge_parameter_list(evidence: &Evidence) -> Outcome {
    let Some(list) = &evidence.parameters else {
        return not_reached();
    };
    let Some(count) = list.count else {
        return failed("no answer", "The board sends no parameters.");
    };
    let received = list.by_index.len();
    let against = (received < usize::from(count)).then_some("Some parameters never arrived.");
    outcome(format!("{received} of {count}"), against)
}

/// Does a parameter survive a restart?
pub(super) const PARAMETER_KEPT: Check = Check {
    name: "parameter kept",
    measures: "`SR0_PARAMS` set, read after a restart, and set back",
    expected: "the value that was set (parameters are in flash before the board restarts)",
    advice: "See the board's texts and docs/troubleshooting.md: a worn flash and a key that locks announce themselves.",
    judge: judge_parameter_kept,
};

fn judge_parameter_kept(evidence: &Evidence) -> Outcome {
    match &evidence.kept {
        Some(trial) => judge_kept(trial),
        None if evidence.parameters.is_some() => not_measured("the list had no SR0_PARAMS"),
        None => not_reached(),
    }
}

fn judge_kept(trial: &KeptTrial) -> Outcome {
    let measured = measured(trial);
    let KeptTrial { name, old, new, .. } = *trial;
    if trial.restored != Some(old) {
        let sentence =
            format!("That {name} was set back is not certain: it was {old}, and may be {new}. Set {old}.");
        return failed(measured, sentence);
    }
    let against = match trial.restarted {
        _ if trial.answered != Some(new) => Some(format!("{name} could not be set.")),
        Some(Restarted::After(_)) => (trial.read != Some(new)).then(|| format!("{name} was not kept.")),
        Some(Restarted::Refused(result)) => Some(format!("The restart was refused: {result:?}.")),
        Some(Restarted::Unanswered) => Some("The restart was not acknowledged.".into()),
        Some(Restarted::NotSeen) => Some("The board acknowledged the restart and did not restart.".into()),
        None => return not_reached(),
    };
    outcome(measured, against)
}

fn measured(trial: &KeptTrial) -> String {
    let after = match trial.restarted {
        Some(Restarted::After(us)) => format!(", restarted in {:.1} s", us as f32 / 1e6),
        _ => ", not restarted".into(),
    };
    let read = trial
        .read
        .map_or(", not read".into(), |read| format!(", read {read}"));
    let left = match trial {
        KeptTrial { found, old, .. } if found != old => {
            format!(", set back to {old}: an earlier check has left {found}")
        }
        _ => String::new(),
    };
    format!("{} set to {}{after}{read}{left}", trial.name, trial.new)
}

/// The fault is provoked in the task that restarts the board.
const EXPECTED_CRASH: &str = "Crash: hard fault in reboot";

/// Is a crash recorded?
pub(super) const CRASH_RECORD: Check = Check {
    name: "crash record",
    measures: "the board's report of a fault that was provoked",
    expected: "a restart, and `Crash: hard fault in reboot, …` (docs/proof.md)",
    advice: "Detach the debug probe: it catches the fault. Attach the report.",
    judge: judge_crash_record,
};

fn judge_crash_record(evidence: &Evidence) -> Outcome {
    judge_trial(&evidence.fault, "--provoke-fault", |trial| {
        judge_fault(trial, evidence)
    })
}

fn judge_fault(trial: &FaultTrial, evidence: &Evidence) -> Outcome {
    match trial.restarted {
        None => return not_reached(),
        Some(Restarted::After(_)) => {}
        Some(Restarted::Refused(result)) => {
            return failed(format!("{result:?}"), "The board refused to provoke a fault.");
        }
        Some(Restarted::Unanswered) => return failed("no answer", "The request was not acknowledged."),
        Some(Restarted::NotSeen) => return failed("no restart", "The board did not restart."),
    }
    let texts = evidence.record.texts();
    let mut crashes = texts
        .iter()
        .filter(|text| text.at >= trial.asked_at && text.text.starts_with(CRASH));
    match crashes.next() {
        Some(crash) => {
            let is_other = !crash.text.starts_with(EXPECTED_CRASH);
            outcome(
                format!("`{}`", crash.text),
                is_other.then_some("Another crash was reported."),
            )
        }
        None => failed(
            "restarted, no report",
            "The board restarted and reported no crash.",
        ),
    }
}

const EXPECTED_MOTION: &str = "the owner saw these wheels turn this way, and no other (docs/hardware.md)";
const MOTOR_ADVICE: &str = "Compare the motor plugs with docs/hardware.md: a plug turned round reverses its wheel, two plugs swapped \
                      turn another one.";

const fn motor_check(name: &'static str, judge: fn(&Evidence) -> Outcome) -> Check {
    Check {
        name,
        measures: "a step of 2 s at up to 40 % of full power, wheels up",
        expected: EXPECTED_MOTION,
        advice: MOTOR_ADVICE,
        judge,
    }
}

pub(super) const LEFT_AHEAD: Check = motor_check(MotorStep::LeftAhead.name(), |evidence| {
    judge_motors(evidence, MotorStep::LeftAhead)
});
pub(super) const RIGHT_AHEAD: Check = motor_check(MotorStep::RightAhead.name(), |evidence| {
    judge_motors(evidence, MotorStep::RightAhead)
});
pub(super) const LEFT_BACK: Check = motor_check(MotorStep::LeftBack.name(), |evidence| {
    judge_motors(evidence, MotorStep::LeftBack)
});
pub(super) const RIGHT_BACK: Check = motor_check(MotorStep::RightBack.name(), |evidence| {
    judge_motors(evidence, MotorStep::RightBack)
});

fn judge_motors(evidence: &Evidence, step: MotorStep) -> Outcome {
    judge_trial(&evidence.motors, "--motors", |results| {
        let result = results.iter().find(|(of, _)| *of == step);
        result.map_or(not_measured("not turned"), |(_, result)| judge_step(result, step))
    })
}

fn judge_step(result: &StepResult, step: MotorStep) -> Outcome {
    let name = step.name();
    match result {
        StepResult::Confirmed => passed("confirmed"),
        StepResult::Denied => failed("denied", format!("Not as expected: {name}.")),
        StepResult::Unanswered => not_measured("the owner did not answer"),
        StepResult::NotArmed(reasons) => {
            failed("not armed", format!("The rover could not be armed: {reasons}."))
        }
        StepResult::Interrupted => failed("port lost", "The port was lost while the wheels turned."),
    }
}

/// A drop of the voltage at full throttle that is well above the converter's error.
const LEAST_DROP_V: f32 = 0.1;

/// Least and largest drop at a fifth of full throttle, as a share of the drop at full throttle.
const LEAST_SHARE: f32 = 0.1;
const LARGEST_SHARE: f32 = 0.9;

/// Is the voltage a mean over the pulses of the motors?
pub(super) const VOLTAGE_UNDER_LOAD: Check = Check {
    name: "voltage under load",
    measures: "the first pack's mean voltage at rest, at a fifth of full throttle and at full throttle of all wheels, wheels up",
    expected: "at a fifth between the other two, by a tenth of their difference from either: a reading of a moment has the \
               motors switched on, or off",
    advice: "Flash the release that this program belongs to; a part on a bus has the averaging time of docs/hardware.md. All \
             wheels must turn freely.",
    judge: judge_voltage_under_load,
};

/// Do voltage and current under load belong together?
pub(super) const CURRENT_UNDER_LOAD: Check = Check {
    name: "current under load",
    measures: "the first pack's mean current beside that voltage",
    expected: "the three points on a line within 3 % of its length, and the converter's error of 15 mV",
    advice: "Voltage and current must both be of the first pack, and both means: docs/hardware.md has the averaging time of \
             each part.",
    judge: judge_current_under_load,
};

/// Means of a quantity of the first pack.
struct LoadMeans {
    none: f32,
    fifth: f32,
    full: f32,
}

impl LoadMeans {
    fn of(evidence: &Evidence, windows: &LoadWindows, find: fn(&MavMessage) -> Option<f32>) -> Option<Self> {
        let mean_under = |load| mean(&evidence.under_load(windows, load, find));
        Some(Self {
            none: mean_under(Load::None)?,
            fifth: mean_under(Load::Fifth)?,
            full: mean_under(Load::Full)?,
        })
    }

    /// Change at full throttle.
    fn change(&self) -> f32 {
        self.full - self.none
    }

    /// Change at a fifth of full throttle, as a share of that at full throttle.
    fn share(&self) -> f32 {
        (self.fifth - self.none) / self.change()
    }

    fn measured(&self, unit: &str) -> String {
        let Self { none, fifth, full } = self;
        format!(
            "{none:.2}, {fifth:.2} and {full:.2} {unit}: a fifth changes it by {:.0} % of the whole",
            100.0 * self.share()
        )
    }
}

/// Judges the pack under load, if the motors have lowered its voltage.
fn judge_loads(evidence: &Evidence, judge: impl Fn(&LoadWindows, &LoadMeans) -> Outcome) -> Outcome {
    judge_trial(&evidence.loads, "--motors", |windows| {
        if !windows.iter().any(|(load, _)| *load == Load::Full) {
            return not_measured("full throttle was not reached");
        }
        let Some(voltages) = LoadMeans::of(evidence, windows, first_pack_v) else {
            return not_measured("no pack is connected, or its voltage was not sent");
        };
        let drop_v = -voltages.change();
        if drop_v < LEAST_DROP_V {
            return not_measured(format!(
                "the motors lower the voltage by {:.0} mV only",
                1e3 * drop_v
            ));
        }
        judge(windows, &voltages)
    })
}

fn judge_voltage_under_load(evidence: &Evidence) -> Outcome {
    judge_loads(evidence, |_, voltages| {
        let against = match voltages.share() {
            share if share < LEAST_SHARE => Some("off"),
            share if share > LARGEST_SHARE => Some("on"),
            _ => None,
        };
        outcome(
            voltages.measured("V"),
            against.map(|how| {
                format!("The voltage is of a moment, not a mean: with the motors switched {how}.")
            }),
        )
    })
}

/// Largest distance from the line, as a share of its length.
const LARGEST_DISTANCE: f32 = 0.03;

/// The sawtooth between its wide codes, behind the board's divider (docs/hardware.md).
const CONVERTER_ERROR_V: f32 = 0.015;

fn judge_current_under_load(evidence: &Evidence) -> Outcome {
    judge_loads(evidence, |windows, voltages| {
        let Some(currents) = LoadMeans::of(evidence, windows, first_pack_a) else {
            return not_measured("no current is measured");
        };
        if currents.change() <= 0.0 {
            return failed(currents.measured("A"), "The current does not rise with the load.");
        }
        let distance = (currents.share() - voltages.share()).abs();
        let allowed = LARGEST_DISTANCE + CONVERTER_ERROR_V / voltages.change().abs();
        outcome(
            format!(
                "{}, of the voltage by {:.0} %",
                currents.measured("A"),
                100.0 * voltages.share()
            ),
            (distance > allowed).then_some(
                "Voltage and current do not rise and fall together: one of them is of a moment, not a mean.",
            ),
        )
    })
}
