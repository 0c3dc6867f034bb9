//! Valid values of a parameter.

use core::fmt;

use crate::numbers::round_to_i32;

/// Valid values of a parameter.
#[derive(Clone, Copy, Debug)]
pub enum Range {
    /// From minimum to maximum, inclusive.
    Between(f32, f32),
    /// 0, or from minimum to maximum, inclusive, both above 0.
    ZeroOrBetween(f32, f32),
    /// One of these values, with their meanings.
    OneOf(&'static [(i32, Meaning)]),
    /// A bit mask of these bits, with their meanings.
    Bits(&'static [(u8, Meaning)]),
}

/// Meaning of a value for the documentation; empty in the firmware.
#[derive(Clone, Copy, Debug)]
pub struct Meaning {
    #[cfg(not(target_os = "none"))]
    text: &'static str,
}

/// The meaning `text`.
pub const fn means(#[cfg_attr(target_os = "none", expect(unused))] text: &'static str) -> Meaning {
    Meaning {
        #[cfg(not(target_os = "none"))]
        text,
    }
}

#[cfg(not(target_os = "none"))]
impl Meaning {
    /// The text of the documentation.
    pub const fn text(self) -> &'static str {
        self.text
    }
}

impl Range {
    /// Whether `value` is valid; NaN is not.
    pub fn contains(&self, value: f32) -> bool {
        match *self {
            Self::Between(lowest, highest) => (lowest..=highest).contains(&value),
            Self::ZeroOrBetween(lowest, highest) => value == 0.0 || (lowest..=highest).contains(&value),
            Self::OneOf(values) => values.iter().any(|(allowed, _)| *allowed as f32 == value),
            Self::Bits(bits) => {
                let known = bits.iter().fold(0, |mask, (bit, _)| mask | 1 << bit);
                // The cast saturates, so values beyond u32 differ after the round trip.
                let mask = value as u32;
                mask as f32 == value && mask & !known == 0
            }
        }
    }

    /// The lowest value or bit of a list that is above this one.
    fn next_above(&self, value: i32) -> Option<i32> {
        match *self {
            Self::Between(..) | Self::ZeroOrBetween(..) => None,
            Self::OneOf(values) => {
                let values = values.iter().map(|(listed, _)| *listed);
                values.filter(|listed| *listed > value).min()
            }
            Self::Bits(bits) => {
                let bits = bits.iter().map(|(bit, _)| 1 << bit);
                bits.filter(|bit| *bit > value).min()
            }
        }
    }

    /// The values of a list in their order; three or more successive ones are one range.
    fn write_list(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        let mut next = self.next_above(i32::MIN);
        while let Some(first) = next {
            let mut last = first;
            next = self.next_above(last);
            while next == Some(last + 1) {
                last += 1;
                next = self.next_above(last);
            }
            write!(f, "{separator}{first}")?;
            match last - first {
                0 => {}
                1 => write!(f, ", {last}")?,
                _ => write!(f, " to {last}")?,
            }
            separator = ", ";
        }
        Ok(())
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::ZeroOrBetween(lowest, highest) => {
                f.write_str("0, ")?;
                write_limits(f, lowest, highest)
            }
            Self::Between(lowest, highest) => write_limits(f, lowest, highest),
            Self::OneOf(_) => self.write_list(f),
            Self::Bits(_) => {
                f.write_str("a sum of ")?;
                self.write_list(f)
            }
        }
    }
}

fn write_limits(f: &mut fmt::Formatter<'_>, lowest: f32, highest: f32) -> fmt::Result {
    write_number(f, lowest)?;
    f.write_str(" to ")?;
    write_number(f, highest)
}

/// With as many decimals as it needs, four at most. Without any it may have any size.
fn write_number(f: &mut fmt::Formatter<'_>, value: f32) -> fmt::Result {
    let whole = round_to_i32(value);
    if whole as f32 == value {
        return write!(f, "{whole}");
    }
    let sign = if value < 0.0 { "-" } else { "" };
    let ten_thousandths = round_to_i32(value * 1e4).unsigned_abs();
    write!(f, "{sign}{}.", ten_thousandths / 10_000)?;
    let mut fraction = ten_thousandths % 10_000;
    loop {
        fraction *= 10;
        write!(f, "{}", fraction / 10_000)?;
        fraction %= 10_000;
        if fraction == 0 {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOT_NUMBERS: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

    #[test]
    fn between_includes_both_ends() {
        let range = Range::Between(-3.3, 3.3);
        for value in [-3.3, 0.0, 3.3] {
            assert!(range.contains(value), "{value}");
        }
        for value in [-3.31, 3.31].into_iter().chain(NOT_NUMBERS) {
            assert!(!range.contains(value), "{value}");
        }
    }

    #[test]
    fn zero_is_beside_a_range_that_begins_above() {
        let range = Range::ZeroOrBetween(8.0, 119.0);
        for value in [0.0, -0.0, 8.0, 119.0] {
            assert!(range.contains(value), "{value}");
        }
        for value in [-1.0, 1.0, 7.0, 120.0].into_iter().chain(NOT_NUMBERS) {
            assert!(!range.contains(value), "{value}");
        }
    }

    #[test]
    fn one_of_contains_only_the_listed_values() {
        let range = const { Range::OneOf(&[(-1, means("none")), (26, means("GP26"))]) };
        for value in [-1.0, 26.0] {
            assert!(range.contains(value), "{value}");
        }
        for value in [0.0, 25.0, 26.5].into_iter().chain(NOT_NUMBERS) {
            assert!(!range.contains(value), "{value}");
        }
    }

    #[test]
    fn ranges_are_written_shortly() {
        let values = const {
            Range::OneOf(&[
                (-1, means("")),
                (0, means("")),
                (9, means("")),
                (4, means("")),
                (5, means("")),
                (3, means("")),
            ])
        };
        let bits = const { Range::Bits(&[(0, means("")), (6, means("")), (8, means(""))]) };
        for (range, text) in [
            (Range::Between(800.0, 1400.0), "800 to 1400"),
            (Range::Between(-3.3, 0.5), "-3.3 to 0.5"),
            (Range::Between(0.0001, 1.0), "0.0001 to 1"),
            (Range::Between(-0.05, 1_000_000.0), "-0.05 to 1000000"),
            (Range::ZeroOrBetween(8.0, 119.0), "0, 8 to 119"),
            (values, "-1, 0, 3 to 5, 9"),
            (bits, "a sum of 1, 64, 256"),
        ] {
            assert_eq!(range.to_string(), text);
        }
    }

    #[test]
    fn bits_contain_every_combination_of_known_bits() {
        let range = const { Range::Bits(&[(6, means("")), (8, means("")), (9, means(""))]) };
        for value in [0.0, 64.0, 256.0, 512.0, 320.0, 832.0] {
            assert!(range.contains(value), "{value}");
        }
        for value in [1.0, 65.0, 128.0, 1024.0, -64.0, 64.5, 0.5, 5e9, 1e30]
            .into_iter()
            .chain(NOT_NUMBERS)
        {
            assert!(!range.contains(value), "{value}");
        }
    }
}
