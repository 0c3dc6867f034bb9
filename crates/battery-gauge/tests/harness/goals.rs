//! The rows of the table: goals, and how figures of single drives become those of a row.

use battery_gauge::Chemistry;

use crate::drive::{Drive, Origin};
use crate::estimator::Estimator;
use crate::owner::{DAYS, HABITS, Habit, Weeks, weeks};
use crate::recordings::{COBALT_LIFE, COLD_LIFE, FIRST_CELL, LARGE_CELL, WARM_LIFE, with_those_between};
use crate::runs::{
    FAULTS, Faulty, Life, Outcome, Repeated, STARTS, Start, Teacher, by_group, faulty, in_parallel, life,
    outcomes, repeated, teachers,
};
use crate::score::{Errors, Score, mean};
use crate::table::{Goal, Row};

const ORIGINS: [(Origin, &str); 2] = [(Origin::Recorded, "recorded"), (Origin::Simulated, "simulated")];

/// All that one estimator made of all drives.
pub struct Results<'a> {
    outcomes: Vec<Outcome<'a>>,
    repeated: Vec<Repeated<'a>>,
    teachers: Vec<Teacher>,
    lives: Vec<Life<'a>>,
    faulty: Vec<Faulty<'a>>,
    weeks: Vec<Weeks>,
}

/// The drives of a life, and whether those between two recorded ones are interpolated.
pub struct LifeOfDrives {
    name: String,
    drives: Vec<Drive>,
}

/// Lives as recorded; the warm ones also with every drive.
pub fn lives(drives: &[Drive]) -> Vec<LifeOfDrives> {
    let mut names: Vec<&String> = drives
        .iter()
        .filter(|drive| drive.cell.is_life)
        .map(|drive| &drive.group)
        .collect();
    names.dedup();
    let mut lives = Vec::new();
    for name in names {
        let mut recorded: Vec<&Drive> = drives.iter().filter(|drive| drive.group == *name).collect();
        recorded.sort_by_key(|drive| drive.number);
        lives.push(LifeOfDrives {
            name: name.clone(),
            drives: recorded.iter().map(|drive| (*drive).clone()).collect(),
        });
        if recorded[0].cell.name == WARM_LIFE {
            lives.push(LifeOfDrives {
                name: format!("{name}{EVERY_DRIVE}"),
                drives: with_those_between(&recorded),
            });
        }
    }
    lives
}

const EVERY_DRIVE: &str = ", every drive";

impl<'a> Results<'a> {
    pub fn of<E: Estimator>(drives: &'a [Drive], all_lives: &'a [LifeOfDrives]) -> Self {
        let first_cell: Vec<&Drive> = drives
            .iter()
            .filter(|drive| is_first_cell(drive) && drive.temperature_c >= 0)
            .collect();
        let sound: Vec<&Drive> = drives
            .iter()
            .filter(|drive| !drive.cell.is_life && drive.temperature_c >= 10)
            .filter(|drive| drive.cell.origin == Origin::Recorded || drive.number == 0)
            .collect();
        Self {
            outcomes: outcomes::<E>(drives),
            repeated: repeated::<E>(drives),
            teachers: teachers::<E>(&first_cell),
            lives: in_parallel(all_lives, |lived| {
                let drives: Vec<&Drive> = lived.drives.iter().collect();
                life::<E>(&lived.name, &drives)
            }),
            faulty: faulty::<E>(&sound),
            weeks: weeks::<E>(),
        }
    }

    /// The figure of each group of drives.
    fn groups(
        &self,
        start: Start,
        which: impl Fn(&Drive) -> bool,
        figure: impl Fn(&Drive, &Score) -> f64,
    ) -> Vec<(String, f64)> {
        let of_start = self
            .outcomes
            .iter()
            .filter(|outcome| outcome.start == start && which(outcome.drive));
        by_group(of_start.map(|outcome| (outcome.drive.group.clone(), figure(outcome.drive, &outcome.score))))
    }

    /// The share of drives with a property.
    fn share(&self, which: impl Fn(&Drive) -> bool, has_property: impl Fn(&Score) -> bool) -> f64 {
        let full = self
            .outcomes
            .iter()
            .filter(|outcome| outcome.start == Start::Full && which(outcome.drive));
        share(full.map(|outcome| has_property(&outcome.score)))
    }

