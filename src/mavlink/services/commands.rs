//! COMMAND_LONG and COMMAND_INT.
//!
//! Both are read from the raw payload, where the command's number and the first four parameters are at the same places:
//! the `mavlink` crate refuses a whole message whose command it does not know, and then it could not be answered.

use ::mavlink::MessageData;

use crate::mavlink::dialect::{
    AUTOPILOT_VERSION_DATA, BATTERY_STATUS_DATA, HEARTBEAT_DATA, MESSAGE_INTERVAL_DATA, MavCmd, MavResult,
    PROTOCOL_VERSION_DATA, SYS_STATUS_DATA,
};
use crate::mavlink::payload::Payload;
use crate::mavlink::scheduler::{Interval, SHORTEST_INTERVAL_US, StreamScheduler};
use crate::mavlink::{Message, Stream, SystemState, build_autopilot_version, build_protocol_version};

const COMMAND_AT: usize = 28;

/// MAV_CMD_PREFLIGHT_STORAGE, parameter 1: reset all parameters to their defaults.
const STORAGE_RESET: f32 = 2.0;

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, parameter 1: reboot the autopilot.
const REBOOT_AUTOPILOT: f32 = 1.0;

/// MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES and its like, parameter 1: send it.
const REQUEST: f32 = 1.0;

/// SET_MESSAGE_INTERVAL, parameter 2.
const INTERVAL_OFF: f32 = -1.0;
const INTERVAL_DEFAULT: f32 = 0.0;

/// MESSAGE_INTERVAL: the message is not available, or it is turned off.
const NOT_AVAILABLE: i32 = 0;
const TURNED_OFF: i32 = -1;

const PREFLIGHT_STORAGE: u16 = MavCmd::MAV_CMD_PREFLIGHT_STORAGE as u16;
const PREFLIGHT_REBOOT_SHUTDOWN: u16 = MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN as u16;
const GET_MESSAGE_INTERVAL: u16 = MavCmd::MAV_CMD_GET_MESSAGE_INTERVAL as u16;
const SET_MESSAGE_INTERVAL: u16 = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL as u16;
const REQUEST_MESSAGE: u16 = MavCmd::MAV_CMD_REQUEST_MESSAGE as u16;
const REQUEST_PROTOCOL_VERSION: u16 = MavCmd::MAV_CMD_REQUEST_PROTOCOL_VERSION as u16;
const REQUEST_AUTOPILOT_CAPABILITIES: u16 = MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES as u16;

/// What the vehicle has to do, beyond answering.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Action {
    /// Restart the board once what was answered and set has been sent and saved.
    Reboot,
    /// Forget everything stored and go back to the defaults.
    ResetParameters,
}

/// A command as it was received. Ground stations fill parameters they don't use with NaN.
#[derive(Clone, Copy, Debug)]
pub(in crate::mavlink) struct Command {
    pub number: u16,
    param1: f32,
    param2: f32,
}

/// What came of a command.
#[derive(Debug, PartialEq)]
pub(in crate::mavlink) struct Outcome {
    pub result: MavResult,
    /// What was asked for, to be sent after the acknowledgement.
    pub message: Option<Message>,
    pub action: Option<Action>,
}

impl From<MavResult> for Outcome {
    fn from(result: MavResult) -> Self {
        Self {
            result,
            message: None,
            action: None,
        }
    }
}

impl From<Action> for Outcome {
    fn from(action: Action) -> Self {
        Self {
            result: MavResult::MAV_RESULT_ACCEPTED,
            message: None,
            action: Some(action),
        }
    }
}

impl From<Message> for Outcome {
    fn from(message: Message) -> Self {
        Self {
            result: MavResult::MAV_RESULT_ACCEPTED,
            message: Some(message),
            action: None,
        }
    }
}

const DENIED: MavResult = MavResult::MAV_RESULT_DENIED;
const UNSUPPORTED: MavResult = MavResult::MAV_RESULT_UNSUPPORTED;

