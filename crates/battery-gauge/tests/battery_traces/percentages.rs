//! Percentages that act (`BATT_FS_PCT_EN`), in drives of packs of other makes down to their ends.

use battery_gauge::{
    BatteryMonitor, BatteryState, ChargeLimits, ChargeState, Chemistry, FailsafeLevel, FailsafeSettings,
    LearntPack, PackEvent, PackSettings, Thresholds,
};
use fastrand::Rng;

use super::replay::{Sample, reading, tick};

/// Interval of the samples, in seconds.
const DT_S: f64 = 0.5;

/// Cells of the packs, and their label in ampere-hours.
const COUNT: u8 = 3;
const LABEL_AH: f64 = 2.2;

/// `BATT_LOW_PCT` and the higher one of `BATT_CRT_PCT` and `BATT_EMR_PCT`, at their defaults.
const PERCENTAGES: [f64; 2] = [15.0, 7.0];

/// A rest before the drive and behind it, in seconds.
const REST_S: f64 = 60.0;
const REST_AFTER_S: f64 = 900.0;

/// Resting voltage of a cell at 0, 10, …, 100 %, in volts.
type Curve = [f64; 11];

/// Cells of a chemistry.
#[derive(Clone, Copy, Debug)]
pub struct Cells {
    pub chemistry: Chemistry,
    /// Means of makes: those of the papers that `src/chemistry.rs` cites; of LiPo the hobbyists' chart.
    pub curve: Curve,
    /// Standard deviation of makes, in volts.
    spread_v: f64,
    /// The voltage drop at 1 C, in volts, and the slow one relative to it.
    pub drop_v: f64,
    pub slow_share: f64,
    /// The voltage under load at which a pack ends, in volts.
    end_v: f64,
}

pub const CELLS: [Cells; 4] = [
    Cells {
        chemistry: Chemistry::LiPo,
        curve: [3.27, 3.69, 3.73, 3.77, 3.80, 3.84, 3.87, 3.95, 4.02, 4.11, 4.20],
        spread_v: 0.03,
        drop_v: 0.026,
        slow_share: 0.5,
        end_v: 3.4,
    },
    Cells {
        chemistry: Chemistry::LiFe,
        curve: [2.50, 3.19, 3.24, 3.28, 3.29, 3.30, 3.30, 3.32, 3.33, 3.34, 3.45],
        spread_v: 0.02,
        drop_v: 0.023,
        slow_share: 1.0,
        end_v: 2.8,
    },
    Cells {
        chemistry: Chemistry::LiIon,
        curve: [2.54, 3.30, 3.45, 3.55, 3.64, 3.72, 3.82, 3.92, 4.02, 4.09, 4.20],
        spread_v: 0.05,
        drop_v: 0.09,
        slow_share: 1.75,
        end_v: 3.0,
    },
    Cells {
        chemistry: Chemistry::NiMh,
        curve: [1.19, 1.24, 1.27, 1.29, 1.31, 1.31, 1.32, 1.33, 1.35, 1.37, 1.40],
        spread_v: 0.03,
        drop_v: 0.018,
        slow_share: 1.0,
        end_v: 1.0,
    },
];

/// The life that a pack has had with this monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Life {
    New,
    Learnt,
    /// Learnt, with three quarters of its capacity and one and a half times its resistance.
    Aged,
}

/// A random number with standard deviation 1, at most 4.2.
fn deviation(random: &mut Rng) -> f64 {
    let sum: f64 = (0..6).map(|_| random.f64() - 0.5).sum();
    sum * 2.0_f64.sqrt()
}

/// A pack with the fast and the slow parts of its sag.
#[derive(Clone)]
struct Pack {
    curve: Curve,
    capacity_ah: f64,
    ohm: f64,
    slow_ohm: f64,
    slow_a: [f64; 2],
    charge: f64,
}

/// Time constants of the slow parts, in seconds.
const SLOW_S: [f64; 2] = [10.0, 200.0];

impl Pack {
    /// One of any make.
    fn any(cells: &Cells, life: Life, random: &mut Rng) -> Self {
        let (capacity, resistance) = match life {
            Life::New | Life::Learnt => (1.0, 1.0),
            Life::Aged => (0.75, 1.5),
        };
        let capacity_ah = LABEL_AH * capacity * (1.0 + 0.04 * deviation(random));
        let [at_empty_v, at_full_v] = [1.0, 0.5].map(|share| share * cells.spread_v * deviation(random));
        let mut curve = cells.curve;
        // A full cell has the voltage of its charger.
        for (point, voltage_v) in curve.iter_mut().enumerate().take(10) {
            let full = point as f64 / 10.0;
            *voltage_v += at_empty_v * (1.0 - full) + at_full_v * full;
        }
        let ohm = cells.drop_v / capacity_ah * resistance * (0.25 * deviation(random)).exp();
        Self {
            curve,
            capacity_ah,
            ohm,
            slow_ohm: ohm * cells.slow_share * (1.0 + 0.3 * deviation(random)).max(0.1),
            slow_a: [0.0; 2],
            charge: 1.0,
        }
    }

