//! Means over a second: all that follows runs once a second, at any sampling rate.

/// Duration of a second, less what the sampling interval may vary, in seconds.
const DURATION_S: f32 = 0.999;

/// The very first one is shorter, in seconds: there is an estimate soon after the start.
const FIRST_S: f32 = 0.249;

/// Sums up to a second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gathering {
    complete_s: f32,
    duration_s: f32,
    voltage: MeasuredSum,
    current: MeasuredSum,
    unmeasured_ah: f32,
}

/// A sum over most of a second.
#[derive(Clone, Copy, Debug)]
struct MeasuredSum {
    value_s: f32,
    missing_s: f32,
}

/// A weighted sum of what was measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sum {
    value_s: f32,
    duration_s: f32,
}

/// Means over a second, or over the sampling interval if that is longer. `None` is not measured.
#[derive(Clone, Copy, Debug)]
pub(in crate::battery) struct Second {
    /// In seconds.
    pub duration_s: f32,
    /// Of the whole pack, in volts.
    pub voltage_v: Option<f32>,
    /// In amperes.
    pub current_a: Option<f32>,
    /// Charge that the source has counted beyond this current, in ampere-hours.
    pub unmeasured_ah: f32,
}

impl Sum {
    /// Nothing yet.
    pub const NEW: Self = Self {
        value_s: 0.0,
        duration_s: 0.0,
    };

    pub fn add(&mut self, dt_s: f32, value: f32) {
        self.value_s += value * dt_s;
        self.duration_s += dt_s;
    }

    /// The integral, in units of the value times seconds.
    pub fn integral(&self) -> f32 {
        self.value_s
    }

    /// The mean, if at least half of `duration_s` is covered.
    pub fn mean(&self, duration_s: f32) -> Option<f32> {
        let is_covered = self.duration_s > 0.0 && self.duration_s >= 0.5 * duration_s;
        is_covered.then(|| self.value_s / self.duration_s)
    }
}

impl MeasuredSum {
    const NEW: Self = Self {
        value_s: 0.0,
        missing_s: 0.0,
    };

    fn add(&mut self, dt_s: f32, value: Option<f32>) {
        match value {
            Some(value) => self.value_s += value * dt_s,
            None => self.missing_s += dt_s,
        }
    }

    /// The mean, if at least half of `duration_s` was measured.
    fn mean(&self, duration_s: f32) -> Option<f32> {
        let measured_s = duration_s - self.missing_s;
        (measured_s > 0.0 && measured_s >= 0.5 * duration_s).then(|| self.value_s / measured_s)
    }
}

impl Gathering {
    /// Nothing yet.
    pub const NEW: Self = Self::complete_at(FIRST_S);

    /// Delays the end of the first one.
    pub fn delay(&mut self, delay_s: f32) {
        self.complete_s += delay_s;
    }

    const fn complete_at(complete_s: f32) -> Self {
        Self {
            complete_s,
            duration_s: 0.0,
            voltage: MeasuredSum::NEW,
            current: MeasuredSum::NEW,
            unmeasured_ah: 0.0,
        }
    }

    /// Takes a charge that the source has counted beyond the current.
    pub fn add_unmeasured(&mut self, charge_ah: f32) {
        self.unmeasured_ah += charge_ah;
    }

    /// Takes a reading; returns the means once a second is complete.
    pub fn add(&mut self, dt_s: f32, voltage_v: Option<f32>, current_a: Option<f32>) -> Option<Second> {
        self.duration_s += dt_s;
        self.voltage.add(dt_s, voltage_v);
        self.current.add(dt_s, current_a);
        if self.duration_s < self.complete_s {
            return None;
        }
        let complete = core::mem::replace(self, Self::complete_at(DURATION_S));
        Some(Second {
            duration_s: complete.duration_s,
            voltage_v: complete.voltage.mean(complete.duration_s),
            current_a: complete.current.mean(complete.duration_s),
            unmeasured_ah: complete.unmeasured_ah,
        })
    }
}
