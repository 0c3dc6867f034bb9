//! The nine instructions (datasheet 3.4).

use super::super::register::{bit, field};

/// The upper three bits of an instruction.
pub const JUMP: u16 = 0;
pub const WAIT: u16 = 1;
pub const IN: u16 = 2;
pub const OUT: u16 = 3;
pub const PUSH_OR_PULL: u16 = 4;
pub const MOVE: u16 = 5;
pub const IRQ: u16 = 6;

/// The 16 bits of an instruction. Those of delay and side-set are for [`DelayAndSide`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction(pub u16);

impl Instruction {
    pub fn operation(self) -> u16 {
        self.0 >> 13
    }

    pub fn flag(self, number: u32) -> bool {
        bit(self.0.into(), number)
    }

    /// Bits 7 to 5: a condition, a source or a destination.
    pub fn middle(self) -> u32 {
        field(self.0.into(), 5, 3)
    }

    /// Bits 4 to 0: an address, an index, data or a number of bits.
    pub fn low(self) -> u32 {
        field(self.0.into(), 0, 5)
    }
}

/// "32 is encoded as 00000" (3.4.4.2), as in the thresholds.
pub fn or_32(bits: u32) -> u32 {
    if bits == 0 { 32 } else { bits }
}

/// What an instruction's five bits for delay and side-set mean to a state machine (3.4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DelayAndSide {
    pub delay: u32,
    /// The value for the side-set pins, and how many they are.
    pub side: Option<(u32, u32)>,
}

impl DelayAndSide {
    /// `side_count` bits from the top are for side-set. If it `is_optional`, the first of them says whether there is any.
    pub fn of(code: u16, side_count: u32, is_optional: bool) -> Self {
        let bits = field(u32::from(code), 8, 5);
        let delay_bits = 5 - side_count;
        let side_bits = bits >> delay_bits;
        let pins = side_count.saturating_sub(u32::from(is_optional));
        let is_given = pins > 0 && (!is_optional || bit(side_bits, pins));
        Self {
            delay: field(bits, 0, delay_bits),
            side: is_given.then_some((field(side_bits, 0, pins), pins)),
        }
    }
}