    /// Means of figures over a part of each life, by cell.
    fn life_means(
        &self,
        which: impl Fn(&str) -> bool,
        from: impl Fn(usize) -> usize,
        figure: impl Fn(&Score) -> f64,
    ) -> Vec<(String, f64)> {
        let lives = self.lives.iter().filter(|life| which(&life.name));
        lives
            .map(|life| {
                let part = &life.drives[from(life.drives.len()).min(life.drives.len())..];
                let figures: Vec<f64> = part
                    .iter()
                    .map(|(_, score)| figure(score))
                    .filter(|figure| figure.is_finite())
                    .collect();
                (life.name.clone(), mean(&figures))
            })
            .collect()
    }

    pub fn rows(&self) -> Vec<Row> {
        vec![
            self.from_full(),
            self.learnt(),
            self.wrong_label(),
            self.equal_drives(),
            self.inside(),
            self.known(),
            self.aged_warm(),
            self.aged_others(),
            self.usable(),
            self.last_fifth(),
            self.warned(),
            self.half_and_voltage(),
            self.iron_and_weeks(),
            self.weeks_beside(),
            self.moved(),
            self.bad_input(),
        ]
    }

    fn from_full(&self) -> Row {
        let mut row = Row::new("from full, less counting, points");
        for (origin, name) in ORIGINS {
            let degrees = [
                ("10 °C and above", 10..100, 0.5),
                ("to −10 °C", -10..10, 1.0),
                ("colder", -99..-10, 2.0),
            ];
            for (part, range, goal) in degrees {
                let groups = self.groups(
                    Start::Full,
                    |drive| drive.cell.origin == origin && range.contains(&drive.temperature_c),
                    |drive, score| score.remaining.rms() - Score::of_counting(drive, drive.right_label_ah()),
                );
                row.add_worst(format!("{name}, {part}"), Goal::AtMost(goal), &groups);
            }
        }
        row
    }

    fn learnt(&self) -> Row {
        let mut row = Row::new("learnt from half a charge or more, first cell, 25 to 0 °C, points");
        let mut rms: Vec<f64> = self.teachers.iter().map(|teacher| teacher.rms).collect();
        rms.sort_by(f64::total_cmp);
        let median = rms.get(rms.len() / 2).copied().unwrap_or(f64::NAN);
        row.add("by the median teacher", Goal::AtMost(1.2), median, "");
        let members: Vec<(String, f64)> = self
            .teachers
            .iter()
            .map(|teacher| (teacher.name.clone(), teacher.rms))
            .collect();
        row.add_worst("by any", Goal::AtMost(2.0), &members);
        let taught = share(self.teachers.iter().map(|teacher| teacher.has_taught));
        row.add(
            "drives that teach, share",
            Goal::None,
            taught,
            format!("of {}", self.teachers.len()),
        );
        row
    }

    fn wrong_label(&self) -> Row {
        let mut row = Row::new("label 20 % wrong, second full drive, points");
        for (origin, name) in ORIGINS {
            for (start, part, goal) in [(Start::LabelLow, "low", 2.5), (Start::LabelHigh, "high", 1.5)] {
                let which = |drive: &Drive| drive.cell.origin == origin && !drive.cell.is_life;
                let groups = self.groups(start, which, |_, score| score.remaining.rms());
                row.add_worst(format!("{name}, {part}"), Goal::AtMost(goal), &groups);
                let values: Vec<f64> = groups.iter().map(|(_, rms)| *rms).collect();
                row.add(
                    format!("{name}, {part}, mean of groups"),
                    Goal::None,
                    mean(&values),
                    "",
                );
            }
        }
        row
    }