    fn cell_v(&self, current_a: f64) -> f64 {
        let place = self.charge.clamp(0.0, 1.0) * 10.0;
        let below = (place as usize).min(9);
        let share = place - below as f64;
        let resting_v = self.curve[below] * (1.0 - share) + self.curve[below + 1] * share;
        let beyond_v = 20.0 * self.charge.min(0.0);
        // The resistance of nearly empty cells grows.
        let growth = 1.0 + 3.0 * (0.2 - self.charge).max(0.0);
        let slow_a = self.slow_a.iter().sum::<f64>() / 2.0;
        resting_v + beyond_v - growth * (self.ohm * current_a + self.slow_ohm * slow_a)
    }

    fn draw(&mut self, current_a: f64) {
        self.charge -= current_a * DT_S / 3600.0 / self.capacity_ah;
        for (slow_a, time_s) in self.slow_a.iter_mut().zip(SLOW_S) {
            *slow_a += (current_a - *slow_a) * (1.0 - (-DT_S / time_s).exp());
        }
    }
}

/// Stop-and-go, and how it is measured.
#[derive(Clone, Copy, Debug)]
struct Drive {
    mean_a: f64,
    period_s: f64,
    duty: f64,
    has_current_sensor: bool,
    /// Share of the readings that fail.
    lost: f64,
}

impl Drive {
    fn any(has_current_sensor: bool, random: &mut Rng) -> Self {
        Self {
            mean_a: LABEL_AH * (0.3 + 0.7 * random.f64()),
            period_s: 10.0 + 60.0 * random.f64(),
            duty: 0.3 + 0.6 * random.f64(),
            has_current_sensor,
            lost: if random.bool() { 0.1 } else { 0.0 },
        }
    }

    fn current_a(&self, t_s: f64) -> f64 {
        if t_s >= REST_S && t_s % self.period_s < self.duty * self.period_s {
            self.mean_a / self.duty * (1.0 + 0.3 * (0.9 * t_s).sin())
        } else {
            0.15
        }
    }

    fn sample(&self, t_s: f64, pack: &Pack, current_a: f64, random: &mut Rng) -> Sample {
        let voltage_v = f64::from(COUNT) * pack.cell_v(current_a) + 0.01 * deviation(random);
        let mut sample = Sample::measured(t_s, voltage_v, current_a, t_s >= REST_S);
        sample.current_a = sample.current_a.filter(|_| self.has_current_sensor);
        sample.healthy = random.f64() >= self.lost;
        sample
    }
}

/// Times in a drive, in seconds, and the true charge when a level acted, in percent.
#[derive(Clone, Debug, Default)]
struct Level {
    announced_s: Option<f64>,
    acted: Option<(f64, f64)>,
    /// The true usable charge has been five points below its percentage since then.
    surely_below_s: Option<f64>,
}

#[derive(Clone, Debug, Default)]
struct Outcome {
    levels: [Level; 2],
    inert_s: Option<f64>,
    end_s: f64,
}

fn settings(cells: &Cells) -> PackSettings {
    let percentage = |percentage: f64| Thresholds {
        usable_pct: Some(percentage as f32),
        ..Thresholds::default()
    };
    let [low, critical] = PERCENTAGES;
    PackSettings {
        chemistry: cells.chemistry,
        cell_count: Some(COUNT),
        capacity_mah: Some(1000.0 * LABEL_AH as f32),
        charge_limits: ChargeLimits {
            low_pct: Some(low as f32),
            critical_pct: Some(critical as f32),
            emergency_pct: Some(5.0),
        },
        failsafe: FailsafeSettings {
            timer_s: Some(10.0),
            low: percentage(low),
            critical: percentage(critical),
            ..FailsafeSettings::default()
        },
        ..PackSettings::default()
    }
}

