//! Valid values of a parameter.

/// Valid values of a parameter.
#[derive(Clone, Copy, Debug)]
pub enum Range {
    /// From minimum to maximum, inclusive.
    Between(f32, f32),
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
    pub fn text(self) -> &'static str {
        self.text
    }
}

impl Range {
    /// Whether `value` is valid; NaN is not.
    pub fn contains(&self, value: f32) -> bool {
        match *self {
            Self::Between(lowest, highest) => (lowest..=highest).contains(&value),
            Self::OneOf(values) => values.iter().any(|(allowed, _)| *allowed as f32 == value),
            Self::Bits(bits) => {
                let known = bits.iter().fold(0, |mask, (bit, _)| mask | 1 << bit);
                // The cast saturates, so values beyond u32 differ after the round trip.
                let mask = value as u32;
                mask as f32 == value && mask & !known == 0
            }
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
