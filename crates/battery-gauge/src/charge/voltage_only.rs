//! State of charge of a pack whose current is not measured.

use super::cell_model::{CellModel, KnownCharge, root_of_squares};
use super::load::{HOURS_PER_SECOND, Load, SagGrowth, Trace};
use crate::LoadState;
use crate::low_pass::MeanThenLowPass;

/// Time constants, in seconds: of the mean voltage about which the load varies it; of the size of the sag; of a resting
/// voltage that is believed; of the rate that gives the time left.
const MEAN_TIME_CONSTANT_S: f32 = 60.0;
const SCALE_TIME_CONSTANT_S: f32 = 400.0;
const REST_TIME_CONSTANT_S: f32 = 3.0;
const RATE_TIME_CONSTANT_S: f32 = 120.0;

/// A pack that is found under load is estimated after the first time, in seconds, and once more after the second.
const SETTLING_S: f32 = 60.0;
const FIRST_ESTIMATE_S: f32 = 30.0;

/// A rested cell's voltage stays within this of its mean for this long, in volts and seconds.
const RESTING_CHANGE_V: f32 = 0.006;
const RESTED_S: f32 = 20.0;

/// A voltage that was not steady for this many seconds, for more than this share of the last minute, is that of a load,
/// though the load is off.
const STEADY_S: f32 = 5.0;
const MAX_UNREST: f32 = 0.2;
const UNREST_TIME_CONSTANT_S: f32 = 60.0;

/// Limits of the sag relative to that of a typical warm cell.
const MIN_SCALE: f32 = 1.0;
const MAX_SCALE: f32 = 4.0;

/// A smaller sag is noise, in volts.
const MIN_SAG_V: f32 = 0.005;

/// Limit of the sag that is attributed to a load, in volts.
const MAX_SAG_V: f32 = 0.8;

/// A voltage above the expected one corrects the estimate this many times faster than one below: a load can only lower
/// the voltage.
const RISE_SPEEDUP: f32 = 3.0;

/// Uncertainty of the sag, relative to it.
const SAG_SIGMA: f32 = 0.2;

const NO_LOAD: MeanThenLowPass = MeanThenLowPass::new(RATE_TIME_CONSTANT_S);

/// An estimate that infers the load from the sag below its own resting voltage.
///
/// One that is too high sees too large a sag, and falls faster: it converges. How large the sag is for a load depends on
/// the cells and their temperature; it is inferred from how much the changes of the load vary the voltage.
#[derive(Clone, Copy, Debug)]
pub struct VoltageOnly {
    soc: f32,
    sigma: f32,
    sag_v: f32,
    /// Sag relative to that of a typical cell.
    scale: f32,
    mean_v: MeanThenLowPass,
    variance: MeanThenLowPass,
    /// Charge drawn since the load began, in capacities per hour.
    rate_per_h: MeanThenLowPass,
    rest: Rest,
    /// Time until a pack that was found under load is estimated, in seconds.
    unsettled_s: f32,
    highest_v: f32,
}

/// Whether the pack rests.
#[derive(Clone, Copy, Debug)]
struct Rest {
    mean_v: MeanThenLowPass,
    steady_s: f32,
    /// Share of the time in which the voltage was not steady with the load off.
    unrest: f32,
}

impl Rest {
    const NEW: Self = Self {
        mean_v: MeanThenLowPass::new(RESTED_S),
        steady_s: 0.0,
        unrest: 0.0,
    };

    /// Takes the mean voltage of a cell over `dt_s` seconds. Returns whether it is that of a rest.
    fn update(&mut self, dt_s: f32, cell_v: f32, load_state: LoadState) -> bool {
        if load_state == LoadState::On {
            *self = Self::NEW;
            return false;
        }
        let is_near = |mean_v: f32| (cell_v - mean_v).abs() < RESTING_CHANGE_V;
        if self.mean_v.value().is_some_and(is_near) {
            self.steady_s += dt_s;
        } else {
            self.steady_s = 0.0;
            self.mean_v = MeanThenLowPass::new(RESTED_S);
        }
        self.mean_v.update(dt_s, cell_v);
        let unrest = if self.steady_s < STEADY_S { 1.0 } else { 0.0 };
        self.unrest += (unrest - self.unrest) * (dt_s / UNREST_TIME_CONSTANT_S).min(1.0);
        self.steady_s >= RESTED_S && self.unrest < MAX_UNREST
    }
}

