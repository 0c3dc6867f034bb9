//! Figures, and how they are compared. Of each, less is better.

use std::collections::HashMap;
use std::fmt;

/// An increase above this is a regression, unless a figure says otherwise.
const TOLERANCE: f64 = 0.10;

/// Something that was measured.
#[derive(Clone, Debug)]
pub struct Figure {
    pub what: String,
    pub value: f64,
    /// Digits behind the point.
    pub digits: usize,
    /// What it shall be at most.
    pub goal: Option<f64>,
    /// What the MAVLink C library takes.
    pub c_library: Option<f64>,
    /// An increase above this share is a regression.
    pub tolerance: f64,
}

impl Figure {
    /// A whole number.
    pub fn new(what: impl Into<String>, value: f64) -> Self {
        Self {
            what: what.into(),
            value,
            digits: 0,
            goal: None,
            c_library: None,
            tolerance: TOLERANCE,
        }
    }

    pub fn with_digits(self, digits: usize) -> Self {
        Self { digits, ..self }
    }

    pub fn with_goal(self, goal: f64) -> Self {
        Self {
            goal: Some(goal),
            ..self
        }
    }

    pub fn with_tolerance(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }

    /// What the C library takes, and the share of it that is the goal.
    pub fn beside_c_library(self, c_library: f64, goal_share: f64) -> Self {
        Self {
            c_library: Some(c_library),
            ..self.with_goal(c_library * goal_share)
        }
    }

    fn number(&self, value: f64) -> String {
        format!("{value:.*}", self.digits)
    }

    fn goal_cell(&self) -> String {
        let Some(goal) = self.goal else {
            return String::new();
        };
        let met = if self.is_missed() {
            "not reached"
        } else {
            "reached"
        };
        format!("{}, {met}", self.number(goal))
    }

    fn c_library_cell(&self) -> String {
        let compared = self
            .c_library
            .map(|c_library| format!("{}, share {:.2}", self.number(c_library), self.value / c_library));
        compared.unwrap_or_default()
    }

    pub fn is_missed(&self) -> bool {
        self.goal.is_some_and(|goal| self.value > goal)
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.what, self.number(self.value))
    }
}

/// Figures of one kind, in one unit.
#[derive(Clone, Debug)]
pub struct Table {
    title: &'static str,
    unit: &'static str,
    pub figures: Vec<Figure>,
}

impl Table {
    pub fn new(title: &'static str, unit: &'static str, figures: Vec<Figure>) -> Self {
        Self { title, unit, figures }
    }
}

/// As it stands on the page.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let compares = self.figures.iter().any(|figure| figure.c_library.is_some());
        let aims = self.figures.iter().any(|figure| figure.goal.is_some());
        let mut row = |what: &str, value: &str, c_library: &str, goal: &str| {
            write!(f, "| {what} | {value} |")?;
            if compares {
                write!(f, " {c_library} |")?;
            }
            if aims {
                write!(f, " {goal} |")?;
            }
            writeln!(f)
        };
        row(self.title, self.unit, "MAVLink C library", "goal, at most")?;
        row("---", "---", "---", "---")?;
        for figure in &self.figures {
            let value = figure.number(figure.value);
            row(
                &figure.what,
                &value,
                &figure.c_library_cell(),
                &figure.goal_cell(),
            )?;
        }
        Ok(())
    }
}

/// What takes more than it did by over its tolerance, a tenth mostly; what is new does not count.
pub fn regressions(tables: &[Table], committed: &HashMap<String, f64>) -> Vec<String> {
    let figures = tables.iter().flat_map(|table| &table.figures);
    let worse = figures.filter_map(|figure| {
        let before = *committed.get(&figure.what)?;
        // The page has it rounded.
        let rounded_off = 0.5 * 0.1f64.powi(figure.digits as i32);
        let is_worse = figure.value > before * (1.0 + figure.tolerance) + rounded_off;
        is_worse.then(|| format!("{figure}, was {before}"))
    });
    worse.collect()
}
