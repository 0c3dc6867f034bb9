//! The rows of the table with their goals.

use battery_gauge::Chemistry;

use crate::drive::{Drive, Origin};
use crate::owner::{DAYS, Day, HABITS, Habit, Weeks};
use crate::recordings::{COBALT_LIFE, COLD_LIFE, CONSTANT_LOAD, LARGE_CELL, WARM_LIFE};
use crate::results::{EVERY_DRIVE, Member, Results, is_first_cell, is_warm, mean_of, pooled, share};
use crate::runs::{FAULTS, Fault, Faulty, Outcome, Repeated, STARTS, Start, VARIATIONS};
use crate::score::{Errors, Score};
use crate::table::{Goal, Row};

const ORIGINS: [(Origin, &str); 2] = [(Origin::Recorded, "recorded"), (Origin::Simulated, "simulated")];

pub fn rows(results: &Results) -> Vec<Row> {
    vec![
        from_full(results),
        learnt(results),
        wrong_label(results),
        equal_drives(results),
        inside(results),
        known(results),
        aged_warm(results),
        aged_others(results),
        usable(results),
        last_fifth(results),
        usable_to_the_end(results),
        warned(results),
        half_and_voltage(results),
        iron_and_weeks(results),
        second_week(results),
        moved(results),
        bad_input(results),
    ]
}

/// Drives of this origin.
fn of(origin: Origin) -> impl Fn(&Drive) -> bool + Copy {
    move |drive| drive.cell.origin == origin
}

/// Recorded drives of new cells but the first.
fn is_other_cell(drive: &Drive) -> bool {
    drive.cell.origin == Origin::Recorded && !is_first_cell(drive) && !drive.cell.is_life
}

fn remaining_rms(_: &Drive, score: &Score) -> f64 {
    score.remaining.rms()
}

fn usable_rms(_: &Drive, score: &Score) -> f64 {
    score.usable.rms()
}

fn from_full(results: &Results) -> Row {
    let mut row = Row::new("from full, less counting, points");
    for (origin, name) in ORIGINS {
        for (range, goal) in [(10..100, 0.5), (-10..10, 1.0), (-99..-10, 2.0)] {
            let which = |drive: &Drive| of(origin)(drive) && range.contains(&drive.temperature_c);
            let more = |drive: &Drive, score: &Score| {
                score.remaining.rms() - Score::of_counting(drive, drive.right_label_ah(), drive.end())
            };
            let groups = results.groups(Start::Full, which, more);
            let part = format!("{name}, {} to {} °C", range.start, range.end - 1);
            row.add_each(&part, Goal::AtMost(goal), &groups);
        }
    }
    row
}

fn learnt(results: &Results) -> Row {
    let mut row = Row::new("learnt from half a charge or more, 25 to 0 °C, points");
    let mut rms: Vec<f64> = results.teachers.iter().map(|teacher| teacher.rms).collect();
    rms.sort_by(f64::total_cmp);
    let median = rms.get(rms.len() / 2).copied();
    row.add("by the median teacher", Goal::AtMost(1.2), median, "");
    let members = results
        .teachers
        .iter()
        .map(|teacher| (teacher.name.clone(), teacher.rms));
    row.add_worst("by any", Goal::AtMost(2.0), &members.collect::<Vec<Member>>());
    let taught = share(results.teachers.iter().map(|teacher| teacher.has_taught));
    row.add("drives that teach, share", Goal::None, taught, "");
    row
}

fn wrong_label(results: &Results) -> Row {
    let mut row = Row::new("label 20 % wrong, second full drive, points");
    for (origin, name) in ORIGINS {
        for (start, part, goal) in [(Start::LabelLow, "low", 2.5), (Start::LabelHigh, "high", 1.5)] {
            let which = |drive: &Drive| of(origin)(drive) && !drive.cell.is_life;
            let groups = results.groups(start, which, remaining_rms);
            row.add_each(&format!("{part}, {name}"), Goal::AtMost(goal), &groups);
        }
    }
    row
}

