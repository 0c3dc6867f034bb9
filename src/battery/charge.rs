//! State of charge, from the cell voltage and the charge drawn.

use super::ArmState;
use super::chemistry::Cell;
use super::load::{CapacitySource, Load};
use super::low_pass::FilterGain;

/// Relative error of counted charge: current sensors and rated capacities.
const COUNTING_ERROR: f32 = 0.05;

/// The same with a capacity that is only inferred from the resistance.
const INFERRED_COUNTING_ERROR: f32 = 0.5;

/// Time constant with which the voltage corrects a count by an inferred capacity, in seconds.
const CORRECTION_TIME_CONSTANT_S: f32 = 60.0;

/// Start reporting once the bounds are this close: ± 30 %.
const MAX_WIDTH_TO_START: f32 = 0.6;

/// Hysteresis: keep reporting up to this width.
const MAX_WIDTH_TO_CONTINUE: f32 = 0.8;

/// Limits of the bounds: beyond empty and full by the uncertainty of the curves' ends.
const MIN_BOUND: f32 = -0.1;
const MAX_BOUND: f32 = 1.1;

/// Half width of the bounds, in standard deviations of the discharge curves.
const CURVE_SIGMAS: f32 = 2.0;

/// Without a current sensor, a voltage above the expected one corrects the estimate this many times faster than one
/// below: a load can only lower the voltage.
const RISE_SPEEDUP: f32 = 3.0;

/// Limit of the sag that is attributed to a load, in volts.
const MAX_SAG_V: f32 = 0.8;

const HOURS_PER_SECOND: f32 = 1.0 / 3600.0;

/// A reading of one cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellReading {
    /// Seconds since the previous reading.
    pub dt_s: f32,
    /// The cell voltage, in volts, if known.
    pub voltage_v: Option<f32>,
    /// The load, if known.
    pub load: Option<Load>,
    /// While the load is unknown, a disarmed rover counts as at rest.
    pub arm_state: ArmState,
}

/// The state of charge, with an upper and a lower bound.
///
/// Counting charge moves all three, and widens the bounds by the errors of current and capacity. The voltage gives
/// bounds of its own, as wide as the errors of the curve and the sag; the tighter bound wins. So a voltage that is
/// consistent with the estimate does not move it: the error of the curve is systematic, and does not average out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StateOfCharge {
    /// 0 empty, 1 full.
    value: f32,
    low: f32,
    high: f32,
    /// The value is unknown while the bounds are further apart.
    max_width: f32,
}

/// The gains with which the voltage corrects a state of charge.
#[derive(Clone, Copy, Debug)]
pub(super) struct FilterGains {
    bounds: FilterGain,
    correction: FilterGain,
}

impl FilterGains {
    pub const fn new(bound_time_constant_s: f32) -> Self {
        Self {
            bounds: FilterGain::new(bound_time_constant_s),
            correction: FilterGain::new(CORRECTION_TIME_CONSTANT_S),
        }
    }
}

impl StateOfCharge {
    /// From the cell voltage under this load; `None` if the load is unknown.
    pub fn from_voltage(cell: &Cell, cell_voltage_v: f32, load: Option<Load>) -> Self {
        let resting_v = resting_voltage_v(cell, cell_voltage_v, load);
        let (low, high) = bounds(cell, resting_v, load);
        Self {
            value: cell.curve.state_of_charge(resting_v),
            low,
            high,
            max_width: MAX_WIDTH_TO_START,
        }
    }

    /// Set by a battery reset, from 0 to 1.
    pub const fn from_reset(value: f32) -> Self {
        Self {
            value,
            low: value,
            high: value,
            max_width: MAX_WIDTH_TO_START,
        }
    }

    pub fn to_words(self) -> [u32; 3] {
        [self.value, self.low, self.high].map(f32::to_bits)
    }

    /// `None` if no state of charge has these words.
    pub fn from_words(words: [u32; 3]) -> Option<Self> {
        let [value, low, high] = words.map(f32::from_bits);
        let is_possible =
            (0.0..=1.0).contains(&value) && low <= high && low >= MIN_BOUND && high <= MAX_BOUND;
        is_possible.then_some(Self {
            value,
            low,
            high,
            max_width: MAX_WIDTH_TO_START,
        })
    }

    /// From 0 to 1; `None` if it is too uncertain.
    pub fn value(&self) -> Option<f32> {
        (self.high - self.low <= self.max_width).then_some(self.value)
    }

    /// Upper bound of a value that is known, from 0 to 1.
    pub fn at_most(&self) -> Option<f32> {
        self.value().map(|value| self.high.max(value).min(1.0))
    }

