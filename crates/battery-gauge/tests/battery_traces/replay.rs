//! Replays samples through the monitor.

use std::path::Path;

use battery_gauge::{
    BatteryMonitor, BatteryState, Chemistry, Instant, LearntPack, LoadState, Measurement, PackEvent,
    PackSettings, ReadError, Tick,
};

/// One reading of a pack.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    pub t_s: f64,
    pub voltage_v: f32,
    pub current_a: Option<f32>,
    pub healthy: bool,
    pub armed: bool,
}

impl Sample {
    /// A measurement of a healthy sensor.
    pub fn measured(t_s: f64, voltage_v: f64, current_a: f64, armed: bool) -> Self {
        Self {
            t_s,
            voltage_v: voltage_v as f32,
            current_a: Some(current_a as f32),
            healthy: true,
            armed,
        }
    }
}

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

/// The numbers in each line below the header.
pub fn rows<const COLUMNS: usize>(text: &str) -> impl Iterator<Item = [f64; COLUMNS]> {
    let number = |field: &str| field.parse::<f64>().expect("a number");
    text.lines().skip(1).map(move |line| {
        let numbers: Vec<f64> = line.split(',').map(number).collect();
        *numbers.first_chunk().expect("a number in each column")
    })
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

/// One Li-ion cell with this label.
pub fn li_ion_cell(label_mah: f32) -> PackSettings {
    PackSettings {
        chemistry: Chemistry::LiIon,
        cell_count: Some(1),
        capacity_mah: Some(label_mah),
        ..PackSettings::default()
    }
}

/// The same samples without a current sensor.
pub fn without_current(samples: &[Sample]) -> Vec<Sample> {
    samples
        .iter()
        .map(|sample| Sample {
            current_a: None,
            ..*sample
        })
        .collect()
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

/// Replays samples through a monitor that knows this of the pack; returns what is known then. `see` sees the state after
/// each sample, and its number.
pub fn replay(
    samples: &[Sample],
    settings: &PackSettings,
    learnt: &LearntPack,
    mut see: impl FnMut(usize, &mut BatteryMonitor, &BatteryState),
) -> LearntPack {
    let (mut monitor, mut battery) = (BatteryMonitor::new(), BatteryState::default());
    monitor.restore_learnt(*learnt);
    for (number, sample) in samples.iter().enumerate() {
        let _ = monitor.update(&mut battery, tick(sample), reading(sample), settings);
        see(number, &mut monitor, &battery);
    }
    monitor.unsaved_learnt().copied().unwrap_or(*learnt)
}

/// When a sample was taken.
pub fn tick(sample: &Sample) -> Tick {
    Tick {
        now: Instant::from_micros((sample.t_s * 1e6).round() as u64),
        load_state: if sample.armed {
            LoadState::On
        } else {
            LoadState::Off
        },
    }
}

/// What the sensor delivered.
pub fn reading(sample: &Sample) -> Result<Measurement, ReadError> {
    if !sample.healthy {
        return Err(ReadError::Timeout);
    }
    Ok(Measurement {
        voltage_v: Some(sample.voltage_v),
        current_a: sample.current_a,
        ..Measurement::default()
    })
}

pub fn root_mean_square(errors: &[f64]) -> f64 {
    let sum: f64 = errors.iter().map(|error| error * error).sum();
    (sum / errors.len() as f64).sqrt()
}

/// Charge drawn up to each sample, in milliampere-hours; each current is integrated from the previous sample.
pub fn drawn_mah(samples: &[Sample]) -> Vec<f64> {
    let mut drawn_mah = 0.0;
    let mut before_s = samples[0].t_s;
    samples
        .iter()
        .map(|sample| {
            let current_a = f64::from(sample.current_a.expect("a current"));
            drawn_mah += current_a * (sample.t_s - before_s) / 3.6;
            before_s = sample.t_s;
            drawn_mah
        })
        .collect()
}