impl VoltageOnly {
    /// From the first voltage of a cell.
    pub fn from_voltage(cell_v: f32, load_state: LoadState, model: &CellModel) -> Self {
        let kept = model.last_charge(cell_v).map(|last| last.soc);
        let mut estimate = Self::from_soc(kept.unwrap_or_else(|| model.soc(cell_v)), 0.0);
        if load_state == LoadState::On {
            estimate.unsettled_s = SETTLING_S;
        }
        estimate.assess(model);
        estimate
    }

    /// From a state of charge that is known to this standard deviation.
    pub const fn from_soc(soc: f32, sigma: f32) -> Self {
        Self {
            soc,
            sigma,
            sag_v: 0.0,
            scale: MIN_SCALE,
            mean_v: MeanThenLowPass::new(MEAN_TIME_CONSTANT_S),
            variance: MeanThenLowPass::new(MEAN_TIME_CONSTANT_S),
            rate_per_h: NO_LOAD,
            rest: Rest::NEW,
            unsettled_s: 0.0,
            highest_v: 0.0,
        }
    }

    /// The charge; `None` while the pack was found under load a short time ago.
    pub fn charge(&self) -> Option<KnownCharge> {
        self.is_known().then_some(KnownCharge {
            soc: self.soc,
            sigma: self.sigma,
        })
    }

    /// Whether the voltages since the start have shown the charge.
    pub fn is_settled(&self) -> bool {
        self.unsettled_s <= 0.0
    }

    fn is_known(&self) -> bool {
        self.unsettled_s <= SETTLING_S - FIRST_ESTIMATE_S
    }

    /// Charge drawn, in capacities per hour, averaged over two minutes, once there was a load for as long.
    pub fn rate_per_h(&self) -> Option<f32> {
        self.rate_per_h.settled()
    }

    /// Brings the standard deviation up to date.
    fn assess(&mut self, model: &CellModel) {
        let slope_v = model.slope_v(self.soc);
        let curve_v = model.curve_sigma_v(self.soc, slope_v);
        let sag_v = SAG_SIGMA * self.sag_by_variation_v(model);
        self.sigma = root_of_squares(curve_v, sag_v) / slope_v;
    }

    /// The load, in capacities per hour.
    fn load_per_h(&self, model: &CellModel) -> f32 {
        self.sag_v / (model.cell.lasting_drop_v() * self.scale)
    }

    /// Takes a second. Returns whether the pack rests.
    pub fn infer(
        &mut self,
        dt_s: f32,
        cell_v: f32,
        load_state: LoadState,
        trace: &mut Trace,
        model: &CellModel,
    ) -> bool {
        let rests = self.update(dt_s, cell_v, trace.polarisation.current_a(), load_state, model);
        trace.polarisation.update(dt_s, self.load_per_h(model));
        trace.reserve.add(cell_v, self.soc, model);
        if let Some(block) = trace.block.add(&Load::none_for(dt_s), Some(cell_v)) {
            if let Some(cell_v) = block.cell_v {
                let growth = SagGrowth::Inferred;
                trace
                    .reserve
                    .update(block.load.duration_s, cell_v, self.soc, growth, model);
            }
            self.assess(model);
            trace.reserve.compute(SagGrowth::Inferred, None, model);
        }
        rests
    }

