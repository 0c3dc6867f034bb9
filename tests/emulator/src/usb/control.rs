//! Control transfers of the host: SETUP, data and status stage (USB 2.0, 8.5.3), and the requests they carry (9.4, and
//! CDC PSTN120 6.3).

use super::super::clock::{Cycle, cycles};
use super::bus::{Delivery, Endpoint, Handshake, Sent, Toggle};
use super::controller::Controller;

/// What a packet of EP0 holds at most.
const PACKET_BYTES: usize = 64;

/// How long hosts wait for the end of a control transfer.
const TIMEOUT: Cycle = cycles(5_000_000);

/// A transaction that is not answered is tried so often (8.6.2).
pub const TRIES: u32 = 3;

const DEVICE_TO_HOST: u8 = 0x80;
const CLASS_INTERFACE: u8 = 0x21;
const GET_DESCRIPTOR: u8 = 6;
const SET_ADDRESS: u8 = 5;
const SET_CONFIGURATION: u8 = 9;
const SET_LINE_CODING: u8 = 0x20;
const GET_LINE_CODING: u8 = 0x21;
const SET_CONTROL_LINE_STATE: u8 = 0x22;
const DEVICE: u16 = 1 << 8;
const CONFIGURATION: u16 = 2 << 8;
const STRING: u16 = 3 << 8;
/// US English.
const LANGUAGE: u16 = 0x0409;
/// 115200 baud 8N1.
const LINE_CODING: [u8; 7] = [0x00, 0xc2, 0x01, 0x00, 0, 0, 8];
const DTR_AND_RTS: u16 = 0b11;

/// What the host asks of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlRequest {
    DeviceDescriptor {
        length: u16,
    },
    SetAddress(u8),
    ConfigurationDescriptor {
        length: u16,
    },
    Languages,
    StringDescriptor(u8),
    SetConfiguration(u8),
    SetLineCoding,
    GetLineCoding,
    /// DTR and RTS raised.
    Open,
    /// DTR and RTS lowered.
    Close,
}

impl ControlRequest {
    fn fields(self) -> (u8, u8, u16, u16, u16) {
        let get = |value, index, length| (DEVICE_TO_HOST, GET_DESCRIPTOR, value, index, length);
        match self {
            Self::DeviceDescriptor { length } => get(DEVICE, 0, length),
            Self::SetAddress(address) => (0, SET_ADDRESS, u16::from(address), 0, 0),
            Self::ConfigurationDescriptor { length } => get(CONFIGURATION, 0, length),
            Self::Languages => get(STRING, 0, 255),
            Self::StringDescriptor(index) => get(STRING | u16::from(index), LANGUAGE, 255),
            Self::SetConfiguration(value) => (0, SET_CONFIGURATION, u16::from(value), 0, 0),
            Self::SetLineCoding => (CLASS_INTERFACE, SET_LINE_CODING, 0, 0, LINE_CODING.len() as u16),
            Self::GetLineCoding => {
                let length = LINE_CODING.len() as u16;
                (CLASS_INTERFACE | DEVICE_TO_HOST, GET_LINE_CODING, 0, 0, length)
            }
            Self::Open => (CLASS_INTERFACE, SET_CONTROL_LINE_STATE, DTR_AND_RTS, 0, 0),
            Self::Close => (CLASS_INTERFACE, SET_CONTROL_LINE_STATE, 0, 0, 0),
        }
    }

    fn setup_packet(self) -> [u8; 8] {
        let (kind, request, value, index, length) = self.fields();
        let [[v0, v1], [i0, i1], [l0, l1]] = [value, index, length].map(u16::to_le_bytes);
        [kind, request, v0, v1, i0, i1, l0, l1]
    }

    fn is_input(self) -> bool {
        self.fields().0 & DEVICE_TO_HOST != 0
    }

    fn length(self) -> usize {
        usize::from(self.fields().4)
    }

    fn data(self) -> &'static [u8] {
        match self {
            Self::SetLineCoding => &LINE_CODING,
            _ => &[],
        }
    }
}

/// Where the host drops a transfer, without a sign to the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AbortPoint {
    BeforeData,
    BeforeStatus,
}

/// Why a transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    Stalled,
    NoAnswer,
    /// A packet that does not belong there.
    Protocol,
    TimedOut,
    Aborted,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Setup,
    Data,
    Status,
}

/// Result of a transaction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// It took this many bytes of data, and the transfer goes on.
    Moved(usize),
    /// The device is not ready.
    Waits,
    Completed(Vec<u8>),
    Failed(Failure),
}

#[derive(Clone)]
pub struct ControlTransfer {
    pub request: ControlRequest,
    abort: Option<AbortPoint>,
    stage: Stage,
    toggle: Toggle,
    moved: usize,
    received: Vec<u8>,
    silent: u32,
    deadline: Option<Cycle>,
}

