//! Reads a ring into which a converter's results are brought without a pause, channel after channel.

use core::sync::atomic::{AtomicU16, Ordering};

use super::ring_reader::RingReader;
use crate::battery::ReadError;
use crate::sensor::{AnalogPin, AnalogReadings, Conversions, PairSums, WantedReadings, exceeds_tolerance};
use crate::time::Instant;

/// Clock of the RP2040's converter, in hertz.
pub const ADC_CLOCK_HZ: u64 = 48_000_000;

/// Cycles of that from one conversion to the next: 61.125 µs, and 244.5 µs for a pin, of which 100 ms hold 409. Within a tick
/// the motors' PWM has 50 periods: 409 shares no factor with that, so a pin is converted at as many phases, evenly spread.
pub const CONVERSION_CYCLES: u64 = 2_934;

const NS_PER_CONVERSION: u64 = CONVERSION_CYCLES * 1_000_000_000 / ADC_CLOCK_HZ;

/// Channels that are converted in turn, in the order of the analog pins.
pub const CHANNELS: usize = AnalogPin::ALL.len();

/// Conversions that the ring holds: 125 ms, a tick and a quarter.
pub const RING_CONVERSIONS: usize = 2048;

const PLACE_MASK: usize = RING_CONVERSIONS - 1;

/// The highest code. A word of the FIFO is above it if its conversion failed: bit 15 is set then (RP2040 datasheet, ADC FIFO
/// register, ERR).
const HIGHEST_CODE: u16 = 0xfff;

/// Reading position in the ring, and the time up to which it was read.
#[derive(Debug)]
pub struct ConversionRing {
    reader: RingReader,
    read_until: Instant,
}

type Round = [AtomicU16; CHANNELS];

/// Whole rounds of conversions in the ring, each with one of every channel: older ones, and those that follow from the ring's
/// beginning on.
#[derive(Clone, Copy, Debug)]
struct Rounds<'a> {
    older: &'a [Round],
    newer: &'a [Round],
}

impl ConversionRing {
    /// For a ring into which nothing was brought before `now`.
    pub const fn starting_at(now: Instant) -> Self {
        Self {
            reader: RingReader::new(RING_CONVERSIONS as u32),
            read_until: now,
        }
    }

    /// Reads the conversions since the last call and before `until`, of `written` until `now`, modulo the reader's period. A
    /// late caller reads what the ring still holds.
    ///
    /// # Errors
    /// [`ReadError::Timeout`]: fewer than half of the conversions are there that the time has room for.
    pub fn read(
        &mut self,
        words: &[AtomicU16; RING_CONVERSIONS],
        written: u32,
        now: Instant,
        until: Instant,
        wanted: WantedReadings,
    ) -> Result<AnalogReadings, ReadError> {
        let later = conversions_in(now.us_since(until)) as u32;
        let expected = conversions_in(until.us_since(self.read_until));
        self.read_until = until;
        let (end, unread) = self.reader.skip_rounds(written, later, CHANNELS as u32);
        if u64::from(unread) * 2 < expected {
            return Err(ReadError::Timeout);
        }
        let unread = (unread as usize).min(RING_CONVERSIONS);
        let end = end as usize & PLACE_MASK;
        Ok(Rounds::ending_at(words, end, unread).readings(wanted))
    }
}

/// Conversions, of all channels, that this time has room for.
fn conversions_in(us: u64) -> u64 {
    us.saturating_mul(1000) / NS_PER_CONVERSION
}

impl<'a> Rounds<'a> {
    /// The last `conversions` before a place in the ring. Both are multiples of a round.
    fn ending_at(words: &'a [AtomicU16; RING_CONVERSIONS], end: usize, conversions: usize) -> Self {
        let (rounds, _) = words.as_chunks();
        let (before, behind) = rounds.split_at_checked(end / CHANNELS).unwrap_or((rounds, &[]));
        let count = conversions / CHANNELS;
        let newer = count.min(before.len());
        Self {
            older: last_of(behind, count - newer),
            newer: last_of(before, newer),
        }
    }

    fn readings(&self, wanted: WantedReadings) -> AnalogReadings {
        let mut readings = AnalogReadings::NONE;
        for pin in wanted.pins() {
            readings.set(pin, self.conversions(pin));
        }
        for (first, second) in wanted.pairs() {
            readings.set_covariance(first, second, self.covariance(first, second));
        }
        readings
    }

