//! Reasons why the rover can't be armed, as text.

use core::fmt::Write;

use heapless::String;

use crate::system::ArmingObstacle;
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

/// Why the rover can't be armed, in ArduPilot's words: "PreArm: Battery 1 ..." or "Arm: Battery 1 ...".
pub(in crate::mavlink) fn arming_text(checked_by: CheckedBy, obstacle: ArmingObstacle) -> String<TEXT_BYTES> {
    let mut text = String::new();
    let prefix = checked_by.prefix();
    // The longest fits.
    let _ = match obstacle {
        ArmingObstacle::Terminated => write!(text, "{prefix}: Terminated: reset the battery or restart"),
        ArmingObstacle::Restarting => write!(text, "{prefix}: restarting"),
        ArmingObstacle::Pack(pack, failure) => {
            write!(text, "{prefix}: Battery {} {failure}", pack.number())
        }
        ArmingObstacle::Stick(Stick::Throttle) => write!(text, "{prefix}: Throttle (RC3) is not neutral"),
        ArmingObstacle::Stick(Stick::Steering) => write!(text, "{prefix}: Steering (RC1) is not neutral"),
        ArmingObstacle::Logging => write!(text, "{prefix}: Logging failed"),
    };
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::ArmingFailure;
    use crate::pack::Pack;

    #[test]
    fn a_failed_check_has_ardupilots_words() {
        assert_eq!(
            arming_text(
                CheckedBy::Request,
                ArmingObstacle::Pack(Pack::Ninth, ArmingFailure::CapacityOrder)
            ),
            "PreArm: Battery 9 capacity failsafe critical >= low"
        );
        assert_eq!(
            arming_text(
                CheckedBy::Attempt,
                ArmingObstacle::Pack(Pack::First, ArmingFailure::BelowArmingVoltage)
            ),
            "Arm: Battery 1 below minimum arming voltage"
        );
    }
}