    fn equal_drives(&self) -> Row {
        let mut row = Row::new("capacity over equal drives, % off");
        for (origin, name) in ORIGINS {
            let of = |figure: fn(&[f64; 3]) -> f64| -> Vec<(String, f64)> {
                let repeated = self
                    .repeated
                    .iter()
                    .filter(|repeated| repeated.drive.cell.origin == origin);
                let figure = |repeated: &Repeated| {
                    (repeated.drive.group.clone(), 100.0 * figure(&repeated.capacities))
                };
                repeated.map(figure).collect()
            };
            row.add_worst(
                format!("{name}, after ten"),
                Goal::AtMost(5.0),
                &of(|c| (c[0] - 1.0).abs()),
            );
            row.add_worst(
                format!("{name}, after thirty"),
                Goal::AtMost(6.0),
                &of(|c| (c[2] - 1.0).abs()),
            );
            let last = of(|c| (c[2] - c[1]).abs());
            row.add_worst(
                format!("{name}, from the 20th to the 30th"),
                Goal::AtMost(1.0),
                &last,
            );
            let of_origin = self
                .repeated
                .iter()
                .filter(|repeated| repeated.drive.cell.origin == origin);
            row.add(
                format!("{name}, drives that teach, share"),
                Goal::None,
                share(of_origin.map(|repeated| repeated.has_learnt)),
                "",
            );
        }
        row
    }

    fn inside(&self) -> Row {
        let mut row = Row::new("inside two deviations, share");
        for (origin, name) in ORIGINS {
            for start in STARTS {
                let mut pooled = Errors::default();
                let of_start = self
                    .outcomes
                    .iter()
                    .filter(|outcome| outcome.start == start && outcome.drive.cell.origin == origin);
                for outcome in of_start {
                    pooled.append(&outcome.score.remaining);
                }
                add_inside(&mut row, &format!("{name}, {start:?}"), &pooled);
            }
            let groups = self.groups(
                Start::Full,
                |drive| drive.cell.origin == origin,
                |_, score| score.remaining.inside_two(),
            );
            row.add_worst(
                format!("{name}, least of a group from full"),
                Goal::AtLeast(0.8),
                &groups,
            );
        }
        let mut pooled = Errors::default();
        for life in self.lives.iter().filter(|life| !life.name.ends_with(EVERY_DRIVE)) {
            life.drives
                .iter()
                .for_each(|(_, score)| pooled.append(&score.remaining));
        }
        add_inside(&mut row, "recorded, lives in order", &pooled);
        row
    }

    fn known(&self) -> Row {
        let mut row = Row::new("known from full, share");
        for (origin, name) in ORIGINS {
            for chemistry in [
                Chemistry::LiPo,
                Chemistry::LiIon,
                Chemistry::LiFe,
                Chemistry::NiMh,
            ] {
                let groups = self.groups(
                    Start::Full,
                    |drive| drive.cell.origin == origin && drive.cell.chemistry == chemistry,
                    |_, score| score.remaining.known(),
                );
                row.add_worst(format!("{name}, {chemistry:?}"), Goal::AtLeast(0.95), &groups);
            }
        }
        row
    }

    fn aged_warm(&self) -> Row {
        let mut row = Row::new("aged, second half of life at 24 °C");
        for (is_every, name) in [
            (false, "as recorded"),
            (true, "every drive, those between interpolated"),
        ] {
            let which = |life: &str| life.starts_with(WARM_LIFE) && life.ends_with(EVERY_DRIVE) == is_every;
            let means = |figure: fn(&Score) -> f64| self.life_means(which, |drives| drives / 2, figure);
            let mut add = |part: &str, goal: Goal, figure: fn(&Score) -> f64| {
                row.add_worst(format!("{part}, {name}"), goal, &means(figure));
            };
            add("told, points", Goal::AtMost(2.5), |score| score.remaining.rms());
            add("usable, points", Goal::AtMost(3.0), |score| score.usable_rms);
            add("usable at cut-off, %", Goal::AtMost(5.0), |score| {
                score.usable_at_end
            });
            add("told at cut-off, %", Goal::None, |score| score.remaining_at_end);
            add("low ahead, min", Goal::Within(4.0, 15.0), |score| {
                score.low_ahead_min
            });
            add(
                "time left ten minutes before, min",
                Goal::Within(8.0, 13.0),
                |score| score.ten_minutes_min,
            );
        }
        row
    }

