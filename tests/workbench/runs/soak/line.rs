//! The line to the board, and what happens to bytes on it.

use emulator::Random;

/// Of each data bit. Start and stop bits arrive.
const BIT_ERROR_RATE: f64 = 1e-3;
const LOSS_RATE: f64 = 1e-2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    Clean,
    Noisy,
    Lossy,
    /// Another sender uses it, too.
    Shared,
    /// Nothing arrives.
    Dead,
}

/// The line to the board.
pub struct Line {
    pub condition: Condition,
    pub random: Random,
}

impl Line {
    pub fn new(random: Random) -> Self {
        Self {
            condition: Condition::Clean,
            random,
        }
    }

    /// What arrives of `bytes`.
    pub fn carry(&mut self, bytes: &[u8]) -> Vec<u8> {
        match self.condition {
            Condition::Clean | Condition::Shared => bytes.to_vec(),
            Condition::Noisy => bytes.iter().map(|byte| byte ^ self.flipped_bits()).collect(),
            Condition::Dead => Vec::new(),
            Condition::Lossy => {
                let arrives = |_: &u8| self.random.unit() >= LOSS_RATE;
                bytes.iter().copied().filter(arrives).collect()
            }
        }
    }

    fn flipped_bits(&mut self) -> u8 {
        let mut flips = || u8::from(self.random.unit() < BIT_ERROR_RATE);
        (0..8).fold(0, |mask, bit| mask | flips() << bit)
    }
}
