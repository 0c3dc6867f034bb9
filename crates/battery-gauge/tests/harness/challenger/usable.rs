//! Charge that the load can still draw, and the time until then.

use std::collections::VecDeque;

use super::block::{Block, Second};
use super::cell::{Cell, Load, grown};
use super::states::{CAPACITY, Gaussian};

/// Bins of the loads of the last hour: logarithmic, from the least load, in capacities per hour, over this range.
const BINS: usize = 48;
const LEAST_PER_H: f64 = 0.03;
const SPAN: f64 = 600.0;
/// A smaller load does not count, in capacities per hour.
const COUNTED_PER_H: f64 = 0.02;
const FORGETTING_S: f64 = 3600.0;
/// Share of the last hour above the load that ends the drive: chosen on recordings.
const LARGEST_SHARE: f64 = 0.004;

/// Usable rises by no more in ten seconds: chosen on recordings.
const RECOVERY: f64 = 0.0005;

/// Lower limit of what is used between full and the end, relative to the capacity.
const LEAST_SPAN: f64 = 0.02;

/// The mean load that gives the time left: over this time, in seconds, and at least, in capacities per hour.
const MEAN_S: f64 = 1200.0;
const LEAST_MEAN_PER_H: f64 = 0.005;

/// A load from here on takes the voltage below critical, in capacities per hour.
const COLLAPSING_PER_H: f64 = 0.1;
/// The voltage is critical by the mean over this time, less what the sampling interval may vary, in seconds.
const END_S: f64 = 9.99;
/// Highest charge that such an end is kept at.
const HIGHEST_END: f64 = 0.7;

/// A load that took the cell to its end.
#[derive(Clone, Copy, Debug)]
pub struct Collapse {
    pub charge: f64,
    pub ohm: f64,
    pub load_a: f64,
}

impl Collapse {
    /// What is kept of one over a drive.
    pub fn kept(self) -> Self {
        Self {
            charge: self.charge.min(HIGHEST_END),
            ..self
        }
    }

    /// The charge at which it comes with this resistance and load, if they are lower.
    fn charge_at(&self, ohm: f64, load_a: f64) -> f64 {
        self.charge * (ohm / self.ohm).min(1.0) * (load_a / self.load_a).min(1.0)
    }
}

/// An estimate after a block.
#[derive(Clone, Copy, Debug)]
pub struct Usable {
    /// From 0 to 1.
    pub usable: f64,
    pub sigma: f64,
    /// The charge at which the load ends the drive.
    pub end: f64,
    pub mean_a: Option<f64>,
}

/// Loads of a drive.
#[derive(Clone, Debug)]
pub struct Loads {
    histogram: [f64; BINS],
    /// The largest sag of a block lately, as it would be above where it grows, in volts.
    peak_v: f64,
    recent: VecDeque<Second>,
    shown: Option<f64>,
    mean_a: f64,
    mean_s: f64,
    /// Where the voltage first fell below critical in this drive.
    pub collapse: Option<Collapse>,
    /// Likewise in an earlier one.
    before: Option<Collapse>,
    /// Whether the load has ended the drive: nothing is usable from then on.
    pub has_ended: bool,
    /// The least charge that was estimated.
    pub least: f64,
}

impl Loads {
    pub fn new(before: Option<Collapse>) -> Self {
        Self {
            histogram: [0.0; BINS],
            peak_v: 0.0,
            recent: VecDeque::new(),
            shown: None,
            mean_a: 0.0,
            mean_s: 0.0,
            collapse: None,
            before,
            has_ended: false,
            least: 1.0,
        }
    }

