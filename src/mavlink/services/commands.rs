//! COMMAND_LONG and COMMAND_INT.

use ::mavlink::MessageData;

use super::vehicle::VehicleService;
use crate::mavlink::dialect::{
    AUTOPILOT_VERSION_DATA, AVAILABLE_MODES_DATA, COMPONENT_METADATA_DATA, MESSAGE_INTERVAL_DATA, MavCmd,
    MavResult, PROTOCOL_VERSION_DATA,
};
use crate::mavlink::event::Action;
use crate::mavlink::requests::Command;
use crate::mavlink::scheduler::{Interval, IntervalRefused, StreamScheduler};
use crate::mavlink::{
    Message, Stream, StreamKind, build_autopilot_version, build_available_mode, build_component_metadata,
    build_protocol_version,
};
use crate::pack::{Pack, PackSet};
use crate::parameter::MonitorKind;
use crate::sensor::ChargerPower;
use crate::system::SystemState;
use crate::time::Instant;
use crate::vehicle::{Mode, Restart};

/// MAV_CMD_PREFLIGHT_STORAGE, parameter 1: reset all parameters to their defaults.
const STORAGE_RESET: f32 = 2.0;

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, parameter 1: reboot the autopilot, also to stay in its boot loader.
const REBOOT_AUTOPILOT: f32 = 1.0;
const REBOOT_TO_BOOT_LOADER: f32 = 3.0;

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, parameters 1 to 4: execute what is not a code. ArduPilot's numbers for it.
const PROVOKE_FAULT: [f32; 4] = [42.0, 24.0, 71.0, 94.0];

/// MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES and its like, parameter 1: send it.
const REQUEST: f32 = 1.0;

/// SET_MESSAGE_INTERVAL, parameter 2.
const INTERVAL_OFF: f32 = -1.0;
const INTERVAL_DEFAULT: f32 = 0.0;

/// MESSAGE_INTERVAL: the message is not available, or it is turned off.
const NOT_AVAILABLE: i32 = 0;
const TURNED_OFF: i32 = -1;

/// MAV_CMD_BATTERY_RESET of ArduPilot's dialect: parameter 1 is a mask of packs, parameter 2 their charge in percent.
const BATTERY_RESET: u16 = 42651;

/// MAV_CMD_BATTERY_RESET, parameter 1: all packs, as MAVProxy writes it.
const ALL_PACKS: f32 = -1.0;

/// MAV_CMD_DO_AUX_FUNCTION of ArduPilot's dialect; parameter 1: solar chargers, by ArduPilot's number. Parameter 2: the position of the switch.
const CHARGERS: f32 = 172.0;
const SWITCH_LOW: f32 = 0.0;
const SWITCH_MIDDLE: f32 = 1.0;
const SWITCH_HIGH: f32 = 2.0;

const DO_AUX_FUNCTION: u16 = 218;
const DO_MOTOR_TEST: u16 = MavCmd::MAV_CMD_DO_MOTOR_TEST as u16;
const PREFLIGHT_STORAGE: u16 = MavCmd::MAV_CMD_PREFLIGHT_STORAGE as u16;
const PREFLIGHT_REBOOT_SHUTDOWN: u16 = MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN as u16;
const GET_MESSAGE_INTERVAL: u16 = MavCmd::MAV_CMD_GET_MESSAGE_INTERVAL as u16;
const SET_MESSAGE_INTERVAL: u16 = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL as u16;
const REQUEST_MESSAGE: u16 = MavCmd::MAV_CMD_REQUEST_MESSAGE as u16;
const REQUEST_PROTOCOL_VERSION: u16 = MavCmd::MAV_CMD_REQUEST_PROTOCOL_VERSION as u16;
const REQUEST_AUTOPILOT_CAPABILITIES: u16 = MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES as u16;

impl Action {
    /// Whether it must not happen to a rover that may be moving.
    pub(in crate::mavlink) fn needs_disarmed(self) -> bool {
        match self {
            Self::Restart(_) | Self::ResetParameters => true,
            Self::SwitchChargers(_) | Self::ResetBatteries { .. } => false,
        }
    }
}

