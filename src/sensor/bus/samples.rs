//! The readings of a pack between two sampling ticks.

use crate::battery::{Consumed, Counted, CurrentRange, Measurement, ReadError};

/// The readings of a pack since they were taken last.
#[derive(Clone, Copy, Debug, Default)]
pub struct Samples {
    voltage: Mean,
    current: Mean,
    /// The worst of them: a mean with one that is over range is too low, too.
    current_range: CurrentRange,
    /// Counts since the readings were taken; `None` if one of them has none: it is the first after a set-up, and what was drawn
    /// before it is as unknown as without a counter.
    counted: Option<Consumed>,
    last: Option<Measurement>,
    /// Whether the pack was read since the readings were taken.
    was_read: bool,
    /// Why the latest reading failed, until there is one.
    error: Option<ReadError>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f32,
    count: u16,
}

impl Mean {
    fn add(&mut self, value: Option<f32>) {
        if let Some(value) = value {
            self.sum += value;
            self.count = self.count.saturating_add(1);
        }
    }

    fn value(&self) -> Option<f32> {
        (self.count > 0).then(|| self.sum / f32::from(self.count))
    }
}

impl Samples {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self {
            voltage: Mean { sum: 0.0, count: 0 },
            current: Mean { sum: 0.0, count: 0 },
            current_range: CurrentRange::Within,
            counted: None,
            last: None,
            was_read: false,
            error: None,
        }
    }

    /// One more reading, or why there is none.
    pub fn add(&mut self, reading: Result<Measurement, ReadError>) {
        self.was_read = true;
        match reading {
            Ok(measurement) => self.add_measurement(&measurement),
            Err(error) => self.error = Some(error),
        }
    }

    fn add_measurement(&mut self, measurement: &Measurement) {
        self.voltage.add(measurement.voltage_v);
        self.current.add(measurement.current_a);
        self.current_range = self.current_range.max(measurement.current_range);
        let before = match self.last {
            Some(_) => self.counted,
            None => Some(Consumed::default()),
        };
        self.counted = before.and_then(|before| match measurement.counted {
            Some(Counted::Increment(more)) => Some(Consumed {
                charge_mah: before.charge_mah + more.charge_mah,
                energy_wh: before.energy_wh + more.energy_wh,
            }),
            _ => None,
        });
        self.last = Some(*measurement);
        self.error = None;
    }

    /// The mean voltage and current, the worst range of a current, the sum of what was counted, and the latest of everything
    /// else; `None` if nothing was added since the last call.
    ///
    /// # Errors
    /// Every reading since the last call failed: the last reason.
    pub fn take(&mut self) -> Option<Result<Measurement, ReadError>> {
        let kept = Self {
            error: self.error,
            ..Self::new()
        };
        let taken = core::mem::replace(self, kept);
        taken.was_read.then(|| taken.reading())
    }

    /// Why there is no reading: what the latest one failed by, else that none came in time.
    pub fn why_none(&self) -> ReadError {
        self.error.unwrap_or(ReadError::Timeout)
    }

    fn reading(&self) -> Result<Measurement, ReadError> {
        let Some(last) = self.last else {
            return Err(self.why_none());
        };
        Ok(Measurement {
            voltage_v: self.voltage.value(),
            current_a: self.current.value(),
            current_range: self.current_range,
            counted: match last.counted {
                Some(Counted::Increment(_)) => self.counted.map(Counted::Increment),
                other => other,
            },
            ..last
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::BusError;

    fn measured(voltage_v: f32, current_a: f32, counted_mah: Option<f32>) -> Result<Measurement, ReadError> {
        Ok(Measurement {
            voltage_v: Some(voltage_v),
            current_a: Some(current_a),
            counted: counted_mah.map(|charge_mah| {
                Counted::Increment(Consumed {
                    charge_mah,
                    energy_wh: 0.25,
                })
            }),
            temperature_c: Some(voltage_v),
            ..Measurement::default()
        })
    }

    #[test]
    // Requirement: AP-13
    fn voltage_and_current_are_averaged_what_was_counted_is_added_up_the_rest_is_the_latest() {
        let mut samples = Samples::new();
        samples.add(measured(12.0, 1.0, Some(0.0)));
        samples.add(measured(11.0, 2.0, Some(0.5)));
        samples.add(Err(ReadError::Bus(BusError::NoAnswer)));
        samples.add(measured(10.0, 6.0, Some(1.0)));
        let mean = samples.take().unwrap().unwrap();
        assert_eq!((mean.voltage_v, mean.current_a), (Some(11.0), Some(3.0)));
        assert_eq!(mean.temperature_c, Some(10.0));
        let counted = Consumed {
            charge_mah: 1.5,
            energy_wh: 0.75,
        };
        assert_eq!(mean.counted, Some(Counted::Increment(counted)));
    }

    #[test]
    // Requirement: S-10
    fn a_tick_in_which_a_counter_began_is_counted_by_its_current() {
        let mut samples = Samples::new();
        for counted_mah in [None, Some(0.5)] {
            samples.add(measured(12.0, 1.0, counted_mah));
        }
        assert_eq!(samples.take().unwrap().unwrap().counted, None);
        samples.add(measured(12.0, 1.0, Some(0.5)));
        assert!(samples.take().unwrap().unwrap().counted.is_some());
    }

    #[test]
    fn one_current_over_range_makes_that_of_the_tick_over_range() {
        let mut samples = Samples::new();
        for range in [
            CurrentRange::OverAndCounted,
            CurrentRange::Over,
            CurrentRange::Within,
        ] {
            let reading = measured(12.0, 1.0, None).map(|measurement| Measurement {
                current_range: range,
                ..measurement
            });
            samples.add(reading);
        }
        let range = |samples: &mut Samples| samples.take().unwrap().unwrap().current_range;
        assert_eq!(range(&mut samples), CurrentRange::Over);
        samples.add(measured(12.0, 1.0, None));
        assert_eq!(range(&mut samples), CurrentRange::Within, "of the next tick");
    }

    #[test]
    fn what_was_taken_is_gone() {
        let mut samples = Samples::new();
        assert_eq!(samples.take(), None, "not read yet");
        samples.add(measured(12.0, 1.0, Some(1.0)));
        assert!(matches!(samples.take(), Some(Ok(_))));
        assert_eq!(samples.take(), None);
        assert_eq!(samples.why_none(), ReadError::Timeout);
    }

    #[test]
    fn the_last_reason_stands_until_there_is_a_reading() {
        let mut samples = Samples::new();
        samples.add(Err(ReadError::Bus(BusError::NoAnswer)));
        samples.add(Err(ReadError::Bus(BusError::Stuck)));
        assert_eq!(samples.take(), Some(Err(BusError::Stuck.into())));
        assert_eq!(samples.take(), None);
        assert_eq!(samples.why_none(), BusError::Stuck.into());
        samples.add(measured(12.0, 1.0, None));
        assert!(matches!(samples.take(), Some(Ok(_))));
        assert_eq!(samples.why_none(), ReadError::Timeout);
    }
}
