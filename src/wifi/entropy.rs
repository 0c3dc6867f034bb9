//! Random numbers of a ring oscillator.

use sha2::{Digest, Sha256};

/// Samples for one result: for the 60 bits of a password also where the jitter is a thousandth of a period at 1.8 MHz, and an
/// attacker knows the oscillator's phase before each.
const SAMPLES: u32 = 8192;

/// Processor cycles between two samples at least, at 125 MHz 8 µs: the Pico SDK's `pico_rand` waits 10 µs a bit, as the oscillator
/// is about as fast as it can be read.
const LEAST_CYCLES: u32 = 1000;

/// By up to this many more they vary: at a multiple of its period an oscillator would seem to stand still.
const VARIED_CYCLES: u32 = 512;

/// Collects samples of an oscillator, and whatever else is noisy.
pub struct EntropyPool {
    hash: Sha256,
    samples: u32,
    changes: u32,
    last: Option<bool>,
    /// Eight samples, then they are hashed.
    byte: u8,
    random: u32,
}

impl EntropyPool {
    /// An empty one.
    pub fn new() -> Self {
        Self {
            hash: Sha256::new(),
            samples: 0,
            changes: 0,
            last: None,
            byte: 0,
            random: 0x5eed_1234,
        }
    }

    /// Processor cycles to wait before the next sample.
    pub fn next_pause_cycles(&mut self) -> u32 {
        // Numerical Recipes' generator; its high bits are the good ones.
        self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        LEAST_CYCLES + (self.random >> 16) % VARIED_CYCLES
    }

    /// Takes a sample of the oscillator.
    pub fn add(&mut self, sample: bool) {
        self.changes += u32::from(self.last.replace(sample).is_some_and(|last| last != sample));
        self.byte = self.byte << 1 | u8::from(sample);
        self.samples += 1;
        if self.samples.is_multiple_of(u8::BITS) {
            self.hash.update([self.byte]);
        }
    }

    /// Mixes in what may be noisy, too: it can't make the result easier to guess.
    pub fn mix(&mut self, words: &[u32]) {
        for word in words {
            self.hash.update(word.to_le_bytes());
        }
    }

    /// Whether there are enough samples.
    pub fn is_full(&self) -> bool {
        self.samples >= SAMPLES
    }

    /// 32 bytes; `None` if the oscillator has shown one value all the time, or two in turns: it stands still.
    pub fn finish(self) -> Option<[u8; 32]> {
        let stands_still = self.changes == 0 || self.changes + 1 >= self.samples;
        (!stands_still).then(|| self.hash.finalize().into())
    }
}

impl Default for EntropyPool {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROCESSOR_HZ: f64 = 125e6;

    /// Pseudo-random numbers with a normal distribution, for jitter.
    struct Noise(u64);