impl Command {
    pub fn read(payload: &Payload<'_>) -> Self {
        Self {
            number: payload.u16(COMMAND_AT),
            param1: payload.f32(0),
            param2: payload.f32(4),
        }
    }

    /// Does what the command asks of the link, and tells what to answer and what the vehicle has to do.
    pub fn execute(&self, scheduler: &mut StreamScheduler, state: &SystemState, now_us: u64) -> Outcome {
        match self.number {
            PREFLIGHT_STORAGE if self.param1 == STORAGE_RESET => Action::ResetParameters.into(),
            PREFLIGHT_REBOOT_SHUTDOWN if self.param1 == REBOOT_AUTOPILOT => Action::Reboot.into(),
            PREFLIGHT_STORAGE | PREFLIGHT_REBOOT_SHUTDOWN => DENIED.into(),
            SET_MESSAGE_INTERVAL => self.set_message_interval(scheduler, now_us).into(),
            GET_MESSAGE_INTERVAL => self.message_interval(self.param1, scheduler),
            REQUEST_MESSAGE => self.request_message(scheduler, state),
            REQUEST_PROTOCOL_VERSION if self.param1 == REQUEST => protocol_version(),
            REQUEST_AUTOPILOT_CAPABILITIES if self.param1 == REQUEST => autopilot_version(),
            REQUEST_PROTOCOL_VERSION | REQUEST_AUTOPILOT_CAPABILITIES => DENIED.into(),
            _ => UNSUPPORTED.into(),
        }
    }

    fn set_message_interval(&self, scheduler: &mut StreamScheduler, now_us: u64) -> MavResult {
        let Some(message_id) = message_id(self.param1) else {
            return DENIED;
        };
        let interval = match self.param2 {
            INTERVAL_OFF => Interval::Off,
            INTERVAL_DEFAULT => Interval::Default,
            interval_us if interval_us >= SHORTEST_INTERVAL_US as f32 && interval_us.is_finite() => {
                Interval::Every(interval_us as u64)
            }
            // Negative, faster than anything is sent, or no number.
            _ => return DENIED,
        };
        match scheduler.set_interval(message_id, interval, now_us) {
            Ok(()) => MavResult::MAV_RESULT_ACCEPTED,
            Err(_) => UNSUPPORTED,
        }
    }

    fn message_interval(&self, asked: f32, scheduler: &StreamScheduler) -> Outcome {
        let id = message_id(asked).and_then(|id| u16::try_from(id).ok());
        let Some(message_id) = id else {
            return DENIED.into();
        };
        let interval_us = match scheduler.interval_us(message_id.into()) {
            Ok(Some(interval_us)) => i32::try_from(interval_us).unwrap_or(i32::MAX),
            Ok(None) => TURNED_OFF,
            Err(_) => NOT_AVAILABLE,
        };
        Message::MessageInterval(MESSAGE_INTERVAL_DATA {
            interval_us,
            message_id,
        })
        .into()
    }

    fn request_message(&self, scheduler: &StreamScheduler, state: &SystemState) -> Outcome {
        let Some(message_id) = message_id(self.param1) else {
            return DENIED.into();
        };
        match message_id {
            HEARTBEAT_DATA::ID => Stream::Heartbeat.build(state).into(),
            SYS_STATUS_DATA::ID => Stream::SysStatus.build(state).into(),
            // The instance, 0 if it isn't given.
            BATTERY_STATUS_DATA::ID if self.param2 == 0.0 || self.param2.is_nan() => {
                Stream::BatteryStatus(0).build(state).into()
            }
            BATTERY_STATUS_DATA::ID => DENIED.into(),
            AUTOPILOT_VERSION_DATA::ID => autopilot_version(),
            PROTOCOL_VERSION_DATA::ID => protocol_version(),
            MESSAGE_INTERVAL_DATA::ID => self.message_interval(self.param2, scheduler),
            _ => UNSUPPORTED.into(),
        }
    }
}

