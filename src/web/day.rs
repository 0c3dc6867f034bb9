//! A day of the calendar, for names of files.

use core::num::NonZeroU32;

use heapless::String;

use crate::numbers::text;

// In days.
const FOUR_CENTURIES: u32 = 146_097;
const FOUR_YEARS: u32 = 1_461;
const FIVE_MONTHS: u32 = 153;
const FROM_MARCH_1600_TO_1970: u32 = 135_080;

const SECONDS_PER_DAY: u32 = 24 * 3_600;

/// The day in UTC of a moment in seconds since 1970, as ISO 8601 writes it: `2026-11-26`.
pub(super) fn day_of(utc_s: NonZeroU32) -> String<10> {
    // Years that begin with March have the day that may be missing at their end.
    let days = utc_s.get() / SECONDS_PER_DAY + FROM_MARCH_1600_TO_1970;
    let century = (4 * days + 3) / FOUR_CENTURIES;
    let of_century = days - FOUR_CENTURIES * century / 4;
    let year = (4 * of_century + 3) / FOUR_YEARS;
    let of_year = of_century - FOUR_YEARS * year / 4;
    let month = (5 * of_year + 2) / FIVE_MONTHS;
    let day = of_year - (FIVE_MONTHS * month + 2) / 5 + 1;
    let march_year = 1_600 + 100 * century + year;
    let (year, month) = match month {
        ..10 => (march_year, month + 3),
        _ => (march_year + 1, month - 9),
    };
    text(format_args!("{year}-{month:02}-{day:02}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn day(utc_s: u32) -> String<10> {
        day_of(NonZeroU32::new(utc_s).expect("not 0"))
    }

    #[test]
    fn a_day_ends_at_midnight() {
        // As `date -u -d @…` writes them.
        assert_eq!(day(1), "1970-01-01");
        assert_eq!(day(951_782_399), "2000-02-28");
        assert_eq!(day(951_782_400), "2000-02-29");
        assert_eq!(day(1_795_651_199), "2026-11-25");
        assert_eq!(day(1_795_651_200), "2026-11-26");
        assert_eq!(day(u32::MAX), "2106-02-07");
    }

    #[test]
    fn each_day_follows_the_one_before() {
        let mut days = (0..=u32::MAX / SECONDS_PER_DAY).map(|number| day(number * SECONDS_PER_DAY + 1));
        for year in 1_970..2_106 {
            let february = match year {
                2_100 => 28,
                _ if year % 4 == 0 => 29,
                _ => 28,
            };
            let lengths = [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
            for (month, length) in (1..).zip(lengths) {
                for day in 1..=length {
                    assert_eq!(
                        days.next().expect("some are left"),
                        format!("{year}-{month:02}-{day:02}").as_str()
                    );
                }
            }
        }
    }
}
