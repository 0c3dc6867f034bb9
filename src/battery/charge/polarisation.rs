//! The slow part of the sag: what is left of earlier loads.

use crate::battery::low_pass::MeanThenLowPass;

/// Time constants, in seconds, and the share of each in the slow sag. Steps of the sag of an 18650 cell reach 1, 1.5, 1.9
/// and 3.1 times the fast one within 1, 10, 100 and 1000 s.
const PARTS: [(f32, f32); 3] = [(10.0, 0.25), (100.0, 0.25), (1000.0, 0.5)];

/// Weighted low-passes of the current.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polarisation([MeanThenLowPass; 3]);

impl Polarisation {
    /// Unknown: until it is as old as its time constant, each part is the mean of the current so far.
    pub const fn unknown() -> Self {
        let [(fast_s, _), (middle_s, _), (slow_s, _)] = PARTS;
        Self([
            MeanThenLowPass::new(fast_s),
            MeanThenLowPass::new(middle_s),
            MeanThenLowPass::new(slow_s),
        ])
    }

    /// The cells have rested.
    pub fn at_rest() -> Self {
        let mut polarisation = Self::unknown();
        for part in &mut polarisation.0 {
            part.initialise(0.0);
        }
        polarisation
    }

    /// Takes the mean current of `dt_s` seconds.
    pub fn update(&mut self, dt_s: f32, current_a: f32) {
        for part in &mut self.0 {
            part.update(dt_s, current_a);
        }
    }

    /// The current averaged over minutes, in amperes.
    pub fn mean_a(&self) -> Option<f32> {
        let [_, middle, _] = &self.0;
        middle.value()
    }

    /// The current averaged over the longest time, in amperes.
    pub fn lasting_a(&self) -> f32 {
        let [_, _, slow] = &self.0;
        slow.value().unwrap_or(0.0)
    }

    /// The current whose fast sag equals the slow one, for a slow share of 1, in amperes.
    pub fn current_a(&self) -> f32 {
        let parts = self.0.iter().zip(PARTS);
        parts
            .map(|(part, (_, share))| share * part.value().unwrap_or(0.0))
            .sum()
    }
}
