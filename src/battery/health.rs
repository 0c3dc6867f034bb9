//! Whether a pack's sensor works, told when it changes.

use super::{PackEvent, PackStatus, ReadError};

/// So long a sensor has to work before it is said to be back, in seconds: a loose contact must not flood the link.
const LASTING_S: f32 = 5.0;

/// Tells once that a sensor has failed, and once that it works again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum HealthNews {
    /// Nothing has been told, or that it works.
    #[default]
    Fine,
    /// It was told that it failed.
    ToldFailed {
        /// For how long it has worked since, in seconds.
        working_s: f32,
    },
}

impl HealthNews {
    /// What there is to tell after a tick of `dt_s` seconds, with the error of its reading if that failed.
    pub fn update(&mut self, dt_s: f32, status: PackStatus, error: Option<ReadError>) -> Option<PackEvent> {
        let (next, event) = match (*self, error) {
            (Self::Fine, Some(error)) if status == PackStatus::Unhealthy => (
                Self::ToldFailed { working_s: 0.0 },
                Some(PackEvent::SensorFailed(error)),
            ),
            (Self::Fine, _) => (Self::Fine, None),
            (Self::ToldFailed { .. }, Some(_)) => (Self::ToldFailed { working_s: 0.0 }, None),
            (Self::ToldFailed { working_s }, None) if working_s + dt_s >= LASTING_S => {
                (Self::Fine, Some(PackEvent::SensorBack))
            }
            (Self::ToldFailed { working_s }, None) => (
                Self::ToldFailed {
                    working_s: working_s + dt_s,
                },
                None,
            ),
        };
        *self = next;
        event
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAILED: (PackStatus, Option<ReadError>) = (PackStatus::Unhealthy, Some(ReadError::NoAnswer));
    const WORKS: (PackStatus, Option<ReadError>) = (PackStatus::Healthy, None);

    fn told(
        news: &mut HealthNews,
        (status, error): (PackStatus, Option<ReadError>),
        ticks: u32,
    ) -> Vec<PackEvent> {
        (0..ticks)
            .filter_map(|_| news.update(0.1, status, error))
            .collect()
    }

    #[test]
    fn a_failure_is_told_once_and_the_return_after_a_while() {
        let mut news = HealthNews::default();
        assert_eq!(told(&mut news, WORKS, 100), []);
        assert_eq!(
            told(&mut news, FAILED, 100),
            [PackEvent::SensorFailed(ReadError::NoAnswer)]
        );
        assert_eq!(told(&mut news, WORKS, 45), []);
        assert_eq!(told(&mut news, FAILED, 1), [], "a loose contact");
        assert_eq!(told(&mut news, WORKS, 100), [PackEvent::SensorBack]);
        assert_eq!(told(&mut news, FAILED, 1).len(), 1);
    }

    #[test]
    fn failed_reads_of_a_pack_that_is_still_healthy_are_not_told() {
        let mut news = HealthNews::default();
        let glitch = (PackStatus::Healthy, Some(ReadError::Checksum));
        assert_eq!(told(&mut news, glitch, 4), []);
    }
}
