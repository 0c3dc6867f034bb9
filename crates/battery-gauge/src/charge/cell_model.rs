//! Model of a pack's cells: chemistry, learnt properties, and known charges.

use crate::chemistry::{Cell, POINTS, SAME_VOLTAGE_V};
use crate::learnt::{LastCharge, LearntPack, OFFSET_POINTS, Offset};
use crate::state::BOUND_SIGMAS;
use crate::{Chemistry, FailsafeSettings, PackSettings, VoltageSource};

/// Standard deviation of a rated capacity, relative to it, by which a voltage corrects a count: a larger one would let the curve of
/// another cell correct more.
const RATED_SIGMA: f32 = 0.04;

/// A reported deviation adds this to it: a rated capacity is known to 8 % (√(0.08² − 0.04²)), as packs differ from their label and
/// age.
const LABEL_SIGMA: f32 = 0.069;

/// Standard deviation of a capacity that is inferred from the resistance, relative to it.
const INFERRED_SIGMA: f32 = 0.5;

/// A learnt capacity counts, and a curve is learnt, once the capacity is known to this standard deviation: before, the
/// label is better.
pub const MAX_LEARNT_SIGMA: f32 = 0.08;

/// A learnt capacity below the label by more than its deviation counts at up to this one: packs lose capacity, and hardly one
/// gains any.
const MAX_AGED_SIGMA: f32 = 0.11;

/// Uncertainty of the charge that belongs to a point of a curve: where the curve is steep, it outweighs that of the
/// voltage.
const CURVE_SHARE_SIGMA: f32 = 0.015;

/// Standard deviation of a curve that the owner has measured, in volts.
const MEASURED_SIGMA_V: f32 = 0.010;

/// Width over which the slope of the curve is taken: its corners must not count.
const SLOPE_WIDTH: f32 = 0.05;

/// Lower limit of the slope, in volts per state of charge: a tenth of that of LiFe.
const MIN_SLOPE_V: f32 = 0.01;

/// Standard deviation of a learnt slow share from one drive to the next.
const LEARNT_SLOW_SIGMA: f32 = 0.25;

/// Standard deviation of a state of charge that the owner sets.
const SET_SIGMA: f32 = 0.01;

/// An end above the voltage at this state of charge is that of other cells.
const HIGHEST_END: f32 = 0.3;

/// State of charge between two points of the curve.
const POINT_WIDTH: f32 = 1.0 / (POINTS - 1) as f32;

/// Heights of a measured curve above that of the chemistry.
pub type MeasuredOffsets = [Offset; OFFSET_POINTS];

/// The owner's curve at the points where one is learnt, if it can be used: between the points that are measured it is
/// interpolated, beyond them its height stays.
pub fn measured_offsets(settings: &PackSettings) -> Option<MeasuredOffsets> {
    if settings.curve_v == [None; OFFSET_POINTS] || !settings.is_curve_possible() {
        return None;
    }
    let curve = &settings.chemistry.cell().curve;
    let mut heights_v = [0.0; OFFSET_POINTS];
    let mut below = None;
    for (point, measured_v) in settings.curve_v.iter().enumerate() {
        let Some(measured_v) = measured_v else { continue };
        let height_v = measured_v - curve.voltage_v(Offset::soc(point));
        let (from, from_v) = below.replace((point, height_v)).unwrap_or((0, height_v));
        let width = (point - from).max(1) as f32;
        for (above, filled_v) in heights_v.iter_mut().skip(from).enumerate() {
            *filled_v = from_v + (height_v - from_v) * (above as f32 / width).min(1.0);
        }
    }
    Some(heights_v.map(|height_v| Offset::from_v(height_v, MEASURED_SIGMA_V)))
}

/// Height of the owner's curve above that of the chemistry at a state of charge from 0 to 1, in volts; 0 without one.
pub fn measured_height_v(settings: &PackSettings, soc: f32) -> f32 {
    measured_offsets(settings).map_or(0.0, |offsets| height_v(&offsets, soc))
}

