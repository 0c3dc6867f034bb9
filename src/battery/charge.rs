//! State of charge, from the cells' voltage and the charge that is drawn.

use super::charge_tracker::CellReading;
use super::chemistry::Cell;
use super::load::{CapacitySource, Load};
use super::low_pass::Pace;

/// How far sensors of the current and capacities on labels are off, as a share.
const DRAWN_UNCERTAINTY: f32 = 0.05;

/// How far a capacity is off that is only guessed from the resistance.
const GUESSED_DRAWN_UNCERTAINTY: f32 = 0.5;

/// What was counted by a guessed capacity is replaced by what the voltage tells within about so many seconds.
const GUESS_TIME_CONSTANT_S: f32 = 60.0;

/// Bounds that are further apart leave nothing to tell: ± 30 %.
const WIDEST: f32 = 0.6;

/// What has been told is told on until they are so far apart.
const WIDEST_ONCE_TOLD: f32 = 0.8;

/// Bounds are kept within these: beyond empty and full as far as they are uncertain.
const LOWEST: f32 = -0.1;
const HIGHEST: f32 = 1.1;

/// How many standard deviations of the curves of different makes the bounds are apart from the middle.
const CURVE_SIGMAS: f32 = 2.0;

/// Without a current, a voltage above what is expected is believed so many times faster than one below: a load can only
/// lower it.
const RISE_SPEEDUP: f32 = 3.0;

/// A larger sag than this is not taken for a load, in volts.
const LARGEST_SAG_V: f32 = 0.8;

const HOURS_PER_SECOND: f32 = 1.0 / 3600.0;

/// The state of charge, between two bounds.
///
/// Counting charge moves it and parts the bounds slowly, by what current and capacity may be wrong. The voltage tells
/// bounds of its own, as wide as the curve and the sag are uncertain; where they are narrower, they are taken over. So
/// the voltage does not move an estimate that it does not contradict: an error of the curve stays the same however often
/// it is looked at, and nothing is learnt from looking again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StateOfCharge {
    /// 0 empty, 1 full.
    value: f32,
    low: f32,
    high: f32,
    /// How far apart the bounds may be for the value to be told.
    widest: f32,
}

/// How fast a state of charge gives way to what the voltage tells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paces {
    bound: Pace,
    guess: Pace,
}

impl Paces {
    pub const fn new(bound_time_constant_s: f32) -> Self {
        Self {
            bound: Pace::new(bound_time_constant_s),
            guess: Pace::new(GUESS_TIME_CONSTANT_S),
        }
    }
}

impl StateOfCharge {
    /// From the voltage of a cell at this load; `None` if the load is not known.
    pub fn from_voltage(cell: &Cell, cell_voltage_v: f32, load: Option<Load>) -> Self {
        let resting_v = resting_voltage_v(cell, cell_voltage_v, load);
        let (low, high) = bounds(cell, resting_v, load);
        Self {
            value: cell.curve.state_of_charge(resting_v),
            low,
            high,
            widest: WIDEST,
        }
    }

    /// Somebody who knows has told, as a share from 0 to 1.
    pub const fn told(value: f32) -> Self {
        Self {
            value,
            low: value,
            high: value,
            widest: WIDEST,
        }
    }

    pub fn to_words(self) -> [u32; 3] {
        [self.value, self.low, self.high].map(f32::to_bits)
    }

    /// `None` if these are no numbers a state of charge can have.
    pub fn from_words(words: [u32; 3]) -> Option<Self> {
        let [value, low, high] = words.map(f32::from_bits);
        let is_possible = (0.0..=1.0).contains(&value) && low <= high && low >= LOWEST && high <= HIGHEST;
        is_possible.then_some(Self {
            value,
            low,
            high,
            widest: WIDEST,
        })
    }

    /// From 0 to 1; `None` if it may be nearly anything.
    pub fn value(&self) -> Option<f32> {
        (self.high - self.low <= self.widest).then_some(self.value)
    }

