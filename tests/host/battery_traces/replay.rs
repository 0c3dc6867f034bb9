//! Replays samples through the monitor.

use rover_battmon::battery::{
    BatteryMonitor, BatteryState, Measurement, PackEvent, PackSettings, ReadError, Tick,
};
use rover_battmon::time::Instant;
use rover_battmon::vehicle::ArmState;
use support::repository;

/// One reading of a pack.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    pub t_s: f64,
    pub voltage_v: f32,
    pub current_a: Option<f32>,
    pub healthy: bool,
    pub armed: bool,
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

/// A trace of `tests/data/traces/`.
pub fn trace(name: &str) -> Vec<Sample> {
    let folder = repository().join("tests/data/traces");
    let text = std::fs::read_to_string(folder.join(name)).expect("the trace");
    text.lines().skip(1).map(sample).collect()
}

fn sample(line: &str) -> Sample {
    let fields: Vec<f64> = line
        .split(',')
        .map(|field| field.parse().expect("a number"))
        .collect();
    let &[t_s, voltage_v, current_a, healthy, armed] = fields.as_slice() else {
        panic!("five fields: {line}");
    };
    Sample {
        t_s,
        voltage_v: voltage_v as f32,
        current_a: Some(current_a as f32),
        healthy: healthy == 1.0,
        armed: armed == 1.0,
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

/// When a sample was taken.
pub fn tick(sample: &Sample) -> Tick {
    Tick {
        now: Instant::from_micros((sample.t_s * 1e6).round() as u64),
        arm_state: if sample.armed {
            ArmState::Armed
        } else {
            ArmState::Disarmed
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

/// Changes of the charge state after the first sample.
pub fn charge_state_changes(moments: &[Moment]) -> usize {
    moments
        .windows(2)
        .filter(|pair| pair[0].state.charge_state != pair[1].state.charge_state)
        .count()
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
