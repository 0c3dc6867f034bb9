//! A ground station inside the simulator: reads what the vehicle announces, and sends what a scenario's driver does.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::convert::Infallible;

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embedded_io_async::{ErrorType, Write};
use rover_battmon::mavlink::dialect::{
    HEARTBEAT_DATA, MANUAL_CONTROL_DATA, MavCmd, MavMessage, MavModeFlag, STATUSTEXT_DATA,
};
use rover_battmon::tasks::{ByteSource, ReceiveError};
use rover_battmon::vehicle::ArmState;
use rover_battmon::vehicle::Mode;

use super::console::Level;
use super::status::driving;
use crate::frames::{self, FrameReader, frame, set_parameter};

/// The vehicle's system id: a scenario sets none.
const VEHICLE: u8 = 1;

/// The ground station. A reference to it is both ends of its wire.
///
/// It sends no HEARTBEAT: the vehicle does not wait for it.
pub struct Station<H> {
    /// Is given an announcement, or the mode and whether the rover is armed, and how urgent it is.
    on_heard: H,
    reader: RefCell<FrameReader>,
    /// The first chunks of a text.
    begun_text: RefCell<String>,
    driving: Cell<(Mode, ArmState)>,
    sequence: Cell<u8>,
    to_send: RefCell<VecDeque<u8>>,
    sent: Signal<NoopRawMutex, ()>,
}

impl<H: Fn(Level, &str)> Station<H> {
    /// A ground station that passes on what it hears.
    pub fn new(on_heard: H) -> Self {
        Self {
            on_heard,
            reader: RefCell::default(),
            begun_text: RefCell::default(),
            driving: Cell::new((Mode::Hold, ArmState::Disarmed)),
            sequence: Cell::new(0),
            to_send: RefCell::default(),
            sent: Signal::new(),
        }
    }

    /// Sets a parameter (PARAM_SET).
    pub fn set(&self, name: &str, value: f32) {
        self.send(&set_parameter(VEHICLE, name, value));
    }

    /// Arms or disarms (MAV_CMD_COMPONENT_ARM_DISARM).
    pub fn arm(&self, arm_state: ArmState) {
        let param1 = match arm_state {
            ArmState::Armed => 1.0,
            ArmState::Disarmed => 0.0,
        };
        self.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, param1, 0.0);
    }

    /// Changes the mode (MAV_CMD_DO_SET_MODE).
    pub fn set_mode(&self, mode: Mode) {
        let flags = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        self.command(
            MavCmd::MAV_CMD_DO_SET_MODE,
            f32::from(flags.bits()),
            mode.number() as f32,
        );
    }

    /// Moves the throttle (MANUAL_CONTROL), from −1000 (back) to 1000 (ahead). It times out.
    pub fn drive(&self, throttle: i16) {
        self.send(&MavMessage::MANUAL_CONTROL(MANUAL_CONTROL_DATA {
            target: VEHICLE,
            z: throttle,
            ..MANUAL_CONTROL_DATA::DEFAULT
        }));
    }

    fn command(&self, command: MavCmd, param1: f32, param2: f32) {
        self.send(&frames::command(VEHICLE, command, [param1, param2, 0.0, 0.0]));
    }

    fn send(&self, message: &MavMessage) {
        let sequence = self.sequence.get();
        self.sequence.set(sequence.wrapping_add(1));
        self.to_send.borrow_mut().extend(frame(sequence, message));
        self.sent.signal(());
    }

    fn hear(&self, message: &MavMessage) {
        match message {
            MavMessage::STATUSTEXT(text) => self.hear_text(text),
            MavMessage::HEARTBEAT(heartbeat) => self.hear_heartbeat(heartbeat),
            _ => {}
        }
    }

    /// A text may come in chunks of one id, the last of which is not full.
    fn hear_text(&self, message: &STATUSTEXT_DATA) {
        let mut text = self.begun_text.borrow_mut();
        if message.chunk_seq == 0 {
            text.clear();
        }
        let bytes: &[u8; 50] = &message.text;
        let end = bytes.iter().position(|byte| *byte == 0);
        text.push_str(&String::from_utf8_lossy(&bytes[..end.unwrap_or(bytes.len())]));
        if message.id == 0 || end.is_some() {
            (self.on_heard)(message.severity.into(), &std::mem::take(&mut *text));
        }
    }

    fn hear_heartbeat(&self, heartbeat: &HEARTBEAT_DATA) {
        let Some(mode) = Mode::from_number(heartbeat.custom_mode) else {
            return;
        };
        let is_armed = heartbeat
            .base_mode
            .contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
        let arm_state = if is_armed {
            ArmState::Armed
        } else {
            ArmState::Disarmed
        };
        if self.driving.replace((mode, arm_state)) != (mode, arm_state) {
            (self.on_heard)(Level::Info, &driving(mode, arm_state));
        }
    }
}

