//! Properties of a pack that are learnt over its drives, and kept in flash.

use core::fmt;
use core::num::NonZeroU16;
use core::ops::{Range, RangeInclusive};

use crate::chemistry::SAME_VOLTAGE_V;
use crate::{Chemistry, MeasuringScale};

/// Points of the charge at which the curve's offset is learnt.
pub const OFFSET_POINTS: usize = 5;

/// Words of a [`LearntPack`] in flash.
pub const LEARNT_WORDS: usize = word::COLLAPSE + 1;

/// The words of the curve among them.
pub const LEARNT_CURVE: Range<usize> = word::CURVE..word::VOLT_MULTIPLIER;

const OPEN_LESSON_WORDS: usize = word::COLLAPSE - word::OPEN_LESSON;

/// The first words of these, which firmware before the scale stored.
pub const OLDER_LEARNT_WORDS: u8 = word::VOLT_MULTIPLIER as u8;

/// Position of each value among the words of a [`LearntPack`]. Without another note it is an `f32` in the unit of its field. A
/// value to come has its word behind these, where older records have zeros.
mod word {
    /// Chemistry, cells, and the number of drives in two bytes, the low one first.
    pub const KIND: usize = 0;
    /// A whole number, [`NO_SERIAL_NUMBER`](super::NO_SERIAL_NUMBER) without one.
    pub const SERIAL_NUMBER: usize = 1;
    pub const CAPACITY_MAH: usize = 2;
    pub const CAPACITY_SIGMA: usize = 3;
    pub const NOW_OHM: usize = 4;
    pub const FIRST_OHM: usize = 5;
    /// Negative while no charge is kept: 0 is that of an empty pack.
    pub const SOC: usize = 6;
    pub const SOC_SIGMA: usize = 7;
    pub const RESTING_V: usize = 8;
    /// A word for each of its points: mean and deviation, of 16 bits each.
    pub const CURVE: usize = 9;
    pub const VOLT_MULTIPLIER: usize = 14;
    pub const VOLT_OFFSET_V: usize = 15;
    pub const AMPERES_PER_VOLT: usize = 16;
    pub const SLOW_SHARE: usize = 17;
    pub const SLOW_SIGMA: usize = 18;
    pub const SEEN_MAH: usize = 19;
    pub const SEEN_SIGMA: usize = 20;
    /// Twelve words: see [`OpenLesson`](super::OpenLesson).
    pub const OPEN_LESSON: usize = 21;
    /// As two numbers of 16 bits.
    pub const COLLAPSE: usize = 33;

    const _: () = assert!(CURVE + super::OFFSET_POINTS == VOLT_MULTIPLIER);
}

/// Plausibility limits: of a capacity in milliampere-hours, of a resistance in ohms, of a cell in volts, of an offset in millivolts;
/// of a charge or standard deviation relative to a whole, and of the slow part of a sag relative to the fast one.
const CAPACITIES_MAH: RangeInclusive<f32> = 1.0..=10_000_000.0;
const RESISTANCES_OHM: RangeInclusive<f32> = 1e-6..=100.0;
const CELL_VOLTAGES_V: RangeInclusive<f32> = 0.1..=10.0;
const HIGHEST_OFFSET_MV: i16 = 1_000;
const SHARES: RangeInclusive<f32> = 0.0..=1.0;
const SLOW_SHARES: RangeInclusive<f32> = 0.0..=10.0;
const MAX_RESTED_H: f32 = 1000.0;

/// A learnt capacity that differs from the rated one by a larger factor is that of another pack.
const MAX_TO_RATED: f32 = 2.0;

/// Resistance relative to what is kept, up to which the pack was warm.
pub const WARM_TO_KEPT: f32 = 1.4;

/// Changes of a charge that are not worth a write to flash: of the state of charge, and of a resting cell in volts.
const LIKE_SOC: f32 = 0.005;
const LIKE_VOLTAGE_V: f32 = 0.002;

/// Loss of capacity, from 0 to 1, at which the life of a pack usually ends; twice its resistance makes it as old.
pub const END_OF_LIFE_LOSS: f32 = 0.2;

/// The word of a pack without a serial number, as `BATT_SERIAL_NUM`.
const NO_SERIAL_NUMBER: i32 = -1;

