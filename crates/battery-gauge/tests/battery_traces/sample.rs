//! Readings of a pack, from a file or a simulation, as the gauge takes them.

use battery_gauge::{Instant, LoadState, Measurement, ReadError, Tick};

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

/// The numbers in each line below the header.
pub fn rows<const COLUMNS: usize>(text: &str) -> impl Iterator<Item = [f64; COLUMNS]> {
    let number = |field: &str| field.parse::<f64>().expect("a number");
    text.lines().skip(1).map(move |line| {
        let numbers: Vec<f64> = line.split(',').map(number).collect();
        *numbers.first_chunk().expect("a number in each column")
    })
}

/// These samples without a current sensor.
pub fn without_current(samples: &[Sample]) -> Vec<Sample> {
    samples
        .iter()
        .map(|sample| Sample {
            current_a: None,
            ..*sample
        })
        .collect()
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