fn equal_drives(results: &Results) -> Row {
    let mut row = Row::new("capacity over equal drives with stops, % off");
    for (origin, name) in ORIGINS {
        let repeated: Vec<&Repeated> = results
            .repeated
            .iter()
            .filter(|repeated| of(origin)(repeated.drive))
            .collect();
        let figures = |figure: fn(&[f64; 3]) -> f64| -> Vec<Member> {
            let member = |one: &&Repeated| (one.drive.group.clone(), 100.0 * figure(&one.capacities));
            repeated.iter().map(member).collect()
        };
        let ten = figures(|[ten, _, _]| (ten - 1.0).abs());
        row.add_worst(format!("after ten, {name}"), Goal::AtMost(5.0), &ten);
        let thirty = figures(|[_, _, thirty]| (thirty - 1.0).abs());
        row.add_worst(format!("after thirty, {name}"), Goal::AtMost(6.0), &thirty);
        let last = figures(|[_, twenty, thirty]| (thirty - twenty).abs());
        row.add_worst(
            format!("from the 20th to the 30th, {name}"),
            Goal::AtMost(1.0),
            &last,
        );
        let within = share(thirty.iter().map(|(_, off)| *off <= 6.0));
        row.add(
            format!("within 6 % after thirty, {name}, share of drives"),
            Goal::None,
            within,
            "",
        );
        let learnt = share(repeated.iter().map(|repeated| repeated.has_learnt));
        row.add(
            format!("drives that teach, {name}, share"),
            Goal::None,
            learnt,
            "",
        );
    }
    row
}

fn inside(results: &Results) -> Row {
    let mut row = Row::new("inside two deviations, share");
    for (origin, name) in ORIGINS {
        for start in STARTS {
            let outcomes = results.started(start, of(origin));
            let errors = pooled(outcomes.map(|outcome| &outcome.score.remaining));
            add_inside(&mut row, &format!("{name}, {start:?}"), errors);
        }
        let groups = results.groups(Start::Full, of(origin), |_, score| score.remaining.inside_two());
        row.add_worst(
            format!("{name}, least of a group from full"),
            Goal::AtLeast(0.8),
            &groups,
        );
    }
    let as_recorded = results
        .lives
        .iter()
        .filter(|life| !life.name.ends_with(EVERY_DRIVE));
    let errors = pooled(as_recorded.flat_map(|life| life.scores.iter().map(|score| &score.remaining)));
    add_inside(&mut row, "recorded, lives in order", errors);
    row
}

fn add_inside(row: &mut Row, part: &str, errors: Option<Errors>) {
    let inside = errors.as_ref().map(Errors::inside_two);
    row.add(format!("{part}, pooled"), Goal::AtLeast(0.88), inside, "");
    let (rms, sigma) = errors.map_or((f64::NAN, f64::NAN), |errors| (errors.rms(), errors.sigma()));
    // A mean deviation of 1.6 times the RMS error, or of 4 points, is not too wide.
    let width = inside.map(|_| sigma / (1.6 * rms).max(4.0));
    let note = format!("± {sigma:.1} at {rms:.1} RMS");
    row.add(
        format!("{part}, mean deviation over the widest allowed"),
        Goal::AtMost(1.0),
        width,
        note,
    );
}

fn known(results: &Results) -> Row {
    let mut row = Row::new("known from full, share");
    for (origin, name) in ORIGINS {
        for chemistry in [
            Chemistry::LiPo,
            Chemistry::LiFe,
            Chemistry::LiIon,
            Chemistry::NiMh,
        ] {
            let which = |drive: &Drive| of(origin)(drive) && drive.cell.chemistry == chemistry;
            let groups = results.groups(Start::Full, which, |_, score| score.remaining.known());
            row.add_worst(format!("{name}, {chemistry:?}"), Goal::AtLeast(0.95), &groups);
        }
    }
    row
}

fn aged_warm(results: &Results) -> Row {
    let mut row = Row::new("aged, second half of life at 24 °C");
    for is_every in [true, false] {
        let which = |life: &str| life.starts_with(WARM_LIFE) && life.ends_with(EVERY_DRIVE) == is_every;
        let mut add = |part: &str, goal: Goal, figure: fn(&Score) -> f64| {
            let means = results.life_means(which, |drives| drives / 2, figure);
            row.add_each(part, goal, &means);
        };
        add("estimated, points", Goal::AtMost(2.5), |score| {
            score.remaining.rms()
        });
        add("usable, points", Goal::AtMost(3.0), |score| score.usable.rms());
        add("usable at cut-off, %", Goal::AtMost(5.0), |score| {
            score.usable_at_end
        });
        add("estimated at cut-off, %", Goal::None, |score| {
            score.remaining_at_end
        });
        add("low ahead, min", Goal::Within(4.0, 15.0), |score| {
            score.low_ahead_min
        });
        let left = |score: &Score| score.ten_minutes_min;
        add("time left ten minutes before, min", Goal::Within(8.0, 13.0), left);
        add("inside two deviations, share", Goal::None, |score| {
            score.remaining.inside_two()
        });
    }
    row
}