/// A drive until five minutes after the pack's end, and a rest. Returns what was learnt, too.
fn drive(
    mut pack: Pack,
    cells: &Cells,
    drive: &Drive,
    learnt: &LearntPack,
    random: &mut Rng,
) -> (Outcome, LearntPack) {
    let settings = settings(cells);
    let (mut monitor, mut battery) = (BatteryMonitor::new(), BatteryState::default());
    monitor.restore_learnt(*learnt);
    let mut outcome = Outcome::default();
    let mut charges = Vec::new();
    let (mut t_s, mut ending_s, mut end) = (0.0, 0.0, None);
    while pack.charge > 0.0 && end.is_none_or(|(end_s, _)| t_s < end_s + 300.0) {
        t_s += DT_S;
        let current_a = drive.current_a(t_s);
        pack.draw(current_a);
        charges.push((t_s, pack.charge));
        let sample = drive.sample(t_s, &pack, current_a, random);
        let update = monitor.update(&mut battery, tick(&sample), reading(&sample), &settings);
        for event in &update.events {
            let announced = match event {
                PackEvent::Charge { state, .. } if *state >= ChargeState::Critical => 2,
                PackEvent::Charge { .. } => 1,
                _ => 0,
            };
            for level in &mut outcome.levels[..announced] {
                level.announced_s.get_or_insert(t_s);
            }
            if matches!(event, PackEvent::PercentagesInert(_)) {
                outcome.inert_s = Some(t_s);
            }
        }
        for level in &update.failsafe {
            let level = &mut outcome.levels[usize::from(*level == FailsafeLevel::Critical)];
            level.announced_s.get_or_insert(t_s);
            level.acted.get_or_insert((t_s, 100.0 * pack.charge));
        }
        ending_s = if pack.cell_v(current_a) < cells.end_v {
            ending_s + DT_S
        } else {
            0.0
        };
        if ending_s >= 5.0 {
            end.get_or_insert((t_s, pack.charge));
        }
    }
    let (end_s, end_charge) = end.unwrap_or((t_s, 0.0));
    outcome.end_s = end_s;
    let usable_pct = |charge: f64| 100.0 * (charge - end_charge) / (1.0 - end_charge);
    for (level, percentage) in outcome.levels.iter_mut().zip(PERCENTAGES) {
        let is_below = |(_, charge): &&(f64, f64)| usable_pct(*charge) < percentage - 5.0;
        level.surely_below_s = charges.iter().find(is_below).map(|(t_s, _)| *t_s);
    }
    for _ in 0..(REST_AFTER_S / DT_S) as u32 {
        t_s += DT_S;
        pack.draw(0.0);
        let mut sample = drive.sample(t_s, &pack, 0.0, random);
        sample.armed = false;
        let _ = monitor.update(&mut battery, tick(&sample), reading(&sample), &settings);
    }
    (outcome, monitor.unsaved_learnt().copied().unwrap_or(*learnt))
}

/// A drive of a pack with this life, from a charge between three quarters and full.
fn drive_of(cells: &Cells, life: Life, has_current_sensor: bool, random: &mut Rng) -> Outcome {
    let mut pack = Pack::any(cells, life, random);
    let mut learnt = LearntPack::UNKNOWN;
    let any_drive = |random: &mut Rng| Drive::any(has_current_sensor, random);
    if life != Life::New {
        for _ in 0..2 {
            let before = any_drive(random);
            (_, learnt) = drive(pack.clone(), cells, &before, &learnt, random);
        }
    }
    pack.charge = 0.75 + 0.25 * random.f64();
    let last = any_drive(random);
    drive(pack, cells, &last, &learnt, random).0
}

impl Outcome {
    /// Whether a level acts long after its text, and no text said that it can't act.
    fn has_silent_level(&self, follows_s: f64) -> bool {
        let is_silent = |level: &Level| {
            let announced_s = level.announced_s.unwrap_or(f64::INFINITY);
            level.acted_s() > announced_s + follows_s
        };
        self.inert_s.is_none() && self.levels.iter().any(is_silent)
    }

    /// Whether a level acts a minute after the pack is surely below its percentage, or later.
    fn is_late(&self) -> bool {
        let is_late = |level: &Level| {
            level
                .surely_below_s
                .is_some_and(|below_s| level.acted_s() > below_s + 60.0)
        };
        self.levels.iter().any(is_late)
    }

    /// Whether a level acts at more than twenty points above its percentage.
    fn is_early(&self) -> bool {
        let mut levels = self.levels.iter().zip(PERCENTAGES);
        levels.any(|(level, percentage)| {
            level
                .acted
                .is_some_and(|(_, charge_pct)| charge_pct > percentage + 20.0)
        })
    }
}

impl Level {
    fn acted_s(&self) -> f64 {
        self.acted.map_or(f64::INFINITY, |(t_s, _)| t_s)
    }
}

#[test]
// Requirement: AP-18, PX-3
fn percentages_act_before_packs_end_and_not_above_them() {
    let mut random = Rng::with_seed(1);
    let (mut early, mut late) = (Vec::new(), Vec::new());
    for _ in 0..8 {
        for cells in &CELLS {
            for life in [Life::New, Life::Learnt, Life::Aged] {
                // A minute and the timer: from then on a text says that it has not acted.
                for (has_current_sensor, follows_s) in [(true, 70.0), (false, 180.0)] {
                    let outcome = drive_of(cells, life, has_current_sensor, &mut random);
                    assert!(
                        !outcome.has_silent_level(follows_s),
                        "{:?} {life:?}, current sensor: {has_current_sensor}: {outcome:?}",
                        cells.chemistry
                    );
                    // Worn cells by voltage alone: their sag is taken for a lower charge, in every seventh drive by too much.
                    if has_current_sensor || life != Life::Aged {
                        early.push(outcome.is_early());
                    }
                    // The reserve for the sag of the others is less certain.
                    if has_current_sensor && matches!(cells.chemistry, Chemistry::LiPo | Chemistry::LiFe) {
                        late.push(outcome.is_late());
                    }
                }
            }
        }
    }
    let count = |drives: &[bool]| drives.iter().filter(|has_property| **has_property).count();
    let (some_early, some_late) = (count(&early), count(&late));
    println!(
        "early: {some_early} of {}, late: {some_late} of {}",
        early.len(),
        late.len()
    );
    assert!(50 * some_early <= early.len(), "{some_early} early");
    // The charge itself is a standard deviation of its estimate off in every third drive.
    assert!(4 * some_late <= late.len(), "{some_late} late");
}
