//! What the rover does on its own, and why it can't be armed, in words.

use core::fmt::Write;

use heapless::String;

use crate::battery::ArmingFailure;
use crate::mavlink::dialect::MavSeverity;
use crate::pack::Pack;
use crate::vehicle::{Stick, VehicleEvent};

/// The longest text, in bytes: two STATUSTEXT.
const TEXT_BYTES: usize = 96;

/// What the rover is checked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::mavlink) enum CheckedBy {
    /// Before it is armed: nothing is at stake yet.
    Request,
    /// On an attempt.
    Attempt,
}

impl CheckedBy {
    /// ArduPilot's words for it.
    fn prefix(self) -> &'static str {
        match self {
            Self::Request => "PreArm",
            Self::Attempt => "Arm",
        }
    }
}

/// How urgent it is, and what to say of an event of the rover.
pub fn vehicle_announcement(event: VehicleEvent) -> (MavSeverity, String<TEXT_BYTES>) {
    let mut text = String::new();
    // A text that does not fit is cut off; a test shows that all do.
    let _ = write!(text, "{event}");
    let severity = match event {
        VehicleEvent::Terminated => MavSeverity::MAV_SEVERITY_CRITICAL,
        VehicleEvent::NeedsPosition(_)
        | VehicleEvent::ControlsTimedOut
        | VehicleEvent::GroundStationsTimedOut => MavSeverity::MAV_SEVERITY_WARNING,
    };
    (severity, text)
}

/// Why `pack` keeps the rover from being armed: "PreArm: Battery 1 ..." or "Arm: Battery 1 ...".
pub(in crate::mavlink) fn arming_failure_text(
    checked_by: CheckedBy,
    pack: Pack,
    failure: ArmingFailure,
) -> String<TEXT_BYTES> {
    let mut text = String::new();
    let _ = write!(
        text,
        "{}: Battery {} {failure}",
        checked_by.prefix(),
        pack.number()
    );
    text
}

/// A stick is deflected on an attempt to arm, in ArduPilot's words.
pub(in crate::mavlink) fn stick_deflected_text(stick: Stick) -> &'static str {
    match stick {
        Stick::Throttle => "Arm: Throttle (RC3) is not neutral",
        Stick::Steering => "Arm: Steering (RC1) is not neutral",
    }
}

/// A failsafe has disarmed the rover for good.
pub(in crate::mavlink) fn terminated_text(checked_by: CheckedBy) -> String<TEXT_BYTES> {
    let mut text = String::new();
    let _ = write!(
        text,
        "{}: Terminated: reset the battery or restart",
        checked_by.prefix()
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::FailsafeAction;

    #[test]
    fn every_event_has_a_text_that_fits() {
        for (event, expected) in [
            (
                VehicleEvent::NeedsPosition(FailsafeAction::SmartRtl),
                "SmartRTL needs a position: Hold",
            ),
            (VehicleEvent::Terminated, "Terminated by battery failsafe"),
            (VehicleEvent::ControlsTimedOut, "Radio Failsafe: Hold"),
            (VehicleEvent::GroundStationsTimedOut, "GCS Failsafe: Hold"),
        ] {
            assert_eq!(vehicle_announcement(event).1, expected);
        }
    }

    #[test]
    fn a_failed_check_has_ardupilots_words() {
        assert_eq!(
            arming_failure_text(CheckedBy::Request, Pack::Ninth, ArmingFailure::CapacityOrder),
            "PreArm: Battery 9 capacity failsafe critical >= low"
        );
        assert_eq!(
            arming_failure_text(CheckedBy::Attempt, Pack::First, ArmingFailure::BelowArmingVoltage),
            "Arm: Battery 1 below minimum arming voltage"
        );
    }
}
