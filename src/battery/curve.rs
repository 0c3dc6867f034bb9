//! Discharge curve: open-circuit voltage of a cell against its state of charge.

/// Points of a curve: 0 %, 5 %, …, 100 %.
pub(super) const POINTS: usize = 21;

/// Open-circuit voltage of a cell, in volts, in steps of 5 %; strictly increasing.
#[derive(Debug)]
pub(super) struct Curve(pub [f32; POINTS]);

const SEGMENTS: usize = POINTS - 1;

/// State of charge between two points.
const SEGMENT_WIDTH: f32 = 1.0 / SEGMENTS as f32;

impl Curve {
    /// Open-circuit voltage of an empty cell, in volts.
    pub fn empty_v(&self) -> f32 {
        self.ends(0).0
    }

    /// Open-circuit voltage of a full cell, in volts.
    pub fn full_v(&self) -> f32 {
        self.ends(SEGMENTS - 1).1
    }

    /// The voltage at a state of charge from 0 to 1, in volts.
    pub fn voltage_v(&self, state_of_charge: f32) -> f32 {
        let position = state_of_charge.clamp(0.0, 1.0) * SEGMENTS as f32;
        let segment = (position as usize).min(SEGMENTS - 1);
        let (low_v, high_v) = self.ends(segment);
        low_v + (position - segment as f32) * (high_v - low_v)
    }

    /// The state of charge at a resting voltage; extrapolated below 0 and above 1.
    pub fn state_of_charge(&self, voltage_v: f32) -> f32 {
        let above = self.0.partition_point(|point_v| *point_v <= voltage_v);
        let segment = above.saturating_sub(1).min(SEGMENTS - 1);
        let (low_v, high_v) = self.ends(segment);
        (segment as f32 + (voltage_v - low_v) / (high_v - low_v)) * SEGMENT_WIDTH
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

    #[test]
    fn state_of_charge_inverts_voltage() {
        for chemistry in CHEMISTRIES {
            let curve = &chemistry.cell().curve;
            for percent in 0..=100 {
                let share = percent as f32 / 100.0;
                let back = curve.state_of_charge(curve.voltage_v(share));
                assert!(
                    (back - share).abs() < 1e-3,
                    "{chemistry:?} at {percent} %: {back}"
                );
            }
            assert!(curve.state_of_charge(curve.full_v() + 0.05) > 1.0);
            assert!(curve.state_of_charge(curve.empty_v() - 0.05) < 0.0);
        }
    }
}
