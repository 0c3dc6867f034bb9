//! Two weeks of an owner's days with simulated packs.

use battery_gauge::PackSettings;
use fastrand::Rng;

use crate::estimator::Estimator;
use crate::runs::in_parallel;
use crate::score::{Errors, run};
use crate::simulated::{CHEMICALS, Pack, Session, Style};

pub const DAYS: usize = 14;

/// Makes of each chemistry.
const MAKES: u64 = 3;

/// What an owner does every day.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Habit {
    /// A drive from full with one stop of a minute.
    OneStop,
    StopAndGo,
    /// Charged to 80 %.
    EightyPercent,
    ThreeMinutes,
    /// Two packs in turn, of which one has a fifth less capacity.
    TwoPacks,
    ColdGarage,
    /// The current sensor has an offset of 0.1 A and a gain that is 5 % wrong.
    WrongSensor,
    /// The charger is taken off at 60 to 95 %, and the board is on at once.
    EarlyCharger,
    LabelLow,
    LabelHigh,
}

pub const HABITS: [(Habit, &str); 10] = [
    (Habit::OneStop, "a stop a day"),
    (Habit::StopAndGo, "stop-and-go"),
    (Habit::EightyPercent, "80 % daily"),
    (Habit::ThreeMinutes, "three-minute drives"),
    (Habit::TwoPacks, "two packs in turn"),
    (Habit::ColdGarage, "cold garage"),
    (Habit::WrongSensor, "sensor + 0.1 A, + 5 %"),
    (Habit::EarlyCharger, "charger off early"),
    (Habit::LabelLow, "label 20 % low"),
    (Habit::LabelHigh, "label 20 % high"),
];

/// The figures of one day.
#[derive(Clone, Debug)]
pub struct Day {
    pub errors: Errors,
    /// Reported and true charge at the end of the last drive, in percent.
    pub reported_pct: Option<f32>,
    pub true_pct: f64,
    /// Capacity relative to the true one; the label's where nothing is learnt.
    pub capacity: f64,
}

#[derive(Clone, Debug)]
pub struct Weeks {
    pub habit: Habit,
    pub chemistry: &'static str,
    pub days: Vec<Day>,
}

pub fn weeks<E: Estimator>() -> Vec<Weeks> {
    let mut jobs = Vec::new();
    for (habit, _) in HABITS {
        for chemical in 0..CHEMICALS.len() {
            jobs.extend((0..MAKES).map(|make| (habit, chemical, make)));
        }
    }
    in_parallel(&jobs, |(habit, chemical, make)| {
        fortnight::<E>(*habit, *chemical, *make)
    })
}

fn fortnight<E: Estimator>(habit: Habit, chemical: usize, make: u64) -> Weeks {
    let mut random = Rng::with_seed(100 + 17 * make + chemical as u64);
    let chemical = CHEMICALS[chemical];
    let mut packs = vec![Pack::any(chemical, &mut random)];
    if habit == Habit::ColdGarage {
        packs = packs.into_iter().map(Pack::cooled).collect();
    }
    if habit == Habit::TwoPacks {
        let mut other = Pack::any(chemical, &mut random);
        other.capacity_ah *= 0.8;
        packs.push(other);
    }
    let mut owner = Owner {
        habit,
        estimator: E::default(),
        random,
        settings: settings(habit, &packs[0]),
    };
    let count = packs.len();
    let days = (0..DAYS)
        .map(|day| owner.day(&mut packs[day % count], day))
        .collect();
    Weeks {
        habit,
        chemistry: chemical.cell.name,
        days,
    }
}

fn settings(habit: Habit, pack: &Pack) -> PackSettings {
    let label_ah = pack.chemical.cell.label_ah.expect("a label");
    pack.chemical.cell.settings(match habit {
        Habit::LabelLow => 0.8 * label_ah,
        Habit::LabelHigh => 1.2 * label_ah,
        _ => label_ah,
    })
}

struct Owner<E> {
    habit: Habit,
    estimator: E,
    random: Rng,
    settings: PackSettings,
}

impl<E: Estimator> Owner<E> {
    fn day(&mut self, pack: &mut Pack, number: usize) -> Day {
        let style = Style {
            load_per_h: 0.6 + 0.4 * self.random.f64(),
            every_s: if self.habit == Habit::StopAndGo {
                120.0
            } else {
                1500.0
            },
            stop_s: if self.habit == Habit::StopAndGo {
                45.0
            } else {
                60.0
            },
        };
        let until = 0.15 + 0.2 * self.random.f64();
        match self.habit {
            Habit::EightyPercent => pack.charge_to(0.8),
            Habit::EarlyCharger => pack.charge_to(0.6 + 0.35 * self.random.f64()),
            Habit::ThreeMinutes if !number.is_multiple_of(3) => {}
            _ => pack.charge_to(1.0),
        }
        // Plugged in and switched on at once, or the next morning.
        if self.habit != Habit::EarlyCharger {
            pack.draw(0.0, 8.0 * 3600.0);
        }
        let (drives, most_s) = match self.habit {
            Habit::ThreeMinutes => (6, 180.0),
            _ => (1, f64::INFINITY),
        };
        let mut errors = Errors::default();
        let (mut reported_pct, mut true_pct) = (None, f64::NAN);
        for _ in 0..drives {
            let mut session = Session::drive(pack, &style, until, most_s, &mut self.random);
            if self.habit == Habit::WrongSensor {
                for sample in &mut session.samples {
                    sample.current_a = sample.current_a.map(|current_a| 0.1 + 1.05 * current_a);
                }
            }
            let reports = run(&mut self.estimator, &self.settings, &session.samples);
            for (report, truth_pct) in reports.iter().zip(&session.truth_pct).skip(120) {
                errors.add_remaining(report, *truth_pct);
            }
            reported_pct = reports.last().and_then(|report| report.remaining_pct);
            true_pct = *session.truth_pct.last().expect("samples");
            pack.draw(0.0, 1800.0);
        }
        let label_ah = f64::from(self.settings.capacity_mah.expect("a label")) / 1000.0;
        Day {
            errors,
            reported_pct,
            true_pct,
            capacity: self.estimator.capacity_ah().unwrap_or(label_ah) / pack.capacity_ah,
        }
    }
}
