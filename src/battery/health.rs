//! Faults of a pack's sensor and of its contact, reported when they begin and end.

use super::failsafe::ArmState;
use super::{PackEvent, PackStatus, ReadError};

/// So long a sensor has to work before its recovery is reported, in seconds: what fails now and then must not flood the link.
const SENSOR_WORKS_S: f32 = 5.0;

/// The same of a contact: a loose wire of a rover that drives may hold for longer.
const CONTACT_HOLDS_S: f32 = 30.0;

/// Reports once that sensor or contact have failed, and once that they work again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HealthReporter {
    sensor: Fault,
    contact: Fault,
}

/// Whether a fault was reported.
#[derive(Clone, Copy, Debug, Default)]
enum Fault {
    /// None, or its end.
    #[default]
    None,
    /// Its beginning.
    Reported {
        /// For how long there was no sign of it since, in seconds.
        gone_s: f32,
    },
}

/// What a tick shows of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sign {
    /// It is there.
    Present,
    /// Too little to report it, and too much for its end.
    Unclear,
    /// It is not there.
    Absent,
}

/// What there is to report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    Begins,
    Ends,
}

impl HealthReporter {
    /// What a tick of `dt_s` seconds, with the error of its reading if that failed, shows of the sensor.
    pub fn sensor(&mut self, dt_s: f32, status: PackStatus, error: Option<ReadError>) -> Option<PackEvent> {
        let sign = match (error, status) {
            (Some(_), PackStatus::Unhealthy) => Sign::Present,
            (Some(_), _) => Sign::Unclear,
            (None, _) => Sign::Absent,
        };
        Some(match self.sensor.update(dt_s, sign, SENSOR_WORKS_S)? {
            Change::Begins => PackEvent::SensorFailed(error?),
            Change::Ends => PackEvent::SensorBack,
        })
    }

    /// What it shows of the contact. Without a pack a disarmed rover is on a desk.
    pub fn contact(
        &mut self,
        dt_s: f32,
        status: PackStatus,
        error: Option<ReadError>,
        arm_state: ArmState,
    ) -> Option<PackEvent> {
        let sign = match (error, status, arm_state) {
            (None, PackStatus::NotConnected, ArmState::Armed) => Sign::Present,
            (None, PackStatus::Healthy, _) => Sign::Absent,
            _ => Sign::Unclear,
        };
        Some(match self.contact.update(dt_s, sign, CONTACT_HOLDS_S)? {
            Change::Begins => PackEvent::ContactLost,
            Change::Ends => PackEvent::ContactBack,
        })
    }
}

impl Fault {
    fn update(&mut self, dt_s: f32, sign: Sign, ends_after_s: f32) -> Option<Change> {
        match (&mut *self, sign) {
            (Self::None, Sign::Present) => {
                *self = Self::Reported { gone_s: 0.0 };
                return Some(Change::Begins);
            }
            (Self::None, _) => {}
            (Self::Reported { gone_s }, Sign::Absent) => {
                *gone_s += dt_s;
                if *gone_s >= ends_after_s {
                    *self = Self::None;
                    return Some(Change::Ends);
                }
            }
            (Self::Reported { gone_s }, _) => *gone_s = 0.0,
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAILED: (PackStatus, Option<ReadError>) = (PackStatus::Unhealthy, Some(ReadError::NoAnswer));
    const WORKS: (PackStatus, Option<ReadError>) = (PackStatus::Healthy, None);

    fn reported(
        reporter: &mut HealthReporter,
        (status, error): (PackStatus, Option<ReadError>),
        ticks: u32,
    ) -> Vec<PackEvent> {
        (0..ticks)
            .filter_map(|_| reporter.sensor(0.1, status, error))
            .collect()
    }

    fn contact(
        reporter: &mut HealthReporter,
        status: PackStatus,
        arm_state: ArmState,
        ticks: u32,
    ) -> Vec<PackEvent> {
        (0..ticks)
            .filter_map(|_| reporter.contact(0.1, status, None, arm_state))
            .collect()
    }

    #[test]
    fn a_failure_is_reported_once_and_the_recovery_after_a_while() {
        let mut reporter = HealthReporter::default();
        assert_eq!(reported(&mut reporter, WORKS, 100), []);
        assert_eq!(
            reported(&mut reporter, FAILED, 100),
            [PackEvent::SensorFailed(ReadError::NoAnswer)]
        );
        assert_eq!(reported(&mut reporter, WORKS, 45), []);
        assert_eq!(reported(&mut reporter, FAILED, 1), [], "a loose contact");
        assert_eq!(reported(&mut reporter, WORKS, 100), [PackEvent::SensorBack]);
        assert_eq!(reported(&mut reporter, FAILED, 1).len(), 1);
    }

    #[test]
    fn failed_reads_of_a_pack_that_is_still_healthy_are_not_reported() {
        let mut reporter = HealthReporter::default();
        let glitch = (PackStatus::Healthy, Some(ReadError::Checksum));
        assert_eq!(reported(&mut reporter, glitch, 4), []);
    }

    #[test]
    fn a_contact_that_flickers_is_reported_once() {
        let mut reporter = HealthReporter::default();
        let mut reports = Vec::new();
        for _ in 0..60 {
            reports.extend(contact(
                &mut reporter,
                PackStatus::NotConnected,
                ArmState::Armed,
                1,
            ));
            reports.extend(contact(&mut reporter, PackStatus::Healthy, ArmState::Armed, 89));
        }
        assert_eq!(reports, [PackEvent::ContactLost]);
        let after = contact(&mut reporter, PackStatus::Healthy, ArmState::Disarmed, 301);
        assert_eq!(after, [PackEvent::ContactBack]);
    }

    #[test]
    fn a_disarmed_rover_without_a_pack_is_not_reported() {
        let mut reporter = HealthReporter::default();
        let lost = PackStatus::NotConnected;
        assert_eq!(contact(&mut reporter, lost, ArmState::Disarmed, 100), []);
        let armed = contact(&mut reporter, lost, ArmState::Armed, 100);
        assert_eq!(armed, [PackEvent::ContactLost]);
    }

    #[test]
    fn a_reading_that_fails_is_no_contact() {
        let mut reporter = HealthReporter::default();
        contact(&mut reporter, PackStatus::NotConnected, ArmState::Armed, 1);
        let failed = (0..1000).filter_map(|_| {
            reporter.contact(
                0.1,
                PackStatus::Healthy,
                Some(ReadError::Timeout),
                ArmState::Armed,
            )
        });
        assert_eq!(failed.count(), 0);
    }
}
