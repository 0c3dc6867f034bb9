//! Torqeedo's boat motors at their TQ bus, RS-485, as in ArduPilot's AP_Torqeedo_TQBus.
//!
//! A master asks, and is answered within 25 ms. A content begins with the address that it is for and the message; an answer is
//! for the master, and its message is 0. Numbers are big-endian; bytes count from the address:
//!
//! | from | to | message | bytes of the content |
//! |---|---|---|---|
//! | battery | tiller 0x14 | 0x01 asks for the speed | |
//! | tiller | master 0x00 | the speed | 2: 0x05 (pin present, speed valid), 3: 0, 4 and 5: speed in 1/1000 |
//! | battery | display 0x20 | 0x41 system state | 2 and 3: flags, 5: error code, 16: charge in %, 17 and 18: voltage in 10 mV, 19 and 20: current in 0.1 A, 27 and 28: temperatures in °C; 29 in all |
//! | master | motor 0x30 | 0x01, 0x03 ask for status, parameters | |
//! | motor | master 0x00 | status | 2: state, 3 and 4: errors; 5 in all |
//! | motor | master 0x00 | parameters | 6 and 7: voltage in 10 mV, 8 and 9: current in 0.1 A, 10 to 13: temperatures in 0.1 °C; 14 in all |
//!
//! A frame has a header, the content, its CRC-8 (Maxim) and a footer. In between, bytes that look like a header, footer or
//! escape follow an escape, with their highest bit inverted.
//!
//! This board drives no boat motor: as a tiller it answers with speed 0, as a master it sends no drive command.

use crc::{CRC_8_MAXIM_DOW, Crc, NoTable};

use crate::announce::LastAnnounced;
use crate::battery::{CurrentRange, Measurement, ReadError, Thermometer};
use crate::parameter::MonitorKind;
use crate::sensor::serial::conditions::{SerialNotice, TorqeedoCondition};
use crate::sensor::serial::protocol::{Baud, Line, Protocol, Request, SerialReading, Wires, centivolts};
use crate::time::Instant;

const MASTER: u8 = 0x00;
const TILLER: u8 = 0x14;
const DISPLAY: u8 = 0x20;

const ASK_FOR_SPEED: u8 = 0x01;
const SYSTEM_STATE: u8 = 0x41;

/// Tiller to master: speed 0.
const STOPPED: [u8; 9] = [0xAC, 0x00, 0x00, 0x05, 0x00, 0x00, 0x00, 0x81, 0xAD];

/// Master to motor.
const ASK_FOR_STATUS: [u8; 5] = [0xAC, 0x30, 0x01, 0x73, 0xAD];
const ASK_FOR_PARAMETERS: [u8; 5] = [0xAC, 0x30, 0x03, 0xCF, 0xAD];

/// A master that has not been answered for this long goes on, in microseconds.
const ANSWER_TIME_US: u64 = 25_000;

/// Interval of requests to the motor, in microseconds: for status and parameters every 0.4 s, as by ArduPilot.
const ASK_INTERVAL_US: u64 = 200_000;

/// Bit of the system state's flags: the charge is valid.
const CHARGE_VALID: u16 = 1 << 9;

/// This board's place on the bus (`TRQD1_TYPE`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::sensor::serial) enum TorqeedoRole {
    /// At the battery, which is the master, instead of the tiller and its display.
    Tiller,
    /// At the motor, as the master.
    Master,
}

/// The TQ bus.
#[derive(Clone, Copy, Debug)]
pub(in crate::sensor::serial) struct Torqeedo {
    frames: FrameReader,
    place: TorqeedoRole,
    /// Until when the battery waits for a speed, if it does.
    speed_awaited: Option<Instant>,
    /// When the motor is asked next.
    ask_due: Instant,
    /// The next question to the motor is that for its status, else that for its parameters.
    asks_for_status: bool,
    announced: LastAnnounced<TorqeedoCondition>,
}