impl<H> ErrorType for &Station<H> {
    type Error = Infallible;
}

impl<H: Fn(Level, &str)> Write for &Station<H> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let frames = self.reader.borrow_mut().take(bytes);
        for message in frames.iter().filter_map(|frame| frame.message.as_ref()) {
            self.hear(message);
        }
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl<H> ByteSource for &Station<H> {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        while self.to_send.borrow().is_empty() {
            self.sent.wait().await;
        }
        let mut to_send = self.to_send.borrow_mut();
        let count = to_send.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(to_send.drain(..count)) {
            *to = from;
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use embassy_futures::block_on;

    use super::*;
    use rover_battmon::mavlink::dialect::MavSeverity;

    /// What is heard in these messages.
    fn heard(messages: &[MavMessage]) -> Vec<(Level, String)> {
        let heard = RefCell::new(Vec::new());
        let station = Station::new(|level, text: &str| heard.borrow_mut().push((level, text.to_owned())));
        for message in messages {
            let Ok(_) = block_on((&station).write(&frame(0, message)));
        }
        heard.take()
    }

    fn text(severity: MavSeverity, text: &str, id: u16, chunk_seq: u8) -> MavMessage {
        MavMessage::STATUSTEXT(STATUSTEXT_DATA {
            severity,
            text: text.into(),
            id,
            chunk_seq,
        })
    }

    #[test]
    fn chunks_are_one_text_with_its_level() {
        let long = "x".repeat(50);
        let messages = [
            text(MavSeverity::MAV_SEVERITY_WARNING, &long, 7, 0),
            text(MavSeverity::MAV_SEVERITY_WARNING, "end", 7, 1),
            text(MavSeverity::MAV_SEVERITY_CRITICAL, &long, 0, 0),
            text(MavSeverity::MAV_SEVERITY_NOTICE, "short", 0, 0),
        ];
        let expected = [
            (Level::Warning, format!("{long}end")),
            (Level::Critical, long),
            (Level::Info, "short".into()),
        ];
        assert_eq!(heard(&messages), expected);
    }

    #[test]
    fn a_mode_is_heard_when_it_changes() {
        let heartbeat = |custom_mode, base_mode| {
            MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                custom_mode,
                base_mode,
                ..HEARTBEAT_DATA::DEFAULT
            })
        };
        let armed = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        let none = MavModeFlag::empty();
        let messages = [
            heartbeat(4, none),
            heartbeat(0, armed),
            heartbeat(0, armed),
            heartbeat(4, armed),
        ];
        let texts: Vec<_> = heard(&messages).into_iter().map(|(_, text)| text).collect();
        assert_eq!(texts, ["MANUAL, armed", "HOLD, armed"]);
    }

    #[test]
    fn what_is_sent_arrives_in_order_whatever_the_reader_takes_at_a_time() {
        let station = Station::new(|_, _: &str| {});
        station.set("BATT_LOW_VOLT", 10.5);
        station.arm(ArmState::Armed);
        let mut received = Vec::new();
        let mut buffer = [0; 7];
        while !station.to_send.borrow().is_empty() {
            let count = block_on((&station).receive(&mut buffer)).unwrap();
            received.extend(&buffer[..count]);
        }
        let frames = FrameReader::default().take(&received);
        let names: Vec<_> = frames
            .iter()
            .map(|frame| match frame.message.as_ref().unwrap() {
                MavMessage::PARAM_SET(set) => set.param_id.to_str().unwrap().to_owned(),
                MavMessage::COMMAND_LONG(command) => format!("{:?} {}", command.command, command.param1),
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(names, ["BATT_LOW_VOLT", "MAV_CMD_COMPONENT_ARM_DISARM 1"]);
    }
}
