//! The nine instructions (datasheet 3.4).

use super::super::register::{bit, field};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instruction {
    Jump {
        condition: u32,
        address: u32,
    },
    Wait {
        polarity: bool,
        source: u32,
        index: u32,
    },
    In {
        source: u32,
        bits: u32,
    },
    Out {
        destination: u32,
        bits: u32,
    },
    Push {
        if_full: bool,
        block: bool,
    },
    Pull {
        if_empty: bool,
        block: bool,
    },
    Move {
        destination: u32,
        operation: u32,
        source: u32,
    },
    Irq {
        clear: bool,
        wait: bool,
        index: u32,
    },
    Set {
        destination: u32,
        data: u32,
    },
}

impl Instruction {
    /// Of the 16 bits, all but those of delay and side-set.
    pub fn of(code: u16) -> Self {
        let code = u32::from(code);
        let (middle, low) = (field(code, 5, 3), field(code, 0, 5));
        match field(code, 13, 3) {
            0 => Self::Jump {
                condition: middle,
                address: low,
            },
            1 => Self::Wait {
                polarity: bit(code, 7),
                source: field(code, 5, 2),
                index: low,
            },
            2 => Self::In {
                source: middle,
                bits: or_32(low),
            },
            3 => Self::Out {
                destination: middle,
                bits: or_32(low),
            },
            4 if bit(code, 7) => Self::Pull {
                if_empty: bit(code, 6),
                block: bit(code, 5),
            },
            4 => Self::Push {
                if_full: bit(code, 6),
                block: bit(code, 5),
            },
            5 => Self::Move {
                destination: middle,
                operation: field(code, 3, 2),
                source: field(code, 0, 3),
            },
            6 => Self::Irq {
                clear: bit(code, 6),
                wait: bit(code, 5),
                index: low,
            },
            _ => Self::Set {
                destination: middle,
                data: low,
            },
        }
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
