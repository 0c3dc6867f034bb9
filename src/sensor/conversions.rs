//! Conversions of the analog pins, and what a tick makes of those since the tick before.

use super::analog_pin::AnalogPin;
use crate::battery::{CurrentRange, ReadError};
use crate::time::Instant;

/// Full-scale code of the RP2040's 12-bit ADC.
pub const ADC_FULL_SCALE: u16 = 4095;

/// ADC reference, in volts: ADC_VREF on the board is the 3.3 V rail.
pub const ADC_REFERENCE_V: f32 = 3.3;

/// Tolerated share of conversions at full scale: spikes are part of a mean, while a mean of a signal that is cut off is wrong.
const TOLERATED_PERCENT: u32 = 1;

/// Whether this many of all `conversions` are more than may be at full scale, or fail.
pub(crate) fn exceeds_tolerance(count: u32, conversions: u32) -> bool {
    count * 100 > conversions * TOLERATED_PERCENT
}

/// A code of a 12-bit converter, 0 to [`ADC_FULL_SCALE`]; a mean of several has a fraction.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct AdcCount(pub f32);

impl AdcCount {
    /// The voltage at the pin, in volts.
    pub fn pin_voltage_v(self) -> f32 {
        self.0 * VOLTS_PER_COUNT
    }

    /// Whether it is near an end of the scale, as a broken or a shorted lead is.
    // Inlined, it would be repeated for each use.
    #[inline(never)]
    pub(super) fn is_near_rail(self) -> bool {
        let share = self.0 / f32::from(ADC_FULL_SCALE);
        !(RAIL_SHARE..=1.0 - RAIL_SHARE).contains(&share)
    }
}

/// Share of the scale at either end that is near a rail.
const RAIL_SHARE: f32 = 0.03;

const VOLTS_PER_COUNT: f32 = ADC_REFERENCE_V / ADC_FULL_SCALE as f32;

/// The conversions of one pin within a tick. There is at least one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conversions {
    sum: u32,
    count: u32,
    lowest: u16,
    highest: u16,
    at_full_scale: u32,
    below_half: u32,
}

impl Conversions {
    /// A single conversion, or any number with the same code, 0 to [`ADC_FULL_SCALE`].
    pub fn of(code: u16) -> Self {
        Self {
            sum: code.into(),
            count: 1,
            lowest: code,
            highest: code,
            at_full_scale: (code >= ADC_FULL_SCALE).into(),
            below_half: 0,
        }
    }

    /// `codes` from 0 to [`ADC_FULL_SCALE`], up to a million of them; `None` without any.
    pub fn from_codes(codes: impl Iterator<Item = u16> + Clone) -> Option<Self> {
        // As words, which the processor adds and compares without more ado.
        let (sum, count, lowest, highest) = codes.clone().fold(
            (0, 0, u32::from(u16::MAX), 0),
            |(sum, count, lowest, highest): (u32, u32, u32, u32), code| {
                let code = u32::from(code);
                (sum + code, count + 1, lowest.min(code), highest.max(code))
            },
        );
        let mut all = Self {
            sum,
            count,
            lowest: lowest as u16,
            highest: highest as u16,
            at_full_scale: 0,
            below_half: 0,
        };
        let half = all.highest / 2;
        // Seldom, so what is needed seldom is not counted each time.
        if all.highest >= ADC_FULL_SCALE || all.lowest < half {
            all.at_full_scale = codes.clone().filter(|code| *code >= ADC_FULL_SCALE).count() as u32;
            all.below_half = codes.filter(|code| *code < half).count() as u32;
        }
        (all.count > 0).then_some(all)
    }

    /// Number of conversions.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Their mean.
    pub fn mean(&self) -> AdcCount {
        AdcCount(self.sum as f32 / self.count as f32)
    }

    /// The lowest of them.
    pub fn lowest(&self) -> AdcCount {
        AdcCount(self.lowest.into())
    }

    /// The highest of them.
    pub fn highest(&self) -> AdcCount {
        AdcCount(self.highest.into())
    }