    fn aged_others(&self) -> Row {
        let mut row = Row::new("other lives in order, points");
        let second_half: fn(usize) -> usize = |drives| drives / 2;
        for (cell, part, from, remaining, usable) in [
            (
                COBALT_LIFE,
                "LiCoO2, second half",
                second_half,
                Goal::AtMost(5.0),
                Goal::AtMost(5.0),
            ),
            (
                COLD_LIFE,
                "at 4 °C, from the fifth drive on",
                |_| 4,
                Goal::AtMost(6.0),
                Goal::AtMost(4.0),
            ),
            (LARGE_CELL, "33 Ah at 1 to 3 C", |_| 0, Goal::None, Goal::None),
        ] {
            let means =
                |figure: fn(&Score) -> f64| self.life_means(|life| life.starts_with(cell), from, figure);
            row.add_worst(
                format!("{part}, told"),
                remaining,
                &means(|score| score.remaining.rms()),
            );
            row.add_worst(
                format!("{part}, usable"),
                usable,
                &means(|score| score.usable_rms),
            );
        }
        row
    }

    fn usable(&self) -> Row {
        let mut row = Row::new("usable from full, points");
        let first = self.groups(Start::Full, is_first_cell, |_, score| score.usable_rms);
        for (group, rms) in first {
            let is_cold = group.contains("_n");
            let goal = if is_cold {
                Goal::NoWorse(0.0)
            } else {
                Goal::AtMost(4.0)
            };
            row.add(
                format!(
                    "first cell, {}",
                    group.trim_start_matches(FIRST_CELL).trim_matches('_')
                ),
                goal,
                rms,
                "",
            );
        }
        if row.figures.is_empty() {
            row.add("first cell", Goal::AtMost(4.0), f64::NAN, "");
        }
        let others = |drive: &Drive| {
            drive.cell.origin == Origin::Recorded && !is_first_cell(drive) && !drive.cell.is_life
        };
        row.add_worst(
            "other new cells",
            Goal::None,
            &self.groups(Start::Full, others, |_, score| score.usable_rms),
        );
        let simulated = |drive: &Drive| drive.cell.origin == Origin::Simulated && drive.temperature_c >= 10;
        let groups = self.groups(Start::Full, simulated, |_, score| score.usable_rms);
        row.add_worst("simulated, warm", Goal::None, &groups);
        row
    }

    fn last_fifth(&self) -> Row {
        let mut row = Row::new("usable within 3 % over the last fifth, share of drives");
        let is_within = |score: &Score| score.last_fifth <= 3.0;
        let at =
            |temperature_c| move |drive: &Drive| is_first_cell(drive) && drive.temperature_c == temperature_c;
        row.add(
            "first cell, 25 °C",
            Goal::AtLeast(0.8),
            self.share(at(25), is_within),
            "",
        );
        let constant = |drive: &Drive| drive.cell.name == "liion";
        let constant = self
            .outcomes
            .iter()
            .filter(|outcome| outcome.start == Start::Full && constant(outcome.drive));
        let lives = self.lives.iter().filter(|life| {
            (life.name.starts_with(WARM_LIFE) || life.name.starts_with(LARGE_CELL))
                && !life.name.ends_with(EVERY_DRIVE)
        });
        let in_order = lives.flat_map(|life| life.drives.iter().map(|(_, score)| score));
        let scores = constant.map(|outcome| &outcome.score).chain(in_order);
        row.add(
            "constant loads at 24 °C",
            Goal::AtLeast(0.8),
            share(scores.map(is_within)),
            "",
        );
        row.add(
            "first cell, 10 °C",
            Goal::AtLeast(0.5),
            self.share(at(10), is_within),
            "",
        );
        let simulated = |drive: &Drive| drive.cell.origin == Origin::Simulated && drive.temperature_c >= 10;
        row.add(
            "simulated, warm",
            Goal::None,
            self.share(simulated, is_within),
            "",
        );
        row
    }

    fn warned(&self) -> Row {
        let mut row = Row::new("warned, first cell, 25 and 10 °C, share of drives");
        let warm = |drive: &Drive| is_first_cell(drive) && drive.temperature_c >= 10;
        let low = self.share(warm, |score| (3.0..=40.0).contains(&score.low_ahead_min));
        row.add("15 % usable 3 to 40 min ahead", Goal::AtLeast(0.9), low, "");
        let half_hour = self.share(warm, |score| (15.0..=60.0).contains(&score.half_hour_min));
        row.add(
            "half an hour before told 15 to 60 min",
            Goal::AtLeast(0.8),
            half_hour,
            "",
        );
        row
    }