impl Protocol for Torqeedo {
    type Model = TorqeedoRole;
    const LINE: Line = Line {
        baud: Baud::Fixed(19_200),
        wires: Wires::OneWire,
    };
    const KINDS: &'static [MonitorKind] = &[MonitorKind::Torqeedo];
    /// ArduPilot's time-out of the battery's values.
    const TIMEOUT_US: u64 = 5_000_000;

    fn new(place: &TorqeedoRole) -> Self {
        Self {
            frames: FrameReader::new(),
            place: *place,
            speed_awaited: None,
            ask_due: Instant::EPOCH,
            asks_for_status: false,
            announced: LastAnnounced::default(),
        }
    }

    /// A partial frame ends with the next header.
    fn push(&mut self, byte: u8, now: Instant, deliver: &mut impl FnMut(SerialReading)) {
        if let Some(content) = self.frames.push(byte) {
            let message = Message::of(self.place, content);
            self.handle(message, now, deliver);
        } else if self.frames.is_inside() {
            // The next frame has begun: it is too late for an answer.
            self.speed_awaited = None;
        }
    }

    fn next_request(&mut self, now: Instant) -> Option<Request> {
        let bytes: &[u8] = match self.place {
            TorqeedoRole::Tiller => {
                self.speed_awaited.take().filter(|until| now < *until)?;
                &STOPPED
            }
            TorqeedoRole::Master if now < self.ask_due => return None,
            TorqeedoRole::Master => {
                self.ask_due = now.after_us(ASK_INTERVAL_US);
                self.take_question()
            }
        };
        Request::from_slice(bytes).ok()
    }

    fn next_due(&self) -> Option<Instant> {
        match self.place {
            TorqeedoRole::Tiller => None,
            TorqeedoRole::Master => Some(self.ask_due),
        }
    }
}

impl Torqeedo {
    /// The next question, in turns.
    fn take_question(&mut self) -> &'static [u8] {
        self.asks_for_status = !self.asks_for_status;
        if self.asks_for_status {
            &ASK_FOR_PARAMETERS
        } else {
            &ASK_FOR_STATUS
        }
    }

    fn handle(&mut self, message: Option<Message>, now: Instant, deliver: &mut impl FnMut(SerialReading)) {
        match message {
            Some(Message::SpeedRequest) => self.speed_awaited = Some(now.after_us(ANSWER_TIME_US)),
            Some(Message::SystemState(measured, condition)) => {
                deliver(reading(measured));
                self.announce(condition, deliver);
            }
            Some(Message::MotorParameters(measured)) => deliver(reading(measured)),
            Some(Message::MotorStatus(condition)) => self.announce(condition, deliver),
            None => {}
        }
    }

    fn announce(&mut self, condition: TorqeedoCondition, deliver: &mut impl FnMut(SerialReading)) {
        if self.announced.has_changed(condition) {
            deliver(SerialReading::Notice(SerialNotice::Torqeedo(condition)));
        }
    }
}

fn reading(measured: Result<Measurement, ReadError>) -> SerialReading {
    match measured {
        Ok(measurement) => SerialReading::Torqeedo(measurement),
        Err(error) => SerialReading::Refused(MonitorKind::Torqeedo, error),
    }
}

/// A message to this board.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Message {
    SpeedRequest,
    SystemState(Result<Measurement, ReadError>, TorqeedoCondition),
    MotorParameters(Result<Measurement, ReadError>),
    MotorStatus(TorqeedoCondition),
}

impl Message {
    /// Decodes a content. `None` is for others, such as an echo of what this board has sent, or has another length.
    fn of(place: TorqeedoRole, content: &[u8]) -> Option<Self> {
        match (place, content) {
            (TorqeedoRole::Tiller, [TILLER, ASK_FOR_SPEED, ..]) => Some(Self::SpeedRequest),
            (TorqeedoRole::Tiller, [DISPLAY, SYSTEM_STATE, state @ ..]) => {
                Self::system_state(state.try_into().ok()?)
            }
            // An answer is recognised by its length.
            (TorqeedoRole::Master, [MASTER, _, _, e1, e0]) => {
                let errors = u16::from_be_bytes([*e1, *e0]);
                Some(Self::MotorStatus(TorqeedoCondition::of_motor(errors)))
            }
            (TorqeedoRole::Master, [MASTER, _, values @ ..]) => {
                Self::motor_parameters(values.try_into().ok()?)
            }
            _ => None,
        }
    }

