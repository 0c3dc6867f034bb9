//! The table of goals, with a column for each estimator.

/// A goal of one figure.
#[derive(Clone, Copy, Debug)]
pub enum Goal {
    AtMost(f64),
    AtLeast(f64),
    Within(f64, f64),
    /// At most the first estimator's figure and this.
    NoWorse(f64),
    /// For information.
    None,
}

/// One part of a row.
#[derive(Clone, Debug)]
pub struct Figure {
    pub part: String,
    /// Of which member of several, each of which has a figure; empty without.
    pub member: String,
    /// `None` where nothing was judged; NaN where the estimator reported nothing.
    pub value: Option<f64>,
    pub goal: Goal,
    /// Of which member a worst figure is.
    pub note: String,
}

#[derive(Clone, Debug)]
pub struct Row {
    pub name: &'static str,
    pub figures: Vec<Figure>,
}

impl Row {
    pub fn new(name: &'static str) -> Self {
        Self {
            name,
            figures: Vec::new(),
        }
    }

    pub fn add(&mut self, part: impl Into<String>, goal: Goal, value: Option<f64>, note: impl Into<String>) {
        self.figures.push(Figure {
            part: part.into(),
            member: String::new(),
            value,
            goal,
            note: note.into(),
        });
    }

    /// A figure of each member, or one that is not judged.
    pub fn add_each(&mut self, part: &str, goal: Goal, members: &[(String, f64)]) {
        self.figures.extend(members.iter().map(|(name, value)| Figure {
            part: part.to_owned(),
            member: name.clone(),
            value: Some(*value),
            goal,
            note: String::new(),
        }));
        if members.is_empty() {
            self.add(part, goal, None, "");
        }
    }

    /// The worst of several members that have reported something.
    pub fn add_worst(&mut self, part: impl Into<String>, goal: Goal, members: &[(String, f64)]) {
        let is_least = matches!(goal, Goal::AtLeast(_) | Goal::Within(..));
        let reported = members.iter().filter(|(_, value)| !value.is_nan());
        let worst = reported.reduce(|worst, member| {
            if (member.1 < worst.1) == is_least {
                member
            } else {
                worst
            }
        });
        let (name, value) = match (worst, members.first()) {
            (Some((name, value)), _) => (name.as_str(), Some(*value)),
            (None, Some(_)) => ("", Some(f64::NAN)),
            (None, None) => ("", None),
        };
        self.add(part, goal, value, name);
    }
}

impl Figure {
    fn title(&self) -> String {
        match self.member.as_str() {
            "" => self.part.clone(),
            member => format!("{}, {member}", self.part),
        }
    }
}

impl Goal {
    /// As text; none of a goal that is another estimator's figure.
    pub fn absolute(self) -> String {
        match self {
            Self::NoWorse(_) => String::new(),
            _ => self.text(),
        }
    }

    fn text(self) -> String {
        match self {
            Self::AtMost(most) => format!("≤ {most}"),
            Self::AtLeast(least) => format!("≥ {least}"),
            Self::Within(least, most) => format!("{least} to {most}"),
            Self::NoWorse(more) => format!("≤ first + {more}"),
            Self::None => String::new(),
        }
    }

    /// How far a value is from it, in its unit or in tenths of a share, where the first estimator has `first`; 0 where it is
    /// reached, infinite of a value that is unknown, `None` without a goal.
    fn distance(self, value: f64, first: Option<f64>) -> Option<f64> {
        let beyond = match self {
            Self::AtMost(most) => value - most,
            Self::AtLeast(least) => 10.0 * (least - value),
            Self::Within(least, most) => (least - value).max(value - most),
            Self::NoWorse(more) => value - (first? + more),
            Self::None => return None,
        };
        Some(if beyond.is_nan() {
            f64::INFINITY
        } else {
            beyond.max(0.0)
        })
    }
}

/// How many figures were judged, and how many of them reach their goals.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    reached: u32,
    judged: u32,
}