/// Height of a measured curve at a state of charge from 0 to 1, in volts.
fn height_v(offsets: &MeasuredOffsets, soc: f32) -> f32 {
    interpolated(soc, |point| offsets.get(point).map_or(0.0, Offset::mean_v))
}

/// A property of the points of a curve between these; constant beyond the first and last.
fn interpolated(soc: f32, at: impl Fn(usize) -> f32) -> f32 {
    let (point, weight) = Offset::position(soc);
    let (low, high) = (at(point), at(point + 1));
    low + (high - low) * weight
}

/// A cell as far as known.
#[derive(Clone, Copy, Debug)]
pub struct CellModel<'a> {
    /// Cell chemistry.
    pub chemistry: Chemistry,
    /// Typical parameters of the chemistry.
    pub cell: &'static Cell,
    /// Cells in series, once known.
    pub cell_count: Option<u8>,
    /// Rated capacity, in ampere-hours, if set.
    pub rated_ah: Option<f32>,
    /// Resistance of a cell, in ohms, once measured.
    pub measured_ohm: Option<f32>,
    /// The voltage at which a cell is empty.
    pub end: EndVoltage,
    /// The most that can be left by a count at the source, from 0 to 1.
    pub soc_at_most: f32,
    /// The curve that the owner has measured, if it can be used: it counts where none is learnt.
    pub measured: Option<MeasuredOffsets>,
    /// Learnt properties of this pack.
    pub learnt: &'a LearntPack,
}

/// The voltage of a cell at which a drive ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndVoltage {
    pub cell_v: f32,
    /// The voltage that is compared with it.
    pub source: VoltageSource,
}

impl EndVoltage {
    /// The owner's critical voltage, if it is one of a cell that is nearly empty; else the usual one.
    pub fn new(settings: &PackSettings, cell_count: Option<u8>) -> Self {
        let cell = settings.chemistry.cell();
        let FailsafeSettings {
            low,
            critical,
            timer_s,
            voltage_source,
            ..
        } = settings.failsafe;
        let per_cell = |pack_v: f32| cell_count.map(|count| pack_v / f32::from(count));
        let set_v = timer_s
            .and(critical.voltage_v)
            .filter(|critical_v| low.voltage_v.is_none_or(|low_v| *critical_v < low_v))
            .and_then(per_cell)
            .filter(|cell_v| (cell.deep_discharge_v..=cell.curve.voltage_v(HIGHEST_END)).contains(cell_v));
        Self {
            cell_v: set_v.unwrap_or(cell.critical_v),
            source: voltage_source,
        }
    }
}

/// A capacity with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capacity {
    pub ah: f32,
    /// Standard deviation, relative to the capacity.
    pub sigma: f32,
}

/// A state of charge that is kept over a reset, set by the owner, or provisional.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownCharge {
    /// From 0 to 1.
    pub soc: f32,
    /// Standard deviation.
    pub sigma: f32,
}

impl KnownCharge {
    /// As the owner says, from 0 to 1.
    pub const fn set(soc: f32) -> Self {
        Self {
            soc,
            sigma: SET_SIGMA,
        }
    }

    /// Two standard deviations below, from 0 to 1.
    pub fn lowest(&self) -> f32 {
        (self.soc - BOUND_SIGMAS * self.sigma).max(0.0)
    }

    /// Two standard deviations above, from 0 to 1.
    pub fn highest(&self) -> f32 {
        (self.soc + BOUND_SIGMAS * self.sigma).min(1.0)
    }

    pub fn to_words(self) -> [u32; 2] {
        [self.soc, self.sigma].map(f32::to_bits)
    }

    /// `None` if no state of charge has these words.
    pub fn from_words(words: [u32; 2]) -> Option<Self> {
        let [soc, sigma] = words.map(f32::from_bits);
        let is_possible = (0.0..=1.0).contains(&soc) && (0.0..=1.0).contains(&sigma);
        is_possible.then_some(Self { soc, sigma })
    }
}