    fn half_and_voltage(&self) -> Row {
        let mut row = Row::new("half-full start; voltage alone; warm, points");
        for (start, part, more) in [
            (Start::Half, "from half", 0.3),
            (Start::VoltageOnly, "voltage alone", 0.5),
        ] {
            let warm = |drive: &Drive| drive.temperature_c >= 10;
            let first = |drive: &Drive| is_first_cell(drive) && warm(drive);
            let mut add = |name: &str, goal: Goal, groups: Vec<(String, f64)>| {
                let figures: Vec<f64> = groups.iter().map(|(_, figure)| *figure).collect();
                row.add(format!("{part}, {name}"), goal, mean(&figures), "");
            };
            let rms = |_: &Drive, score: &Score| score.remaining.rms();
            add(
                "first cell, mean of groups",
                Goal::NoWorse(more),
                self.groups(start, first, rms),
            );
            let others = |drive: &Drive| {
                drive.cell.origin == Origin::Recorded
                    && !is_first_cell(drive)
                    && !drive.cell.is_life
                    && warm(drive)
            };
            add(
                "other new cells",
                Goal::NoWorse(more),
                self.groups(start, others, rms),
            );
            let simulated = |drive: &Drive| drive.cell.origin == Origin::Simulated && warm(drive);
            add(
                "simulated",
                Goal::NoWorse(more),
                self.groups(start, simulated, rms),
            );
        }
        row
    }

    fn iron_and_weeks(&self) -> Row {
        let mut row = Row::new("cold LiFe; simulated weeks");
        let inside = |_: &Drive, score: &Score| score.remaining.inside_two();
        for (part, most_c) in [("LiFe at −10 °C and colder", -10), ("LiFe below 0 °C", -1)] {
            let iron =
                |drive: &Drive| drive.cell.chemistry == Chemistry::LiFe && drive.temperature_c <= most_c;
            let groups = self.groups(Start::Full, iron, inside);
            row.add_worst(
                format!("{part}, inside two deviations, share"),
                Goal::AtLeast(0.8),
                &groups,
            );
        }
        for (habit, name) in HABITS {
            let goal = match habit {
                Habit::OneStop | Habit::StopAndGo | Habit::EightyPercent | Habit::ThreeMinutes => {
                    Goal::AtMost(5.0)
                }
                _ => Goal::None,
            };
            if habit != Habit::TwoPacks {
                let members =
                    self.weeks_of(habit, |weeks| 100.0 * (weeks.days[DAYS - 1].capacity - 1.0).abs());
                row.add_worst(format!("{name}: capacity on day 14, % off"), goal, &members);
            }
        }
        row
    }

    fn weeks_beside(&self) -> Row {
        let mut row = Row::new("simulated weeks, second week, mean of packs");
        for (habit, name) in HABITS {
            let second_week = |weeks: &Weeks| {
                let mut pooled = Errors::default();
                weeks.days[DAYS / 2..]
                    .iter()
                    .for_each(|day| pooled.append(&day.errors));
                pooled
            };
            let of = |figure: fn(&Errors) -> f64| {
                let members = self.weeks_of(habit, |weeks| figure(&second_week(weeks)));
                let known: Vec<f64> = members
                    .iter()
                    .map(|(_, figure)| *figure)
                    .filter(|figure| !figure.is_nan())
                    .collect();
                mean(&known)
            };
            row.add(format!("{name}: told, points"), Goal::None, of(Errors::rms), "");
            row.add(
                format!("{name}: inside two deviations, share"),
                Goal::None,
                of(Errors::inside_two),
                "",
            );
            row.add(format!("{name}: known, share"), Goal::None, of(Errors::known), "");
        }
        row
    }

    fn weeks_of(&self, habit: Habit, figure: impl Fn(&Weeks) -> f64) -> Vec<(String, f64)> {
        let weeks = self.weeks.iter().filter(|weeks| weeks.habit == habit);
        weeks
            .map(|weeks| (weeks.chemistry.to_owned(), figure(weeks)))
            .collect()
    }

