//! Capacity, resistance, slow sag and curve of a pack, learnt from a drive.

use super::cell_model::{Capacity, CellModel, KnownCharge, root_of_squares};
use crate::learnt::{LearntCapacity, LearntResistance, LearntSlowShare, Offset, WARM_TO_KEPT};

/// Standard deviation of a label, relative to it, if a lesson does not contradict it, and the most that a true capacity is away
/// from one.
const LABEL_SIGMA: f32 = 0.07;
const MAX_LABEL_SIGMA: f32 = 0.3;

/// Standard deviation of the true capacity, relative to the rated one: for what is believed.
const RATED_SIGMA: f32 = 0.15;

/// Change of a capacity until a better lesson, relative to it: assumed.
const DRIFT_SIGMA: f32 = 0.02;

/// Least standard deviation of a learnt capacity, relative to it: Texas Instruments' gauges state 3 % after an update (SLUUBT5).
const MIN_CAPACITY_SIGMA: f32 = 0.035;

/// A capacity further from the expected one, in standard deviations, is not believed.
const GATE: f32 = 3.0;

/// A lesson whose deviation is below this share of that of the best one is news of its own.
const BETTER: f32 = 0.7;

/// Share of a change that is taken over from a lesson as good as those before: nine tenths after three.
const FOLLOWING: f32 = 0.6;

/// The kept resistance follows that of this many drives, and rises by this factor at most: never into the cold.
const RESISTANCE_DRIVES: f32 = 4.0;
const MAX_RISE: f32 = 1.02;

/// Standard deviation of the offset seen in one drive, and lower limit of a learnt one, in volts.
const OFFSET_SIGMA_V: f32 = 0.015;
const MIN_OFFSET_SIGMA_V: f32 = 0.008;

/// Changes from drive to drive of an offset, in volts, and of a slow share: assumed.
const OFFSET_DRIFT_V: f32 = 0.003;
const SLOW_DRIFT: f32 = 0.1;

/// Standard deviation of a sag, relative to it: of a typical slow share, and of one that is learnt with the offsets.
const SAG_SIGMA: f32 = 0.15;
const LEARNT_SAG_SIGMA: f32 = 0.05;

/// Takes the capacity that a drive has shown.
///
/// Lessons as good as one another have their errors in common, those of the curve and of the slow sag at the rest: many of them
/// are no better than one, and what counts is how they differ. A lesson that is better is weighed against what is known, the
/// first one against the label: the further that is off, the less it counts.
pub fn learn_capacity(
    before: Option<LearntCapacity>,
    lesson: &Capacity,
    rated_ah: f32,
) -> Option<LearntCapacity> {
    let lesson_variance = lesson.sigma * lesson.sigma;
    let is_plausible = |innovation: f32, sigma: f32| {
        innovation * innovation <= GATE * GATE * (sigma * sigma + lesson_variance)
    };
    if let Some(kept) = before
        && kept.seen_mah > 0.0
        && lesson.sigma > BETTER * kept.seen_sigma
    {
        let innovation = lesson.ah / kept.seen_ah() - 1.0;
        let weight = (kept.seen_sigma / lesson.sigma).min(1.0);
        let change = 1.0 + FOLLOWING * weight * weight * innovation;
        return is_plausible(innovation, RATED_SIGMA).then_some(LearntCapacity {
            capacity_mah: kept.capacity_mah * change,
            seen_mah: kept.seen_mah * change,
            ..kept
        });
    }
    let expected_ah = before.map_or(rated_ah, |kept| kept.ah());
    let innovation = lesson.ah / expected_ah - 1.0;
    let sigma = match before {
        Some(kept) => kept.sigma + DRIFT_SIGMA,
        None => libm::sqrtf((innovation * innovation - lesson_variance).max(0.0))
            .clamp(LABEL_SIGMA, MAX_LABEL_SIGMA),
    };
    let gain = sigma * sigma / (sigma * sigma + lesson_variance);
    is_plausible(innovation, sigma.max(RATED_SIGMA)).then_some(LearntCapacity {
        capacity_mah: 1e3 * expected_ah * (1.0 + gain * innovation),
        sigma: (sigma * libm::sqrtf(1.0 - gain)).max(MIN_CAPACITY_SIGMA),
        seen_mah: 1e3 * lesson.ah,
        seen_sigma: lesson.sigma,
    })
}