    /// Conversions of a pin, without failed ones.
    // Once, and not for each use.
    #[inline(never)]
    fn conversions(&self, pin: AnalogPin) -> Result<Conversions, ReadError> {
        let good = self.of_channel(pin as usize).filter(|word| *word <= HIGHEST_CODE);
        let conversions = Conversions::from_codes(good);
        let all = self.older.len() + self.newer.len();
        let failed = all as u32 - conversions.map_or(0, |conversions| conversions.count());
        if exceeds_tolerance(failed, all as u32) {
            return Err(ReadError::Conversion);
        }
        conversions.ok_or(ReadError::Timeout)
    }

    /// Of the conversions of two pins in the same rounds.
    #[inline(never)]
    fn covariance(&self, first: AnalogPin, second: AnalogPin) -> Option<f32> {
        let mut sums = PairSums::default();
        let blocks = [self.older, self.newer].into_iter();
        for block in blocks.flat_map(|rounds| rounds.chunks(PairSums::BLOCK)) {
            sums.add(block.iter().filter_map(|round| {
                let word = |pin: AnalogPin| Some(round.get(pin as usize)?.load(Ordering::Relaxed));
                let (first, second) = (word(first)?, word(second)?);
                (first.max(second) <= HIGHEST_CODE).then_some((first, second))
            }));
        }
        sums.covariance()
    }

    fn of_channel(&self, channel: usize) -> impl Iterator<Item = u16> + Clone {
        let rounds = self.older.iter().chain(self.newer);
        rounds.filter_map(move |round| Some(round.get(channel)?.load(Ordering::Relaxed)))
    }
}