fn aged_others(results: &Results) -> Row {
    let mut row = Row::new("aged LiCoO2, second half; aged at 4 °C, from the fifth drive on; points");
    let second_half: fn(usize) -> usize = |drives| drives / 2;
    for (cell, part, from, remaining, usable) in [
        (
            COBALT_LIFE,
            "LiCoO2",
            second_half,
            Goal::AtMost(5.0),
            Goal::AtMost(5.0),
        ),
        (COLD_LIFE, "at 4 °C", |_| 4, Goal::AtMost(6.0), Goal::AtMost(4.0)),
        (LARGE_CELL, "new, 1 to 3 C", |_| 0, Goal::None, Goal::None),
    ] {
        let which = |life: &str| life.starts_with(cell);
        let estimated = results.life_means(which, from, |score| score.remaining.rms());
        row.add_each(&format!("{part}, estimated"), remaining, &estimated);
        let means = results.life_means(which, from, |score| score.usable.rms());
        row.add_each(&format!("{part}, usable"), usable, &means);
    }
    row
}

fn usable(results: &Results) -> Row {
    let mut row = Row::new("usable from full, points");
    let at = |range: std::ops::Range<i32>| {
        let which = |drive: &Drive| is_first_cell(drive) && range.contains(&drive.temperature_c);
        results.groups(Start::Full, which, usable_rms)
    };
    row.add_each("first cell", Goal::AtMost(4.0), &at(0..100));
    row.add_each("first cell, colder", Goal::NoWorse(0.0), &at(-99..0));
    let others = results.groups(Start::Full, is_other_cell, usable_rms);
    row.add_each("other cells", Goal::None, &others);
    row.add_each(
        "simulated",
        Goal::None,
        &results.groups(Start::Full, of(Origin::Simulated), usable_rms),
    );
    row
}

fn last_fifth(results: &Results) -> Row {
    let mut row = Row::new("usable within 3 % over the last fifth, share of drives");
    let is_within = |score: &Score| score.last_fifth <= 3.0;
    let at =
        |temperature_c| move |drive: &Drive| is_first_cell(drive) && drive.temperature_c == temperature_c;
    row.add(
        "first cell, 25 °C",
        Goal::AtLeast(0.8),
        results.share_of(at(25), is_within),
        "",
    );
    let constant = results.started(Start::Full, |drive| drive.cell.name == CONSTANT_LOAD);
    let is_constant = |life: &str| life.starts_with(WARM_LIFE) || life.starts_with(LARGE_CELL);
    let lives = results
        .lives
        .iter()
        .filter(|life| is_constant(&life.name) && !life.name.ends_with(EVERY_DRIVE));
    let scores = constant
        .map(|outcome| &outcome.score)
        .chain(lives.flat_map(|life| &life.scores));
    row.add(
        "constant loads",
        Goal::AtLeast(0.8),
        share(scores.map(is_within)),
        "",
    );
    row.add(
        "first cell, 10 °C",
        Goal::AtLeast(0.5),
        results.share_of(at(10), is_within),
        "",
    );
    let simulated = |drive: &Drive| drive.cell.origin == Origin::Simulated && is_warm(drive);
    row.add(
        "simulated, warm",
        Goal::None,
        results.share_of(simulated, is_within),
        "",
    );
    row
}