impl CellModel<'_> {
    /// The capacity: learnt, else set, else inferred from the resistance.
    pub fn capacity(&self) -> Option<Capacity> {
        let learnt = self.learnt_capacity();
        let rated = self.rated_ah.map(|ah| Capacity {
            ah,
            sigma: RATED_SIGMA,
        });
        let inferred = self.measured_ohm.map(|ohm| Capacity {
            ah: self.cell.ohmic_drop_v / ohm,
            sigma: INFERRED_SIGMA,
        });
        learnt.or(rated).or(inferred)
    }

    /// The learnt capacity, where it is better than the label.
    fn learnt_capacity(&self) -> Option<Capacity> {
        let learnt = self.learnt.capacity?;
        let capacity = Capacity {
            ah: learnt.ah(),
            sigma: learnt.sigma,
        };
        let has_aged = self
            .rated_ah
            .is_some_and(|rated_ah| capacity.ah < (1.0 - capacity.sigma) * rated_ah);
        let max_sigma = if has_aged {
            MAX_AGED_SIGMA
        } else {
            MAX_LEARNT_SIGMA
        };
        (capacity.sigma < max_sigma).then_some(capacity)
    }

    /// Standard deviation of the charge after this share of the capacity was counted, beyond that of the estimate: what a label
    /// alone is worth less than [`RATED_SIGMA`].
    pub fn label_sigma(&self, used: f32) -> f32 {
        match (self.learnt_capacity(), self.rated_ah) {
            (None, Some(_)) => used * LABEL_SIGMA,
            _ => 0.0,
        }
    }

    /// The resistance of a cell, in ohms: measured, else typical of a cell with this capacity.
    pub fn resistance_ohm(&self, capacity: &Capacity) -> f32 {
        self.measured_ohm.unwrap_or(self.cell.ohmic_drop_v / capacity.ah)
    }

    /// The resistance of a cell of this very pack, in ohms: measured since the start, else kept by the pack's serial number.
    /// The kept one is that of a warm drive: a lower limit.
    pub fn own_ohm(&self) -> Option<f32> {
        let kept = self
            .learnt
            .resistance
            .filter(|_| self.learnt.serial_number.is_some());
        self.measured_ohm.or(kept.map(|kept| kept.now_ohm))
    }

    /// The resistance of a cell, in ohms: measured since the start, else learnt in warm drives.
    pub fn known_ohm(&self) -> Option<f32> {
        let learnt = self.learnt.resistance.map(|learnt| learnt.now_ohm);
        self.measured_ohm.or(learnt)
    }

    /// The terminal voltage of a cell at which a drive ends, in volts: where the resting voltage ends it, deep discharge.
    pub fn terminal_end_v(&self) -> f32 {
        match self.end.source {
            VoltageSource::Terminal | VoltageSource::WeakestCell | VoltageSource::NotMeasured => {
                self.end.cell_v
            }
            VoltageSource::Resting => self.cell.deep_discharge_v,
        }
    }

    /// The slow part of a sag relative to the fast one: learnt, else typical.
    pub fn slow_share(&self) -> f32 {
        self.learnt.slow.map_or(self.cell.slow_share, |slow| slow.share)
    }

    /// Its standard deviation.
    pub fn slow_share_sigma(&self) -> f32 {
        match self.learnt.slow {
            Some(_) => LEARNT_SLOW_SIGMA,
            None => self.cell.slow_share_sigma,
        }
    }

    /// Resting voltage at a state of charge from 0 to 1, in volts.
    pub fn voltage_v(&self, soc: f32) -> f32 {
        self.cell.curve.voltage_v(soc) + self.interpolate(soc, Offset::mean_v)
    }

    /// The state of charge from 0 to 1 at a resting voltage.
    pub fn soc(&self, resting_v: f32) -> f32 {
        // Curve and offsets are linear between the points of the curve.
        let at = |point: usize| self.voltage_v(point as f32 * POINT_WIDTH);
        let (mut low, mut high) = (0, POINTS - 1);
        while high - low > 1 {
            let middle = (low + high) / 2;
            if at(middle) < resting_v {
                low = middle;
            } else {
                high = middle;
            }
        }
        let (low_v, high_v) = (at(low), at(high));
        // Offsets may make a flat curve fall.
        let rise_v = (high_v - low_v).max(MIN_SLOPE_V * POINT_WIDTH);
        let beyond = ((resting_v - low_v) / rise_v).clamp(0.0, 1.0);
        (low as f32 + beyond) * POINT_WIDTH
    }

    /// The kept charge of a pack that rests at this voltage of a cell, if it is still the same.
    pub fn last_charge(&self, cell_v: f32) -> Option<LastCharge> {
        let last = self.learnt.charge?;
        ((cell_v - last.resting_v).abs() <= SAME_VOLTAGE_V).then_some(last)
    }

    /// Slope of the curve, in volts per state of charge.
    pub fn slope_v(&self, soc: f32) -> f32 {
        let low = (soc - 0.5 * SLOPE_WIDTH).clamp(0.0, 1.0 - SLOPE_WIDTH);
        let rise_v = self.voltage_v(low + SLOPE_WIDTH) - self.voltage_v(low);
        (rise_v / SLOPE_WIDTH).max(MIN_SLOPE_V)
    }

    /// Standard deviation of the curve, in volts.
    pub fn curve_sigma_v(&self, soc: f32, slope_v: f32) -> f32 {
        let typical_v = self.cell.curve_sigma_v;
        let sigma_v = self.interpolate(soc, |offset| offset.sigma_v().unwrap_or(typical_v));
        let steep_v = CURVE_SHARE_SIGMA * slope_v;
        root_of_squares(sigma_v, steep_v)
    }

    /// Height of the curve above that of the chemistry where none is learnt, and its standard deviation, in volts.
    pub fn unlearnt_height_v(&self, soc: f32) -> (f32, f32) {
        match &self.measured {
            Some(offsets) => (height_v(offsets, soc), MEASURED_SIGMA_V),
            None => (0.0, self.cell.curve_sigma_v),
        }
    }

    /// A property of the offsets, as learnt, else as measured.
    fn interpolate(&self, soc: f32, property: impl Fn(&Offset) -> f32) -> f32 {
        if self.learnt.capacity.is_none() && self.measured.is_none() {
            // Nothing is known: the offsets are alike.
            return property(&Offset::default());
        }
        interpolated(soc, |point| property(&self.offset(point)))
    }

    /// The offset of a point, as learnt, else as measured.
    fn offset(&self, point: usize) -> Offset {
        let learnt = self.learnt.offsets.get(point).copied();
        learnt
            .filter(|offset| offset.sigma_v().is_some())
            .or(self.measured.and_then(|offsets| offsets.get(point).copied()))
            .unwrap_or_default()
    }
}