    /// Takes the next reading.
    pub fn update(&mut self, cell: &Cell, reading: &CellReading, gains: &mut FilterGains) {
        match (reading.load, reading.voltage_v) {
            (Some(load), Some(voltage_v)) => {
                self.count(reading.dt_s, load);
                let alpha = gains.bounds.alpha(reading.dt_s);
                self.tighten(alpha, cell, voltage_v, load);
                if load.capacity == CapacitySource::Inferred {
                    let alpha = gains.correction.alpha(reading.dt_s);
                    self.correct(cell, voltage_v, load, alpha);
                }
            }
            (Some(load), None) => self.count(reading.dt_s, load),
            (None, Some(voltage_v)) => self.infer_load(reading.dt_s, cell, voltage_v),
            (None, None) => {}
        }
        self.max_width = match self.value() {
            Some(_) => MAX_WIDTH_TO_CONTINUE,
            None => MAX_WIDTH_TO_START,
        };
    }

    /// Moves towards the state of charge at this voltage and load, with gain `alpha`.
    pub fn correct(&mut self, cell: &Cell, cell_voltage_v: f32, load: Load, alpha: f32) {
        let by_voltage = cell
            .curve
            .state_of_charge(resting_voltage_v(cell, cell_voltage_v, Some(load)));
        self.value = (self.value + (by_voltage - self.value) * alpha).clamp(0.0, 1.0);
    }

    /// Counts the charge drawn by a load in `dt_s` seconds.
    fn count(&mut self, dt_s: f32, load: Load) {
        let drawn = load.rate_per_h * dt_s * HOURS_PER_SECOND;
        let relative_error = match load.capacity {
            CapacitySource::Set => COUNTING_ERROR,
            CapacitySource::Inferred => INFERRED_COUNTING_ERROR,
        };
        let error = relative_error * drawn.abs();
        self.value = (self.value - drawn).clamp(0.0, 1.0);
        self.low = (self.low - drawn - error).clamp(MIN_BOUND, MAX_BOUND);
        self.high = (self.high - drawn + error).clamp(MIN_BOUND, MAX_BOUND);
    }

    /// Tightens the bounds towards those at this voltage and load, with gain `alpha`.
    fn tighten(&mut self, alpha: f32, cell: &Cell, cell_voltage_v: f32, load: Load) {
        let resting_v = resting_voltage_v(cell, cell_voltage_v, Some(load));
        let (low, high) = bounds(cell, resting_v, Some(load));
        self.low += (low - self.low).max(0.0) * alpha;
        self.high = self.high.max(self.low);
        self.high += (high - self.high).min(0.0) * alpha;
        self.low = self.low.min(self.high);
        self.value = self.value.max(self.low).min(self.high).clamp(0.0, 1.0);
    }

    /// Counts the charge drawn in `dt_s` seconds by a load that is not measured but inferred from the sag, with the
    /// typical sag at 1 C. An estimate that is too high has too large a sag, and falls faster: it converges.
    fn infer_load(&mut self, dt_s: f32, cell: &Cell, cell_voltage_v: f32) {
        let sag_v = cell.curve.voltage_v(self.value) - cell_voltage_v;
        let sag_v = sag_v.clamp(-MAX_SAG_V, MAX_SAG_V);
        let speedup = if sag_v < 0.0 { RISE_SPEEDUP } else { 1.0 };
        let drawn = speedup * sag_v / cell.lasting_drop_v() * dt_s * HOURS_PER_SECOND;
        self.value = (self.value - drawn).clamp(0.0, 1.0);
        (self.low, self.high) = bounds(cell, cell.curve.voltage_v(self.value), None);
    }
}

/// The cell voltage plus the known sag, limited to the curve.
fn resting_voltage_v(cell: &Cell, cell_voltage_v: f32, load: Option<Load>) -> f32 {
    let sag_v = load.map_or(0.0, |load| load.sag_v);
    // Not `clamp`: it panics if the limits are inverted.
    (cell_voltage_v + sag_v)
        .max(cell.curve.empty_v())
        .min(cell.curve.full_v())
}

/// The bounds of the state of charge of a cell with this resting voltage.
fn bounds(cell: &Cell, resting_v: f32, load: Option<Load>) -> (f32, f32) {
    let sag_error_v = load.map_or(0.0, |load| load.sag_error_v.abs());
    let error_v = CURVE_SIGMAS * cell.curve_spread_v + sag_error_v;
    let at = |voltage_v| cell.curve.state_of_charge(voltage_v).clamp(MIN_BOUND, MAX_BOUND);
    (at(resting_v - error_v), at(resting_v + error_v))
}
