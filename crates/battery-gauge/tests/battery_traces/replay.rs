//! Replays samples through the monitor.

use std::path::Path;

use battery_gauge::{BatteryMonitor, BatteryState, PackEvent, PackSettings};

pub use super::sample::{Sample, drawn_mah, reading, root_mean_square, rows, tick, without_current};

/// The state after a sample.
#[derive(Clone, Debug)]
pub struct Moment {
    pub t_s: f64,
    pub state: BatteryState,
    pub events: Vec<PackEvent>,
}

impl Moment {
    pub fn remaining_pct(&self) -> Option<f64> {
        self.state.readings.remaining_pct.map(f64::from)
    }
}

/// The folder of the whole repository.
pub fn repository() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).expect("it is crates/battery-gauge")
}

/// A trace of `tests/data/traces/`.
pub fn trace(name: &str) -> Vec<Sample> {
    let folder = repository().join("tests/data/traces");
    let text = std::fs::read_to_string(folder.join(name)).expect("the trace");
    let sample = |[t_s, voltage_v, current_a, healthy, armed]: [f64; 5]| Sample {
        healthy: healthy == 1.0,
        ..Sample::measured(t_s, voltage_v, current_a, armed == 1.0)
    };
    rows(&text).map(sample).collect()
}

/// A 3S pack.
pub fn cells_set() -> PackSettings {
    PackSettings {
        cell_count: Some(3),
        ..PackSettings::default()
    }
}

/// The 3S pack of the traces.
pub fn cells_and_capacity_set() -> PackSettings {
    PackSettings {
        capacity_mah: Some(2200.0),
        ..cells_set()
    }
}

/// Replays samples through a new monitor.
pub fn run(samples: &[Sample], settings: &PackSettings) -> Vec<Moment> {
    run_from(BatteryMonitor::new(), samples, settings)
}

/// Replays samples through `monitor`.
pub fn run_from(mut monitor: BatteryMonitor, samples: &[Sample], settings: &PackSettings) -> Vec<Moment> {
    let mut battery = BatteryState::default();
    samples
        .iter()
        .map(|sample| {
            let update = monitor.update(&mut battery, tick(sample), reading(sample), settings);
            Moment {
                t_s: sample.t_s,
                state: battery,
                events: update.events.to_vec(),
            }
        })
        .collect()
}
