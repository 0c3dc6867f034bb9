//! Readings summed up to seconds, and seconds to blocks of ten, by their times.

/// Duration of a second, less what the sampling interval may vary, in seconds.
const SECOND_S: f64 = 0.999;
/// Duration of a block, likewise, in seconds.
const BLOCK_S: f64 = 9.99;

/// Time constants of what follows a load, in seconds: an 18650's sag grows by them.
const LAGS_S: [f64; 3] = [10.0, 100.0, 1000.0];

/// Means over a second, or over the sampling interval if that is longer.
#[derive(Clone, Copy, Debug)]
pub struct Second {
    pub duration_s: f64,
    /// Of a cell, in volts.
    pub voltage_v: f64,
    /// Discharge is positive, in amperes.
    pub current_a: f64,
}

/// Sums up to a second.
#[derive(Clone, Copy, Debug, Default)]
pub struct SecondSum {
    duration_s: f64,
    volt_s: f64,
    ampere_s: f64,
}

impl SecondSum {
    /// Takes a reading and the time since the one before; returns the second, once it is complete.
    pub fn add(&mut self, dt_s: f64, voltage_v: f64, current_a: f64) -> Option<Second> {
        self.duration_s += dt_s;
        self.volt_s += dt_s * voltage_v;
        self.ampere_s += dt_s * current_a;
        if self.duration_s < SECOND_S {
            return None;
        }
        let complete = std::mem::take(self);
        Some(Second {
            duration_s: complete.duration_s,
            voltage_v: complete.volt_s / complete.duration_s,
            current_a: complete.ampere_s / complete.duration_s,
        })
    }

    /// Charge of the second that is not complete, in ampere-seconds.
    pub fn ampere_s(&self) -> f64 {
        self.ampere_s
    }
}

/// Low-passes of the current by [`LAGS_S`], in amperes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lags {
    age_s: f64,
    /// As if the load before had been the same.
    continued_a: [f64; 3],
    /// As if there had been none.
    rested_a: [f64; 3],
}

impl Lags {
    pub fn add(&mut self, second: &Second) {
        self.age_s += second.duration_s;
        for (lag, time_s) in LAGS_S.iter().enumerate() {
            let rate = (second.duration_s / time_s).min(1.0);
            let faster = rate.max(second.duration_s / self.age_s);
            self.continued_a[lag] += (second.current_a - self.continued_a[lag]) * faster;
            self.rested_a[lag] += (second.current_a - self.rested_a[lag]) * rate;
        }
    }

    /// Time since the first reading, in seconds.
    pub fn age_s(&self) -> f64 {
        self.age_s
    }

    /// Mean over a thousand seconds, in amperes.
    pub fn slow_a(&self) -> f64 {
        self.continued_a[2]
    }
}

/// Fast and slow means of a load, in amperes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lagged {
    pub fast_a: f64,
    pub slow_a: f64,
}

/// Means over a block.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block {
    pub duration_s: f64,
    pub voltage_v: f64,
    pub current_a: f64,
    pub continued: Lagged,
    pub rested: Lagged,
    /// Sums of the squared steps of the current from second to second, and of the steps times the voltage's, in A² and V·A.
    pub steps: f64,
    pub steps_v: f64,
}

impl Block {
    /// Takes a second; returns the block, once it is complete.
    pub fn add(&mut self, second: &Second, before: Option<&Second>, lags: &Lags) -> Option<Self> {
        let dt_s = second.duration_s;
        self.duration_s += dt_s;
        self.voltage_v += dt_s * second.voltage_v;
        self.current_a += dt_s * second.current_a;
        for (lagged, lags_a) in [
            (&mut self.continued, lags.continued_a),
            (&mut self.rested, lags.rested_a),
        ] {
            lagged.fast_a += dt_s * 0.5 * (lags_a[0] + lags_a[1]);
            lagged.slow_a += dt_s * lags_a[2];
        }
        if let Some(before) = before {
            let step_a = second.current_a - before.current_a;
            self.steps += step_a * step_a;
            self.steps_v -= step_a * (second.voltage_v - before.voltage_v);
        }
        if self.duration_s < BLOCK_S {
            return None;
        }
        Some(std::mem::take(self).divided())
    }

    fn divided(self) -> Self {
        let mean = |lagged: Lagged| Lagged {
            fast_a: lagged.fast_a / self.duration_s,
            slow_a: lagged.slow_a / self.duration_s,
        };
        Self {
            voltage_v: self.voltage_v / self.duration_s,
            current_a: self.current_a / self.duration_s,
            continued: mean(self.continued),
            rested: mean(self.rested),
            ..self
        }
    }

    /// Charge since the last block in ampere-seconds, of one that is not complete.
    pub fn ampere_s(&self) -> f64 {
        self.current_a
    }
}