/// Knowledge of a pack that outlasts a power cycle. `None` is not learnt yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearntPack {
    pub(super) chemistry: Chemistry,
    /// Cells in series; 0 while they are unknown.
    pub(super) cell_count: u8,
    /// The pack's serial number (`BATT_SERIAL_NUM`), if set.
    pub(super) serial_number: Option<i32>,
    /// Drives from which something was learnt.
    pub(super) drives: u16,
    pub(super) capacity: Option<LearntCapacity>,
    pub(super) resistance: Option<LearntResistance>,
    pub(super) offsets: [Offset; OFFSET_POINTS],
    /// The state of charge when the pack was last at rest.
    pub(super) charge: Option<LastCharge>,
    /// The slow part of its sag, once learnt.
    pub(super) slow: Option<LearntSlowShare>,
    /// The scale of its measurements, where that is set.
    pub(super) scale: Option<MeasuringScale>,
    /// A drive after which it has not rested yet.
    pub(super) open: Option<OpenLesson>,
    /// Its last collapse under load, unless a later drive has passed it.
    pub(super) collapse: Option<Collapse>,
}

/// A learnt capacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearntCapacity {
    /// In milliampere-hours.
    pub capacity_mah: f32,
    /// Standard deviation, relative to the capacity.
    pub sigma: f32,
    /// The capacity as drives have shown it, with the error that they have in common, in milliampere-hours; 0: not known.
    pub seen_mah: f32,
    /// Standard deviation of the best of them, relative to it.
    pub seen_sigma: f32,
}

impl LearntCapacity {
    /// In ampere-hours.
    pub fn ah(&self) -> f32 {
        self.capacity_mah * 1e-3
    }

    /// As drives have shown it, in ampere-hours.
    pub fn seen_ah(&self) -> f32 {
        self.seen_mah * 1e-3
    }

    /// Without an implausible one of the drives.
    fn if_plausible(mut self) -> Option<Self> {
        if !(CAPACITIES_MAH.contains(&self.seen_mah) && SHARES.contains(&self.seen_sigma)) {
            self.seen_mah = 0.0;
            self.seen_sigma = 0.0;
        }
        (CAPACITIES_MAH.contains(&self.capacity_mah) && SHARES.contains(&self.sigma)).then_some(self)
    }
}

/// A cell's resistance when warm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearntResistance {
    /// The lowest of recent drives, in ohms.
    pub now_ohm: f32,
    /// That of the first drive, in ohms: what ageing is measured against.
    pub first_ohm: f32,
}

impl LearntResistance {
    fn if_plausible(self) -> Option<Self> {
        let is_plausible =
            RESISTANCES_OHM.contains(&self.now_ohm) && RESISTANCES_OHM.contains(&self.first_ohm);
        is_plausible.then_some(self)
    }
}

/// The slow part of a cell's sag relative to the fast one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LearntSlowShare {
    pub share: f32,
    /// Standard deviation.
    pub sigma: f32,
}

impl LearntSlowShare {
    fn if_plausible(self) -> Option<Self> {
        let is_plausible =
            SLOW_SHARES.contains(&self.share) && self.sigma > 0.0 && SHARES.contains(&self.sigma);
        is_plausible.then_some(self)
    }
}

/// Height of the cell's curve above that of its chemistry at one charge, in tenths of a millivolt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Offset {
    /// The most likely height.
    pub mean_100uv: i16,
    /// Standard deviation; 0: not learnt.
    pub sigma_100uv: i16,
}

/// A state of charge that is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LastCharge {
    /// From 0 to 1.
    pub soc: f32,
    /// Standard deviation.
    pub sigma: f32,
    /// The voltage of a cell that has rested since then, in volts.
    pub resting_v: f32,
}

/// The charge at which a load has taken a cell to the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Collapse {
    /// State of charge, in ten-thousandths.
    share_1e4: u16,
    /// Mean resistance of a cell in that drive, in ten microohms.
    ohm_1e5: NonZeroU16,
}

impl Collapse {
    /// At this state of charge from 0 to 1 and resistance in ohms; `None` where they are beyond those of a plausible pack.
    pub fn new(soc: f32, ohm: f32) -> Option<Self> {
        let numbers = [soc * 1e4 + 0.5, ohm * 1e5 + 0.5];
        let is_possible = soc >= 0.0 && numbers.iter().all(|number| *number < f32::from(u16::MAX));
        is_possible.then(|| Self::from_numbers(numbers.map(|number| number as u16)))?
    }

