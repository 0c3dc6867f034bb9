//! A scale with round numbers.

/// A scale from one round number to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    lowest: f64,
    highest: f64,
    step: f64,
}

impl Axis {
    /// A scale that holds all of these values, with about this many ticks.
    pub fn over(values: impl IntoIterator<Item = f64>, ticks: u32) -> Self {
        let (lowest, highest) = values
            .into_iter()
            .map(|value| (value, value))
            .reduce(|(lowest, highest), (value, _)| (f64::min(lowest, value), f64::max(highest, value)))
            .unwrap_or((0.0, 1.0));
        let step = round_step((highest - lowest) / f64::from(ticks));
        let lowest = (lowest / step).floor() * step;
        Self {
            lowest,
            highest: ((highest / step).ceil() * step).max(lowest + step),
            step,
        }
    }

    /// Where a value lies: 0 at the lowest end, 1 at the highest.
    pub fn share(&self, value: f64) -> f64 {
        (value - self.lowest) / (self.highest - self.lowest)
    }

    /// The round numbers of the scale, with how each is written.
    pub fn ticks(&self) -> impl Iterator<Item = (f64, String)> {
        let Self {
            lowest,
            highest,
            step,
        } = *self;
        let count = ((highest - lowest) / step).round() as u32;
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        (0..=count).map(move |number| {
            let value = lowest + f64::from(number) * step;
            (value, format!("{value:.decimals$}"))
        })
    }
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

    fn ticks(values: &[f64], ticks: u32) -> Vec<String> {
        let axis = Axis::over(values.iter().copied(), ticks);
        axis.ticks().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round_numbers_around_the_values() {
        assert_eq!(ticks(&[0.0, 100.0], 5), ["0", "20", "40", "60", "80", "100"]);
        assert_eq!(
            ticks(&[10.31, 12.58], 6),
            ["10.0", "10.5", "11.0", "11.5", "12.0", "12.5", "13.0"]
        );
        assert_eq!(ticks(&[-3.0, 8.0], 4), ["-5", "0", "5", "10"]);
    }

    #[test]
    fn one_value_and_none_have_a_scale() {
        let axis = Axis::over([7.4], 6);
        assert!((0.0..=1.0).contains(&axis.share(7.4)));
        assert!(axis.ticks().count() >= 2);
        assert!(Axis::over([], 6).share(0.5).is_finite());
    }
}
