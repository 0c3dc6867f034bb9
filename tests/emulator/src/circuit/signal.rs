//! The levels at the pins of the bridges, ahead of time.

use super::super::clock::{Cycle, NEVER};
use super::super::pwm::Slice;

/// The drive of a pin as long as no register is written.
#[derive(Clone, Copy, Debug)]
pub enum PinSignal {
    Level(bool),
    /// An output of a slice as it was at some moment: what comes later follows from that.
    Pwm {
        slice: Slice,
        channel: usize,
    },
}

impl PinSignal {
    /// The level at `now`. Time does not go back.
    pub fn level(&mut self, now: Cycle) -> bool {
        match self {
            Self::Level(level) => *level,
            Self::Pwm { slice, channel } => {
                slice.advance(now);
                slice.level(*channel)
            }
        }
    }

    /// When the level may be another one, after the moment at which it was asked for.
    pub fn next_change(&self) -> Cycle {
        match self {
            Self::Level(_) => NEVER,
            Self::Pwm { slice, channel } => slice.next_change(*channel),
        }
    }
}