    /// State of charge, from 0 to 1.
    pub fn soc(&self) -> f32 {
        f32::from(self.share_1e4) * 1e-4
    }

    fn ohm(&self) -> f32 {
        f32::from(self.ohm_1e5.get()) * 1e-5
    }

    /// The state of charge at which cells with this resistance, in ohms, collapse: the sag is proportional to it. A larger one
    /// than in that drive is no reason to expect it earlier: the reserve for the sag grows by itself.
    pub fn soc_at(&self, ohm: Option<f32>) -> f32 {
        self.soc() * ohm.map_or(1.0, |ohm| (ohm / self.ohm()).min(1.0))
    }

    /// A collapse at a state of charge that is higher by this difference, with this one's resistance.
    pub fn corrected(&self, difference: f32) -> Option<Self> {
        Self::new(self.soc() + difference, self.ohm())
    }

    /// As two numbers: ten-thousandths, and ten microohms.
    pub fn to_numbers(self) -> [u16; 2] {
        [self.share_1e4, self.ohm_1e5.get()]
    }

    /// `None` if no collapse has these numbers.
    pub fn from_numbers([share_1e4, ohm_1e5]: [u16; 2]) -> Option<Self> {
        let ohm_1e5 = NonZeroU16::new(ohm_1e5)?;
        (share_1e4 <= 10_000).then_some(Self { share_1e4, ohm_1e5 })
    }
}

/// Lessons of a pack's drives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lessons {
    drives: u16,
    capacity: Option<LearntCapacity>,
    resistance: Option<LearntResistance>,
    offsets: [Offset; OFFSET_POINTS],
    slow: Option<LearntSlowShare>,
}

/// A lesson of a drive that ended without a rest: the next start may be that rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OpenLesson {
    /// State of charge at its start and the standard deviation, in ten-thousandths.
    pub start: [u16; 2],
    /// Charge drawn since, in ampere-hours.
    pub drawn_ah: f32,
    /// Time at rest, in hours.
    pub rested_h: f32,
    /// Mean resistance of a cell, in ohms.
    pub ohm: f32,
    /// At each point of the curve: the voltage of a cell without the fast sag and what the slow one may be, in tenths of a
    /// millivolt, and the charge drawn by then, in 65535ths. Zeros where the drive was not.
    pub points: [[u16; 3]; OFFSET_POINTS],
    /// The source of its current: see [`BatteryMonitor::follow_current`](crate::BatteryMonitor::follow_current).
    pub current_source: u16,
}

impl OpenLesson {
    fn to_words(self) -> [u32; OPEN_LESSON_WORDS] {
        let [soc, sigma] = self.start;
        let mut words = [0; OPEN_LESSON_WORDS];
        let (head, points) = words.split_at_mut(4);
        head.copy_from_slice(&[
            pair(soc, sigma),
            self.drawn_ah.to_bits(),
            self.rested_h.to_bits(),
            self.ohm.to_bits(),
        ]);
        let mut halves = self.points.as_flattened().iter().chain([&self.current_source]);
        for word in points {
            let mut half = || halves.next().copied().unwrap_or(0);
            *word = pair(half(), half());
        }
        words
    }

    /// `None` if no drive has these words.
    fn from_words(words: &[u32; OPEN_LESSON_WORDS]) -> Option<Self> {
        let [start, drawn_ah, rested_h, ohm, halves @ ..] = words;
        let mut points = [[0; 3]; OFFSET_POINTS];
        let mut halves = halves.iter().flat_map(|word| halves_of(*word));
        for (point, half) in points.as_flattened_mut().iter_mut().zip(&mut halves) {
            *point = half;
        }
        let lesson = Self {
            start: halves_of(*start),
            drawn_ah: f32::from_bits(*drawn_ah),
            rested_h: f32::from_bits(*rested_h),
            ohm: f32::from_bits(*ohm),
            points,
            current_source: halves.next().unwrap_or(0),
        };
        let is_plausible = lesson.start.iter().all(|part| *part <= 10_000)
            && CAPACITIES_MAH.contains(&(lesson.drawn_ah * 1e3))
            && (0.0..=MAX_RESTED_H).contains(&lesson.rested_h)
            && RESISTANCES_OHM.contains(&lesson.ohm);
        is_plausible.then_some(lesson)
    }
}