/// The last `count` of some rounds, or all.
fn last_of(rounds: &[Round], count: usize) -> &[Round] {
    let skipped = rounds.len().saturating_sub(count);
    rounds.get(skipped..).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::battery::CurrentRange;
    use crate::time::at_us;

    fn all_pins() -> WantedReadings {
        let mut wanted = WantedReadings::NONE;
        AnalogPin::ALL.into_iter().for_each(|pin| wanted.add(pin));
        wanted
    }

    const PWM_PERIOD_CYCLES: u64 = 96_000;
    const TICK_US: u64 = 100_000;

    /// A ring, and a converter whose pins have these codes as a function of the number of the conversion.
    struct Converter<F> {
        words: [AtomicU16; RING_CONVERSIONS],
        ring: ConversionRing,
        written: u64,
        word_of: F,
    }

    impl<F: Fn(u64) -> u16> Converter<F> {
        fn new(word_of: F) -> Self {
            Self {
                words: [const { AtomicU16::new(0) }; RING_CONVERSIONS],
                ring: ConversionRing::starting_at(at_us(0)),
                written: 0,
                word_of,
            }
        }

        /// Converts up to `us`.
        fn convert_until(&mut self, us: u64) {
            while self.written < conversions_in(us) {
                let word = (self.word_of)(self.written);
                self.words[self.written as usize % RING_CONVERSIONS].store(word, Ordering::Relaxed);
                self.written += 1;
            }
        }

        fn read(
            &mut self,
            now_us: u64,
            until_us: u64,
            wanted: WantedReadings,
        ) -> Result<AnalogReadings, ReadError> {
            self.convert_until(now_us);
            let written = (self.written % u64::from(super::super::COUNT_PERIOD)) as u32;
            self.ring
                .read(&self.words, written, at_us(now_us), at_us(until_us), wanted)
        }

        fn means(&mut self, now_us: u64, until_us: u64) -> [f32; CHANNELS] {
            let readings = self.read(now_us, until_us, all_pins()).expect("readings");
            AnalogPin::ALL.map(|pin| readings.pin(pin).expect("a reading").mean().0)
        }
    }

    /// The channel of a conversion.
    fn channel(number: u64) -> u16 {
        (number % CHANNELS as u64) as u16
    }

    /// The largest error of the share of a pulse with a period of the PWM's, over all duties and phases, when a pin is converted
    /// this many times.
    fn worst_error(conversions: u64) -> f64 {
        let spacing = CONVERSION_CYCLES * CHANNELS as u64;
        let mut phases: Vec<u64> = (0..conversions)
            .map(|index| index * spacing % PWM_PERIOD_CYCLES)
            .collect();
        phases.sort_unstable();
        let (count, period) = (conversions as f64, PWM_PERIOD_CYCLES as f64);
        // The worst pulses begin or end just beside a conversion.
        let deviations = phases
            .iter()
            .enumerate()
            .map(|(index, phase)| index as f64 / count - *phase as f64 / period);
        let (lowest, highest) = deviations.fold((f64::MAX, f64::MIN), |(lowest, highest), deviation| {
            (lowest.min(deviation), highest.max(deviation))
        });
        highest - lowest + 1.0 / count
    }

    #[test]
    fn the_pace_gives_the_share_of_any_pulse_within_3_per_mille() {
        let spacing = CONVERSION_CYCLES * CHANNELS as u64;
        let tick_cycles = TICK_US * ADC_CLOCK_HZ / 1_000_000;
        let in_a_tick = (tick_cycles + spacing / 2) / spacing;
        assert_eq!(in_a_tick, 409);
        let error = worst_error(in_a_tick);
        assert!(error <= 0.003, "{error}");
        // At the edge of a tick there is now and then one less or more.
        for conversions in [in_a_tick - 1, in_a_tick + 1] {
            let error = worst_error(conversions);
            assert!(error <= 0.006, "{conversions}: {error}");
        }
    }

    /// A pack that supplies one to four motors, whose pulses begin at these places of a period.
    #[test]
    fn the_current_of_motors_that_are_switched_is_that_of_their_duty() {
        const IN_STEP: [u64; 4] = [0; 4];
        const STAGGERED: [u64; 4] = [
            0,
            PWM_PERIOD_CYCLES / 2,
            PWM_PERIOD_CYCLES / 4,
            PWM_PERIOD_CYCLES * 3 / 4,
        ];
        const COUNTS_PER_MOTOR: u64 = 1000;
        let mut worst = [0.0f32; 2];
        for (offsets, worst) in [IN_STEP, STAGGERED].iter().zip(&mut worst) {
            for (duty, phase) in (1..=16).flat_map(|duty| (0..48).map(move |phase| (duty, phase))) {
                let on_cycles = PWM_PERIOD_CYCLES * duty / 16;
                for motors in 1..=4 {
                    let word_of = |number: u64| {
                        let at = number * CONVERSION_CYCLES + phase * PWM_PERIOD_CYCLES / 48;
                        let is_on = |offset: &&u64| (at + **offset) % PWM_PERIOD_CYCLES < on_cycles;
                        let on = offsets[..motors].iter().filter(is_on).count() as u64;
                        (on * COUNTS_PER_MOTOR) as u16
                    };
                    let mut converter = Converter::new(word_of);
                    let mean = converter.means(TICK_US, TICK_US)[1];
                    let expected = (motors as u64 * COUNTS_PER_MOTOR * duty) as f32 / 16.0;
                    *worst = worst.max((mean - expected).abs() / (motors as u64 * COUNTS_PER_MOTOR) as f32);
                }
            }
        }
        assert!(worst[0] < 0.006 && worst[1] < 0.006, "{worst:?}");
    }

    #[test]
    fn each_pin_has_the_mean_of_its_own_conversions() {
        let mut converter = Converter::new(|number| 1000 * channel(number) + (number / 4 % 2) as u16);
        for tick in 1..100 {
            let now_us = tick * TICK_US;
            let means = converter.means(now_us + tick * 37 % 900, now_us);
            for (pin, mean) in means.into_iter().enumerate() {
                let expected = 1000.0 * pin as f32 + 0.5;
                assert!((mean - expected).abs() < 0.002, "{tick}: {means:?}");
            }
        }
    }

    #[test]
    fn a_late_tick_ends_when_it_was_due() {
        // It rises at 100 ms.
        let rise = conversions_in(TICK_US) / 4 * 4;
        let mut converter = Converter::new(|number| if number < rise { 100 } else { 200 });
        let means = [(TICK_US + 20_000, TICK_US), (2 * TICK_US, 2 * TICK_US)]
            .map(|(now_us, until_us)| converter.means(now_us, until_us)[0]);
        // Within a round of conversions.
        assert!(
            (means[0] - 100.0).abs() < 0.3 && (means[1] - 200.0).abs() < 0.3,
            "{means:?}"
        );
    }

    #[test]
    fn a_very_late_tick_has_the_mean_of_what_the_ring_holds() {
        let mut converter = Converter::new(|number| if number < 16_000 { 100 } else { 200 });
        assert_eq!(converter.means(5_000_000, 5_000_000), [200.0; CHANNELS]);
        assert_eq!(converter.means(5_100_000, 5_100_000), [200.0; CHANNELS]);
    }

    #[test]
    fn a_converter_that_has_stopped_is_noticed_in_the_same_tick() {
        let mut converter = Converter::new(|_| 2000);
        assert!(converter.read(TICK_US, TICK_US, all_pins()).is_ok());
        converter.convert_until(140_000);
        let (words, written) = (&converter.words, converter.written as u32);
        let failed = converter
            .ring
            .read(words, written, at_us(200_000), at_us(200_000), all_pins());
        assert_eq!(failed.err(), Some(ReadError::Timeout));
    }

    #[test]
    fn failed_conversions_are_left_out_and_more_than_one_in_a_hundred_fail_the_pin() {
        for (one_in, is_valid) in [(103, true), (99, false)] {
            let word_of = move |number: u64| match channel(number) == 1 && (number / 4).is_multiple_of(one_in)
            {
                true => 1 << 15 | 7,
                false => 3000,
            };
            let mut converter = Converter::new(word_of);
            let readings = converter.read(TICK_US, TICK_US, all_pins()).unwrap();
            let means = AnalogPin::ALL.map(|pin| readings.pin(pin).map(|reading| reading.mean().0));
            let expected = if is_valid {
                Ok(3000.0)
            } else {
                Err(ReadError::Conversion)
            };
            assert_eq!(means, [Ok(3000.0), expected, Ok(3000.0), Ok(3000.0)]);
        }
    }

    #[test]
    fn full_scale_of_a_few_conversions_is_part_of_the_mean() {
        let mut converter = Converter::new(|number| if number / 4 % 200 == 0 { 4095 } else { 4000 });
        let readings = converter.read(TICK_US, TICK_US, all_pins()).unwrap();
        let reading = readings.pin(AnalogPin::Gp28).unwrap();
        assert_eq!(reading.range(), CurrentRange::Within);
        assert!(reading.mean().0 > 4000.0 && reading.highest().0 == 4095.0);
    }

    #[test]
    fn every_pair_of_pins_has_the_covariance_of_neighbouring_conversions() {
        // All pins step at the same time, between two rounds.
        let mut converter = Converter::new(|number| 100 * channel(number) + 300 * (number / 128 % 2) as u16);
        let mut wanted = WantedReadings::NONE;
        for one in AnalogPin::ALL {
            for other in AnalogPin::ALL {
                wanted.add_pair(one, other);
            }
        }
        let readings = converter.read(TICK_US, TICK_US, wanted).unwrap();
        assert_eq!(wanted.pairs().count(), 6);
        for (one, other) in wanted.pairs() {
            let covariance_v2 = readings.covariance_v2(one, other).expect("computed");
            let counts = 3.3 / 4095.0;
            let covariance = covariance_v2 / (counts * counts);
            assert!(
                (covariance - 22_500.0).abs() < 1500.0,
                "{one:?} {other:?}: {covariance}"
            );
        }
    }

    proptest! {
        /// Whatever ticks are late by, every conversion counts once, or was overwritten: what was drawn is what is counted.
        #[test]
        fn the_charge_of_ticks_is_that_of_all_conversions(
            late_us in prop::collection::vec(0u64..20_000, 1..60),
            seed in any::<u64>(),
        ) {
            // Multiples of the golden ratio: no seed makes a ramp of them, of which some would be overwritten.
            let noise = move |number: u64| {
                (number.wrapping_add(seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as u16 & HIGHEST_CODE
            };
            let mut converter = Converter::new(noise);
            let mut counted = 0.0;
            for (tick, late_us) in (1..).zip(&late_us) {
                let due_us = tick * TICK_US;
                counted += f64::from(converter.means(due_us + late_us, due_us)[2]);
            }
            let ticks = late_us.len() as u64;
            let all = (0..conversions_in(ticks * TICK_US) / 4).map(|round| f64::from(noise(4 * round + 2)));
            let expected = all.clone().sum::<f64>() / all.count() as f64 * ticks as f64;
            prop_assert!((counted / expected - 1.0).abs() < 0.003, "{counted} {expected}");
        }
    }
}
