//! Times and quantities in words.

/// A moment of the recording: minutes and seconds, as 12:04, with hours in front from the first on.
pub fn clock(time_s: f64) -> String {
    let (minutes, seconds) = minutes_and_seconds(time_s);
    match minutes / 60 {
        0 => format!("{minutes}:{seconds:02}"),
        hours => format!("{hours}:{:02}:{seconds:02}", minutes % 60),
    }
}

/// A duration: 45 s, 12 min 4 s or 1 h 12 min.
pub fn duration(duration_s: f64) -> String {
    let (minutes, seconds) = minutes_and_seconds(duration_s.round());
    match (minutes / 60, minutes % 60) {
        (0, 0) => format!("{seconds} s"),
        (0, minutes) => format!("{minutes} min {seconds} s"),
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
    let (minutes, _) = minutes_and_seconds(unix_s);
    let (year, month, day) = day(minutes / (24 * 60));
    format!("{year}-{month:02}-{day:02}")
}

/// Year, month and day of the day that is this many after 1970-01-01. Years are counted from March, so that the day of a leap
/// year is the last one, and in periods of 400, which are equally long.
fn day(since_1970: u64) -> (u64, u64, u64) {
    const BEFORE_1970: u64 = 719_468;
    const PERIOD: u64 = 146_097;
    let days = since_1970 + BEFORE_1970;
    let (period, of_period) = (days / PERIOD, days % PERIOD);
    let leap_days = of_period / 1460 - of_period / 36_524 + of_period / 146_096;
    let year = (of_period - leap_days) / 365;
    let of_year = of_period - (365 * year + year / 4 - year / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let (month, later) = match from_march {
        0..10 => (from_march + 3, 0),
        _ => (from_march - 9, 1),
    };
    (400 * period + year + later, month, day)
}

/// Whole ones; saturating.
fn minutes_and_seconds(time_s: f64) -> (u64, u64) {
    let seconds = time_s as u64;
    (seconds / 60, seconds % 60)
}

/// A value with its unit, or that it is unknown.
pub fn quantity(value: Option<f32>, decimals: usize, unit: &str) -> String {
    match value {
        Some(value) => format!("{value:.decimals$} {unit}"),
        None => "unknown".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn days_are_those_of_the_calendar() {
        for (unix_s, expected) in [
            (0.0, "1970-01-01 00:00 UTC"),
            (951_782_399.0, "2000-02-28 23:59 UTC"),
            (951_782_400.0, "2000-02-29 00:00 UTC"),
            (1_709_251_199.0, "2024-02-29 23:59 UTC"),
            (1_795_639_396.25, "2026-11-25 20:43 UTC"),
            (1_798_761_599.0, "2026-12-31 23:59 UTC"),
            (4_107_542_400.0, "2100-03-01 00:00 UTC"),
        ] {
            assert_eq!(utc(unix_s), expected);
        }
        utc(f64::MAX);
    }

    #[test]
    fn durations_have_the_units_that_matter() {
        for (duration_s, expected) in [
            (0.4, "0 s"),
            (59.9, "1 min 0 s"),
            (190.0, "3 min 10 s"),
            (4_320.0, "1 h 12 min"),
        ] {
            assert_eq!(duration(duration_s), expected);
        }
    }
}