fn pair(low: u16, high: u16) -> u32 {
    u32::from(low) | u32::from(high) << 16
}

fn halves_of(word: u32) -> [u16; 2] {
    [word as u16, (word >> 16) as u16]
}

/// Why a drive has taught nothing of its pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LessonObstacle {
    /// `BATT_CAPACITY` is 0.
    NoCapacity,
    /// The current is not measured.
    NoCurrent,
    /// The charge was not known at the start: the pack had not rested, or its curve is flat. Or too much of the charge since
    /// then was assumed.
    UnknownStart,
    /// Less than 35 % of the capacity was drawn.
    LittleDrawn,
    /// The resistance is unknown, as the load has hardly changed, or over four times a typical one.
    Resistance,
    /// The pack has not rested since.
    NoRest,
    /// The voltage at rest says nothing of the charge, or none that fits what was drawn.
    Implausible,
}

impl fmt::Display for LessonObstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoCapacity => "BATT_CAPACITY is 0",
            Self::NoCurrent => "no current sensor",
            Self::UnknownStart => "charge unknown at the start",
            Self::LittleDrawn => "less than 35% drawn",
            Self::Resistance => "resistance unknown or too high",
            Self::NoRest => "no rest of 30s at the end",
            Self::Implausible => "no plausible capacity",
        })
    }
}

impl LastCharge {
    fn if_plausible(self) -> Option<Self> {
        let is_plausible = SHARES.contains(&self.soc)
            && SHARES.contains(&self.sigma)
            && CELL_VOLTAGES_V.contains(&self.resting_v);
        is_plausible.then_some(self)
    }

    fn is_like(&self, other: &Self) -> bool {
        (self.soc - other.soc).abs() < LIKE_SOC && (self.resting_v - other.resting_v).abs() < LIKE_VOLTAGE_V
    }
}

impl Offset {
    /// The point below a state of charge from 0 to 1, and the weight of the point above.
    pub fn position(soc: f32) -> (usize, f32) {
        let position = (soc * OFFSET_POINTS as f32 - 0.5)
            .max(0.0)
            .min((OFFSET_POINTS - 1) as f32);
        let point = (position as usize).min(OFFSET_POINTS - 2);
        (point, position - point as f32)
    }

    /// The state of charge of a point, from 0 to 1.
    pub fn soc(point: usize) -> f32 {
        (point as f32 + 0.5) / OFFSET_POINTS as f32
    }

    /// In volts.
    pub fn mean_v(&self) -> f32 {
        f32::from(self.mean_100uv) * 1e-4
    }

    /// Standard deviation in volts; `None` if it is not learnt.
    pub fn sigma_v(&self) -> Option<f32> {
        (self.sigma_100uv > 0).then(|| f32::from(self.sigma_100uv) * 1e-4)
    }

    fn to_word(self) -> u32 {
        let [mean_low, mean_high] = self.mean_100uv.to_le_bytes();
        let [sigma_low, sigma_high] = self.sigma_100uv.to_le_bytes();
        u32::from_le_bytes([mean_low, mean_high, sigma_low, sigma_high])
    }

    /// `None` if no curve has this offset.
    fn from_word(word: u32) -> Option<Self> {
        let [mean_low, mean_high, sigma_low, sigma_high] = word.to_le_bytes();
        let offset = Self {
            mean_100uv: i16::from_le_bytes([mean_low, mean_high]),
            sigma_100uv: i16::from_le_bytes([sigma_low, sigma_high]),
        };
        let limit_100uv = HIGHEST_OFFSET_MV * 10;
        let is_plausible = (-limit_100uv..=limit_100uv).contains(&offset.mean_100uv)
            && (0..=limit_100uv).contains(&offset.sigma_100uv);
        is_plausible.then_some(offset)
    }

    /// From volts, limited to what is plausible.
    pub fn from_v(mean_v: f32, sigma_v: f32) -> Self {
        let limit = f32::from(HIGHEST_OFFSET_MV) * 10.0;
        Self {
            mean_100uv: (mean_v * 1e4).clamp(-limit, limit) as i16,
            sigma_100uv: (sigma_v * 1e4).clamp(1.0, limit) as i16,
        }
    }
}