impl ControlTransfer {
    pub fn new(request: ControlRequest, abort: Option<AbortPoint>) -> Self {
        Self {
            request,
            abort,
            stage: Stage::Setup,
            toggle: Toggle::Data1,
            moved: 0,
            received: Vec::new(),
            silent: 0,
            deadline: None,
        }
    }

    /// One transaction.
    pub fn step(&mut self, address: u8, delivery: Delivery, controller: &mut Controller, now: Cycle) -> Step {
        let deadline = *self.deadline.get_or_insert(now + TIMEOUT);
        if now >= deadline {
            return Step::Failed(Failure::TimedOut);
        }
        if self.is_aborted_here() {
            return Step::Failed(Failure::Aborted);
        }
        let endpoint = Endpoint { address, number: 0 };
        match (self.stage, self.request.is_input()) {
            (Stage::Setup, _) => self.set_up(controller, address),
            (Stage::Data, true) => self.receive(controller, endpoint, delivery),
            (Stage::Data, false) => self.send(controller, endpoint),
            (Stage::Status, true) => self.send_status(controller, endpoint),
            (Stage::Status, false) => self.receive_status(controller, endpoint),
        }
    }

    fn is_aborted_here(&self) -> bool {
        match self.abort {
            Some(AbortPoint::BeforeData) => self.stage == Stage::Data,
            Some(AbortPoint::BeforeStatus) => self.stage == Stage::Status,
            None => false,
        }
    }

    fn set_up(&mut self, controller: &mut Controller, address: u8) -> Step {
        match controller.setup(address, self.request.setup_packet()) {
            Some(_) => {
                let has_data = self.request.length() != 0;
                self.moved(if has_data { Stage::Data } else { Stage::Status }, 8)
            }
            None => self.not_answered(),
        }
    }

    fn receive(&mut self, controller: &mut Controller, endpoint: Endpoint, delivery: Delivery) -> Step {
        match controller.input(endpoint, delivery) {
            Some(Sent::Data(toggle, bytes)) if toggle == self.toggle => {
                self.received.extend(&bytes);
                self.toggle = toggle.flipped();
                let is_last = bytes.len() < PACKET_BYTES || self.received.len() >= self.request.length();
                self.moved(if is_last { Stage::Status } else { Stage::Data }, bytes.len())
            }
            // It has come before (8.6.4).
            Some(Sent::Data(_, bytes)) => self.moved(Stage::Data, bytes.len()),
            other => self.not_sent(other),
        }
    }

    fn send(&mut self, controller: &mut Controller, endpoint: Endpoint) -> Step {
        let rest = &self.request.data()[self.moved..];
        let packet = &rest[..rest.len().min(PACKET_BYTES)];
        match controller.output(endpoint, self.toggle, packet) {
            Some(Handshake::Ack) => {
                self.toggle = self.toggle.flipped();
                self.moved += packet.len();
                let is_last = packet.len() == rest.len();
                self.moved(if is_last { Stage::Status } else { Stage::Data }, packet.len())
            }
            other => self.not_taken(other),
        }
    }

    fn send_status(&mut self, controller: &mut Controller, endpoint: Endpoint) -> Step {
        match controller.output(endpoint, Toggle::Data1, &[]) {
            Some(Handshake::Ack) => Step::Completed(std::mem::take(&mut self.received)),
            other => self.not_taken(other),
        }
    }

    fn receive_status(&mut self, controller: &mut Controller, endpoint: Endpoint) -> Step {
        match controller.input(endpoint, Delivery::Acknowledged) {
            Some(Sent::Data(Toggle::Data1, bytes)) if bytes.is_empty() => Step::Completed(Vec::new()),
            Some(Sent::Data(..)) => Step::Failed(Failure::Protocol),
            other => self.not_sent(other),
        }
    }

    fn not_sent(&mut self, answer: Option<Sent>) -> Step {
        match answer {
            Some(Sent::Stall) => Step::Failed(Failure::Stalled),
            Some(_) => Step::Waits,
            None => self.not_answered(),
        }
    }

    fn not_taken(&mut self, answer: Option<Handshake>) -> Step {
        match answer {
            Some(Handshake::Stall) => Step::Failed(Failure::Stalled),
            Some(_) => Step::Waits,
            None => self.not_answered(),
        }
    }

    fn not_answered(&mut self) -> Step {
        self.silent += 1;
        if self.silent == TRIES {
            return Step::Failed(Failure::NoAnswer);
        }
        Step::Moved(0)
    }

    fn moved(&mut self, next: Stage, bytes: usize) -> Step {
        self.stage = next;
        self.silent = 0;
        Step::Moved(bytes)
    }
}