/// Whether a pack with this resistance of a cell was warm. A first one is: nothing lower is known of it.
pub fn is_warm(kept: Option<LearntResistance>, ohm: f32) -> bool {
    kept.is_none_or(|kept| ohm <= WARM_TO_KEPT * kept.now_ohm)
}

/// Takes the resistance of a warm drive.
pub fn learn_resistance(before: Option<LearntResistance>, ohm: f32) -> LearntResistance {
    match before {
        None => LearntResistance {
            now_ohm: ohm,
            first_ohm: ohm,
        },
        // The kept one was cold.
        Some(kept) if WARM_TO_KEPT * ohm < kept.now_ohm => LearntResistance {
            now_ohm: ohm,
            first_ohm: kept.first_ohm.min(ohm),
        },
        Some(kept) => {
            let following_ohm = kept.now_ohm + (ohm - kept.now_ohm) / RESISTANCE_DRIVES;
            LearntResistance {
                now_ohm: following_ohm.min(MAX_RISE * kept.now_ohm),
                ..kept
            }
        }
    }
}

/// Means of a drive near one point of the curve.
#[derive(Clone, Copy, Debug)]
pub struct SeenPoint {
    /// The voltage of a cell without the fast part of the sag, in volts.
    pub without_fast_v: f32,
    /// The fast part of the sag whose multiple the slow part is, in volts.
    pub slow_v: f32,
    /// Charge drawn since the start of the drive, in ampere-hours.
    pub drawn_ah: f32,
}

/// Origin of the slow part of the sag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlowSag {
    /// As known before.
    Known,
    /// With the curve: wires and contacts raise the resistance, and have no slow sag.
    Learnt,
}

/// A point of the curve as it was known, and seen in a drive.
struct ComparedPoint {
    before_v: f32,
    before_sigma_v: f32,
    /// Voltage, less the slow part of the sag, above the one before, in volts.
    above_v: f32,
    slow_v: f32,
    noise_v: f32,
}

impl ComparedPoint {
    fn variance(&self) -> f32 {
        self.before_sigma_v * self.before_sigma_v + self.noise_v * self.noise_v
    }
}

/// A curve that is learnt from a drive.
pub struct CurveLesson<'a> {
    /// State of charge at the start of the drive.
    pub start: KnownCharge,
    pub capacity: Capacity,
    pub slow_sag: SlowSag,
    /// The cell as known before.
    pub model: &'a CellModel<'a>,
}

