//! Times, quantities and names of files, as a person reads them.

use std::ffi::OsStr;
use std::fmt::Display;
use std::path::Path;

use rover_battmon::time::{Day, Utc};

/// An error of a file.
pub fn about(path: &Path, error: &dyn Display) -> String {
    format!("{}: {error}", shown(path))
}

/// A moment of the recording: minutes and seconds, as 12:04, with hours in front from the first on.
pub fn clock(time_s: f64) -> String {
    let (minutes, seconds) = minutes_and_seconds(time_s);
    match minutes / 60 {
        0 => format!("{minutes}:{seconds:02}"),
        hours => format!("{hours}:{:02}:{seconds:02}", minutes % 60),
    }
}

/// A duration: 45 s, 12 min 4 s, 1 h 12 min or 2 h.
pub fn duration(duration_s: f64) -> String {
    let (minutes, seconds) = minutes_and_seconds(duration_s.round());
    match (minutes / 60, minutes % 60) {
        (0, 0) => format!("{seconds} s"),
        (0, minutes) => format!("{minutes} min {seconds} s"),
        (hours, 0) => format!("{hours} h"),
        (hours, minutes) => format!("{hours} h {minutes} min"),
    }
}

/// A moment of UTC, in seconds since 1970: 2026-11-25 20:43 UTC.
pub fn utc(unix_s: f64) -> String {
    let (minutes, _) = minutes_and_seconds(unix_s);
    format!(
        "{} {:02}:{:02} UTC",
        date(unix_s),
        minutes / 60 % 24,
        minutes % 60
    )
}

/// The day of a moment of UTC, in seconds since 1970: 2026-11-25.
pub fn date(unix_s: f64) -> String {
    Day::of(Utc::from_micros((unix_s * 1e6) as u64)).to_string()
}

/// Whole ones; saturating.
fn minutes_and_seconds(time_s: f64) -> (u64, u64) {
    let seconds = time_s as u64;
    (seconds / 60, seconds % 60)
}

/// Number of occurrences.
pub fn times(count: usize) -> String {
    match count {
        1 => "once".into(),
        2 => "twice".into(),
        count => format!("{count} times"),
    }
}

/// A number of drives, readings or whatever `one` is.
pub fn counted(count: u64, one: &str) -> String {
    match count {
        1 => format!("1 {one}"),
        count => format!("{count} {one}s"),
    }
}

/// A number of copies.
pub fn copies(count: usize) -> String {
    match count {
        1 => "1 copy".into(),
        count => format!("{count} copies"),
    }
}

/// Name of a file for a terminal: control characters, those that turn the direction of text, and bytes that are not UTF-8
/// are escaped.
pub fn shown(name: impl AsRef<OsStr>) -> String {
    let mut text = String::new();
    for chunk in name.as_ref().as_encoded_bytes().utf8_chunks() {
        for character in chunk.valid().chars() {
            match character {
                '\u{200e}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => {
                    text.extend(character.escape_unicode());
                }
                _ if character.is_control() => text.extend(character.escape_default()),
                _ => text.push(character),
            }
        }
        text.extend(chunk.invalid().iter().map(|byte| format!("\\x{byte:02x}")));
    }
    text
}

/// A value as it is shown: what rounds to zero has no sign.
pub fn rounded(value: impl Into<f64>, decimals: usize) -> String {
    let value = value.into();
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(zero) if zero.chars().all(|digit| matches!(digit, '0' | '.')) => zero.into(),
        _ => text,
    }
}

/// A value with its unit, or that it is unknown.
pub fn quantity(value: Option<f32>, decimals: usize, unit: &str) -> String {
    match value {
        Some(value) => format!("{} {unit}", rounded(value, decimals)),
        None => "unknown".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::ffi::OsStrExt;

    #[test]
    fn moments_are_those_of_a_clock() {
        for (time_s, expected) in [
            (0.0, "0:00"),
            (59.9, "0:59"),
            (724.0, "12:04"),
            (3600.0, "1:00:00"),
            (45_296.5, "12:34:56"),
        ] {
            assert_eq!(clock(time_s), expected);
        }
    }

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        for (value, decimals, expected) in [
            (-0.4_f32, 0, "0"),
            (-0.04, 1, "0.0"),
            (-0.06, 1, "-0.1"),
            (-10.4, 0, "-10"),
            (0.4, 0, "0"),
        ] {
            assert_eq!(rounded(value, decimals), expected);
        }
    }

    #[test]
    fn a_moment_has_its_day_and_minute() {
        assert_eq!(utc(0.0), "1970-01-01 00:00 UTC");
        assert_eq!(utc(1_795_639_396.25), "2026-11-25 20:43 UTC");
        utc(f64::MAX);
    }

    #[test]
    fn durations_have_the_units_that_matter() {
        for (duration_s, expected) in [
            (0.4, "0 s"),
            (59.9, "1 min 0 s"),
            (190.0, "3 min 10 s"),
            (4_320.0, "1 h 12 min"),
            (7_201.0, "2 h"),
        ] {
            assert_eq!(duration(duration_s), expected);
        }
    }

    #[test]
    fn a_name_can_not_write_to_the_terminal() {
        for (name, expected) in [
            (
                b"logs/caf\xc3\xa9 'e\xcc\x81'.BIN".as_slice(),
                "logs/café 'e\u{301}'.BIN",
            ),
            (b"a\n\x1b[2J\x7f\xc2\x9b.BIN", "a\\n\\u{1b}[2J\\u{7f}\\u{9b}.BIN"),
            (b"\xe2\x80\xaeNIB.a", "\\u{202e}NIB.a"),
            (b"\xff.BIN\xc3", "\\xff.BIN\\xc3"),
        ] {
            assert_eq!(shown(OsStr::from_bytes(name)), expected);
        }
    }
}