    /// Whether the signal stayed within the converter's range.
    pub fn range(&self) -> CurrentRange {
        if exceeds_tolerance(self.at_full_scale, self.count) {
            CurrentRange::Over
        } else {
            CurrentRange::Within
        }
    }

    /// The mean of a pack's voltage. No pack falls below half of its voltage within a tick: its contact was interrupted for a part
    /// of it, or made, and the lowest voltage is the one without contact.
    pub(super) fn voltage(&self) -> AdcCount {
        if exceeds_tolerance(self.below_half, self.count) {
            self.lowest()
        } else {
            self.mean()
        }
    }

    /// These conversions, if the voltage may be what they show.
    ///
    /// # Errors
    /// The signal was above the converter's range.
    pub fn within_range(self) -> Result<Self, ReadError> {
        match self.range() {
            CurrentRange::Within => Ok(self),
            _ => Err(ReadError::OverRange),
        }
    }
}

/// Sums over conversions of two pins that follow each other, for their covariance. In integers, they are exact.
#[derive(Clone, Copy, Debug, Default)]
pub struct PairSums {
    first: u32,
    second: u32,
    products: u64,
    count: u32,
}

impl PairSums {
    /// The most pairs that may be added at once: as many products of 12 bits by 12 fit into a word.
    pub const BLOCK: usize = 256;

    /// Adds up to [`Self::BLOCK`] pairs of codes from 0 to [`ADC_FULL_SCALE`].
    pub fn add(&mut self, pairs: impl Iterator<Item = (u16, u16)>) {
        let mut products = 0;
        for (first, second) in pairs {
            let (first, second) = (u32::from(first), u32::from(second));
            self.first += first;
            self.second += second;
            products += first * second;
            self.count += 1;
        }
        self.products += u64::from(products);
    }

    /// The covariance, in counts squared; `None` without any pair. Exact up to its conversion to a float: an offset of either
    /// pin does not matter.
    pub fn covariance(&self) -> Option<f32> {
        if self.count == 0 {
            return None;
        }
        let product_of_sums = u64::from(self.first) * u64::from(self.second);
        let scaled = (u64::from(self.count) * self.products) as i64 - product_of_sums as i64;
        let count = self.count as f32;
        Some(scaled as f32 / (count * count))
    }
}

/// The readings that are wanted of the converter: pins, and pairs of different pins, without an order, whose covariance is
/// wanted, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WantedReadings {
    /// A bit for each pin, in the order of [`AnalogPin::ALL`].
    pins: u8,
    /// A bit for each of [`PAIRS`].
    pairs: u8,
}

const PAIRS: [(AnalogPin, AnalogPin); PAIR_COUNT] = [
    (AnalogPin::Gp26, AnalogPin::Gp27),
    (AnalogPin::Gp26, AnalogPin::Gp28),
    (AnalogPin::Gp26, AnalogPin::Gp29),
    (AnalogPin::Gp27, AnalogPin::Gp28),
    (AnalogPin::Gp27, AnalogPin::Gp29),
    (AnalogPin::Gp28, AnalogPin::Gp29),
];

fn index_of_pair(one: AnalogPin, other: AnalogPin) -> Option<usize> {
    PAIRS
        .iter()
        .position(|pair| *pair == (one, other) || *pair == (other, one))
}

impl WantedReadings {
    /// Nothing.
    pub const NONE: Self = Self { pins: 0, pairs: 0 };

    /// That of one pin.
    pub fn of(pin: AnalogPin) -> Self {
        let mut wanted = Self::NONE;
        wanted.add(pin);
        wanted
    }

    /// Adds that of a pin.
    pub fn add(&mut self, pin: AnalogPin) {
        self.pins |= 1 << pin as u8;
    }

    /// Adds those of two pins, with their covariance.
    pub fn add_pair(&mut self, one: AnalogPin, other: AnalogPin) {
        self.add(one);
        self.add(other);
        if let Some(index) = index_of_pair(one, other) {
            self.pairs |= 1 << index;
        }
    }

