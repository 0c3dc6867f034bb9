//! Random delays, so that nodes that start together do not keep on sending together.

/// Pseudo-random numbers: xorshift of 32 bits (Marsaglia, *Xorshift RNGs*, 2003).
#[derive(Clone, Copy, Debug)]
pub(super) struct Random(u32);

impl Random {
    /// Another sequence for each seed.
    pub fn seeded(seed: u32) -> Self {
        // 0 would stay 0.
        Self(seed | 1)
    }

    /// The next number.
    pub fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// The next duration of `least_ms` to `most_ms` milliseconds, in microseconds.
    pub fn delay_us(&mut self, least_ms: u32, most_ms: u32) -> u64 {
        let range = (most_ms - least_ms).max(1);
        u64::from(least_ms + self.next() % range) * 1000
    }
}