impl LearntPack {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self {
        chemistry: Chemistry::LiPo,
        cell_count: 0,
        serial_number: None,
        drives: 0,
        capacity: None,
        resistance: None,
        offsets: [Offset {
            mean_100uv: 0,
            sigma_100uv: 0,
        }; OFFSET_POINTS],
        charge: None,
        slow: None,
        scale: None,
        open: None,
        collapse: None,
    };

    /// Nothing is learnt yet of the pack with this serial number.
    // Inlined, the whole would be written out at each use.
    #[inline(never)]
    pub fn of(serial_number: Option<i32>) -> Self {
        Self {
            serial_number,
            ..Self::UNKNOWN
        }
    }

    /// The pack's serial number, if set.
    pub fn serial_number(&self) -> Option<i32> {
        self.serial_number
    }

    /// Capacity, in milliampere-hours, once learnt.
    pub fn capacity_mah(&self) -> Option<f32> {
        self.capacity.map(|capacity| capacity.capacity_mah)
    }

    /// Standard deviation of the capacity, in milliampere-hours, once learnt.
    pub fn capacity_sigma_mah(&self) -> Option<f32> {
        self.capacity
            .map(|capacity| capacity.capacity_mah * capacity.sigma)
    }

    /// Resistance of the whole pack when warm, in ohms, once learnt.
    pub fn resistance_ohm(&self) -> Option<f32> {
        self.resistance
            .map(|resistance| resistance.now_ohm * f32::from(self.cell_count))
    }

    /// Whether a cell with this resistance, in ohms, may be one of this pack: the ratio is that up to which a pack is warm.
    pub(super) fn has_resistance(&self, cell_ohm: f32) -> bool {
        self.resistance.is_some_and(|kept| {
            cell_ohm <= WARM_TO_KEPT * kept.now_ohm && kept.now_ohm <= WARM_TO_KEPT * cell_ohm
        })
    }

    /// Cells in series, if known.
    pub fn cell_count(&self) -> Option<u8> {
        (self.cell_count > 0).then_some(self.cell_count)
    }

    /// Drives that have taught something.
    pub fn drives(&self) -> u16 {
        self.drives
    }

    /// Its capacity, once a drive has shown it.
    pub fn capacity(&self) -> Option<LearntCapacity> {
        self.capacity
    }

    /// The resistance of a cell when warm.
    pub fn cell_resistance(&self) -> Option<LearntResistance> {
        self.resistance
    }

    /// The charge at which it was left.
    pub fn last_charge(&self) -> Option<LastCharge> {
        self.charge
    }

    /// How far its cells lie off the curve of their chemistry.
    pub fn offsets(&self) -> &[Offset; OFFSET_POINTS] {
        &self.offsets
    }

    /// Whether anything of the curve is learnt.
    pub fn has_curve(&self) -> bool {
        self.offsets.iter().any(|offset| offset.sigma_100uv > 0)
    }

    /// Capacity in milliampere-hours and resistance in ohms, once learnt.
    pub(super) fn learnt(&self) -> Option<(f32, f32)> {
        self.capacity_mah().zip(self.resistance_ohm())
    }

    /// State of health, in percent: the capacity relative to the rated one, and the resistance relative to that of the
    /// first drive, of which twice as much counts as a fifth of the capacity; the lower one. The end of life is usually
    /// drawn at 80 % of the capacity or twice the resistance.
    pub fn health_pct(&self, rated_mah: Option<f32>) -> Option<u8> {
        let by_capacity = self
            .capacity
            .zip(rated_mah)
            .map(|(learnt, rated_mah)| learnt.capacity_mah / rated_mah)?;
        let by_resistance = self.resistance.map_or(1.0, |learnt| {
            1.0 - END_OF_LIFE_LOSS * (learnt.now_ohm / learnt.first_ohm - 1.0)
        });
        // Saturating; a NaN becomes 0.
        Some((by_capacity.min(by_resistance).clamp(0.0, 1.0) * 100.0 + 0.5) as u8)
    }

    /// Whether this may have been learnt of a pack with this chemistry, as many cells, and such a rated capacity.
    pub(super) fn matches(
        &self,
        chemistry: Chemistry,
        cell_count: Option<u8>,
        rated_mah: Option<f32>,
    ) -> bool {
        let is_blank = self.cell_count == 0;
        is_blank
            || (self.chemistry == chemistry
                && cell_count.is_none_or(|count| count == self.cell_count)
                && self.is_plausible_for(rated_mah))
    }