impl CurveLesson<'_> {
    /// Learns the slow share by how the points differ with it from the curve: of each, its offset and its noise are unknown.
    pub fn slow_share<'p>(
        &self,
        points: impl Iterator<Item = (&'p Offset, SeenPoint)>,
    ) -> Option<LearntSlowShare> {
        if self.slow_sag == SlowSag::Known {
            return self.model.learnt.slow;
        }
        let before_sigma = match self.model.learnt.slow {
            Some(slow) => slow.sigma + SLOW_DRIFT,
            None => self.model.cell.slow_share_sigma,
        };
        let mut precision = 1.0 / (before_sigma * before_sigma);
        let mut weighted = self.model.slow_share() * precision;
        for (offset, seen) in points {
            let point = self.compare(offset, &seen);
            let weight = 1.0 / point.variance();
            precision += point.slow_v * point.slow_v * weight;
            weighted -= point.slow_v * point.above_v * weight;
        }
        Some(LearntSlowShare {
            share: (weighted / precision).max(0.0),
            sigma: libm::sqrtf(1.0 / precision),
        })
    }

    /// Learns an offset with this slow share, and the deviation of that where it was learnt.
    pub fn offset(&self, before: &Offset, seen: &SeenPoint, slow: Option<LearntSlowShare>) -> Offset {
        let point = self.compare(before, seen);
        let share = slow.map_or(self.model.cell.slow_share, |slow| slow.share);
        let before_variance = point.before_sigma_v * point.before_sigma_v;
        let gain = before_variance / point.variance();
        let mean_v = point.before_v + gain * (point.above_v + share * point.slow_v);
        let sigma_v = libm::sqrtf(before_variance * (1.0 - gain));
        let sigma_v = match (self.slow_sag, slow) {
            (SlowSag::Learnt, Some(slow)) => root_of_squares(sigma_v, gain * point.slow_v * slow.sigma),
            // No drive shows the curve better than the sag is known.
            _ => sigma_v.max((SAG_SIGMA * point.slow_v * (1.0 + share)).min(point.before_sigma_v)),
        };
        Offset::from_v(mean_v, sigma_v.max(MIN_OFFSET_SIGMA_V))
    }

    fn compare(&self, before: &Offset, seen: &SeenPoint) -> ComparedPoint {
        let Self { capacity, model, .. } = self;
        let drawn = seen.drawn_ah / capacity.ah;
        let soc = self.start.soc - drawn;
        let (before_v, before_sigma_v) = match before.sigma_v() {
            Some(sigma_v) => (before.mean_v(), sigma_v + OFFSET_DRIFT_V),
            None => model.unlearnt_height_v(soc),
        };
        let by_start_v = model.slope_v(soc) * self.start.sigma;
        let by_sag_v = match self.slow_sag {
            SlowSag::Known => SAG_SIGMA * seen.slow_v * (1.0 + model.slow_share()),
            SlowSag::Learnt => {
                let by_capacity_v = model.slope_v(soc) * capacity.sigma * drawn;
                root_of_squares(LEARNT_SAG_SIGMA * seen.slow_v, by_capacity_v)
            }
        };
        ComparedPoint {
            before_v,
            before_sigma_v,
            above_v: seen.without_fast_v - model.cell.curve.voltage_v(soc) - before_v,
            slow_v: seen.slow_v,
            noise_v: root_of_squares(root_of_squares(OFFSET_SIGMA_V, by_start_v), by_sag_v),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After these lessons, in ampere-hours with their deviations, by a label of 2 Ah.
    fn after(lessons: impl IntoIterator<Item = (f32, f32)>) -> LearntCapacity {
        let lessons = lessons.into_iter().map(|(ah, sigma)| Capacity { ah, sigma });
        lessons
            .fold(None, |before, lesson| learn_capacity(before, &lesson, 2.0))
            .expect("plausible")
    }

    #[test]
    fn lessons_with_one_error_are_no_better_than_one() {
        let once = after([(2.16, 0.08)]);
        let often = after([(2.16, 0.08); 30]);
        assert_eq!(often, once);
        assert!((2.0..2.1).contains(&once.ah()) && once.sigma > 0.03, "{once:?}");
    }

    #[test]
    fn a_label_that_is_far_off_does_not_count() {
        for (ah, sigma) in [(1.6, 0.02), (2.5, 0.02), (1.6, 0.06)] {
            let learnt = after([(ah, sigma)]).ah();
            assert!((learnt / ah - 1.0).abs() < 0.03, "{ah} ± {sigma}: {learnt}");
        }
    }

    #[test]
    fn a_change_is_followed_within_four_drives() {
        let before = after([(1.9, 0.02); 5]).ah();
        let changed = after([(1.9, 0.02); 5].into_iter().chain([(1.71, 0.02); 4])).ah();
        assert!((changed / before - 0.9).abs() < 0.01, "{before}, then {changed}");
    }

    #[test]
    fn a_better_lesson_outweighs_many() {
        let learnt = after([(2.3, 0.15); 10].into_iter().chain([(1.9, 0.02)])).ah();
        assert!((learnt / 1.9 - 1.0).abs() < 0.02, "{learnt}");
    }

    #[test]
    fn a_resistance_rises_slowly_and_falls_to_that_of_a_warm_drive() {
        let cold = learn_resistance(None, 0.08);
        let warm = learn_resistance(Some(cold), 0.03);
        assert_eq!((warm.now_ohm, warm.first_ohm), (0.03, 0.03));
        let mut kept = warm;
        for _ in 0..10 {
            assert!(is_warm(Some(kept), 0.041));
            kept = learn_resistance(Some(kept), 0.041);
        }
        assert!((1.2..1.23).contains(&(kept.now_ohm / 0.03)), "{kept:?}");
        assert!(!is_warm(Some(warm), 0.05));
    }
}