/// The answer that a command asked for.
#[derive(Debug, PartialEq)]
pub enum Answer {
    Message(Message),
    /// Messages with this id that are streamed, once: of this pack, `None` if there is no such pack, which does not matter to
    /// messages of the vehicle.
    Streams(u32, Option<Pack>),
    /// AVAILABLE_MODES of each mode.
    Modes,
}

/// The streams of [`Answer::Streams`] that have something to report: of NAMED_VALUE_FLOAT one for each name.
pub fn requested_streams(
    message_id: u32,
    pack: Option<Pack>,
    state: &SystemState<'_>,
) -> impl Iterator<Item = Stream> {
    let kinds = StreamKind::with_message_id(message_id);
    let streams = kinds.map(move |kind| kind.of(pack.unwrap_or(Pack::First)));
    let asked = streams.filter(move |stream| stream.pack().is_none() || stream.pack() == pack);
    asked.filter(|stream| stream.is_reported_in(state))
}

/// Result of a command.
#[derive(Debug, PartialEq)]
pub struct CommandOutcome {
    pub result: MavResult,
    /// The answer, to be sent after the acknowledgement.
    pub answer: Option<Answer>,
    pub action: Option<Action>,
}

impl From<MavResult> for CommandOutcome {
    fn from(result: MavResult) -> Self {
        Self {
            result,
            answer: None,
            action: None,
        }
    }
}

impl From<Action> for CommandOutcome {
    fn from(action: Action) -> Self {
        Self {
            action: Some(action),
            ..ACCEPTED.into()
        }
    }
}

impl From<Answer> for CommandOutcome {
    fn from(answer: Answer) -> Self {
        Self {
            answer: Some(answer),
            ..ACCEPTED.into()
        }
    }
}

impl From<Message> for CommandOutcome {
    fn from(message: Message) -> Self {
        Answer::Message(message).into()
    }
}

const ACCEPTED: MavResult = MavResult::MAV_RESULT_ACCEPTED;
const FAILED: MavResult = MavResult::MAV_RESULT_FAILED;
const DENIED: MavResult = MavResult::MAV_RESULT_DENIED;
const UNSUPPORTED: MavResult = MavResult::MAV_RESULT_UNSUPPORTED;

impl Command {
    /// Whether it is answered and changes nothing.
    pub fn only_reads(&self) -> bool {
        matches!(
            self.number,
            GET_MESSAGE_INTERVAL
                | REQUEST_MESSAGE
                | REQUEST_PROTOCOL_VERSION
                | REQUEST_AUTOPILOT_CAPABILITIES
        )
    }

    /// Whether it restarts the board, or resets parameters or batteries.
    pub fn changes_for_good(&self) -> bool {
        matches!(
            self.number,
            PREFLIGHT_STORAGE | PREFLIGHT_REBOOT_SHUTDOWN | BATTERY_RESET
        )
    }

    /// Whether it changes something for all stations, whatever it asks of its own link.
    pub fn changes_for_all(&self) -> bool {
        self.changes_for_good() || self.number == DO_AUX_FUNCTION || VehicleService::changes_by(self.number)
    }

    /// Whether it requests the message with this id.
    pub fn requests_message(&self, id: u32) -> bool {
        self.number == REQUEST_MESSAGE && message_id(self.param1) == Some(id)
    }

    /// Does what the command asks of the link, and returns the answer and what the vehicle has to do.
    pub fn execute(
        &self,
        scheduler: &mut StreamScheduler,
        state: &SystemState<'_>,
        now: Instant,
    ) -> CommandOutcome {
        match self.number {
            PREFLIGHT_STORAGE if self.param1 == STORAGE_RESET => Action::ResetParameters.into(),
            PREFLIGHT_REBOOT_SHUTDOWN if self.param1 == REBOOT_AUTOPILOT => {
                Action::Restart(Restart::Firmware).into()
            }
            PREFLIGHT_REBOOT_SHUTDOWN if self.param1 == REBOOT_TO_BOOT_LOADER => {
                Action::Restart(Restart::BootLoader).into()
            }
            PREFLIGHT_REBOOT_SHUTDOWN if self.parameters() == PROVOKE_FAULT => {
                Action::Restart(Restart::Fault).into()
            }
            PREFLIGHT_STORAGE | PREFLIGHT_REBOOT_SHUTDOWN => DENIED.into(),
            SET_MESSAGE_INTERVAL => self.set_message_interval(scheduler, now).into(),
            GET_MESSAGE_INTERVAL => self.message_interval(self.param1, scheduler),
            BATTERY_RESET => self.reset_batteries(state),
            DO_AUX_FUNCTION if self.param1 == CHARGERS => self.switch_chargers(state),
            REQUEST_MESSAGE => self.request_message(scheduler, state),
            REQUEST_PROTOCOL_VERSION if self.param1 == REQUEST => protocol_version(),
            REQUEST_AUTOPILOT_CAPABILITIES if self.param1 == REQUEST => autopilot_version(state),
            REQUEST_PROTOCOL_VERSION | REQUEST_AUTOPILOT_CAPABILITIES => DENIED.into(),
            _ => UNSUPPORTED.into(),
        }
    }