    /// Takes the mean voltage of a cell over `dt_s` seconds. Returns whether the pack rests.
    ///
    /// `slow_per_h` is what is left of earlier loads, in capacities per hour
    /// ([`Polarisation::current_a`](super::load::Polarisation::current_a)).
    fn update(
        &mut self,
        dt_s: f32,
        cell_v: f32,
        slow_per_h: f32,
        load_state: LoadState,
        model: &CellModel,
    ) -> bool {
        if self.rest.update(dt_s, cell_v, load_state) {
            let slow_v = model.slow_share() * model.cell.ohmic_drop_v * self.scale * slow_per_h;
            self.rest(dt_s, cell_v, slow_v, model);
            return true;
        }
        let sag_v = model.voltage_v(self.soc) - cell_v;
        self.adapt_scale(dt_s, cell_v, sag_v, model);
        self.correct_start(dt_s, cell_v, model);
        self.sag_v = sag_v.clamp(-MAX_SAG_V, MAX_SAG_V);
        let speedup = if sag_v < 0.0 { RISE_SPEEDUP } else { 1.0 };
        let rate_per_h = speedup * self.load_per_h(model);
        self.average_rate(dt_s, rate_per_h, model);
        self.soc = (self.soc - rate_per_h * dt_s * HOURS_PER_SECOND).clamp(0.0, 1.0);
        false
    }

    /// The load begins with a sag that is more than noise, and is over when its average is less.
    fn average_rate(&mut self, dt_s: f32, rate_per_h: f32, model: &CellModel) {
        let noise_per_h = MIN_SAG_V / (model.cell.lasting_drop_v() * self.scale);
        if self.rate_per_h.value().is_none() && rate_per_h < noise_per_h {
            return;
        }
        self.rate_per_h.update(dt_s, rate_per_h);
        if self
            .rate_per_h
            .settled()
            .is_some_and(|rate_per_h| rate_per_h < noise_per_h)
        {
            self.rate_per_h = NO_LOAD;
        }
    }

    /// A pack at rest is as its voltage says, unless that is still as it was kept.
    fn rest(&mut self, dt_s: f32, cell_v: f32, slow_v: f32, model: &CellModel) {
        let kept = model.last_charge(cell_v).map(|last| last.soc);
        let target = kept.unwrap_or_else(|| model.soc(cell_v + slow_v));
        self.soc += (target - self.soc) * (dt_s / REST_TIME_CONSTANT_S).min(1.0);
        self.unsettled_s = 0.0;
        self.sag_v = 0.0;
        self.rate_per_h = NO_LOAD;
    }

    /// A pack that was found under load is at least as full as its highest voltage, and its sag, say.
    fn correct_start(&mut self, dt_s: f32, cell_v: f32, model: &CellModel) {
        if self.unsettled_s <= 0.0 {
            return;
        }
        let was_known = self.is_known();
        self.unsettled_s -= dt_s;
        self.highest_v = self.highest_v.max(cell_v);
        let is_known_now = !was_known && self.is_known();
        if is_known_now || self.unsettled_s <= 0.0 {
            let mean_v = self.mean_v.value().unwrap_or(cell_v);
            let resting_v = (mean_v + self.sag_by_variation_v(model)).max(self.highest_v);
            self.soc = self.soc.max(model.soc(resting_v));
        }
    }

    fn adapt_scale(&mut self, dt_s: f32, cell_v: f32, sag_v: f32, model: &CellModel) {
        self.mean_v.update(dt_s, cell_v);
        let from_mean_v = cell_v - self.mean_v.value().unwrap_or(cell_v);
        self.variance.update(dt_s, from_mean_v * from_mean_v);
        let by_variation_v = self.sag_by_variation_v(model);
        let sag_v = sag_v.max(MIN_SAG_V);
        let change = (by_variation_v - sag_v) / by_variation_v.max(sag_v);
        let scale = self.scale * (1.0 + change * (dt_s / SCALE_TIME_CONSTANT_S).min(1.0));
        self.scale = scale.clamp(MIN_SCALE, MAX_SCALE);
    }

    fn sag_by_variation_v(&self, model: &CellModel) -> f32 {
        model.cell.sag_by_variation * libm::sqrtf(self.variance.value().unwrap_or(0.0))
    }
}
