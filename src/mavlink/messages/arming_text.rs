//! Reasons why the rover can't be armed, as text.

use core::fmt::Write;

use heapless::String;

use crate::battery::ArmingFailure;
use crate::pack::Pack;
use crate::vehicle::Stick;

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