/// Standard deviation of the sum of two that are independent.
pub fn root_of_squares(a: f32, b: f32) -> f32 {
    libm::sqrtf(a * a + b * b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chemistry::CHEMISTRIES;
    use crate::learnt::OFFSET_POINTS;

    #[test]
    fn share_inverts_voltage_with_and_without_offsets() {
        let offset = LearntPack {
            offsets: [-0.010, -0.005, 0.0, 0.005, 0.010].map(|mean_v| Offset::from_v(mean_v, 0.01)),
            ..LearntPack::UNKNOWN
        };
        assert_eq!(offset.offsets.len(), OFFSET_POINTS);
        for chemistry in CHEMISTRIES {
            for learnt in [&LearntPack::UNKNOWN, &offset] {
                let model = CellModel {
                    chemistry,
                    cell: chemistry.cell(),
                    cell_count: Some(3),
                    rated_ah: None,
                    measured_ohm: None,
                    end: EndVoltage {
                        cell_v: 3.0,
                        source: VoltageSource::Terminal,
                    },
                    soc_at_most: 1.0,
                    measured: None,
                    learnt,
                };
                for percent in 0..=100 {
                    let soc = percent as f32 / 100.0;
                    let back = model.soc(model.voltage_v(soc));
                    assert!((back - soc).abs() < 2e-3, "{chemistry:?} at {percent} %: {back}");
                }
                assert_eq!(model.soc(10.0), 1.0);
                assert_eq!(model.soc(0.0), 0.0);
            }
        }
    }
}
