//! All that an estimator made of all drives, and how figures of single drives are picked and averaged.

use crate::drive::{Drive, Origin};
use crate::estimator::Estimator;
use crate::owner::{Habit, Weeks, weeks};
use crate::recordings::{FIRST_CELL, WARM_LIFE, with_those_between};
use crate::runs::{
    Faulty, Life, Outcome, Repeated, Start, Teacher, by_group, faulty, in_parallel, life, outcomes, repeated,
    teachers,
};
use crate::score::{Errors, Score, mean};

/// A name and its figure.
pub type Member = (String, f64);

/// The drives of a life in their order.
pub struct Lived {
    pub name: String,
    pub drives: Vec<Drive>,
}

/// End of the name of a life whose drives between two recorded ones are interpolated.
pub const EVERY_DRIVE: &str = ", every drive";

/// Lives as recorded; the warm ones also with every drive.
pub fn lives(drives: &[Drive]) -> Vec<Lived> {
    let of_lives = drives.iter().filter(|drive| drive.cell.is_life);
    let mut names: Vec<&String> = of_lives.map(|drive| &drive.group).collect();
    names.dedup();
    let mut lives = Vec::new();
    for name in names {
        let mut recorded: Vec<&Drive> = drives.iter().filter(|drive| drive.group == *name).collect();
        recorded.sort_by_key(|drive| drive.number);
        lives.push(Lived {
            name: name.clone(),
            drives: recorded.iter().map(|drive| (*drive).clone()).collect(),
        });
        if recorded[0].cell.name == WARM_LIFE {
            lives.push(Lived {
                name: format!("{name}{EVERY_DRIVE}"),
                drives: with_those_between(&recorded),
            });
        }
    }
    lives
}

pub struct Results<'a> {
    pub outcomes: Vec<Outcome<'a>>,
    pub repeated: Vec<Repeated<'a>>,
    pub teachers: Vec<Teacher>,
    pub lives: Vec<Life>,
    pub faulty: Vec<Faulty<'a>>,
    pub weeks: Vec<Weeks>,
}

impl<'a> Results<'a> {
    pub fn of<E: Estimator>(drives: &'a [Drive], all_lives: &'a [Lived]) -> Self {
        let not_cold = |drive: &&Drive| is_first_cell(drive) && drive.temperature_c >= 0;
        let first_cell: Vec<&Drive> = drives.iter().filter(not_cold).collect();
        let warm = drives
            .iter()
            .filter(|drive| !drive.cell.is_life && is_warm(drive));
        let one_of_each = |drive: &&Drive| drive.cell.origin == Origin::Recorded || drive.number == 0;
        let misused: Vec<&Drive> = warm.filter(one_of_each).collect();
        Self {
            outcomes: outcomes::<E>(drives),
            repeated: repeated::<E>(drives),
            teachers: teachers::<E>(&first_cell),
            lives: in_parallel(all_lives, |lived| life::<E>(&lived.name, &lived.drives)),
            faulty: faulty::<E>(&misused),
            weeks: weeks::<E>(),
        }
    }

    /// Drives with this start.
    pub fn started(
        &self,
        start: Start,
        which: impl Fn(&Drive) -> bool,
    ) -> impl Iterator<Item = &Outcome<'a>> {
        let is_one = move |outcome: &&Outcome| outcome.start == start && which(outcome.drive);
        self.outcomes.iter().filter(is_one)
    }

    /// The mean figure of each group of drives.
    pub fn groups(
        &self,
        start: Start,
        which: impl Fn(&Drive) -> bool,
        figure: impl Fn(&Drive, &Score) -> f64,
    ) -> Vec<Member> {
        let member = |outcome: &Outcome| (outcome.drive.group.clone(), figure(outcome.drive, &outcome.score));
        by_group(self.started(start, which).map(member))
    }

    /// The share of drives from full with a property.
    pub fn share_of(&self, which: impl Fn(&Drive) -> bool, property: impl Fn(&Score) -> bool) -> Option<f64> {
        share(
            self.started(Start::Full, which)
                .map(|outcome| property(&outcome.score)),
        )
    }

    /// Mean figures of each life's drives from some number on.
    pub fn life_means(
        &self,
        which: impl Fn(&str) -> bool,
        from: impl Fn(usize) -> usize,
        figure: impl Fn(&Score) -> f64,
    ) -> Vec<Member> {
        let means = |life: &Life| {
            let count = life.scores.len();
            let part = &life.scores[from(count).min(count)..];
            let figures: Vec<f64> = part
                .iter()
                .map(&figure)
                .filter(|figure| figure.is_finite())
                .collect();
            (life.name.clone(), mean(&figures))
        };
        self.lives
            .iter()
            .filter(|life| which(&life.name))
            .map(means)
            .collect()
    }

    /// A figure of each simulated pack.
    pub fn weeks_of(&self, habit: Habit, figure: impl Fn(&Weeks) -> f64) -> Vec<Member> {
        let weeks = self.weeks.iter().filter(|weeks| weeks.habit == habit);
        weeks
            .map(|weeks| (weeks.chemistry.to_owned(), figure(weeks)))
            .collect()
    }
}

pub fn is_first_cell(drive: &Drive) -> bool {
    drive.cell.name == FIRST_CELL
}

pub fn is_warm(drive: &Drive) -> bool {
    drive.temperature_c >= 10
}

/// The share of true ones.
pub fn share(properties: impl Iterator<Item = bool>) -> Option<f64> {
    let (mut some, mut all) = (0, 0);
    for property in properties {
        some += u32::from(property);
        all += 1;
    }
    (all > 0).then(|| f64::from(some) / f64::from(all))
}

/// Errors of several drives together.
pub fn pooled<'e>(errors: impl Iterator<Item = &'e Errors>) -> Option<Errors> {
    let mut pooled = None;
    for errors in errors {
        pooled.get_or_insert_with(Errors::default).append(errors);
    }
    pooled
}

/// Mean of the members that have reported something.
pub fn mean_of(members: &[Member]) -> Option<f64> {
    let reported: Vec<f64> = members
        .iter()
        .map(|(_, figure)| *figure)
        .filter(|figure| !figure.is_nan())
        .collect();
    (!members.is_empty()).then(|| mean(&reported))
}
