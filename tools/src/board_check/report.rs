//! The report, to be attached to an issue.

use std::fmt::Write;

use super::checks::{Check, Outcome, judge_all};
use super::evidence::{Evidence, Interruption, Text};

/// Beginning of each report.
pub const REPORT_HEAD: &str = "# Board check\n";

/// Result of all checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// No check failed. What was not measured has not passed either.
    Passed,
    /// Some check failed, or the check ended early.
    Failed,
    /// There was no board.
    NotConnected,
    /// The rover is armed, so nothing was checked.
    Armed,
}

/// Result of each check.
#[derive(Clone, Debug)]
pub struct Report {
    rows: Vec<(&'static Check, Outcome)>,
    texts: Vec<Text>,
    verdict: Verdict,
}

impl Report {
    /// Judges the evidence of a check.
    pub(super) fn of(evidence: &Evidence) -> Self {
        let rows = judge_all(evidence);
        let has_failed = rows
            .iter()
            .any(|(_, outcome)| matches!(outcome, Outcome::Failed { .. }));
        let verdict = match evidence.board {
            None => Verdict::NotConnected,
            Some(_) if evidence.ended == Some(Interruption::Armed) => Verdict::Armed,
            Some(_) if has_failed || evidence.ended.is_some() => Verdict::Failed,
            Some(_) => Verdict::Passed,
        };
        Self {
            rows,
            texts: evidence.record.texts(),
            verdict,
        }
    }

    /// Result of all checks.
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// Each check and its result.
    pub fn rows(&self) -> &[(&'static Check, Outcome)] {
        &self.rows
    }

    /// A sentence for each check that failed, and what to do.
    pub fn findings(&self) -> Vec<String> {
        let failed = self.rows.iter().filter_map(|(check, outcome)| match outcome {
            Outcome::Failed { sentence, .. } => Some((check, sentence)),
            _ => None,
        });
        failed
            .map(|(check, sentence)| format!("{}: {sentence} {}", check.name, check.advice))
            .collect()
    }

    /// "21 passed, 1 failed, 3 not measured"
    pub fn summary(&self) -> String {
        let count = |is: fn(&Outcome) -> bool| self.rows.iter().filter(|(_, outcome)| is(outcome)).count();
        format!(
            "{} passed, {} failed, {} not measured",
            count(|outcome| matches!(outcome, Outcome::Passed(_))),
            count(|outcome| matches!(outcome, Outcome::Failed { .. })),
            count(|outcome| matches!(outcome, Outcome::NotMeasured(_))),
        )
    }

    /// The report as Markdown. `port` is where the board was.
    pub fn markdown(&self, port: &str) -> String {
        let mut text = format!(
            "{REPORT_HEAD}\nPort {port}, board-check {}: {}.\n",
            env!("CARGO_PKG_VERSION"),
            self.summary()
        );
        section(&mut text, "Findings", &self.findings());
        text += "\n## Checks\n| check | result | measured | expected |\n|---|---|---|---|\n";
        for (check, outcome) in &self.rows {
            let (result, measured) = match outcome {
                Outcome::Passed(measured) => ("passed", measured),
                Outcome::Failed { measured, .. } => ("**failed**", measured),
                Outcome::NotMeasured(why) => ("not measured", why),
            };
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "| {} | {result} | {} | {} |",
                check.name,
                cell(measured),
                check.expected
            );
        }
        section(&mut text, "Texts of the board", &self.different_texts());
        text
    }

    /// Each of the board's texts once, as the board repeats some for every connection.
    fn different_texts(&self) -> Vec<String> {
        let mut different = Vec::new();
        for text in &self.texts {
            let quoted = format!("`{}`", text.text);
            if !different.contains(&quoted) {
                different.push(quoted);
            }
        }
        different
    }
}

/// A list under a heading; nothing if it is empty.
fn section(text: &mut String, heading: &str, lines: &[String]) {
    if !lines.is_empty() {
        *text += &format!("\n## {heading}\n");
    }
    for line in lines {
        *text += &format!("- {line}\n");
    }
}

/// What the board sends must not break the table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}