    /// The pins.
    pub fn pins(self) -> impl Iterator<Item = AnalogPin> {
        let is_wanted = move |pin: &AnalogPin| self.pins & 1 << *pin as u8 != 0;
        AnalogPin::ALL.into_iter().filter(is_wanted)
    }

    /// The pairs, the pin with the lower number first.
    pub fn pairs(self) -> impl Iterator<Item = (AnalogPin, AnalogPin)> {
        let places = PAIRS.into_iter().enumerate();
        places.filter_map(move |(index, pair)| (self.pairs & 1 << index != 0).then_some(pair))
    }
}

const PIN_COUNT: usize = AnalogPin::ALL.len();
const PAIR_COUNT: usize = PIN_COUNT * (PIN_COUNT - 1) / 2;

/// Readings of the pins in one tick.
#[derive(Clone, Copy, Debug)]
pub struct AnalogReadings {
    pins: [Result<Conversions, ReadError>; PIN_COUNT],
    /// In the order of [`PAIRS`].
    covariances: [Option<f32>; PAIR_COUNT],
}

impl AnalogReadings {
    /// No pin was read.
    pub const NONE: Self = Self::failed(ReadError::NoPin);

    /// No pin could be read, for this reason.
    pub const fn failed(error: ReadError) -> Self {
        Self {
            pins: [Err(error); PIN_COUNT],
            covariances: [None; PAIR_COUNT],
        }
    }

    /// Sets the reading of a pin.
    pub fn set(&mut self, pin: AnalogPin, reading: Result<Conversions, ReadError>) {
        if let Some(place) = self.pins.get_mut(pin as usize) {
            *place = reading;
        }
    }

    /// Sets the covariance of two pins, in counts squared.
    pub fn set_covariance(&mut self, one: AnalogPin, other: AnalogPin, covariance: Option<f32>) {
        let index = index_of_pair(one, other);
        if let Some(place) = index.and_then(|index| self.covariances.get_mut(index)) {
            *place = covariance;
        }
    }

    /// Reading of a pin.
    ///
    /// # Errors
    /// The read failed, or the pin was not read.
    pub fn pin(&self, pin: AnalogPin) -> Result<Conversions, ReadError> {
        self.pins
            .get(pin as usize)
            .copied()
            .unwrap_or(Err(ReadError::NoPin))
    }

    /// Covariance of the voltages at two pins, in volts squared, if it was computed.
    pub fn covariance_v2(&self, one: AnalogPin, other: AnalogPin) -> Option<f32> {
        let counts = self.covariances.get(index_of_pair(one, other)?)?;
        counts.map(|counts| counts * (VOLTS_PER_COUNT * VOLTS_PER_COUNT))
    }
}

/// Whether an analog pin is pulled up while it is in use: then a broken lead is one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum PinPull {
    /// A pull would bend a divider's ratio.
    #[default]
    None,
    /// By the pad's resistor of some 60 kΩ.
    Up,
}

/// Analog pins behind a converter that converts them in turn, without a pause.
pub trait AnalogIn {
    /// Reads what was converted since the last call, or since the start, and before `until`, which is at most
    /// [`LATEST_READING_US`] ago. A converter that has failed has begun again when this returns.
    fn read(&mut self, until: Instant, wanted: WantedReadings) -> AnalogReadings;

    /// Pulls `pin` like this from now on, if it can be pulled.
    fn pull(&mut self, _pin: AnalogPin, _pull: PinPull) {}
}