    fn is_plausible_for(&self, rated_mah: Option<f32>) -> bool {
        self.capacity_mah()
            .zip(rated_mah)
            .is_none_or(|(learnt_mah, rated_mah)| {
                learnt_mah <= MAX_TO_RATED * rated_mah && rated_mah <= MAX_TO_RATED * learnt_mah
            })
    }

    /// Whether this adds nothing to `other` that would be worth a write to flash.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let has_like_charge = match (&self.charge, &other.charge) {
            (Some(charge), Some(other)) => charge.is_like(other),
            (charge, other) => charge == other,
        };
        has_like_charge && self.without_charge() == other.without_charge()
    }

    /// Without the last charge, which another charging has overtaken.
    pub(super) fn without_charge(&self) -> Self {
        Self {
            charge: None,
            ..*self
        }
    }

    /// The lessons of its drives.
    pub(super) fn lessons(&self) -> Lessons {
        Lessons {
            drives: self.drives,
            capacity: self.capacity,
            resistance: self.resistance,
            offsets: self.offsets,
            slow: self.slow,
        }
    }

    /// The pack after these lessons.
    pub(super) fn with_lessons(&self, lessons: &Lessons) -> Self {
        Self {
            drives: lessons.drives,
            capacity: lessons.capacity,
            resistance: lessons.resistance,
            offsets: lessons.offsets,
            slow: lessons.slow,
            ..*self
        }
    }

    /// Without a drive that its next rest would end.
    pub(super) fn without_open_lesson(&self) -> Self {
        Self { open: None, ..*self }
    }

    /// The knowledge under another scale of its measurements: values in ampere-hours and ohms are converted. Small offsets of the
    /// curve, and the voltage of a rest, do not outlast another scale of the voltage.
    ///
    /// `None` if it is the same, or differs by less than what is known of a voltage.
    pub(super) fn rescaled(&self, scale: &MeasuringScale) -> Option<Self> {
        let Some(before) = self.scale else {
            return Some(Self {
                scale: Some(*scale),
                ..*self
            });
        };
        if before == *scale {
            return None;
        }
        let nominal_v = self.chemistry.nominal_cell_voltage_v();
        let cells = f32::from(self.cell_count.max(1));
        let change_v = scale.voltage_change_v(&before, nominal_v * cells) / cells;
        let has_another_voltage = change_v.abs() > SAME_VOLTAGE_V;
        if !has_another_voltage && before.amperes_per_volt == scale.amperes_per_volt {
            return None;
        }
        // Without a factor no current is measured: another one follows.
        let by_current = match (before.amperes_per_volt, scale.amperes_per_volt) {
            (_, 0.0) => return None,
            (0.0, _) => 1.0,
            (before, now) => (now / before).abs(),
        };
        let mut rescaled = self.without_open_lesson();
        let mut by_voltage = 1.0;
        rescaled.scale = Some(MeasuringScale {
            amperes_per_volt: scale.amperes_per_volt,
            ..before
        });
        if has_another_voltage {
            by_voltage = scale.volt_multiplier / before.volt_multiplier;
            rescaled.offsets = Self::UNKNOWN.offsets;
            rescaled.charge = None;
            rescaled.scale = Some(*scale);
        }
        if let Some(capacity) = &mut rescaled.capacity {
            capacity.capacity_mah *= by_current;
            capacity.seen_mah *= by_current;
        }
        if let Some(LearntResistance { now_ohm, first_ohm }) = &mut rescaled.resistance {
            *now_ohm *= by_voltage / by_current;
            *first_ohm *= by_voltage / by_current;
        }
        rescaled.collapse = rescaled
            .collapse
            .and_then(|collapse| Collapse::new(collapse.soc(), collapse.ohm() * by_voltage / by_current));
        // Without implausible values.
        Self::from_words(&rescaled.to_words())
    }

    /// As words for flash. Parts that are not learnt are 0, but for the charge and the serial number.
    pub fn to_words(&self) -> [u32; LEARNT_WORDS] {
        let mut words = [0; LEARNT_WORDS];
        let [drives_low, drives_high] = self.drives.to_le_bytes();
        words[word::KIND] =
            u32::from_le_bytes([self.chemistry as u8, self.cell_count, drives_low, drives_high]);
        words[word::SERIAL_NUMBER] = self.serial_number.unwrap_or(NO_SERIAL_NUMBER) as u32;
        if let Some(capacity) = &self.capacity {
            words[word::CAPACITY_MAH] = capacity.capacity_mah.to_bits();
            words[word::CAPACITY_SIGMA] = capacity.sigma.to_bits();
            words[word::SEEN_MAH] = capacity.seen_mah.to_bits();
            words[word::SEEN_SIGMA] = capacity.seen_sigma.to_bits();
        }
        if let Some(resistance) = &self.resistance {
            words[word::NOW_OHM] = resistance.now_ohm.to_bits();
            words[word::FIRST_OHM] = resistance.first_ohm.to_bits();
        }
        words[word::SOC] = (-1.0_f32).to_bits();
        if let Some(charge) = &self.charge {
            words[word::SOC] = charge.soc.to_bits();
            words[word::SOC_SIGMA] = charge.sigma.to_bits();
            words[word::RESTING_V] = charge.resting_v.to_bits();
        }
        for (word, offset) in words.iter_mut().skip(word::CURVE).zip(self.offsets) {
            *word = offset.to_word();
        }
        if let Some(scale) = &self.scale {
            words[word::VOLT_MULTIPLIER] = scale.volt_multiplier.to_bits();
            words[word::VOLT_OFFSET_V] = scale.volt_offset_v.to_bits();
            words[word::AMPERES_PER_VOLT] = scale.amperes_per_volt.to_bits();
        }
        if let Some(slow) = &self.slow {
            words[word::SLOW_SHARE] = slow.share.to_bits();
            words[word::SLOW_SIGMA] = slow.sigma.to_bits();
        }
        if let Some(open) = self.open {
            for (word, open) in words.iter_mut().skip(word::OPEN_LESSON).zip(open.to_words()) {
                *word = open;
            }
        }
        if let Some(collapse) = self.collapse {
            let [soc, ohm] = collapse.to_numbers();
            words[word::COLLAPSE] = pair(soc, ohm);
        }
        words
    }

    /// `None` if no pack has these words; a part that no pack has is not learnt.
    pub fn from_words(words: &[u32; LEARNT_WORDS]) -> Option<Self> {
        let values = words.map(f32::from_bits);
        let [chemistry, cell_count, drives @ ..] = words[word::KIND].to_le_bytes();
        let serial_number = words[word::SERIAL_NUMBER] as i32;
        let mut offsets = [Offset::default(); OFFSET_POINTS];
        for (offset, word) in offsets.iter_mut().zip(words.iter().skip(word::CURVE)) {
            *offset = Offset::from_word(*word).unwrap_or_default();
        }
        let [open @ .., collapse]: &[u32; OPEN_LESSON_WORDS + 1] = words.last_chunk()?;
        Some(Self {
            chemistry: Chemistry::from_number(chemistry.into())?,
            cell_count,
            serial_number: (serial_number != NO_SERIAL_NUMBER).then_some(serial_number),
            drives: u16::from_le_bytes(drives),
            capacity: LearntCapacity {
                capacity_mah: values[word::CAPACITY_MAH],
                sigma: values[word::CAPACITY_SIGMA],
                seen_mah: values[word::SEEN_MAH],
                seen_sigma: values[word::SEEN_SIGMA],
            }
            .if_plausible(),
            resistance: LearntResistance {
                now_ohm: values[word::NOW_OHM],
                first_ohm: values[word::FIRST_OHM],
            }
            .if_plausible(),
            offsets,
            charge: LastCharge {
                soc: values[word::SOC],
                sigma: values[word::SOC_SIGMA],
                resting_v: values[word::RESTING_V],
            }
            .if_plausible(),
            slow: LearntSlowShare {
                share: values[word::SLOW_SHARE],
                sigma: values[word::SLOW_SIGMA],
            }
            .if_plausible(),
            scale: MeasuringScale {
                volt_multiplier: values[word::VOLT_MULTIPLIER],
                volt_offset_v: values[word::VOLT_OFFSET_V],
                amperes_per_volt: values[word::AMPERES_PER_VOLT],
            }
            .if_plausible(),
            open: OpenLesson::from_words(open),
            collapse: Collapse::from_numbers(halves_of(*collapse)),
        })
    }
}
