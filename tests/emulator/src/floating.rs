//! The level of an input that nothing drives and nothing pulls: noise, for a seed the same in every run.

use super::clock::{Cycle, cycles};
use super::random::Random;

/// How long the level stays at least: some bits at 115,200 baud, so that a receiver finds breaks and bytes without stop bits.
const STEP: Cycle = cycles(30);

#[derive(Clone, Copy, Debug, Default)]
pub struct Floating {
    seed: u64,
}

impl Floating {
    pub fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// 32 inputs at a time.
    pub fn levels_at(self, time: Cycle) -> u32 {
        Random::new(self.seed ^ (time / STEP)).next_u64() as u32
    }

    /// When the levels may change after `time`.
    pub fn next_change(self, time: Cycle) -> Cycle {
        (time / STEP + 1) * STEP
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_low_as_often_as_high_and_never_for_long() {
        let floating = Floating::new(3);
        let levels: Vec<u32> = (0..1000)
            .map(|step| floating.levels_at(step * STEP) & 1)
            .collect();
        let high: u32 = levels.iter().sum();
        assert!((400..600).contains(&high), "{high}");
        assert!(
            levels
                .windows(30)
                .all(|some| some.contains(&0) && some.contains(&1))
        );
    }
}