    /// An alternative to a command that is not supported.
    pub fn alternative(&self) -> Option<&'static str> {
        // The rover can't sense whether its wheels are off the ground, so it does not turn them while disarmed.
        (self.number == DO_MOTOR_TEST).then_some("No motor test: use board-check")
    }

    fn parameters(&self) -> [f32; 4] {
        [self.param1, self.param2, self.param3, self.param4]
    }

    fn set_message_interval(&self, scheduler: &mut StreamScheduler, now: Instant) -> MavResult {
        let Some(message_id) = message_id(self.param1) else {
            return DENIED;
        };
        let interval = match self.param2 {
            INTERVAL_OFF => Interval::Off,
            INTERVAL_DEFAULT => Interval::Default,
            // A negative value or NaN becomes 0, which no message can have.
            interval_us => Interval::Every(interval_us as u32),
        };
        match scheduler.set_interval(message_id, interval, now) {
            Ok(()) => ACCEPTED,
            Err(IntervalRefused::OutOfRange) => DENIED,
            Err(IntervalRefused::NotStreamed) => UNSUPPORTED,
        }
    }

    fn message_interval(&self, asked: f32, scheduler: &StreamScheduler) -> CommandOutcome {
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

    fn request_message(&self, scheduler: &StreamScheduler, state: &SystemState<'_>) -> CommandOutcome {
        let Some(message_id) = message_id(self.param1) else {
            return DENIED.into();
        };
        match message_id {
            AUTOPILOT_VERSION_DATA::ID => autopilot_version(state),
            PROTOCOL_VERSION_DATA::ID => protocol_version(),
            MESSAGE_INTERVAL_DATA::ID => self.message_interval(self.param2, scheduler),
            AVAILABLE_MODES_DATA::ID => self.available_modes(),
            COMPONENT_METADATA_DATA::ID => Message::ComponentMetadata(build_component_metadata(state)).into(),
            _ => self.request_streams(message_id, state),
        }
    }

    /// The mode whose index is parameter 2, from 1; all of them if that is 0 or isn't given.
    fn available_modes(&self) -> CommandOutcome {
        if self.param2.is_nan() || self.param2 == 0.0 {
            return Answer::Modes.into();
        }
        let mut modes = Mode::ALL.into_iter().zip(1u8..);
        match modes.find(|(_, index)| f32::from(*index) == self.param2) {
            Some((mode, _)) => Message::AvailableModes(build_available_mode(mode)).into(),
            None => DENIED.into(),
        }
    }

    /// The message at once: of the pack whose instance is parameter 2, 0 if it isn't given.
    fn request_streams(&self, message_id: u32, state: &SystemState<'_>) -> CommandOutcome {
        let asked = if self.param2.is_nan() { 0.0 } else { self.param2 };
        let mut packs = Pack::ALL.into_iter();
        let pack = packs.find(|pack| f32::from(pack.instance()) == asked);
        if StreamKind::with_message_id(message_id).next().is_none() {
            UNSUPPORTED.into()
        } else if requested_streams(message_id, pack, state).next().is_none() {
            DENIED.into()
        } else {
            Answer::Streams(message_id, pack).into()
        }
    }

    /// Switches all solar chargers; as in ArduPilot the middle position leaves them as they are. Fails without a pack on the CAN bus.
    fn switch_chargers(&self, state: &SystemState<'_>) -> CommandOutcome {
        let power = match self.param2 {
            SWITCH_LOW => ChargerPower::Off,
            SWITCH_HIGH => ChargerPower::On,
            SWITCH_MIDDLE => return ACCEPTED.into(),
            _ => return DENIED.into(),
        };
        if !state.kinds.iter().any(|(_, kind)| *kind == MonitorKind::Can) {
            return FAILED.into();
        }
        Action::SwitchChargers(power).into()
    }

    /// Resets the packs that are named, and with a sum the packs that it is of. As in ArduPilot it fails if a pack that is
    /// named does not exist, unless it lies beyond the last one that does; or if it reports its own charge, which is not
    /// overridden. All the others are reset all the same, and the level of such a pack ends, too.
    fn reset_batteries(&self, state: &SystemState<'_>) -> CommandOutcome {
        let Some(asked) = packs_named_by(self.param1).filter(|_| self.param2.is_finite()) else {
            return DENIED.into();
        };
        let asked = state.with_members(asked);
        let existing = state.monitored_packs();
        let packs = asked & existing;
        if packs.is_empty() {
            return FAILED.into();
        }
        let last = existing.iter().last();
        let misses_one = (asked - existing).iter().any(|pack| Some(pack) < last);
        let is_complete = !misses_one && (packs & state.gauged_packs()).is_empty();
        let percent = self.param2.clamp(0.0, 100.0);
        CommandOutcome {
            result: if is_complete { ACCEPTED } else { FAILED },
            answer: None,
            action: Some(Action::ResetBatteries { packs, percent }),
        }
    }
}

