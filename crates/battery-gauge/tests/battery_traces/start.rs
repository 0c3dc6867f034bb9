//! A pack is switched on under load: simulated cells whose sag develops as that of an 18650 does.

use battery_gauge::{BatteryMonitor, BatteryState, PackSettings};
use proptest::prelude::*;

use super::percentages::{CELLS, Cells};
use super::replay::{Sample, reading, tick};

const CAPACITY_AH: f64 = 2.9;
const RATE_HZ: u32 = 10;
const LI_ION: &Cells = &CELLS[2];

/// Time constants of the sag, in seconds, and what it develops with each, relative to the resistance within a second.
const FAST_PARTS: [(f64, f64); 1] = [(0.2, 0.6)];
const SLOW_PARTS: [(f64, f64); 3] = [(10.0, 0.25), (100.0, 0.25), (1000.0, 0.5)];

/// A cell under load.
struct Cell {
    resting_v: f64,
    ohm: f64,
    /// Sag that has developed: time constant, share of the resistance, current.
    parts: Vec<(f64, f64, f64)>,
}

impl Cell {
    /// Of a chemistry, with a resistance relative to that of a typical warm one: up to five when cold.
    fn new(cells: &Cells, resting_v: f64, relative_resistance: f64) -> Self {
        let slow = SLOW_PARTS.map(|(time_s, share)| (time_s, cells.slow_share * share));
        let parts = FAST_PARTS.into_iter().chain(slow);
        Self {
            resting_v,
            ohm: relative_resistance * cells.drop_v / CAPACITY_AH,
            parts: parts.map(|(time_s, share)| (time_s, share, 0.0)).collect(),
        }
    }

    fn draw(&mut self, current_a: f64, dt_s: f64) {
        for (time_s, _, drawn_a) in &mut self.parts {
            *drawn_a += (current_a - *drawn_a) * (1.0 - (-dt_s / *time_s).exp());
        }
    }

    fn voltage_v(&self, current_a: f64) -> f64 {
        let [(_, developed)] = FAST_PARTS;
        let developed_a: f64 = self.parts.iter().map(|(_, share, drawn_a)| share * drawn_a).sum();
        self.resting_v - self.ohm * ((1.0 - developed) * current_a + developed_a)
    }
}

/// A load that varies, in amperes.
fn load_a(peak_a: f64, t_s: f64) -> f64 {
    if t_s % 8.0 < 5.0 { peak_a } else { 0.4 * peak_a }
}

/// What the monitor reports in two minutes, after a time under load that it did not see: the charge and its deviation.
fn reported(cells: &Cells, mut cell: Cell, peak_a: f64, unseen_s: f64, charging: bool) -> Vec<(f32, f32)> {
    let settings = PackSettings {
        chemistry: cells.chemistry,
        cell_count: Some(1),
        capacity_mah: Some((CAPACITY_AH * 1e3) as f32),
        ..PackSettings::default()
    };
    let dt_s = 1.0 / f64::from(RATE_HZ);
    let sign = if charging { -1.0 } else { 1.0 };
    let unseen = (unseen_s / dt_s) as u32;
    let (mut monitor, mut battery) = (BatteryMonitor::new(), BatteryState::default());
    let mut reported = Vec::new();
    for step in 0..unseen + 120 * RATE_HZ {
        let t_s = f64::from(step) * dt_s;
        let current_a = sign * load_a(peak_a, t_s);
        if step >= unseen {
            let sample = Sample::measured(t_s, cell.voltage_v(current_a), current_a, true);
            let _ = monitor.update(&mut battery, tick(&sample), reading(&sample), &settings);
            let readings = &battery.readings;
            reported.extend(readings.remaining_pct.zip(readings.remaining_sigma_pct));
        }
        cell.draw(current_a, dt_s);
    }
    reported
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Warm or cold, with any load, from its beginning or after a restart in it.
    #[test]
    fn a_half_empty_pack_under_load_never_reads_full(
        cells in prop::sample::select(&CELLS),
        relative_resistance in 0.5..6.0_f64,
        peak_per_h in 0.2..10.0_f64,
        unseen_s in prop_oneof![Just(0.0), 0.0..1200.0],
        charging in any::<bool>(),
    ) {
        // Packs are charged with up to a capacity an hour, and not in the cold.
        let (relative_resistance, peak_per_h) = if charging {
            (relative_resistance.min(2.0), 0.1 * peak_per_h)
        } else {
            (relative_resistance, peak_per_h)
        };
        let cell = Cell::new(&cells, cells.curve[5], relative_resistance);
        for (remaining_pct, sigma_pct) in reported(&cells, cell, peak_per_h * CAPACITY_AH, unseen_s, charging) {
            prop_assert!(remaining_pct < 95.0 || sigma_pct > 15.0, "{remaining_pct} ± {sigma_pct} %");
        }
    }

    /// Without its resistance at −20 °C it would be 10 to 16 % low.
    #[test]
    fn a_full_pack_found_under_load_is_full(relative_resistance in 1.0..4.0, peak_a in 1.7..2.8) {
        let cell = Cell::new(LI_ION, LI_ION.curve[10], relative_resistance);
        let reported = reported(LI_ION, cell, peak_a, 0.0, false);
        let (remaining_pct, sigma_pct) = *reported.last().expect("an estimate");
        // Two minutes draw up to 3 %.
        prop_assert!(remaining_pct > 96.0 && sigma_pct < 2.0, "{remaining_pct} ± {sigma_pct} %");
    }
}