    fn moved(&self) -> Row {
        let mut row = Row::new("moved by ≤ 1 point RMS or a quarter of its deviation, share of runs");
        for (origin, name) in ORIGINS {
            for start in [Start::Full, Start::Again, Start::Half, Start::VoltageOnly] {
                for variant in ["1 mV of noise", "without its first second"] {
                    let of_start = self
                        .outcomes
                        .iter()
                        .filter(|outcome| outcome.start == start && outcome.drive.cell.origin == origin);
                    let moves: Vec<_> = of_start
                        .flat_map(|outcome| outcome.moved.iter().map(move |moved| (outcome.drive, moved)))
                        .filter(|(_, (what, moved))| *what == variant && !moved.rms.is_nan())
                        .collect();
                    let worst = moves
                        .iter()
                        .max_by(|(_, (_, here)), (_, (_, there))| here.rms.total_cmp(&there.rms));
                    let note = worst.map_or(String::new(), |(drive, (_, moved))| {
                        format!(
                            "at most {:.2} points, {:.2} σ: {}",
                            moved.rms, moved.in_deviations, drive.group
                        )
                    });
                    let share = share(moves.iter().map(|(_, (_, moved))| moved.is_small()));
                    if start != Start::Half || variant == "1 mV of noise" {
                        row.add(
                            format!("{name}, {start:?}, {variant}"),
                            Goal::AtLeast(1.0),
                            share,
                            note,
                        );
                    }
                }
            }
        }
        for life in &self.lives {
            let note = format!("{:.2} points, {:.2} σ", life.moved.rms, life.moved.in_deviations);
            let is_small = f64::from(u8::from(life.moved.is_small()));
            row.add(
                format!("{} in order, 1 mV of noise", life.name),
                Goal::AtLeast(1.0),
                is_small,
                note,
            );
        }
        row
    }

    fn bad_input(&self) -> Row {
        let mut row = Row::new("bad input in one drive");
        for (origin, origin_name) in ORIGINS {
            for (fault, name) in FAULTS {
                let of_fault: Vec<&Faulty> = self
                    .faulty
                    .iter()
                    .filter(|faulty| faulty.fault == fault && faulty.drive.cell.origin == origin)
                    .collect();
                let is_honest = |faulty: &&Faulty| {
                    faulty.is_announced
                        || faulty.after[0].has_fault
                        || faulty.after[0].remaining.inside(2.0) >= 0.85
                };
                row.add(
                    format!("{origin_name}, {name}: inside after it, or announced, share"),
                    Goal::AtLeast(1.0),
                    share(of_fault.iter().map(|faulty| is_honest(faulty))),
                    format!(
                        "announced {:.2}",
                        share(of_fault.iter().map(|faulty| faulty.is_announced))
                    ),
                );
                let third: Vec<(String, f64)> = of_fault
                    .iter()
                    .map(|faulty| (faulty.drive.group.clone(), faulty.after[2].remaining.rms()))
                    .collect();
                row.add_worst(
                    format!("{origin_name}, {name}: third drive after it, points"),
                    Goal::AtMost(5.0),
                    &third,
                );
                let broken = of_fault.iter().filter(|faulty| !faulty.is_finite).count();
                let broken = if of_fault.is_empty() {
                    f64::NAN
                } else {
                    broken as f64
                };
                row.add(
                    format!("{origin_name}, {name}: drives with not a number"),
                    Goal::AtMost(0.0),
                    broken,
                    "",
                );
            }
        }
        row
    }
}

fn is_first_cell(drive: &Drive) -> bool {
    drive.cell.name == FIRST_CELL
}

/// The share of true ones; NaN of none.
fn share(properties: impl Iterator<Item = bool>) -> f64 {
    let (mut some, mut all) = (0, 0);
    for property in properties {
        some += u32::from(property);
        all += 1;
    }
    f64::from(some) / f64::from(all)
}

fn add_inside(row: &mut Row, part: &str, pooled: &Errors) {
    let (rms, sigma) = (pooled.rms(), pooled.sigma());
    row.add(
        format!("{part}, pooled"),
        Goal::AtLeast(0.88),
        pooled.inside_two(),
        "",
    );
    // A mean deviation of 1.6 times the RMS error, or of 4 points, is not too wide.
    row.add(
        format!("{part}, mean deviation relative to the widest allowed"),
        Goal::AtMost(1.0),
        sigma / (1.6 * rms).max(4.0),
        format!("± {sigma:.1} at {rms:.1} RMS"),
    );
}
