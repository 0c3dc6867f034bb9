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
    /// NaN where nothing was judged.
    pub value: f64,
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

    pub fn add(&mut self, part: impl Into<String>, goal: Goal, value: f64, note: impl Into<String>) {
        self.figures.push(Figure {
            part: part.into(),
            value,
            goal,
            note: note.into(),
        });
    }

    /// The worst of several members.
    pub fn add_worst(&mut self, part: impl Into<String>, goal: Goal, members: &[(String, f64)]) {
        let is_least = matches!(goal, Goal::AtLeast(_));
        let worst = members
            .iter()
            .filter(|(_, value)| !value.is_nan())
            .reduce(|worst, member| {
                if (member.1 < worst.1) == is_least {
                    member
                } else {
                    worst
                }
            });
        match worst {
            Some((name, value)) => self.add(part, goal, *value, name.clone()),
            None => self.add(part, goal, f64::NAN, ""),
        }
    }
}

impl Goal {
    fn text(self) -> String {
        match self {
            Self::AtMost(most) => format!("≤ {most}"),
            Self::AtLeast(least) => format!("≥ {least}"),
            Self::Within(least, most) => format!("{least} to {most}"),
            Self::NoWorse(more) => format!("≤ first + {more}"),
            Self::None => String::new(),
        }
    }

    /// Whether a value reaches it, where the first estimator has `first`.
    fn is_reached(self, value: f64, first: f64) -> bool {
        match self {
            Self::AtMost(most) => value <= most,
            Self::AtLeast(least) => value >= least,
            Self::Within(least, most) => (least..=most).contains(&value),
            Self::NoWorse(more) => value <= first + more,
            Self::None => true,
        }
    }
}

/// Prints the rows of each estimator side by side.
pub fn print(estimators: &[(&str, Vec<Row>)]) {
    let names: Vec<&str> = estimators.iter().map(|(name, _)| *name).collect();
    println!("| row | part | {} | goal |", names.join(" | "));
    println!("|---|---|{}---|", "---|".repeat(names.len()));
    let mut counts = vec![[0; 2]; names.len()];
    for (number, row) in estimators[0].1.iter().enumerate() {
        for (part, figure) in row.figures.iter().enumerate() {
            let cells = estimators.iter().zip(&mut counts).map(|((_, rows), counts)| {
                let here = &rows[number].figures[part];
                cell(here, figure.value, counts)
            });
            let cells: Vec<String> = cells.collect();
            println!(
                "| {} | {} | {} | {} |",
                row.name,
                figure.part,
                cells.join(" | "),
                figure.goal.text()
            );
        }
    }
    for (name, [reached, missed]) in names.iter().zip(counts) {
        println!("{name}: {reached} figures reach their goals, {missed} do not.");
    }
}

/// A figure and whether it reaches its goal, which `counts` counts.
fn cell(figure: &Figure, first: f64, counts: &mut [u32; 2]) -> String {
    if figure.value.is_nan() {
        return "not judged".into();
    }
    let is_reached = figure.goal.is_reached(figure.value, first);
    let mark = match figure.goal {
        Goal::None => "",
        _ => {
            counts[usize::from(!is_reached)] += 1;
            if is_reached { " ✓" } else { " ✗" }
        }
    };
    let note = if figure.note.is_empty() {
        String::new()
    } else {
        format!(" ({})", figure.note)
    };
    format!("{:.2}{mark}{note}", figure.value)
}