    fn system_state(state: &[u8; 27]) -> Option<Self> {
        let [f1, f0, _, code, ..] = *state;
        let [
            ..,
            charge_pct,
            v1,
            v0,
            c1,
            c0,
            _,
            _,
            _,
            _,
            _,
            _,
            switch_c,
            input_c,
        ] = *state;
        let flags = u16::from_be_bytes([f1, f0]);
        let charge = f32::from(charge_pct.min(100)) * 0.01;
        let is_charge_known = flags & CHARGE_VALID != 0 && charge_pct != u8::MAX;
        let hottest_c = f32::from(switch_c.max(input_c));
        Some(Self::SystemState(
            measured([v1, v0], [c1, c0], hottest_c, is_charge_known.then_some(charge)),
            TorqeedoCondition::of_system(flags, code),
        ))
    }

    fn motor_parameters(values: &[u8; 12]) -> Option<Self> {
        let [_, _, _, _, v1, v0, c1, c0, b1, b0, s1, s0] = *values;
        let board = i16::from_be_bytes([b1, b0]);
        let stator = i16::from_be_bytes([s1, s0]);
        let hottest_c = f32::from(board.max(stator)) * 0.1;
        Some(Self::MotorParameters(measured(
            [v1, v0],
            [c1, c0],
            hottest_c,
            None,
        )))
    }
}

/// Measurement of words for voltage and current, a temperature in degrees Celsius, and a charge from 0 to 1.
fn measured(
    voltage: [u8; 2],
    current: [u8; 2],
    temperature_c: f32,
    state_of_charge: Option<f32>,
) -> Result<Measurement, ReadError> {
    let current = u16::from_be_bytes(current);
    Ok(Measurement {
        voltage_v: Some(centivolts(u16::from_be_bytes(voltage))?),
        current_a: Some(f32::from(current) * 0.1),
        current_range: CurrentRange::of_unsigned_word(current),
        temperature_c: Some(temperature_c),
        thermometer: Thermometer::Device,
        state_of_charge,
        ..Measurement::default()
    })
}

/// Without a table, as of contents of a few bytes.
const CRC: Crc<u8, NoTable> = Crc::<u8, NoTable>::new(&CRC_8_MAXIM_DOW);

const HEADER: u8 = 0xAC;
const FOOTER: u8 = 0xAD;
const ESCAPE: u8 = 0xAE;
const ESCAPE_MASK: u8 = 0x80;

/// Most bytes of a content with its checksum, as ArduPilot's limit.
const CONTENT_BYTES: usize = 35;

/// Finds frames in what is received.
#[derive(Clone, Copy, Debug)]
struct FrameReader {
    content: [u8; CONTENT_BYTES],
    length: usize,
    position: Position,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Position {
    Outside,
    Inside,
    AfterEscape,
}

impl FrameReader {
    /// Outside a frame.
    pub const fn new() -> Self {
        Self {
            content: [0; CONTENT_BYTES],
            length: 0,
            position: Position::Outside,
        }
    }

    /// Whether a frame has begun.
    pub fn is_inside(&self) -> bool {
        self.position != Position::Outside
    }

    /// Takes a byte, and returns the content without its checksum if it completes a valid frame.
    pub fn push(&mut self, byte: u8) -> Option<&[u8]> {
        match (self.position, byte) {
            // Neither is part of a content: whatever was before, a frame begins or ends here.
            (_, HEADER) => {
                self.position = Position::Inside;
                self.length = 0;
                None
            }
            (Position::Inside, FOOTER) => {
                self.position = Position::Outside;
                self.checked()
            }
            (_, FOOTER) => {
                self.position = Position::Outside;
                None
            }
            (Position::Outside, _) => None,
            (Position::Inside, ESCAPE) => {
                self.position = Position::AfterEscape;
                None
            }
            (Position::AfterEscape, byte) => {
                self.position = Position::Inside;
                self.add(byte ^ ESCAPE_MASK);
                None
            }
            (Position::Inside, byte) => {
                self.add(byte);
                None
            }
        }
    }

