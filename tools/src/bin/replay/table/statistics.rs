//! Statistics of many values.

/// From the first value to the last one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span(Option<(f64, f64)>);

impl Span {
    /// Takes the next value, if it is known.
    pub fn add(&mut self, value: Option<f32>) {
        if let Some(value) = value.map(f64::from) {
            self.0.get_or_insert((value, value)).1 = value;
        }
    }

    /// The last value less the first.
    pub fn length(&self) -> Option<f64> {
        self.0.map(|(first, last)| last - first)
    }
}

/// The lowest and the highest value.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extremes(Option<(f32, f32)>);

impl Extremes {
    /// Takes another value, if it is known.
    pub fn add(&mut self, value: Option<f32>) {
        if let Some(value) = value {
            let (lowest, highest) = self.0.get_or_insert((value, value));
            (*lowest, *highest) = (lowest.min(value), highest.max(value));
        }
    }

    /// The lowest one.
    pub fn lowest(&self) -> Option<f64> {
        self.0.map(|(lowest, _)| lowest.into())
    }

    /// The highest one.
    pub fn highest(&self) -> Option<f64> {
        self.0.map(|(_, highest)| highest.into())
    }
}

/// Mean and standard deviation, by Welford's method.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spread {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Spread {
    /// Takes another value, if it is known.
    pub fn add(&mut self, value: Option<f32>) {
        let Some(value) = value.map(f64::from) else {
            return;
        };
        self.count += 1.0;
        let before = value - self.mean;
        self.mean += before / self.count;
        self.squares += before * (value - self.mean);
    }

    /// The mean.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0.0).then_some(self.mean)
    }

    /// The standard deviation, of two values or more.
    pub fn sigma(&self) -> Option<f64> {
        (self.count > 1.0).then(|| (self.squares / (self.count - 1.0)).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[Option<f32>]) -> ([Option<f64>; 4], Option<f64>) {
        let (mut span, mut extremes, mut spread) = (Span::default(), Extremes::default(), Spread::default());
        for value in values {
            span.add(*value);
            extremes.add(*value);
            spread.add(*value);
        }
        let (lowest, highest) = (extremes.lowest(), extremes.highest());
        ([span.length(), lowest, highest, spread.mean()], spread.sigma())
    }

    #[test]
    fn values_are_summed_up_and_what_was_never_known_stays_unknown() {
        assert_eq!(of(&[None]), ([None; 4], None));
        let (found, sigma) = of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0].map(Some));
        assert_eq!(found, [7.0, 2.0, 9.0, 5.0].map(Some));
        let sigma = sigma.expect("it is known");
        assert!((sigma - (32.0_f64 / 7.0).sqrt()).abs() < 1e-12, "{sigma}");
    }
}