/// Prints the rows of each estimator side by side, and how many figures of each row reach their goals.
pub fn print(estimators: &[(&str, Vec<Row>)]) {
    let names: Vec<&str> = estimators.iter().map(|(name, _)| *name).collect();
    let (_, first) = &estimators[0];
    let mut counts = vec![vec![Count::default(); names.len()]; first.len()];
    println!("| row | part | {} | goal |", names.join(" | "));
    println!("|---|---|{}---|", "---|".repeat(names.len()));
    for (number, row) in first.iter().enumerate() {
        for (part, figure) in row.figures.iter().enumerate() {
            let columns = estimators.iter().zip(&mut counts[number]).enumerate();
            let cells = columns.map(|(column, ((_, rows), count))| {
                let here = &rows[number].figures[part];
                assert_eq!(here.title(), figure.title(), "both have judged the same");
                // Its own figure is no goal for the first.
                cell(here, figure.value.filter(|_| column > 0), count)
            });
            let cells: Vec<String> = cells.collect();
            let goal = figure.goal.text();
            println!(
                "| {} | {} | {} | {goal} |",
                row.name,
                figure.title(),
                cells.join(" | ")
            );
        }
    }
    println!("\n| figures that reach their goals | {} |", names.join(" | "));
    println!("|---|{}", "---|".repeat(names.len()));
    for (row, counts) in first.iter().zip(&counts) {
        let counts = counts
            .iter()
            .map(|count| format!("{} of {}", count.reached, count.judged));
        println!("| {} | {} |", row.name, counts.collect::<Vec<_>>().join(" | "));
    }
}

/// A figure and whether it reaches its goal, where the first estimator has `first`.
fn cell(figure: &Figure, first: Option<f64>, count: &mut Count) -> String {
    let Some(value) = figure.value else {
        return "not judged".into();
    };
    let mut text = if value.is_nan() {
        "unknown".into()
    } else {
        format!("{value:.2}")
    };
    if let Some(distance) = figure.goal.distance(value, first) {
        let is_reached = distance == 0.0;
        count.judged += 1;
        count.reached += u32::from(is_reached);
        text += if is_reached { " ✓" } else { " ✗" };
    }
    if !figure.note.is_empty() {
        text += &format!(" ({})", figure.note);
    }
    text
}

/// Prints in how many figures each further estimator is nearer to its goals than the first.
pub fn print_comparison(estimators: &[(&str, Vec<Row>)]) {
    let Some(((first_name, first), others)) = estimators.split_first() else {
        return;
    };
    for (name, rows) in others {
        let figures = first
            .iter()
            .flat_map(|row| row.figures.iter().map(move |figure| (row.name, figure)));
        let pairs = figures.zip(rows.iter().flat_map(|row| &row.figures));
        let (mut nearer, mut farther, mut much) = (0, 0, Vec::new());
        for ((row, before), here) in pairs {
            let Some((before_value, value)) = before.value.zip(here.value) else {
                continue;
            };
            // What the first has is 0 away from itself.
            let distances = before
                .goal
                .distance(before_value, before.value)
                .zip(here.goal.distance(value, before.value));
            let Some((before_distance, distance)) = distances else {
                continue;
            };
            nearer += u32::from(before_distance > distance + 0.5);
            farther += u32::from(distance > before_distance + 0.5);
            if distance > before_distance + 2.0 {
                much.push(format!("{row}: {}: {before_value:.2}, {value:.2}", here.title()));
            }
        }
        println!(
            "\n{name} is nearer than {first_name} by more than 0.5 in {nearer} figures, farther in {farther}."
        );
        println!("Farther by more than 2 in {}:\n{}", much.len(), much.join("\n"));
        let is_better = nearer >= 2 * farther && much.is_empty();
        println!(
            "{name} {} it.",
            if is_better { "replaces" } else { "does not replace" }
        );
    }
}
