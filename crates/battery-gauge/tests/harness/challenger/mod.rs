//! A challenger of the crate's estimator.

mod block;
mod cell;
mod covariance;
mod form;
mod hypotheses;
mod inferred_load;
mod kept;
mod kinds;
mod power_cycle;
mod predict;
mod states;
mod update;
mod usable;

use battery_gauge::PackSettings;

use crate::estimator::{Estimator, Report};
use crate::sample::Sample;
use cell::Cell;
use kept::Kept;
use kinds::Kind;
use power_cycle::PowerCycle;

/// One Gaussian a pack over charge, capacity, resistance, sag and this cell's curve.
#[derive(Clone, Default)]
pub struct Challenger {
    settings: PackSettings,
    kept: Option<Kept>,
    cycle: Option<PowerCycle>,
    before_s: f64,
}

impl Challenger {
    /// What flash would hold if power went off now.
    fn kept(&self) -> Option<Kept> {
        let kept = self.kept.as_ref()?;
        let teacher = self.cycle.as_ref().filter(|cycle| cycle.teaches());
        Some(teacher.map_or_else(|| kept.clone(), |cycle| kept.after(cycle)))
    }

    fn cell(&self) -> Cell {
        let label_ah = f64::from(self.settings.capacity_mah.expect("a label")) / 1000.0;
        let critical_v = self.settings.failsafe.critical.voltage_v.map_or(0.0, f64::from);
        Cell::new(
            Kind::of(self.settings.chemistry),
            label_ah,
            critical_v / self.cells(),
        )
    }

    fn cells(&self) -> f64 {
        f64::from(self.settings.cell_count.unwrap_or(1))
    }
}

impl Estimator for Challenger {
    const NAME: &'static str = "challenger";

    fn start(&mut self, settings: &PackSettings) {
        let kept = self.kept();
        self.settings = *settings;
        self.cycle = None;
        let cell = self.cell();
        self.kept = Some(match kept {
            Some(kept) => kept.with(cell.kind, cell.label_ah),
            None => Kept::new(cell.kind, cell.label_ah),
        });
    }

    fn update(&mut self, sample: &Sample) -> Report {
        if !sample.healthy {
            return Report::default();
        }
        let voltage_v = f64::from(sample.voltage_v) / self.cells();
        let current_a = sample.current_a.map(f64::from);
        match &mut self.cycle {
            None => {
                let kept = self.kept.as_ref().expect("power is on");
                self.cycle = Some(PowerCycle::new(self.cell(), kept, voltage_v, current_a));
            }
            Some(cycle) => cycle.update(sample.t_s - self.before_s, voltage_v, current_a, sample.armed),
        }
        self.before_s = sample.t_s;
        let Some(estimate) = self.cycle.as_ref().and_then(PowerCycle::estimate) else {
            return Report::default();
        };
        let percent = |share: f64| Some((100.0 * share) as f32);
        Report {
            remaining_pct: percent(estimate.charge),
            sigma_pct: percent(estimate.sigma),
            usable_pct: percent(estimate.usable),
            usable_sigma_pct: percent(estimate.usable_sigma),
            time_left_s: estimate.time_left_s.map(|time_s| time_s as f32),
            has_fault: false,
        }
    }

    fn set_remaining(&mut self, remaining_pct: f32) {
        if let Some(cycle) = &mut self.cycle {
            cycle.set_charge(f64::from(remaining_pct) / 100.0, 0.02);
        }
    }

    fn capacity_ah(&self) -> Option<f64> {
        self.kept()?.capacity_ah()
    }
}
