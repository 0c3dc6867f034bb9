//! The owner beside a board for `board-check`, and how its wheels turned.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::mpsc::TryRecvError;

use rover_battmon_tools::board_check::{Outcome, Owner, Report};

/// How fast the wheels of each side have turned since the last question, from −1 to 1, wherever that was most.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turned {
    pub left: f32,
    pub right: f32,
}

impl Turned {
    pub fn note(&mut self, left: f32, right: f32) {
        let further = |a: f32, b: f32| if b.abs() > a.abs() { b } else { a };
        self.left = further(self.left, left);
        self.right = further(self.right, right);
    }

    /// What the question about it is answered with.
    fn answer(self, question: &str) -> &'static str {
        // A motor does not start below.
        const LEAST: f32 = 0.15;
        let (turning, still) = if question.contains("both left wheels turn") {
            (self.left, self.right)
        } else {
            (self.right, self.left)
        };
        let ahead = if question.contains("turn ahead") {
            turning
        } else {
            -turning
        };
        if ahead > LEAST && still.abs() < LEAST {
            "y"
        } else {
            "n"
        }
    }
}

/// An owner who looks at the wheels.
#[derive(Default)]
pub struct Watcher {
    pub turned: Rc<RefCell<Turned>>,
    /// Answers to what the multimeter shows, separated by bars.
    pub multimeter: &'static str,
    /// Presses Ctrl-C as soon as a wheel turns.
    pub is_startled: bool,
    /// Presses Ctrl-C after a line that begins so.
    pub stops_after: Option<&'static str>,
    pub shown: Vec<String>,
    pub answer: Option<String>,
}

impl Owner for Watcher {
    fn show(&mut self, line: &str) {
        self.shown.push(line.into());
    }

    fn ask(&mut self, question: &str) {
        let answer = match question {
            _ if question.contains("all wheels off the ground") => "y",
            _ if question.contains("multimeter") => {
                let (answer, others) = self.multimeter.split_once('|').unwrap_or((self.multimeter, ""));
                self.multimeter = others;
                answer
            }
            _ => self.turned.take().answer(question),
        };
        self.answer = Some(answer.into());
    }

    fn answer(&mut self) -> Result<String, TryRecvError> {
        self.answer.take().ok_or(TryRecvError::Disconnected)
    }

    fn has_stopped(&mut self) -> bool {
        let is_turning = *self.turned.borrow() != Turned::default();
        let last = self.shown.last();
        let has_seen_enough = |start: &str| last.is_some_and(|line| line.starts_with(start));
        self.is_startled && is_turning || self.stops_after.is_some_and(has_seen_enough)
    }
}

/// The names of the checks that failed.
pub fn failed(report: &Report) -> Vec<&'static str> {
    with_outcome(report, |outcome| matches!(outcome, Outcome::Failed { .. }))
}

/// The names of the checks that were not measured.
pub fn not_measured(report: &Report) -> Vec<&'static str> {
    with_outcome(report, |outcome| matches!(outcome, Outcome::NotMeasured(_)))
}

fn with_outcome(report: &Report, is_meant: impl Fn(&Outcome) -> bool) -> Vec<&'static str> {
    let rows = report.rows().iter().filter(|(_, outcome)| is_meant(outcome));
    rows.map(|(check, _)| check.name).collect()
}