fn usable_to_the_end(results: &Results) -> Row {
    let mut row = Row::new("usable to the end, from full, worst drive");
    for (origin, name) in ORIGINS {
        let mut add = |part: &str, which: fn(&Drive) -> bool, most: f64, figure: fn(&Score) -> f64| {
            let outcomes = results.started(Start::Full, |drive| of(origin)(drive) && which(drive));
            let member = |outcome: &Outcome| (outcome.drive.group.clone(), figure(&outcome.score));
            let members: Vec<Member> = outcomes.map(member).collect();
            row.add_worst(format!("{name}: {part}"), Goal::AtMost(most), &members);
            let known = members.iter().filter(|(_, figure)| !figure.is_nan());
            let reached = share(known.map(|(_, figure)| *figure <= most));
            row.add(
                format!("{name}: {part}, share of drives within"),
                Goal::None,
                reached,
                "",
            );
        };
        let rise = |score: &Score| score.usable_rise;
        add("largest rise in ten minutes, points", |_| true, 3.0, rise);
        let collapse = |drive: &Drive| drive.has_collapsed;
        add("when first below critical, %", collapse, 3.0, |score| {
            score.usable_at_end
        });
        add("ten seconds later, %", collapse, 0.5, |score| {
            score.usable_after_end
        });
        add("from then on, %", collapse, 0.5, |score| score.usable_comes_back);
        add(
            "true when 0 is reported, %",
            |_| true,
            5.0,
            |score| score.usable_at_zero,
        );
    }
    row
}

fn warned(results: &Results) -> Row {
    let mut row = Row::new("warned in time, 25 and 10 °C, share of drives");
    let first = |drive: &Drive| is_first_cell(drive) && is_warm(drive);
    let simulated = |drive: &Drive| drive.cell.origin == Origin::Simulated && is_warm(drive);
    let is_ahead = |score: &Score| (3.0..=40.0).contains(&score.low_ahead_min);
    let is_near = |score: &Score| (15.0..=60.0).contains(&score.half_hour_min);
    let ahead = "15 % usable 3 to 40 min ahead";
    row.add(ahead, Goal::AtLeast(0.9), results.share_of(first, is_ahead), "");
    row.add(
        format!("{ahead}, simulated"),
        Goal::None,
        results.share_of(simulated, is_ahead),
        "",
    );
    let near = "half an hour before estimated 15 to 60 min";
    row.add(near, Goal::AtLeast(0.8), results.share_of(first, is_near), "");
    row.add(
        format!("{near}, simulated"),
        Goal::None,
        results.share_of(simulated, is_near),
        "",
    );
    row
}

fn half_and_voltage(results: &Results) -> Row {
    let mut row = Row::new("half-full start; voltage alone; warm; mean of groups, points");
    for (start, part, more) in [
        (Start::Half, "from half", 0.3),
        (Start::VoltageOnly, "voltage alone", 0.5),
    ] {
        let mut add = |name: &str, which: fn(&Drive) -> bool| {
            let warm = |drive: &Drive| which(drive) && is_warm(drive);
            let mean = mean_of(&results.groups(start, warm, remaining_rms));
            row.add(format!("{part}, {name}"), Goal::NoWorse(more), mean, "");
        };
        add("first cell", is_first_cell);
        add("other cells", is_other_cell);
        add("simulated", |drive| drive.cell.origin == Origin::Simulated);
    }
    row
}

fn iron_and_weeks(results: &Results) -> Row {
    let mut row = Row::new("cold LiFe; simulated weeks");
    for (part, most_c) in [("−10 °C and colder", -10), ("below 0 °C", -1)] {
        let iron = |drive: &Drive| {
            let is_cold = drive.temperature_c <= most_c && drive.cell.origin == Origin::Recorded;
            drive.cell.chemistry == Chemistry::LiFe && is_cold
        };
        let groups = results.groups(Start::Full, iron, |_, score| score.remaining.inside_two());
        row.add_worst(
            format!("LiFe {part}, inside two deviations, share"),
            Goal::AtLeast(0.8),
            &groups,
        );
    }
    for (habit, name) in HABITS.into_iter().filter(|(habit, _)| *habit != Habit::TwoPacks) {
        let goal = match habit {
            Habit::OneStop | Habit::StopAndGo | Habit::EightyPercent | Habit::ThreeMinutes => {
                Goal::AtMost(5.0)
            }
            _ => Goal::None,
        };
        let off = |weeks: &Weeks| 100.0 * (weeks.days[DAYS - 1].capacity - 1.0).abs();
        let part = format!("{name}: capacity on day 14, % off");
        row.add_worst(part, goal, &results.weeks_of(habit, off));
    }
    row
}

fn second_week(results: &Results) -> Row {
    let mut row = Row::new("simulated weeks, days 8 to 14, mean of packs");
    for (habit, name) in HABITS {
        let mut add = |part: &str, figure: fn(&Errors) -> f64| {
            let of_week = |weeks: &Weeks| {
                let errors = pooled(weeks.days[DAYS / 2..].iter().map(|day| &day.errors));
                errors.as_ref().map_or(f64::NAN, figure)
            };
            let mean = mean_of(&results.weeks_of(habit, of_week));
            row.add(format!("{name}: {part}"), Goal::None, mean, "");
        };
        add("estimated, points", Errors::rms);
        add("inside two deviations, share", Errors::inside_two);
        add("known, share", Errors::known);
    }
    row
}

