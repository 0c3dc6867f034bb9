//! Drives with the true charge at each reading.

use battery_gauge::{ChargeLimits, Chemistry, FailsafeSettings, PackSettings, Thresholds};

use crate::sample::{Sample, drawn_mah};

/// Origin of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    Recorded,
    Simulated,
}

/// Where a drive of a cell ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// When the mean of ten seconds is below the critical voltage.
    Critical,
    /// With its last load: the test stopped there.
    LastLoad,
}

/// A make of cells, as its owner would set it.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    pub origin: Origin,
    /// Begin of the names of its recordings.
    pub name: &'static str,
    pub chemistry: Chemistry,
    /// In ampere-hours, where it is known.
    pub label_ah: Option<f64>,
    pub critical_v: f32,
    pub end: End,
    /// Whether its drives, in the order of their numbers, are the life of one cell.
    pub is_life: bool,
}

impl Cell {
    /// Settings with this capacity.
    pub fn settings(&self, capacity_ah: f64) -> PackSettings {
        PackSettings {
            chemistry: self.chemistry,
            cell_count: Some(1),
            capacity_mah: Some(1000.0 * capacity_ah as f32),
            charge_limits: ChargeLimits {
                low_pct: Some(15.0),
                critical_pct: Some(7.0),
                emergency_pct: Some(5.0),
            },
            failsafe: FailsafeSettings {
                timer_s: Some(10.0),
                critical: Thresholds {
                    voltage_v: Some(self.critical_v),
                    ..Thresholds::default()
                },
                ..FailsafeSettings::default()
            },
            ..PackSettings::default()
        }
    }
}

/// A drive from full.
#[derive(Clone, Debug)]
pub struct Drive {
    pub cell: Cell,
    /// Drives with the same cell and conditions, whose figures are averaged.
    pub group: String,
    /// Number in the life of its cell.
    pub number: usize,
    pub temperature_c: i32,
    pub samples: Vec<Sample>,
    /// At each sample, in percent; NaN where it is unknown.
    pub truth_pct: Vec<f64>,
    /// Charge drawn until each sample.
    pub drawn_ah: Vec<f64>,
    pub capacity_ah: f64,
    /// The last sample with a load.
    pub last_load: usize,
    /// The sample at which the cell can't serve its load any more.
    pub empty: usize,
    /// Whether its voltage shows that.
    pub has_collapsed: bool,
}

/// A charge that a test leaves in a cell, relative to its capacity: assumed where no truth says it.
const LEFT_AT_CUT_OFF: f64 = 0.05;

/// Time over which a voltage is averaged that ends a drive, in seconds.
const END_MEAN_S: f64 = 10.0;

impl Drive {
    /// `truth_pct` is `None` where the end of the load is the only truth.
    pub fn new(
        cell: Cell,
        group: String,
        number: usize,
        temperature_c: i32,
        samples: Vec<Sample>,
        truth_pct: Option<Vec<f64>>,
    ) -> Self {
        let drawn_ah: Vec<f64> = drawn_mah(&samples).iter().map(|mah| mah / 1000.0).collect();
        let current_a = |sample: &Sample| sample.current_a.expect("a current");
        let largest_a = samples.iter().map(current_a).fold(0.0, f32::max);
        let share = if cell.is_life { 0.25 } else { 0.05 };
        let last_load = samples
            .iter()
            .rposition(|sample| current_a(sample) > share * largest_a)
            .expect("a load");
        let total_ah = drawn_ah[last_load];
        let truth_pct = truth_pct.unwrap_or_else(|| {
            let truth = |drawn_ah: &f64| 100.0 * (1.0 - drawn_ah / total_ah * (1.0 - LEFT_AT_CUT_OFF));
            drawn_ah.iter().map(truth).collect()
        });
        let known = (0..=last_load)
            .rev()
            .find(|at| !truth_pct[*at].is_nan())
            .expect("a truth");
        let capacity_ah = 100.0 * drawn_ah[known] / (truth_pct[0] - truth_pct[known]);
        let collapse = match cell.end {
            End::Critical => first_below(&samples[..last_load], cell.critical_v),
            End::LastLoad => None,
        };
        Self {
            cell,
            group,
            number,
            temperature_c,
            samples,
            truth_pct,
            drawn_ah,
            capacity_ah,
            last_load,
            empty: collapse.unwrap_or(last_load),
            has_collapsed: collapse.is_some(),
        }
    }

    /// The label if it is right, else the tester's capacity, in ampere-hours.
    pub fn right_label_ah(&self) -> f64 {
        let is_right = |label_ah: &f64| (label_ah / self.capacity_ah - 1.0).abs() <= 0.05;
        self.cell.label_ah.filter(is_right).unwrap_or(self.capacity_ah)
    }

    /// The sample at which half of its charge is drawn.
    pub fn middle(&self) -> usize {
        let half_ah = 0.5 * self.drawn_ah[self.drawn_ah.len() - 1];
        self.drawn_ah
            .iter()
            .position(|ah| *ah >= half_ah)
            .expect("a middle")
    }

    /// The last sample that is judged: of the load, or the one at which the cell is empty.
    pub fn end(&self) -> usize {
        self.last_load.max(self.empty)
    }

    /// Charge that the load can still draw at a sample, in percent of all that it could.
    pub fn usable_pct(&self, at: usize) -> f64 {
        100.0 * (1.0 - self.drawn_ah[at] / self.drawn_ah[self.empty])
    }

    pub fn seconds(&self, at: usize) -> f64 {
        self.samples[at].t_s - self.samples[0].t_s
    }

    /// The first sample behind its first second.
    pub fn after_first_second(&self) -> usize {
        self.samples
            .partition_point(|sample| sample.t_s < self.samples[0].t_s + 1.0)
    }

    /// Whether it begins with a rest of a second.
    pub fn begins_at_rest(&self) -> bool {
        let mut first = self
            .samples
            .iter()
            .take_while(|sample| sample.t_s - self.samples[0].t_s <= 1.0);
        first.all(|sample| f64::from(sample.current_a.unwrap_or(0.0)).abs() < 0.03 * self.capacity_ah)
    }
}

/// The sample at which the mean of ten seconds is below a voltage for the first time, after ten minutes; a minute of a short drive.
fn first_below(samples: &[Sample], voltage_v: f32) -> Option<usize> {
    let start_s = samples[0].t_s;
    let duration_s = samples[samples.len() - 1].t_s - start_s;
    let from_s = start_s + if duration_s > 1500.0 { 600.0 } else { 60.0 };
    let (mut sum_v, mut first) = (0.0, 0);
    for (at, sample) in samples.iter().enumerate() {
        sum_v += f64::from(sample.voltage_v);
        while samples[first].t_s <= sample.t_s - END_MEAN_S {
            sum_v -= f64::from(samples[first].voltage_v);
            first += 1;
        }
        let mean_v = sum_v / (at - first + 1) as f64;
        if sample.t_s > from_s && mean_v < f64::from(voltage_v) {
            return Some(at);
        }
    }
    None
}
