//! A scale with round numbers.

use crate::words::{clock, date, rounded};

const MINUTE_S: f64 = 60.0;
const HOUR_S: f64 = 3600.0;

/// Distances of ticks that divide a minute or an hour, in seconds.
const TIME_STEPS_S: [f64; 13] = [
    1.0, 2.0, 5.0, 10.0, 15.0, 30.0, MINUTE_S, 120.0, 300.0, 600.0, 900.0, 1800.0, HOUR_S,
];

/// Least extent of a scale: of its largest value, and at all. Values that are all the same are in its middle.
const LEAST_SHARE: f64 = 0.02;
const LEAST_EXTENT: f64 = 0.1;

/// A scale from one round number to another.
pub struct Axis {
    lowest: f64,
    highest: f64,
    step: f64,
    /// Writes a value, given the distance of ticks.
    label: Box<dyn Fn(f64, f64) -> String>,
    /// Name of the values, unless the title of the diagram has it.
    pub caption: &'static str,
}

impl Axis {
    /// A scale that holds all of these values, with about this many ticks.
    pub fn over(values: impl IntoIterator<Item = f64>, ticks: u32) -> Self {
        let (lowest, highest) = ends(values);
        let least = (LEAST_SHARE * lowest.abs().max(highest.abs())).max(LEAST_EXTENT);
        let missing = (least - (highest - lowest)).max(0.0);
        // A quantity that is never negative has no negative scale.
        let widened = lowest - 0.5 * missing;
        let from = if lowest >= 0.0 { widened.max(0.0) } else { widened };
        Self::with_steps(
            (from, from + (highest - lowest) + missing),
            ticks,
            round_step,
            decimal,
        )
    }

    /// An axis of moments in seconds, which are written in minutes and seconds.
    pub fn over_time(times_s: impl IntoIterator<Item = f64>, ticks: u32) -> Self {
        Self {
            caption: "time (min:s)",
            ..Self::with_steps(ends(times_s), ticks, time_step_s, |time_s, _| clock(time_s))
        }
    }

    /// An axis of drives, counted from 1, by the dates of those that have one, in seconds since 1970.
    pub fn over_drives(dates_s: Vec<Option<f64>>, ticks: u32) -> Self {
        let whole_step = |step: f64| round_step(step.max(1.0));
        let count = dates_s.len() as f64;
        let label = move |number: f64, _| match dates_s.get((number as usize).wrapping_sub(1)) {
            Some(Some(date_s)) => date(*date_s),
            Some(None) => number.to_string(),
            // A scale may begin before the first drive and end behind the last.
            None => String::new(),
        };
        Self {
            caption: "drive",
            ..Self::with_steps((1.0, count), ticks, whole_step, label)
        }
    }

    fn with_steps(
        (lowest, highest): (f64, f64),
        ticks: u32,
        round: fn(f64) -> f64,
        label: impl Fn(f64, f64) -> String + 'static,
    ) -> Self {
        let step = round((highest - lowest) / f64::from(ticks));
        let lowest = (lowest / step).floor() * step;
        Self {
            lowest,
            highest: ((highest / step).ceil() * step).max(lowest + step),
            step,
            label: Box::new(label),
            caption: "",
        }
    }

    /// Position of a value: 0 at the lowest end, 1 at the highest.
    pub fn share(&self, value: f64) -> f64 {
        (value - self.lowest) / (self.highest - self.lowest)
    }

    /// The round numbers of the scale, with how each is written.
    pub fn ticks(&self) -> impl Iterator<Item = (f64, String)> {
        let count = ((self.highest - self.lowest) / self.step).round() as u32;
        (0..=count).map(|number| {
            let value = self.lowest + f64::from(number) * self.step;
            (value, (self.label)(value, self.step))
        })
    }
}

/// The lowest and the highest of these values.
fn ends(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values
        .into_iter()
        .map(|value| (value, value))
        .reduce(|(lowest, highest), (value, _)| (f64::min(lowest, value), f64::max(highest, value)))
        .unwrap_or((0.0, 1.0))
}

/// A value with the decimals of its step.
fn decimal(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    rounded(value, decimals)
}

/// The next distance of ticks that divides a minute or an hour, or the next whole number of hours that is round.
fn time_step_s(step_s: f64) -> f64 {
    let next = TIME_STEPS_S.into_iter().find(|round_s| *round_s >= step_s);
    next.unwrap_or_else(|| round_step(step_s / HOUR_S) * HOUR_S)
}

/// The next of 1, 2 and 5 times a power of ten.
fn round_step(step: f64) -> f64 {
    // Values that are all the same need a scale, too.
    let step = step.max(1e-3);
    let decade = 10f64.powf(step.log10().floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|factor| factor * decade)
        .find(|round| *round >= step)
        .unwrap_or(10.0 * decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_minutes_and_seconds_or_whole_numbers() {
        for (axis, expected) in [
            (Axis::over([0.0, 100.0], 5), "0 20 40 60 80 100"),
            (
                Axis::over([10.31, 12.58], 6),
                "10.0 10.5 11.0 11.5 12.0 12.5 13.0",
            ),
            (Axis::over([-3.0, 8.0], 4), "-5 0 5 10"),
            (Axis::over_time([0.0, 69.9], 5), "0:00 0:15 0:30 0:45 1:00 1:15"),
            (
                Axis::over_time([63.0, 599.9], 5),
                "0:00 2:00 4:00 6:00 8:00 10:00",
            ),
            (
                Axis::over_time([0.0, 30_000.0], 5),
                "0:00 2:00:00 4:00:00 6:00:00 8:00:00 10:00:00",
            ),
            (Axis::over_time([2.3, 2.4], 5), "0:02 0:03"),
            (Axis::over_drives(vec![None], 5), "1 "),
            (
                Axis::over_drives(vec![Some(0.0), None, Some(86_400.0 * 40.0)], 5),
                "1970-01-01 2 1970-02-10",
            ),
            // A steady value is no drama.
            (
                Axis::over([5.0004, 5.0004], 6),
                "4.94 4.96 4.98 5.00 5.02 5.04 5.06",
            ),
            (Axis::over([0.0, 0.0], 6), "0.00 0.02 0.04 0.06 0.08 0.10"),
            (Axis::over([-0.01, 0.03], 6), "-0.04 -0.02 0.00 0.02 0.04 0.06"),
            (Axis::over([2200.0], 4), "2160 2180 2200 2220 2240"),
        ] {
            let ticks: Vec<String> = axis.ticks().map(|(_, text)| text).collect();
            assert_eq!(ticks.join(" "), expected);
        }
    }

    #[test]
    fn one_value_and_none_have_a_scale() {
        let axis = Axis::over([7.4], 6);
        assert!((0.0..=1.0).contains(&axis.share(7.4)));
        assert!(axis.ticks().count() >= 2);
        assert!(Axis::over([], 6).share(0.5).is_finite());
    }
}
