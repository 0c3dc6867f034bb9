//! A check and its outcome.

use crate::board_check::evidence::{Evidence, Trial};

/// A check.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// Its name.
    pub name: &'static str,
    /// Measured quantity.
    pub measures: &'static str,
    /// Expected result, and its source.
    pub expected: &'static str,
    /// Advice for a failure.
    pub advice: &'static str,
    /// Judges the evidence.
    pub(super) judge: fn(&Evidence) -> Outcome,
}

/// The outcome of a check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// As expected; what was measured.
    Passed(String),
    /// Not as expected.
    Failed {
        /// The measurement.
        measured: String,
        /// The fault.
        sentence: String,
    },
    /// Not measured, and why.
    NotMeasured(String),
}

/// Passed if there is nothing to say against it.
pub(super) fn outcome(measured: impl Into<String>, against: Option<impl Into<String>>) -> Outcome {
    let measured = measured.into();
    match against {
        None => Outcome::Passed(measured),
        Some(sentence) => Outcome::Failed {
            measured,
            sentence: sentence.into(),
        },
    }
}

pub(super) fn passed(measured: impl Into<String>) -> Outcome {
    Outcome::Passed(measured.into())
}

pub(super) fn failed(measured: impl Into<String>, sentence: impl Into<String>) -> Outcome {
    outcome(measured, Some(sentence))
}

pub(super) fn not_measured(why: impl Into<String>) -> Outcome {
    Outcome::NotMeasured(why.into())
}

pub(super) fn not_reached() -> Outcome {
    not_measured("the check ended before")
}

/// Judges what is done on request only.
pub(super) fn judge_trial<T>(trial: &Trial<T>, option: &str, judge: impl FnOnce(&T) -> Outcome) -> Outcome {
    match trial {
        Trial::NotAsked => not_measured(format!("not asked for: {option}")),
        Trial::NotReached => not_reached(),
        Trial::Done(done) => judge(done),
    }
}