    fn add(&mut self, byte: u8) {
        match self.content.get_mut(self.length) {
            Some(place) => {
                *place = byte;
                self.length += 1;
            }
            // Longer than any frame.
            None => self.position = Position::Outside,
        }
    }

    fn checked(&self) -> Option<&[u8]> {
        let (crc, content) = self.content.get(..self.length)?.split_last()?;
        (!content.is_empty() && CRC.checksum(content) == *crc).then_some(content)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::time::at_us;

    fn read(torqeedo: &mut Torqeedo, bytes: &[u8]) -> Vec<SerialReading> {
        let mut found = Vec::new();
        for byte in bytes {
            torqeedo.push(*byte, Instant::EPOCH, &mut |reading| found.push(reading));
        }
        found
    }

    /// The request of battery to tiller for its speed.
    fn speed_request() -> Vec<u8> {
        frame(&[0x14, 0x01])
    }

    /// Battery to display: these flags, error code, charge, voltage in 10 mV, current in 0.1 A, 31 °C and 29 °C.
    fn system_state(flags: u16, code: u8, charge_pct: u8, voltage: u16, current: u16) -> Vec<u8> {
        let mut content = vec![0x20, 0x41];
        content.extend(flags.to_be_bytes());
        content.extend([0, code]);
        // Motor: voltage, current, power, speed, temperatures.
        content.extend([0x0B, 0xB8, 0, 100, 0, 250, 0x03, 0xE8, 40, 45]);
        content.push(charge_pct);
        content.extend(voltage.to_be_bytes());
        content.extend(current.to_be_bytes());
        // Speed over ground, range.
        content.extend([0, 0, 0, 0, 0, 0]);
        content.extend([31, 29]);
        assert_eq!(content.len(), 29);
        frame(&content)
    }

    fn motor_parameters(voltage: u16, current: u16, temperatures: [i16; 2]) -> Vec<u8> {
        let mut content = vec![0x00, 0x00, 0x03, 0xE8, 0x00, 0xFA];
        content.extend(voltage.to_be_bytes());
        content.extend(current.to_be_bytes());
        content.extend(temperatures.map(i16::to_be_bytes).concat());
        assert_eq!(content.len(), 14);
        frame(&content)
    }

    fn motor_status(errors: u16) -> Vec<u8> {
        let [e1, e0] = errors.to_be_bytes();
        frame(&[0x00, 0x00, 0x08, e1, e0])
    }

    fn tiller() -> Torqeedo {
        Torqeedo::new(&TorqeedoRole::Tiller)
    }

    fn master() -> Torqeedo {
        Torqeedo::new(&TorqeedoRole::Master)
    }

    fn announced(readings: &[SerialReading]) -> Vec<String> {
        let text = |reading: &SerialReading| match reading {
            SerialReading::Notice(notice) => Some(notice.to_string()),
            _ => None,
        };
        readings.iter().filter_map(text).collect()
    }

    /// The measurement in the only reading.
    fn measured(mut torqeedo: Torqeedo, bytes: &[u8]) -> Measurement {
        let found = read(&mut torqeedo, bytes);
        let [SerialReading::Torqeedo(measurement)] = found[..] else {
            panic!("{found:?}");
        };
        measurement
    }

    #[test]
    fn what_is_sent_are_frames() {
        assert_eq!(STOPPED[..], frame(&[0x00, 0x00, 0x05, 0x00, 0x00, 0x00]));
        assert_eq!(ASK_FOR_STATUS[..], frame(&[0x30, 0x01]));
        assert_eq!(ASK_FOR_PARAMETERS[..], frame(&[0x30, 0x03]));
    }

    #[test]
    fn system_state_has_the_values_of_the_battery() {
        let measurement = measured(tiller(), &system_state(CHARGE_VALID, 0, 87, 2594, 123));
        assert!((measurement.voltage_v.unwrap() - 25.94).abs() < 1e-4);
        assert!((measurement.current_a.unwrap() - 12.3).abs() < 1e-4);
        assert!((measurement.state_of_charge.unwrap() - 0.87).abs() < 1e-6);
        assert_eq!(measurement.temperature_c, Some(31.0));
        let measurement = measured(tiller(), &system_state(0, 0, 87, 2594, 123));
        assert_eq!(measurement.state_of_charge, None, "not valid");
    }

    #[test]
    fn motor_parameters_have_voltage_current_and_the_higher_temperature() {
        let measurement = measured(master(), &motor_parameters(2480, 215, [305, -12]));
        assert!((measurement.voltage_v.unwrap() - 24.8).abs() < 1e-4);
        assert!((measurement.current_a.unwrap() - 21.5).abs() < 1e-4);
        assert!((measurement.temperature_c.unwrap() - 30.5).abs() < 1e-4);
        assert_eq!(measurement.state_of_charge, None);
    }

    #[test]
    fn tiller_answers_a_request_with_speed_0_once() {
        let mut tiller = tiller();
        assert_eq!(tiller.next_request(Instant::EPOCH), None, "not asked");
        read(&mut tiller, &speed_request());
        assert_eq!(tiller.next_request(at_us(1_000)).unwrap(), STOPPED);
        assert_eq!(tiller.next_request(at_us(1_000)), None);
        // For others.
        read(&mut tiller, &frame(&[0x30, 0x01]));
        read(&mut tiller, &frame(&[0x14, 0x00]));
        assert_eq!(tiller.next_request(at_us(1_000)), None);
    }

    #[test]
    fn tiller_does_not_answer_too_late() {
        let mut tiller = tiller();
        read(&mut tiller, &speed_request());
        assert_eq!(tiller.next_request(at_us(ANSWER_TIME_US)), None);
        read(&mut tiller, &speed_request());
        read(&mut tiller, &system_state(0, 0, 50, 2400, 10)[..1]);
        assert_eq!(tiller.next_request(Instant::EPOCH), None, "the battery goes on");
    }

    #[test]
    fn master_asks_in_turns_and_never_drives() {
        let mut master = master();
        let mut now = at_us(7_000);
        for question in [ASK_FOR_PARAMETERS, ASK_FOR_STATUS, ASK_FOR_PARAMETERS] {
            assert_eq!(master.next_request(now).unwrap(), question);
            assert_eq!(master.next_request(now), None);
            now = now.after_us(ASK_INTERVAL_US);
            assert_eq!(master.next_due(), Some(now));
        }
    }

    #[test]
    fn echo_of_its_own_frames_is_not_taken() {
        let mut tiller = tiller();
        assert_eq!(read(&mut tiller, &STOPPED), []);
        assert_eq!(tiller.next_request(Instant::EPOCH), None);
        for question in [ASK_FOR_PARAMETERS, ASK_FOR_STATUS] {
            assert_eq!(read(&mut master(), &question), []);
        }
    }

    #[test]
    fn other_lengths_are_not_taken() {
        for length in 2..34 {
            let state = [&[0x20, 0x41][..], &vec![1; length - 2]].concat();
            let is_taken = !read(&mut tiller(), &frame(&state)).is_empty();
            assert_eq!(is_taken, length == 29, "{length}");
            let answer = frame(&vec![0; length]);
            let is_taken = !read(&mut master(), &answer).is_empty();
            assert_eq!(is_taken, length == 14, "{length}");
        }
    }

    #[test]
    fn error_is_announced_once_and_its_end() {
        let mut tiller = tiller();
        let mut texts = |code| announced(&read(&mut tiller, &system_state(0, code, 50, 2400, 10)));
        assert_eq!(texts(0), Vec::<String>::new());
        assert_eq!(texts(5), ["Torqeedo: error 5, motor blocked"]);
        assert_eq!(texts(5), Vec::<String>::new());
        assert_eq!(texts(0), ["Torqeedo: no error"]);
        let mut master = master();
        let mut texts = |errors| announced(&read(&mut master, &motor_status(errors)));
        assert_eq!(texts(0x0100), Vec::<String>::new(), "no drive commands are sent");
        assert_eq!(texts(0x0102), ["Torqeedo: motor blocked"]);
        assert_eq!(texts(0x0002), Vec::<String>::new());
        assert_eq!(texts(0), ["Torqeedo: no error"]);
    }

    proptest! {
        /// Whatever is received, a tiller sends speed 0, and nothing unless it was asked last.
        #[test]
        fn nothing_but_speed_0_is_ever_sent(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut tiller = tiller();
            read(&mut tiller, &bytes);
            if let Some(sent) = tiller.next_request(Instant::EPOCH) {
                prop_assert_eq!(&sent[..], &STOPPED[..]);
                prop_assert!(bytes.windows(5).any(|window| window == speed_request()));
            }
        }
    }

    /// The frame of a content.
    fn frame(content: &[u8]) -> Vec<u8> {
        let mut frame = vec![HEADER];
        for byte in content.iter().copied().chain([CRC.checksum(content)]) {
            if matches!(byte, HEADER | FOOTER | ESCAPE) {
                frame.extend([ESCAPE, byte ^ ESCAPE_MASK]);
            } else {
                frame.push(byte);
            }
        }
        frame.push(FOOTER);
        frame
    }

    fn contents(reader: &mut FrameReader, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut found = Vec::new();
        for byte in bytes {
            found.extend(reader.push(*byte).map(<[u8]>::to_vec));
        }
        found
    }

    #[test]
    fn frames_are_those_of_a_tiller() {
        // The examples of a turned handle in ArduPilot's libraries/AP_Torqeedo/AP_Torqeedo_TQBus.cpp; of the second, the byte
        // behind the escape is 0x2C: it is 0xAC, not the 0xAE of its comment.
        let ahead = [0xAC, 0x00, 0x00, 0x05, 0x00, 0x00, 0xED, 0x95, 0xAD];
        assert_eq!(frame(&[0, 0, 5, 0, 0x00, 0xED]), ahead);
        let back = [0xAC, 0x00, 0x00, 0x05, 0x00, 0xFF, 0xAE, 0x2C, 0x0C, 0xAD];
        assert_eq!(frame(&[0, 0, 5, 0, 0xFF, 0xAC]), back);
        let mut reader = FrameReader::new();
        assert_eq!(contents(&mut reader, &ahead), [[0, 0, 5, 0, 0x00, 0xED]]);
        assert_eq!(contents(&mut reader, &back), [[0, 0, 5, 0, 0xFF, 0xAC]]);
    }

    #[test]
    fn checksum_is_that_of_the_catalogue() {
        // CRC-8/MAXIM-DOW's check value.
        assert_eq!(CRC.checksum(b"123456789"), 0xA1);
    }

    #[test]
    fn too_long_or_empty_is_no_frame() {
        let mut reader = FrameReader::new();
        let longest = vec![0; CONTENT_BYTES - 1];
        assert_eq!(contents(&mut reader, &frame(&longest)), [longest]);
        let long = [&[HEADER][..], &[0; CONTENT_BYTES + 1], &[FOOTER]].concat();
        assert_eq!(contents(&mut reader, &long), Vec::<Vec<u8>>::new());
        assert_eq!(contents(&mut reader, &[HEADER, FOOTER]), Vec::<Vec<u8>>::new());
        assert_eq!(contents(&mut reader, &[HEADER, 0, FOOTER]), Vec::<Vec<u8>>::new());
    }

    proptest! {
        #[test]
        fn frame_is_found_right_after_garbage(
            garbage in prop::collection::vec(any::<u8>(), 0..100),
            content in prop::collection::vec(any::<u8>(), 1..CONTENT_BYTES),
        ) {
            let mut reader = FrameReader::new();
            contents(&mut reader, &garbage);
            let found = contents(&mut reader, &frame(&content));
            prop_assert_eq!(found, [content]);
        }
    }
}