/// The packs that parameter 1 of MAV_CMD_BATTERY_RESET names.
fn packs_named_by(parameter: f32) -> Option<PackSet> {
    let mask = parameter as u16;
    match parameter {
        ALL_PACKS => Some(PackSet::ALL),
        _ => (f32::from(mask) == parameter).then_some(PackSet::from_bits(mask)),
    }
}

fn autopilot_version(state: &SystemState<'_>) -> CommandOutcome {
    Message::AutopilotVersion(build_autopilot_version(state.identity)).into()
}

fn protocol_version() -> CommandOutcome {
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
    use crate::battery::{BatteryState, ChargeSource, PackStatus, Visibility};
    use proptest::prelude::*;

    /// Packs 0 and 3 are monitored, 3 on board only; there is none between them.
    fn packs() -> [BatteryState; 5] {
        let mut packs = [BatteryState::disabled(); 5];
        packs[0].status = PackStatus::Healthy;
        packs[3].status = PackStatus::Healthy;
        packs[3].visibility = Visibility::Internal;
        packs
    }

    fn command(number: u16, param1: f32, param2: f32) -> Command {
        Command {
            number,
            param1,
            param2,
            param3: f32::NAN,
            param4: f32::NAN,
        }
    }

    fn execute(number: u16, param1: f32, param2: f32) -> CommandOutcome {
        execute_with(&packs(), number, param1, param2)
    }

    fn execute_with(packs: &[BatteryState], number: u16, param1: f32, param2: f32) -> CommandOutcome {
        let state = SystemState {
            batteries: packs,
            ..SystemState::default()
        };
        let mut scheduler = StreamScheduler::new(Instant::EPOCH);
        scheduler.set_extra1_rate(2.0, Instant::EPOCH);
        command(number, param1, param2).execute(&mut scheduler, &state, Instant::EPOCH)
    }

    #[test]
    fn known_commands_with_other_parameters_are_denied_and_do_nothing() {
        for param1 in [0.0, 1.0, 3.0, -1.0, f32::NAN] {
            assert_eq!(execute(245, param1, 0.0), DENIED.into());
        }
        for param1 in [0.0, 2.0, 2.5, 4.0, -3.0, f32::NAN] {
            assert_eq!(execute(246, param1, 0.0), DENIED.into());
        }
        assert_eq!(execute(245, 2.0, f32::NAN), Action::ResetParameters.into());
        for (param1, restart) in [(1.0, Restart::Firmware), (3.0, Restart::BootLoader)] {
            assert_eq!(execute(246, param1, f32::NAN), Action::Restart(restart).into());
        }
    }

    #[test]
    fn fault_is_provoked_by_all_four_numbers_only() {
        let execute = |[param1, param2, param3, param4]: [f32; 4]| {
            let command = Command {
                number: 246,
                param1,
                param2,
                param3,
                param4,
            };
            let mut scheduler = StreamScheduler::new(Instant::EPOCH);
            command.execute(&mut scheduler, &SystemState::default(), Instant::EPOCH)
        };
        let outcome = execute(PROVOKE_FAULT);
        assert_eq!(outcome, Action::Restart(Restart::Fault).into());
        for place in 0..4 {
            for other in [0.0, 93.0, -PROVOKE_FAULT[place], f32::NAN] {
                let mut parameters = PROVOKE_FAULT;
                parameters[place] = other;
                assert_eq!(execute(parameters), DENIED.into(), "{parameters:?}");
            }
        }
    }

    #[test]
    fn bad_intervals_are_denied_and_foreign_messages_unsupported() {
        for interval_us in [-2.0, 1.0, 19_999.0, 1.9e9, f32::NAN, f32::INFINITY] {
            assert_eq!(execute(511, 147.0, interval_us), DENIED.into(), "{interval_us}");
        }
        for message_id in [-1.0, 0.5, 16_777_216.0, 1e9, f32::NAN] {
            assert_eq!(execute(511, message_id, 0.0), DENIED.into(), "{message_id}");
            assert_eq!(execute(510, message_id, 0.0), DENIED.into(), "{message_id}");
            assert_eq!(execute(512, message_id, 0.0), DENIED.into(), "{message_id}");
        }
        assert_eq!(execute(511, 30.0, 100_000.0), UNSUPPORTED.into());
        for (interval_us, result) in [(-1.0, DENIED), (2e6, DENIED), (1e6, ACCEPTED), (0.0, ACCEPTED)] {
            assert_eq!(execute(511, 0.0, interval_us), result.into(), "{interval_us}");
        }
        assert_eq!(execute(512, 30.0, 0.0), UNSUPPORTED.into());
    }

    #[test]
    fn versions_are_answered_when_they_are_requested() {
        for number in [519, 520] {
            assert!(execute(number, 1.0, 0.0).answer.is_some(), "{number}");
            for param1 in [0.0, 2.0, f32::NAN] {
                assert_eq!(execute(number, param1, 0.0), DENIED.into(), "{number}: {param1}");
            }
        }
    }

    /// By these a link takes a command without a signature, or drops an old one.
    #[test]
    fn a_command_reads_or_changes_for_good_by_its_number() {
        for (number, only_reads, changes_for_good) in [
            (245, false, true),
            (246, false, true),
            (42651, false, true),
            (510, true, false),
            (512, true, false),
            (519, true, false),
            (520, true, false),
            (218, false, false),
            (511, false, false),
        ] {
            let command = command(number, 1.0, 1.0);
            assert_eq!(command.only_reads(), only_reads, "{number}");
            assert_eq!(command.changes_for_good(), changes_for_good, "{number}");
        }
    }

    #[test]
    fn battery_status_is_sent_of_a_reported_pack_by_its_instance() {
        for instance in [0.0, -0.0, f32::NAN] {
            let outcome = execute(512, 147.0, instance);
            assert_eq!(outcome, Answer::Streams(147, Some(Pack::First)).into());
        }
        // None there, on board only, none there, no instance at all.
        for instance in [1.0, 3.0, 4.0, 5.0, 255.0, 256.0, -1.0, 0.5, f32::INFINITY] {
            assert_eq!(execute(512, 147.0, instance), DENIED.into(), "{instance}");
        }
    }

    fn reset(result: MavResult, mask: u16, percent: f32) -> CommandOutcome {
        let packs = PackSet::from_bits(mask);
        CommandOutcome {
            result,
            answer: None,
            action: Some(Action::ResetBatteries { packs, percent }),
        }
    }

    #[test]
    fn packs_that_exist_are_reset_and_one_that_is_missing_before_the_last_fails() {
        for (asked, percent, outcome) in [
            (1.0, 56.0, reset(ACCEPTED, 1, 56.0)),
            (8.0, 97.5, reset(ACCEPTED, 8, 97.5)),
            (9.0, 0.0, reset(ACCEPTED, 9, 0.0)),
            // Bits above the last pack don't matter.
            (17.0, 100.0, reset(ACCEPTED, 1, 100.0)),
            (3.0, 100.0, reset(FAILED, 1, 100.0)),
            (-1.0, 250.0, reset(FAILED, 9, 100.0)),
            (65535.0, -3.0, reset(FAILED, 9, 0.0)),
            // None of those named exists.
            (0.0, 50.0, FAILED.into()),
            (2.0, 50.0, FAILED.into()),
            (16.0, 50.0, FAILED.into()),
        ] {
            assert_eq!(execute(42651, asked, percent), outcome, "{asked}");
        }
    }

    #[test]
    fn the_level_of_a_pack_that_reports_its_charge_ends_though_the_command_fails() {
        let mut packs = packs();
        packs[3].charge_source = ChargeSource::Gauge;
        for (asked, outcome) in [
            (1.0, reset(ACCEPTED, 1, 50.0)),
            (8.0, reset(FAILED, 8, 50.0)),
            (9.0, reset(FAILED, 9, 50.0)),
            (-1.0, reset(FAILED, 9, 50.0)),
        ] {
            assert_eq!(execute_with(&packs, 42651, asked, 50.0), outcome, "{asked}");
        }
    }

    #[test]
    fn a_sum_is_reset_with_the_packs_it_is_of() {
        let mut packs = packs();
        // Of the first pack, and of two that are not monitored.
        packs[3].members = 0b1_0011;
        assert_eq!(execute_with(&packs, 42651, 8.0, 50.0), reset(ACCEPTED, 9, 50.0));
        // Of a sum, in turn of a pack with a gauge.
        packs[1] = packs[0];
        packs[1].members = 0b1000;
        packs[3].members = 1;
        assert_eq!(execute_with(&packs, 42651, 2.0, 50.0), reset(ACCEPTED, 11, 50.0));
        packs[0].charge_source = ChargeSource::Gauge;
        assert_eq!(execute_with(&packs, 42651, 2.0, 50.0), reset(FAILED, 11, 50.0));
        assert_eq!(execute_with(&packs, 42651, 1.0, 50.0), reset(FAILED, 1, 50.0));
    }

    #[test]
    fn a_reset_without_a_mask_or_a_percentage_is_denied() {
        for mask in [0.5, -2.0, 65536.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(execute(42651, mask, 50.0), DENIED.into(), "{mask}");
        }
        for percent in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(execute(42651, 1.0, percent), DENIED.into(), "{percent}");
        }
    }

    #[test]
    fn without_a_pack_there_is_nothing_to_reset() {
        assert_eq!(execute_with(&[], 42651, -1.0, 50.0), FAILED.into());
    }

    #[test]
    fn the_interval_reported_is_the_one_set() {
        let reported = |outcome: CommandOutcome| match outcome.answer {
            Some(Answer::Message(Message::MessageInterval(data))) => (data.message_id, data.interval_us),
            other => panic!("{other:?}"),
        };
        assert_eq!(reported(execute(510, 369.0, 0.0)), (369, -1));
        assert_eq!(reported(execute(510, 147.0, 0.0)), (147, 500_000));
        assert_eq!(reported(execute(510, 0.0, 0.0)), (0, 1_000_000));
        assert_eq!(reported(execute(510, 30.0, 0.0)), (30, 0));
        let mut scheduler = StreamScheduler::new(Instant::EPOCH);
        let mut execute =
            |command: Command| command.execute(&mut scheduler, &SystemState::default(), Instant::EPOCH);
        assert_eq!(execute(command(511, 1.0, -1.0)).result, ACCEPTED);
        assert_eq!(reported(execute(command(510, 1.0, f32::NAN))), (1, -1));
    }

    proptest! {
        #[test]
        fn every_other_number_is_answered_unsupported(number in any::<u16>(), param1 in any::<f32>()) {
            prop_assume!(![245, 246, 510, 511, 512, 519, 520, 42651].contains(&number));
            prop_assert_eq!(execute(number, param1, 0.0), UNSUPPORTED.into());
        }
    }
}
