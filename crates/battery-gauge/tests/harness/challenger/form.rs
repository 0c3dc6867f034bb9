//! Constants that differ with and without a current sensor; all were chosen on recordings.

/// A form of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// Deviation of the capacity's logarithm with a label that is right, and the weight of that hypothesis.
    pub right_label_sigma: f64,
    pub right_label_weight: f64,
    /// Of the resistance's logarithm, if it is not that of the chemistry.
    pub resistance_sigma: Option<f64>,
    /// Noise of a block's voltage while the charge moves, in volts: wiggles of the curve must not be matched.
    pub moving_noise_v: f64,
    /// Deviation of the sag's relative error.
    pub sag_sigma: f64,
    /// Deviation of the curve's fine error at the start, in volts, and its time constant, in seconds.
    pub fine_start_v: f64,
    pub fine_tau_s: f64,
    /// Noise of a reading's voltage beside a step of the load, in volts.
    pub step_noise_v: f64,
    /// Error of the current, in capacities per hour.
    pub offset_per_h: f64,
}

pub const MEASURED: Form = Form {
    right_label_sigma: 0.07,
    right_label_weight: 0.7,
    resistance_sigma: None,
    moving_noise_v: 0.05,
    sag_sigma: 0.1,
    fine_start_v: 0.015,
    fine_tau_s: 3000.0,
    step_noise_v: 0.003,
    offset_per_h: 0.0,
};

/// The load is inferred from the voltage. It measures no resistance, and the capacity has its error.
pub const INFERRED: Form = Form {
    right_label_sigma: 0.35,
    right_label_weight: 1.0,
    resistance_sigma: Some(0.4),
    moving_noise_v: 0.02,
    sag_sigma: 0.3,
    fine_start_v: 0.02,
    fine_tau_s: 1000.0,
    step_noise_v: f64::INFINITY,
    offset_per_h: 4.0,
};