/// A tick that begins later than this, in microseconds, takes everything up to its beginning.
pub const LATEST_READING_US: u64 = 20_000;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    // Requirement: FR-11
    fn a_mean_keeps_its_fraction() {
        let conversions = Conversions::from_codes([1000, 1001, 1001, 1000, 1001].into_iter()).unwrap();
        assert_eq!(conversions.mean(), AdcCount(1000.6));
        assert_eq!(
            (conversions.lowest(), conversions.highest()),
            (AdcCount(1000.0), AdcCount(1001.0))
        );
        assert_eq!(Conversions::from_codes([].into_iter()), None);
    }

    #[test]
    fn more_than_one_conversion_in_a_hundred_at_full_scale_is_over_range() {
        let with = |at_full_scale: usize| {
            let codes = (0..400).map(|index| if index < at_full_scale { 4095 } else { 4094 });
            Conversions::from_codes(codes).unwrap().range()
        };
        assert_eq!(with(0), CurrentRange::Within);
        assert_eq!(with(4), CurrentRange::Within);
        assert_eq!(with(5), CurrentRange::Over);
        assert_eq!(with(400), CurrentRange::Over);
        let full_scale = Conversions::of(ADC_FULL_SCALE);
        assert_eq!(full_scale.within_range(), Err(ReadError::OverRange));
    }

    #[test]
    fn pairs_have_no_order_and_a_pin_is_no_pair_with_itself() {
        let mut wanted = WantedReadings::NONE;
        wanted.add_pair(AnalogPin::Gp26, AnalogPin::Gp26);
        assert_eq!(wanted, WantedReadings::of(AnalogPin::Gp26));
        wanted.add_pair(AnalogPin::Gp29, AnalogPin::Gp27);
        wanted.add_pair(AnalogPin::Gp27, AnalogPin::Gp29);
        assert_eq!(
            wanted.pairs().collect::<Vec<_>>(),
            [(AnalogPin::Gp27, AnalogPin::Gp29)]
        );
        assert_eq!(
            wanted.pins().collect::<Vec<_>>(),
            [AnalogPin::Gp26, AnalogPin::Gp27, AnalogPin::Gp29]
        );
        let mut readings = AnalogReadings::NONE;
        readings.set_covariance(AnalogPin::Gp29, AnalogPin::Gp27, Some(4.0));
        let covariance_v2 = readings.covariance_v2(AnalogPin::Gp27, AnalogPin::Gp29);
        assert_eq!(covariance_v2, Some(4.0 * AdcCount(1.0).pin_voltage_v().powi(2)));
    }

    #[test]
    fn a_voltage_that_was_there_for_a_part_of_the_tick_is_that_without_contact() {
        let voltage = |without_contact: usize| {
            let codes = (0..400).map(|index| if index < without_contact { 90 } else { 2500 });
            Conversions::from_codes(codes).unwrap().voltage()
        };
        assert_eq!(voltage(5), AdcCount(90.0));
        assert_eq!(voltage(399), AdcCount(90.0));
        // Single conversions are noise.
        assert_eq!(voltage(4), AdcCount((4.0 * 90.0 + 396.0 * 2500.0) / 400.0));
        assert_eq!(voltage(0), AdcCount(2500.0));
    }

    proptest! {
        /// The covariance is that of the definition, whatever the offsets are.
        #[test]
        fn covariance_does_not_depend_on_offsets(
            codes in prop::collection::vec((0u16..2048, 0u16..2048), 1..512),
            offsets in (0u16..2048, 0u16..2048),
        ) {
            let shifted = codes.iter().map(|(first, second)| (first + offsets.0, second + offsets.1));
            let count = codes.len() as f64;
            let mean = |value: fn(&(u16, u16)) -> u16| {
                codes.iter().map(|pair| f64::from(value(pair))).sum::<f64>() / count
            };
            let (first, second) = (mean(|pair| pair.0), mean(|pair| pair.1));
            let products = codes.iter().map(|pair| (f64::from(pair.0) - first) * (f64::from(pair.1) - second));
            let expected = (products.sum::<f64>() / count) as f32;
            let shifted: Vec<_> = shifted.collect();
            let mut sums = PairSums::default();
            for block in shifted.chunks(PairSums::BLOCK) {
                sums.add(block.iter().copied());
            }
            let found = sums.covariance().unwrap();
            prop_assert!((found - expected).abs() <= 1e-5 * expected.abs().max(1.0), "{found} {expected}");
        }
    }
}