fn autopilot_version() -> Outcome {
    Message::AutopilotVersion(build_autopilot_version()).into()
}

fn protocol_version() -> Outcome {
    Message::ProtocolVersion(build_protocol_version()).into()
}

/// MAVLink 2 message ids have 24 bits, all of which a float can hold.
fn message_id(parameter: f32) -> Option<u32> {
    let id = parameter as u32;
    (id as f32 == parameter && id < 1 << 24).then_some(id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn execute(number: u16, param1: f32, param2: f32) -> Outcome {
        let mut scheduler = StreamScheduler::new(0);
        scheduler.set_extra1_rate(2.0, 0);
        Command {
            number,
            param1,
            param2,
        }
        .execute(&mut scheduler, &SystemState::default(), 0)
    }

    #[test]
    fn known_commands_with_other_parameters_are_denied_and_do_nothing() {
        for param1 in [0.0, 1.0, 3.0, -1.0, f32::NAN] {
            assert_eq!(execute(245, param1, 0.0), DENIED.into());
        }
        for param1 in [0.0, 2.0, 3.0, f32::NAN] {
            assert_eq!(execute(246, param1, 0.0), DENIED.into());
        }
        assert_eq!(execute(245, 2.0, f32::NAN), Action::ResetParameters.into());
        assert_eq!(execute(246, 1.0, f32::NAN), Action::Reboot.into());
    }

    #[test]
    fn bad_intervals_are_denied_and_foreign_messages_unsupported() {
        for interval_us in [-2.0, 1.0, 19_999.0, f32::NAN, f32::INFINITY] {
            assert_eq!(execute(511, 147.0, interval_us), DENIED.into(), "{interval_us}");
        }
        for message_id in [-1.0, 0.5, 1e9, f32::NAN] {
            assert_eq!(execute(511, message_id, 0.0), DENIED.into(), "{message_id}");
            assert_eq!(execute(510, message_id, 0.0), DENIED.into(), "{message_id}");
            assert_eq!(execute(512, message_id, 0.0), DENIED.into(), "{message_id}");
        }
        assert_eq!(execute(511, 30.0, 100_000.0), UNSUPPORTED.into());
        assert_eq!(execute(512, 30.0, 0.0), UNSUPPORTED.into());
        assert_eq!(
            execute(512, 147.0, 1.0),
            DENIED.into(),
            "there is no second battery"
        );
    }

    #[test]
    fn the_interval_told_is_the_one_set() {
        let told = |outcome: Outcome| match outcome.message {
            Some(Message::MessageInterval(data)) => (data.message_id, data.interval_us),
            other => panic!("{other:?}"),
        };
        assert_eq!(told(execute(510, 147.0, 0.0)), (147, 500_000));
        assert_eq!(told(execute(510, 0.0, 0.0)), (0, 1_000_000));
        assert_eq!(told(execute(510, 30.0, 0.0)), (30, 0));
        let mut scheduler = StreamScheduler::new(0);
        let off = Command {
            number: 511,
            param1: 1.0,
            param2: -1.0,
        };
        assert_eq!(
            off.execute(&mut scheduler, &SystemState::default(), 0).result,
            MavResult::MAV_RESULT_ACCEPTED
        );
        let get = Command {
            number: 510,
            param1: 1.0,
            param2: f32::NAN,
        };
        assert_eq!(
            told(get.execute(&mut scheduler, &SystemState::default(), 0)),
            (1, -1)
        );
    }

    proptest! {
        #[test]
        fn every_other_number_is_answered_unsupported(number in any::<u16>(), param1 in any::<f32>()) {
            prop_assume!(![245, 246, 510, 511, 512, 519, 520].contains(&number));
            prop_assert_eq!(execute(number, param1, 0.0), UNSUPPORTED.into());
        }
    }
}
