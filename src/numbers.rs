//! Numbers without float formatting and float comparisons: in texts, and from floating point to whole numbers; texts of a
//! limited length.

use core::fmt::{self, Write};

use heapless::String;
use heapless::string::StringView;

/// A number with two decimals. Float formatting would take some 20 KB of flash.
pub struct Hundredths(pub f32);

impl fmt::Display for Hundredths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hundredths = round_to_i32(self.0 * 100.0);
        let sign = if hundredths < 0 { "-" } else { "" };
        let magnitude = hundredths.unsigned_abs();
        write!(f, "{sign}{}.{:02}", magnitude / 100, magnitude % 100)
    }
}

/// A text of `N` bytes at most: what does not fit is cut off, behind a whole word if there is one, and shown by three dots.
pub(crate) fn text<const N: usize>(parts: fmt::Arguments<'_>) -> String<N> {
    let mut text = String::new();
    write_fitting(text.as_mut_view(), parts);
    text
}

/// The end of a text that was cut off.
const CUT_OFF: &str = "...";

/// Of any length: each would be compiled again.
#[inline(never)]
fn write_fitting(text: &mut StringView, parts: fmt::Arguments<'_>) {
    if Fitting(text).write_fmt(parts).is_ok() {
        return;
    }
    let room = text.floor_char_boundary(text.capacity().saturating_sub(CUT_OFF.len()));
    let (kept, rest) = text.split_at_checked(room).unwrap_or_default();
    // Searching a character in a text may panic, for the compiler.
    let words = match kept.bytes().rposition(|byte| byte == b' ') {
        Some(end) if !rest.starts_with(' ') => kept.get(..end).unwrap_or(kept),
        _ => kept,
    };
    let length = words.trim_end_matches([' ', ',', ':']).len();
    while text.len() > length {
        text.pop();
    }
    // It fits.
    let _ = text.push_str(CUT_OFF);
}

/// Takes what fits, to the last whole character, and fails if something does not.
struct Fitting<'a>(&'a mut StringView);

impl Write for Fitting<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = self.0.capacity() - self.0.len();
        let fitting = text.get(..text.floor_char_boundary(room)).unwrap_or_default();
        // It fits.
        let _ = self.0.push_str(fitting);
        if fitting.len() < text.len() {
            return Err(fmt::Error);
        }
        Ok(())
    }
}

/// The mean; `None` of no values.
pub(crate) fn mean(values: impl Iterator<Item = f32>) -> Option<f32> {
    let (sum, count) = values.fold((0.0, 0u8), |(sum, count), value| {
        (sum + value, count.saturating_add(1))
    });
    (count > 0).then(|| sum / f32::from(count))
}

/// Bits of a single's significand behind the leading 1.
const FRACTION_BITS: i32 = 23;
const EXPONENT_BIAS: i32 = 127;
/// The exponent of infinity and NaN.
const NOT_A_NUMBER: i32 = 128;

/// Rounded half away from zero, saturating at the range of `i32`; NaN is 0.
pub(crate) fn round_to_i32(value: f32) -> i32 {
    let bits = value.to_bits();
    let exponent = (bits >> FRACTION_BITS & 0xff) as i32 - EXPONENT_BIAS;
    let fraction = bits & ((1 << FRACTION_BITS) - 1);
    let significand = fraction | 1 << FRACTION_BITS;
    let magnitude = match exponent {
        ..-1 => 0,
        -1..FRACTION_BITS => {
            let dropped_bits = FRACTION_BITS - exponent;
            (significand + (1 << (dropped_bits - 1))) >> dropped_bits
        }
        FRACTION_BITS..31 => significand << (exponent - FRACTION_BITS),
        NOT_A_NUMBER if fraction != 0 => 0,
        _ if value.is_sign_negative() => return i32::MIN,
        _ => return i32::MAX,
    };
    // Below 2^31, so it fits.
    let magnitude = magnitude as i32;
    if value.is_sign_negative() {
        -magnitude
    } else {
        magnitude
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn halves_go_away_from_zero_and_the_range_saturates() {
        for (value, expected) in [
            (1.5, 2),
            (-1.5, -2),
            (0.5, 1),
            (0.499_999_97, 0),
            (-0.4, 0),
            (8_388_607.5, 8_388_608),
            (16_777_217.0, 16_777_216),
            (2_147_483_520.0, 2_147_483_520),
            (1e20, i32::MAX),
            (-1e20, i32::MIN),
            (f32::INFINITY, i32::MAX),
            (f32::NEG_INFINITY, i32::MIN),
            (f32::NAN, 0),
            (f32::MIN_POSITIVE, 0),
        ] {
            assert_eq!(round_to_i32(value), expected, "{value}");
        }
    }

    #[test]
    fn a_text_that_does_not_fit_ends_behind_a_whole_word_with_dots() {
        let fifty = "Battery 1 fault: cells differ at rest, cell failed";
        for (full, expected) in [
            (fifty.to_owned(), fifty),
            (
                format!("{fifty}."),
                "Battery 1 fault: cells differ at rest, cell...",
            ),
            (
                format!("{fifty}, x"),
                "Battery 1 fault: cells differ at rest, cell...",
            ),
            // The word ends where the dots begin.
            (
                "Battery 1 fault: cells differ at rest, and failed, too".into(),
                "Battery 1 fault: cells differ at rest, and...",
            ),
            (
                "Battery 1 fault: it is over temperature for a long, long time".into(),
                "Battery 1 fault: it is over temperature for a...",
            ),
            (format!("Battery 1 {}", "x".repeat(50)), "Battery 1..."),
            (
                "x".repeat(51),
                "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...",
            ),
            (
                format!("{}°°°", "x".repeat(46)),
                "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...",
            ),
            (" ".repeat(60), "..."),
            ("".into(), ""),
        ] {
            let text: heapless::String<50> = text(format_args!("{full}"));
            assert_eq!(text, expected, "{full}");
            // In parts, as it is formatted.
            let (first, second) = full.split_at(full.floor_char_boundary(30));
            let parts: heapless::String<50> = super::text(format_args!("{first}{second}"));
            assert_eq!(parts, expected, "{full}");
        }
    }

    proptest! {
        #[test]
        fn it_rounds_as_floating_point_does(bits in any::<u32>(), plausible in -1e7f32..1e7) {
            for value in [f32::from_bits(bits), plausible] {
                prop_assert_eq!(round_to_i32(value), value.round() as i32, "{}", value);
            }
        }
    }
}
