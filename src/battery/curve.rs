//! Discharge curve: open-circuit voltage of a cell against its state of charge.

/// Points of a curve: 0 %, 5 %, …, 100 %.
pub(super) const POINTS: usize = 21;

/// Open-circuit voltage of a cell, in volts, in steps of 5 %; strictly increasing.
#[derive(Debug)]
pub(super) struct Curve(pub [f32; POINTS]);

const SEGMENTS: usize = POINTS - 1;

impl Curve {
    /// The voltage at a state of charge from 0 to 1, in volts.
    pub fn voltage_v(&self, state_of_charge: f32) -> f32 {
        let position = state_of_charge.clamp(0.0, 1.0) * SEGMENTS as f32;
        let segment = (position as usize).min(SEGMENTS - 1);
        let (low_v, high_v) = self.ends(segment);
        low_v + (position - segment as f32) * (high_v - low_v)
    }

    fn ends(&self, segment: usize) -> (f32, f32) {
        let point = |number: usize| self.0.get(number).copied().unwrap_or_default();
        (point(segment), point(segment + 1))
    }
}

#[cfg(test)]
mod tests {
    use crate::battery::Chemistry;

    const CHEMISTRIES: [Chemistry; 4] = [
        Chemistry::LiPo,
        Chemistry::LiFe,
        Chemistry::LiIon,
        Chemistry::NiMh,
    ];

    #[test]
    fn every_curve_is_strictly_increasing() {
        for chemistry in CHEMISTRIES {
            let points = &chemistry.cell().curve.0;
            assert!(points.is_sorted_by(|low, high| low < high), "{chemistry:?}");
        }
    }
}