    /// Takes a block, with the likeliest states, the charge of all hypotheses and the slow mean of the load.
    pub fn update(
        &mut self,
        block: &Block,
        states: &Gaussian,
        charge: f64,
        slow_a: f64,
        cell: &Cell,
    ) -> Usable {
        let peak_a = self.largest_a(block, cell);
        let by_peak = self.end_by_sag(block, states, charge, cell);
        let (mut end, gradient) = if peak_a > 0.0 {
            let load = Load {
                now_a: peak_a,
                fast_a: slow_a,
                slow_a,
            };
            let (end, gradient) = cell.ending_charge(states, &load);
            (0.5 * (end + by_peak), gradient)
        } else {
            let mut charge_alone = [0.0; _];
            charge_alone[super::states::CHARGE] = 1.0;
            (0.0, charge_alone)
        };
        let ohm = cell.ohm(&states.mean);
        if let Some(before) = self.before.filter(|before| peak_a > 0.0 && before.charge > 0.0) {
            let is_near = charge >= before.charge - 0.02 || block.voltage_v <= cell.critical_v + 0.1;
            if is_near {
                end = end.max(before.charge_at(ohm, peak_a));
            }
        }
        self.note_collapse(block, charge, ohm, peak_a, cell);
        let span = (1.0 - end).max(LEAST_SPAN);
        let usable = ((charge - end) / span).clamp(0.0, 1.0);
        let most = self
            .shown
            .map_or(1.0, |shown| shown + RECOVERY * block.duration_s / 10.0);
        let usable = if self.has_ended { 0.0 } else { usable.min(most) };
        self.shown = Some(usable);
        self.mean_s += block.duration_s;
        self.mean_a +=
            (block.current_a - self.mean_a) * (block.duration_s / MEAN_S.min(self.mean_s)).min(1.0);
        self.least = self.least.min(charge.max(0.0));
        let with_end = states.covariance.times(&gradient);
        let variance: f64 = with_end
            .iter()
            .zip(gradient)
            .map(|(part, factor)| part * factor)
            .sum();
        Usable {
            usable,
            sigma: variance.max(0.0).sqrt() / span,
            end,
            mean_a: Some(self.mean_a).filter(|mean_a| *mean_a > LEAST_MEAN_PER_H * cell.label_ah),
        }
    }

    /// The charge at which the largest sag of a block lately ends the drive.
    fn end_by_sag(&mut self, block: &Block, states: &Gaussian, charge: f64, cell: &Cell) -> f64 {
        if block.current_a > COUNTED_PER_H * cell.label_ah {
            let sag_v = cell.resting_v(charge, &states.mean) - block.voltage_v;
            let kept = 1.0 - (block.duration_s / FORGETTING_S).min(1.0);
            self.peak_v = (self.peak_v * kept).max(sag_v / grown(charge, &states.mean));
        }
        cell.charge_under(self.peak_v, &states.mean)
    }

    /// Takes a second: the load has ended the drive once the mean of ten seconds is critical.
    pub fn see_end(&mut self, second: Second, cell: &Cell) {
        self.recent.push_back(second);
        let duration_s: f64 = self.recent.iter().map(|one| one.duration_s).sum();
        if duration_s < END_S {
            return;
        }
        let mean = |what: fn(&Second) -> f64| {
            let sum: f64 = self.recent.iter().map(|one| one.duration_s * what(one)).sum();
            sum / duration_s
        };
        let is_loaded = mean(|one| one.current_a) > COLLAPSING_PER_H * cell.label_ah;
        self.has_ended |= is_loaded && mean(|one| one.voltage_v) < cell.critical_v;
        self.recent.pop_front();
    }

    fn note_collapse(&mut self, block: &Block, charge: f64, ohm: f64, load_a: f64, cell: &Cell) {
        let is_below =
            block.voltage_v < cell.critical_v && block.current_a > COLLAPSING_PER_H * cell.label_ah;
        if !is_below {
            return;
        }
        match &mut self.collapse {
            None => self.collapse = Some(Collapse { charge, ohm, load_a }),
            Some(collapse) if charge < collapse.charge => {
                collapse.ohm = ohm;
                collapse.load_a = load_a;
            }
            Some(_) => {}
        }
    }

    /// The largest load of about the last hour, without a few peaks above it, in amperes; 0 without any.
    fn largest_a(&mut self, block: &Block, cell: &Cell) -> f64 {
        let load_per_h = block.current_a / cell.label_ah;
        let bins = BINS as f64;
        if load_per_h > COUNTED_PER_H {
            let kept = 1.0 - (block.duration_s / FORGETTING_S).min(1.0);
            self.histogram.iter_mut().for_each(|count| *count *= kept);
            let bin = ((load_per_h / LEAST_PER_H).ln() / SPAN.ln() * bins).max(0.0) as usize;
            self.histogram[bin.min(BINS - 1)] += block.duration_s / 10.0;
        }
        let total: f64 = self.histogram.iter().sum();
        if total == 0.0 {
            return 0.0;
        }
        let mut above = 0.0;
        let mut bin = BINS;
        while bin > 0 && above < LARGEST_SHARE * total {
            bin -= 1;
            above += self.histogram[bin];
        }
        LEAST_PER_H * ((bin as f64 + 0.5) / bins * SPAN.ln()).exp() * cell.label_ah
    }
}

/// Time until a charge is used, in seconds.
pub fn time_left_s(available: f64, states: &Gaussian, mean_a: f64, label_ah: f64) -> f64 {
    available.max(0.0) * label_ah * states.mean[CAPACITY].exp() / mean_a * 3600.0
}