    impl Noise {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
        }
    }

    /// Samples of an oscillator.
    struct Sampled {
        samples: Vec<bool>,
        /// Bits of min-entropy for someone who knows the phase before each sample.
        unknown_bits: f64,
        result: Option<[u8; 32]>,
    }

    /// Probability that a normally distributed number is less than this (Abramowitz and Stegun, 26.2.17).
    fn normal_below(x: f64) -> f64 {
        let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
        let polynomial = [
            1.330_274_429,
            -1.821_255_978,
            1.781_477_937,
            -0.356_563_782,
            0.319_381_530,
        ];
        let tail = polynomial.iter().fold(0.0, |sum, factor| (sum + factor) * t) * (-x * x / 2.0).exp()
            / std::f64::consts::TAU.sqrt();
        if x < 0.0 { tail } else { 1.0 - tail }
    }

    /// Samples a square wave whose periods vary by this share of a period (standard deviation).
    fn sampled(frequency_hz: f64, jitter: f64, seed: u64) -> Sampled {
        let mut noise = Noise(seed);
        let mut pool = EntropyPool::new();
        let (mut phase, mut samples, mut unknown_bits) = (noise.uniform(), Vec::new(), 0.0);
        while !pool.is_full() {
            // Reading takes some cycles, too.
            let periods = f64::from(pool.next_pause_cycles() + 30) / PROCESSOR_HZ * frequency_hz;
            let deviation = jitter * periods.sqrt();
            let edge_distance = ((phase + periods).rem_euclid(0.5) - 0.25).abs() - 0.25;
            unknown_bits -= normal_below(-edge_distance / deviation).log2();
            phase += periods + noise.normal() * deviation;
            let sample = phase.rem_euclid(1.0) < 0.5;
            pool.add(sample);
            samples.push(sample);
        }
        Sampled {
            samples,
            unknown_bits,
            result: pool.finish(),
        }
    }

    /// Bits of min-entropy of a sample by the Markov estimate (NIST SP 800-90B, 6.3.3).
    fn markov_estimate(samples: &[bool]) -> f64 {
        let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
        let ones = samples.iter().filter(|sample| **sample).count();
        let first = [
            share(samples.len() - ones, samples.len()),
            share(ones, samples.len()),
        ];
        let next = [false, true].map(|from| {
            let followers = samples.windows(2).filter(|pair| pair[0] == from);
            let (mut all, mut set) = (0, 0);
            followers.for_each(|pair| {
                all += 1;
                set += usize::from(pair[1]);
            });
            [share(all - set, all), share(set, all)]
        });
        let log = |first: f64, steps: &[(f64, i32)]| {
            first.log2()
                + steps
                    .iter()
                    .map(|(p, times)| p.log2() * f64::from(*times))
                    .sum::<f64>()
        };
        let likeliest = [
            log(first[0], &[(next[0][0], 127)]),
            log(first[0], &[(next[0][1], 64), (next[1][0], 63)]),
            log(first[0], &[(next[0][1], 1), (next[1][1], 126)]),
            log(first[1], &[(next[1][0], 1), (next[0][0], 126)]),
            log(first[1], &[(next[1][0], 64), (next[0][1], 63)]),
            log(first[1], &[(next[1][1], 127)]),
        ];
        let most = likeliest.into_iter().fold(f64::NEG_INFINITY, f64::max);
        (-most / 128.0).min(1.0)
    }

    #[test]
    // Requirement: R-12
    fn an_oscillator_of_any_frequency_gives_a_password() {
        for jitter in [0.001, 0.01] {
            let (mut least_unknown, mut least_markov) = (f64::INFINITY, f64::INFINITY);
            for step in 0..=142 {
                let frequency_hz = 1.8e6 + 0.1e6 * f64::from(step);
                let sampled = sampled(frequency_hz, jitter, step as u64);
                assert!(sampled.result.is_some(), "{frequency_hz} Hz, jitter {jitter}");
                let markov = markov_estimate(&sampled.samples) * sampled.samples.len() as f64;
                least_markov = least_markov.min(markov);
                least_unknown = least_unknown.min(sampled.unknown_bits);
            }
            println!(
                "jitter {jitter}: {least_markov:.0} bits by the Markov estimate, {least_unknown:.0} with the phase known"
            );
            assert!(least_markov >= 60.0 && least_unknown >= 60.0);
        }
    }

    #[test]
    fn an_oscillator_that_stands_still_or_alternates_gives_none() {
        for wave in [|_| false, |_| true, |sample: u32| sample.is_multiple_of(2)] {
            let mut pool = EntropyPool::new();
            (0..SAMPLES).for_each(|sample| pool.add(wave(sample)));
            assert!(pool.is_full());
            assert_eq!(pool.finish(), None);
        }
    }

    #[test]
    fn each_sample_and_what_is_mixed_in_count() {
        let result = |changed: u32, word: u32| {
            let mut pool = EntropyPool::new();
            (0..SAMPLES).for_each(|sample| pool.add((sample % 3 == 0) != (sample == changed)));
            pool.mix(&[word]);
            pool.finish()
        };
        let mut results: Vec<_> = (0..SAMPLES).map(|changed| result(changed, 1)).collect();
        results.extend([result(SAMPLES, 1), result(SAMPLES, 2)]);
        let count = results.len();
        results.sort();
        results.dedup();
        assert_eq!(results.len(), count);
    }
}
