//! COMMAND_LONG and COMMAND_INT.
//!
//! Both are read from the raw payload, where the command's number and the first four parameters are at the same places:
//! the `mavlink` crate refuses a whole message whose command it does not know, and then it could not be answered.

use crate::mavlink::dialect::{MavCmd, MavResult};
use crate::mavlink::payload::Payload;

const COMMAND_AT: usize = 28;

/// MAV_CMD_PREFLIGHT_STORAGE, parameter 1: reset all parameters to their defaults.
const STORAGE_RESET: f32 = 2.0;

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, parameter 1: reboot the autopilot.
const REBOOT_AUTOPILOT: f32 = 1.0;

/// What the vehicle has to do, beyond answering.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Action {
    /// Restart the board once what was answered and set has been sent and saved.
    Reboot,
    /// Forget everything stored and go back to the defaults.
    ResetParameters,
}

/// A command as it was received.
pub(in crate::mavlink) struct Command {
    pub number: u16,
    param1: f32,
}

impl Command {
    pub fn read(payload: &Payload<'_>) -> Self {
        Self {
            number: payload.u16(COMMAND_AT),
            param1: payload.f32(0),
        }
    }

    /// What to answer, and what to do.
    pub fn execute(&self) -> (MavResult, Option<Action>) {
        const PREFLIGHT_STORAGE: u16 = MavCmd::MAV_CMD_PREFLIGHT_STORAGE as u16;
        const PREFLIGHT_REBOOT_SHUTDOWN: u16 = MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN as u16;
        match self.number {
            PREFLIGHT_STORAGE if self.param1 == STORAGE_RESET => accept(Action::ResetParameters),
            PREFLIGHT_REBOOT_SHUTDOWN if self.param1 == REBOOT_AUTOPILOT => accept(Action::Reboot),
            PREFLIGHT_STORAGE | PREFLIGHT_REBOOT_SHUTDOWN => (MavResult::MAV_RESULT_DENIED, None),
            _ => (MavResult::MAV_RESULT_UNSUPPORTED, None),
        }
    }
}

fn accept(action: Action) -> (MavResult, Option<Action>) {
    (MavResult::MAV_RESULT_ACCEPTED, Some(action))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn command(number: u16, param1: f32) -> (MavResult, Option<Action>) {
        Command { number, param1 }.execute()
    }

    #[test]
    fn known_commands_with_other_parameters_are_denied_and_do_nothing() {
        for param1 in [0.0, 1.0, 3.0, -1.0, f32::NAN] {
            assert_eq!(command(245, param1), (MavResult::MAV_RESULT_DENIED, None));
        }
        for param1 in [0.0, 2.0, 3.0, f32::NAN] {
            assert_eq!(command(246, param1), (MavResult::MAV_RESULT_DENIED, None));
        }
        assert_eq!(
            command(245, 2.0),
            (MavResult::MAV_RESULT_ACCEPTED, Some(Action::ResetParameters))
        );
        assert_eq!(
            command(246, 1.0),
            (MavResult::MAV_RESULT_ACCEPTED, Some(Action::Reboot))
        );
    }

    proptest! {
        #[test]
        fn every_other_number_is_answered_unsupported(number in any::<u16>(), param1 in any::<f32>()) {
            prop_assume!(number != 245 && number != 246);
            prop_assert_eq!(command(number, param1), (MavResult::MAV_RESULT_UNSUPPORTED, None));
        }
    }
}
