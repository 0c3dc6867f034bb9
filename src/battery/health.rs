//! Reports sensor faults and lost contacts of a pack, once when they begin and once when they end.

use super::diagnosis::{Change, Condition, Evidence};
use super::{ArmState, PackEvent, PackStatus, ReadError};

/// A sensor has to work for this long before its recovery is reported, in seconds: intermittent failures must not flood
/// the link.
const SENSOR_RECOVERY_S: f32 = 5.0;

/// The same of a contact: a loose wire may hold for longer while driving.
const CONTACT_RECOVERY_S: f32 = 30.0;

/// The reported faults of one pack.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HealthReporter {
    sensor: Condition,
    contact: Condition,
}

impl HealthReporter {
    /// Updates the sensor's fault after `dt_s` seconds, with the read error of this tick.
    pub fn sensor(&mut self, dt_s: f32, status: PackStatus, error: Option<ReadError>) -> Option<PackEvent> {
        let evidence = match (error, status) {
            (Some(_), PackStatus::Unhealthy) => Evidence::Present,
            (Some(_), _) => Evidence::Ambiguous,
            (None, _) => Evidence::Absent,
        };
        Some(match self.sensor.update(dt_s, evidence, SENSOR_RECOVERY_S)? {
            Change::Begins => PackEvent::SensorFailed(error?),
            Change::Ends => PackEvent::SensorRecovered,
        })
    }

    /// Updates the contact's fault. A disarmed rover may have no pack.
    pub fn contact(
        &mut self,
        dt_s: f32,
        status: PackStatus,
        error: Option<ReadError>,
        arm_state: ArmState,
    ) -> Option<PackEvent> {
        let evidence = match (error, status, arm_state) {
            (None, PackStatus::NotConnected, ArmState::Armed) => Evidence::Present,
            (None, PackStatus::Healthy, _) => Evidence::Absent,
            _ => Evidence::Ambiguous,
        };
        Some(match self.contact.update(dt_s, evidence, CONTACT_RECOVERY_S)? {
            Change::Begins => PackEvent::ContactLost,
            Change::Ends => PackEvent::ContactRestored,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::BusError;

    const FAILED: (PackStatus, Option<ReadError>) =
        (PackStatus::Unhealthy, Some(ReadError::Bus(BusError::NoAnswer)));
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
    fn failure_is_reported_once_and_recovery_debounced() {
        let mut reporter = HealthReporter::default();
        assert_eq!(reported(&mut reporter, WORKS, 100), []);
        assert_eq!(
            reported(&mut reporter, FAILED, 100),
            [PackEvent::SensorFailed(ReadError::Bus(BusError::NoAnswer))]
        );
        assert_eq!(reported(&mut reporter, WORKS, 45), []);
        assert_eq!(reported(&mut reporter, FAILED, 1), [], "a loose contact");
        assert_eq!(reported(&mut reporter, WORKS, 100), [PackEvent::SensorRecovered]);
        assert_eq!(reported(&mut reporter, FAILED, 1).len(), 1);
    }

    #[test]
    fn failed_reads_of_a_healthy_pack_are_not_reported() {
        let mut reporter = HealthReporter::default();
        let glitch = (PackStatus::Healthy, Some(ReadError::Bus(BusError::Checksum)));
        assert_eq!(reported(&mut reporter, glitch, 4), []);
    }

    #[test]
    fn intermittent_contact_is_reported_once() {
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
        assert_eq!(after, [PackEvent::ContactRestored]);
    }

    #[test]
    fn missing_pack_is_not_reported_while_disarmed() {
        let mut reporter = HealthReporter::default();
        let lost = PackStatus::NotConnected;
        assert_eq!(contact(&mut reporter, lost, ArmState::Disarmed, 100), []);
        let armed = contact(&mut reporter, lost, ArmState::Armed, 100);
        assert_eq!(armed, [PackEvent::ContactLost]);
    }

    #[test]
    fn failed_read_does_not_restore_a_contact() {
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