    /// Takes the next reading.
    pub fn update(&mut self, cell: &Cell, reading: &CellReading, paces: &mut Paces) {
        match (reading.load, reading.voltage_v) {
            (Some(load), Some(voltage_v)) => {
                self.draw(reading.dt_s, load);
                let share = paces.bound.share_of_step(reading.dt_s);
                self.bound(share, cell, voltage_v, load);
                if load.capacity == CapacitySource::Guessed {
                    let share = paces.guess.share_of_step(reading.dt_s);
                    self.look_again(cell, voltage_v, load, share);
                }
            }
            (Some(load), None) => self.draw(reading.dt_s, load),
            (None, Some(voltage_v)) => self.follow(reading.dt_s, cell, voltage_v),
            (None, None) => {}
        }
        self.widest = match self.value() {
            Some(_) => WIDEST_ONCE_TOLD,
            None => WIDEST,
        };
    }

    /// Moves to what the voltage tells by this share of the way.
    pub fn look_again(&mut self, cell: &Cell, cell_voltage_v: f32, load: Load, share: f32) {
        let told = cell
            .curve
            .state_of_charge(resting_voltage_v(cell, cell_voltage_v, Some(load)));
        self.value = (self.value + (told - self.value) * share).clamp(0.0, 1.0);
    }

    /// A load has lasted for `dt_s` seconds.
    fn draw(&mut self, dt_s: f32, load: Load) {
        let drawn = load.rate_per_h * dt_s * HOURS_PER_SECOND;
        let uncertainty = match load.capacity {
            CapacitySource::Set => DRAWN_UNCERTAINTY,
            CapacitySource::Guessed => GUESSED_DRAWN_UNCERTAINTY,
        };
        let error = uncertainty * drawn.abs();
        self.value = (self.value - drawn).clamp(0.0, 1.0);
        self.low = (self.low - drawn - error).clamp(LOWEST, HIGHEST);
        self.high = (self.high - drawn + error).clamp(LOWEST, HIGHEST);
    }

    /// Takes over a share of what the cell's voltage under this load tells.
    fn bound(&mut self, share: f32, cell: &Cell, cell_voltage_v: f32, load: Load) {
        let resting_v = resting_voltage_v(cell, cell_voltage_v, Some(load));
        let (low, high) = bounds(cell, resting_v, Some(load));
        self.low += (low - self.low).max(0.0) * share;
        self.high = self.high.max(self.low);
        self.high += (high - self.high).min(0.0) * share;
        self.low = self.low.min(self.high);
        self.value = self.value.max(self.low).min(self.high).clamp(0.0, 1.0);
    }

    /// The cell had this voltage for `dt_s` seconds, under a load that is not measured.
    ///
    /// The sag tells the load: a load of one capacity an hour takes a typical amount off the voltage. So the charge is
    /// counted by the sag below the resting voltage, and an estimate that is too high has too large a sag and falls faster.
    fn follow(&mut self, dt_s: f32, cell: &Cell, cell_voltage_v: f32) {
        let sag_v = cell.curve.voltage_v(self.value) - cell_voltage_v;
        let sag_v = sag_v.clamp(-LARGEST_SAG_V, LARGEST_SAG_V);
        let speedup = if sag_v < 0.0 { RISE_SPEEDUP } else { 1.0 };
        let drawn = speedup * sag_v / cell.lasting_drop_v() * dt_s * HOURS_PER_SECOND;
        self.value = (self.value - drawn).clamp(0.0, 1.0);
        (self.low, self.high) = bounds(cell, cell.curve.voltage_v(self.value), None);
    }
}

/// The voltage of a cell without its load, as far as that is known, and within its curve.
fn resting_voltage_v(cell: &Cell, cell_voltage_v: f32, load: Option<Load>) -> f32 {
    let sag_v = load.map_or(0.0, |load| load.sag_v);
    // Not `clamp`, which would panic if the curve were upside down.
    (cell_voltage_v + sag_v)
        .max(cell.curve.empty_v())
        .min(cell.curve.full_v())
}

/// Between which states of charge a cell is that rests at this voltage.
fn bounds(cell: &Cell, resting_v: f32, load: Option<Load>) -> (f32, f32) {
    let sag_error_v = load.map_or(0.0, |load| load.sag_error_v.abs());
    let error_v = CURVE_SIGMAS * cell.curve_spread_v + sag_error_v;
    let at = |voltage_v| cell.curve.state_of_charge(voltage_v).clamp(LOWEST, HIGHEST);
    (at(resting_v - error_v), at(resting_v + error_v))
}