fn moved(results: &Results) -> Row {
    let mut row = Row::new("moved by ≤ 1 point RMS or ¼ deviation, share of runs");
    for (origin, name) in ORIGINS {
        for start in STARTS {
            for variation in VARIATIONS {
                let runs: Vec<_> = results
                    .started(start, of(origin))
                    .flat_map(|outcome| {
                        outcome
                            .moved
                            .iter()
                            .map(|(what, moved)| (outcome.drive, *what, moved))
                    })
                    .filter(|(_, what, moved)| *what == variation && !moved.rms.is_nan())
                    .collect();
                let Some((drive, _, most)) = runs
                    .iter()
                    .max_by(|(_, _, here), (_, _, there)| here.rms.total_cmp(&there.rms))
                else {
                    continue;
                };
                let most = format!("{:.2} points, {:.2} σ", most.rms, most.in_deviations);
                let small = share(runs.iter().map(|(_, _, moved)| moved.is_small()));
                let note = format!("at most {most}: {}", drive.group);
                row.add(
                    format!("{name}, {start:?}, {variation}"),
                    Goal::AtLeast(1.0),
                    small,
                    note,
                );
            }
        }
    }
    for life in &results.lives {
        for (variation, moved) in VARIATIONS.iter().zip(&life.moved) {
            let note = format!("{:.2} points, {:.2} σ", moved.rms, moved.in_deviations);
            let small = share([moved.is_small()].into_iter());
            let part = format!("{} in order, {variation}", life.name);
            row.add(part, Goal::AtLeast(1.0), small, note);
        }
    }
    row
}

fn bad_input(results: &Results) -> Row {
    let mut row = Row::new("bad input in one drive");
    for (origin, name) in ORIGINS {
        let members = |fault: Fault, figure: fn(&Faulty) -> f64| -> Vec<Member> {
            let faulty = results.faulty.iter();
            let of_fault = faulty.filter(|faulty| faulty.fault == fault && of(origin)(faulty.drive));
            of_fault
                .map(|faulty| (faulty.drive.group.clone(), figure(faulty)))
                .collect()
        };
        for (fault, what) in FAULTS {
            let inside = members(fault, |faulty| match faulty.is_announced {
                true => 1.0,
                false => faulty.after[0].remaining.inside(2.0),
            });
            let part = format!("{what}, {name}: inside after it, or announced, share of the time");
            row.add_worst(part, Goal::AtLeast(0.85), &inside);
            let third = members(fault, |faulty| faulty.after[2].remaining.rms());
            row.add_worst(
                format!("{what}, {name}: third drive after it, points"),
                Goal::AtMost(5.0),
                &third,
            );
        }
        let faulty = results.faulty.iter().filter(|faulty| of(origin)(faulty.drive));
        let finite = share(faulty.map(|faulty| faulty.is_finite));
        row.add(
            format!("{name}: drives with nothing but numbers, share"),
            Goal::AtLeast(1.0),
            finite,
            "",
        );
    }
    row
}

/// Prints the first week of a pack with each habit: estimated and true charge at the end of each day, in percent.
pub fn print_weeks(name: &str, results: &Results) {
    let days: Vec<String> = (1..=7).map(|day| format!("day {day}")).collect();
    println!("\n| {name}: estimated, true at the end | {} |", days.join(" | "));
    println!("|---|{}", "---|".repeat(days.len()));
    for (habit, name) in HABITS {
        for chemistry in ["LiPo", "Li-ion"] {
            let is_one = |weeks: &&Weeks| weeks.habit == habit && weeks.chemistry == chemistry;
            let Some(weeks) = results.weeks.iter().find(is_one) else {
                continue;
            };
            let day = |day: &Day| {
                let estimated = day
                    .reported_pct
                    .map_or("unknown".into(), |estimated_pct| format!("{estimated_pct:.0}"));
                format!("{estimated}, {:.0}", day.true_pct)
            };
            let days: Vec<String> = weeks.days[..7].iter().map(day).collect();
            println!("| {name}, {chemistry} | {} |", days.join(" | "));
        }
    }
}
