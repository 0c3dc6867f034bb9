//! Load of a pack whose current is not measured.

use super::block::Second;
use super::kinds::{Kind, RESISTANCE_MEAN};

/// Time constant of the mean below which a dip is seen, in seconds, and fall of the envelope above dips, in volts a second: chosen
/// on recordings.
const MEAN_S: f64 = 5.0;
const FALL_V_PER_S: f64 = 0.0003;
/// A dip over the immediate drop of its load: it has slow parts, too. Chosen on recordings.
const DIP_SHARE: f64 = 2.0;

/// Infers the load from how far the voltage is below its envelope.
#[derive(Clone, Copy, Debug)]
pub struct InferredLoad {
    mean_v: f64,
    envelope_v: f64,
}

impl InferredLoad {
    pub fn new(voltage_v: f64) -> Self {
        Self {
            mean_v: voltage_v,
            envelope_v: voltage_v,
        }
    }

    /// Takes a second; returns the load in capacities per hour.
    pub fn update(&mut self, second: &Second, kind: &Kind) -> f64 {
        let dt_s = second.duration_s;
        self.mean_v += (second.voltage_v - self.mean_v) * (dt_s / MEAN_S).min(1.0);
        self.envelope_v = self.mean_v.max(self.envelope_v - FALL_V_PER_S * dt_s);
        let drop_v = f64::from(kind.cell().ohmic_drop_v) * RESISTANCE_MEAN.exp() * DIP_SHARE;
        (self.envelope_v - second.voltage_v).max(0.0) / drop_v
    }
}
