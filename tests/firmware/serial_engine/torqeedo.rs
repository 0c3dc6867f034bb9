//! Torqeedo's TQ bus: its battery as the master, and its motor, built from the messages of ArduPilot's
//! libraries/AP_Torqeedo/AP_Torqeedo_TQBus.h and .cpp. The bus is RS-485, so what the board sends may come back as an echo.

use super::{Peer, after_a_second, assert_recovers_from, assert_untroubled, run_with, with_second_pack};
use emulator::{LogLevel, SentByte};
use support::frames::texts_of;
use workbench::bench::{Bench, MILLISECOND, SECOND};

const TORQEEDO: f32 = 23.0;
const TILLER: f32 = 1.0;
const MOTOR: f32 = 2.0;

/// The pin that switches the transceiver to sending.
const DRIVER_ENABLE: usize = 22;

/// A bit at 19200 baud, in microseconds.
const BIT_US: f64 = 1e6 / 19_200.0;

const CYCLES_PER_US: f64 = 125.0;

/// The CRC-8 of 1-Wire, bit by bit.
fn crc8(bytes: &[u8]) -> u8 {
    let step = |crc: u8, _| crc >> 1 ^ if crc & 1 != 0 { 0x8C } else { 0 };
    bytes.iter().fold(0, |crc, byte| (0..8).fold(crc ^ byte, step))
}

fn frame(content: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xAC];
    for byte in content.iter().copied().chain([crc8(content)]) {
        match byte {
            0xAC..=0xAE => frame.extend([0xAE, byte ^ 0x80]),
            _ => frame.push(byte),
        }
    }
    frame.push(0xAD);
    frame
}

/// The content of a frame, which needs no escape.
fn content(frame: &[u8]) -> Vec<u8> {
    let [0xAC, content @ .., crc, 0xAD] = frame else {
        panic!("no frame: {frame:02x?}");
    };
    assert_eq!(*crc, crc8(content));
    content.to_vec()
}

/// What the board sends, up to the end of each frame.
#[derive(Default)]
struct Receiver(Vec<u8>);

impl Receiver {
    /// The content of a frame that is complete.
    fn take(&mut self, sent: &[u8]) -> Option<Vec<u8>> {
        self.0.extend(sent);
        (self.0.last() == Some(&0xAD)).then(|| content(&std::mem::take(&mut self.0)))
    }
}

/// What is wrong with the other end, or the wire.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    Silent,
    WrongChecksum,
    /// Contents with a byte less.
    TooShort,
    /// Bytes that are not a frame before each one.
    Noise,
}

/// A frame of this content, or what a fault makes of it.
fn faulty(fault: Fault, content: &[u8]) -> Vec<u8> {
    match fault {
        Fault::None => frame(content),
        Fault::Silent => Vec::new(),
        Fault::WrongChecksum => {
            let mut bytes = frame(content);
            let last = bytes.len() - 2;
            bytes[last] = if bytes[last] == 0 { 1 } else { 0 };
            bytes
        }
        Fault::TooShort => frame(&content[..content.len() - 1]),
        Fault::Noise => [&[0x00, 0xAC, 0x20, 0x41, 0xAE, 0x55][..], &frame(content)].concat(),
    }
}

/// Whether what the board sends comes back to it.
#[derive(Clone, Copy, PartialEq)]
pub enum Echo {
    None,
    Comes,
}

/// A battery: asks the tiller for its speed every 50 ms, and instead each fourth time sends its state to the display.
pub struct Battery {
    voltage: u16,
    current: u16,
    code: u8,
    fault: Fault,
    echo: Echo,
    receiver: Receiver,
    next_us: u64,
    turns: u64,
    asked_us: Option<u64>,
    answers: usize,
    latest_answer_us: u64,
}

impl Battery {
    pub fn new(echo: Echo) -> Self {
        Self {
            voltage: 2594,
            current: 123,
            code: 0,
            fault: Fault::None,
            echo,
            receiver: Receiver::default(),
            next_us: 0,
            turns: 0,
            asked_us: None,
            answers: 0,
            latest_answer_us: 0,
        }
    }

    /// Flags (the charge is valid), error code, the motor's values, 87 %, the battery's values, range, 31 °C and 44 °C.
    fn state(&self) -> Vec<u8> {
        let mut content = vec![0x20, 0x41, 0x02, 0x00, 0, self.code];
        content.extend([0x0B, 0xB8, 0, 100, 0, 250, 0x03, 0xE8, 40, 45, 87]);
        content.extend(self.voltage.to_be_bytes());
        content.extend(self.current.to_be_bytes());
        content.extend([0, 0xAC, 0, 0xAD, 0, 0xAE, 31, 44]);
        assert_eq!(content.len(), 29);
        content
    }

    fn take_answer(&mut self, answer: &[u8], now_us: u64) {
        assert_eq!(answer, [0x00, 0x00, 0x05, 0x00, 0x00, 0x00], "speed 0");
        let asked_us = self.asked_us.take().expect("only if it was asked");
        self.latest_answer_us = self.latest_answer_us.max(now_us - asked_us);
        self.answers += 1;
    }
}

impl Peer for Battery {
    const BAUD: u32 = 19_200;

    fn turn(&mut self, sent: &[u8], now_us: u64) -> Vec<u8> {
        if let Some(answer) = self.receiver.take(sent) {
            self.take_answer(&answer, now_us);
        }
        if self.echo == Echo::Comes && !sent.is_empty() {
            return sent.to_vec();
        }
        if now_us < self.next_us {
            return Vec::new();
        }
        self.next_us = now_us + 50 * MILLISECOND;
        self.turns += 1;
        if self.turns.is_multiple_of(4) {
            return faulty(self.fault, &self.state());
        }
        let request = faulty(self.fault, &[0x14, 0x01]);
        let is_valid = matches!(self.fault, Fault::None | Fault::Noise);
        self.asked_us = is_valid.then_some(now_us);
        request
    }
}

/// A motor: answers what it is asked.
struct Motor {
    voltage: u16,
    current: u16,
    errors: u16,
    fault: Fault,
    echo: Echo,
    receiver: Receiver,
    asked: Vec<u8>,
}

impl Motor {
    pub fn new(echo: Echo) -> Self {
        Self {
            voltage: 2480,
            current: 215,
            // It misses drive commands.
            errors: 0x0100,
            fault: Fault::None,
            echo,
            receiver: Receiver::default(),
            asked: Vec::new(),
        }
    }

    fn answer(&self, question: &[u8]) -> Vec<u8> {
        let mut content = vec![0x00, 0x00];
        match question {
            [0x30, 0x03] => {
                content.extend([0x03, 0xE8, 0x02, 0x14]);
                content.extend(self.voltage.to_be_bytes());
                content.extend(self.current.to_be_bytes());
                // 30.5 °C and -1.2 °C.
                content.extend([0x01, 0x31, 0xFF, 0xF4]);
            }
            [0x30, 0x01] => {
                content.push(0x08);
                content.extend(self.errors.to_be_bytes());
            }
            other => panic!("it must not be sent {other:02x?}"),
        }
        faulty(self.fault, &content)
    }
}

impl Peer for Motor {
    const BAUD: u32 = 19_200;

    fn turn(&mut self, sent: &[u8], _: u64) -> Vec<u8> {
        let echo = match self.echo {
            Echo::Comes => sent,
            Echo::None => &[],
        };
        let Some(question) = self.receiver.take(sent) else {
            return echo.to_vec();
        };
        self.asked.push(question[1]);
        [echo, &self.answer(&question)].concat()
    }
}

fn with_torqeedo(place: f32, driver_enable: f32) -> Bench {
    let parameters = [
        ("SERIAL1_PROTOCOL", 39.0),
        ("TRQD1_TYPE", place),
        ("TRQD1_DE_PIN", driver_enable),
    ];
    with_second_pack(TORQEEDO, &parameters)
}

#[test]
// Requirement: AP-9
fn a_battery_is_read_and_answered_with_speed_0() {
    for echo in [Echo::None, Echo::Comes] {
        let mut bench = with_torqeedo(TILLER, -1.0);
        let mut battery = Battery::new(echo);
        run_with(&mut bench, &mut battery, SECOND);
        let from_us = bench.time_us();
        run_with(&mut bench, &mut battery, 3 * SECOND);
        after_a_second(&mut bench, &mut battery, |status| {
            assert_eq!((status.voltage_mv(0), status.current_ca()), (25_940, 1230));
            assert_eq!(status.remaining_pct(), 87);
            assert_eq!(status.temperature_cdegc(), 4400);
            // 12.3 A for 5 s.
            assert!(
                (15..=18).contains(&status.consumed_mah()),
                "{} mAh",
                status.consumed_mah()
            );
        });
        // Three of four turns are questions.
        assert!(
            (70..=76).contains(&battery.answers),
            "{} answers",
            battery.answers
        );
        assert!(
            battery.latest_answer_us <= 25 * MILLISECOND,
            "{} us",
            battery.latest_answer_us
        );
        assert_untroubled(&bench, from_us);
    }
}

#[test]
fn a_motor_is_asked_and_never_driven() {
    for echo in [Echo::None, Echo::Comes] {
        let mut bench = with_torqeedo(MOTOR, -1.0);
        let mut motor = Motor::new(echo);
        run_with(&mut bench, &mut motor, 4 * SECOND);
        after_a_second(&mut bench, &mut motor, |status| {
            assert_eq!((status.voltage_mv(0), status.current_ca()), (24_800, 2150));
            assert_eq!(status.temperature_cdegc(), 3050);
        });
        assert!(motor.asked.len().abs_diff(25) <= 1, "{:?}", motor.asked);
        assert!(motor.asked.windows(2).all(|pair| pair[0] != pair[1]), "in turns");
        assert!(
            texts_of(&bench.frames())
                .iter()
                .all(|text| !text.starts_with("Torqeedo"))
        );
    }
}

#[test]
fn errors_are_announced_once() {
    let mut bench = with_torqeedo(TILLER, -1.0);
    let mut battery = Battery::new(Echo::None);
    run_with(&mut bench, &mut battery, SECOND);
    battery.code = 5;
    run_with(&mut bench, &mut battery, 2 * SECOND);
    battery.code = 0;
    run_with(&mut bench, &mut battery, 2 * SECOND);
    let mut texts = texts_of(&bench.frames());
    texts.retain(|text| text.starts_with("Torqeedo"));
    assert_eq!(texts, ["Torqeedo: error 5, motor blocked", "Torqeedo: no error"]);

    let mut bench = with_torqeedo(MOTOR, -1.0);
    let mut motor = Motor::new(Echo::None);
    motor.errors |= 0x0080;
    run_with(&mut bench, &mut motor, 2 * SECOND);
    let mut texts = texts_of(&bench.frames());
    texts.retain(|text| text.starts_with("Torqeedo"));
    assert_eq!(texts, ["Torqeedo: too hot"]);
}

#[test]
fn noise_between_frames_costs_none() {
    let mut bench = with_torqeedo(TILLER, -1.0);
    let mut battery = Battery::new(Echo::None);
    battery.fault = Fault::Noise;
    run_with(&mut bench, &mut battery, 2 * SECOND);
    after_a_second(&mut bench, &mut battery, |status| {
        assert_eq!((status.voltage_mv(0), status.current_ca()), (25_940, 1230));
    });
    assert!(battery.answers >= 40, "{} answers", battery.answers);
    assert_eq!(bench.logged(LogLevel::Warn, "battery 2: read failed").len(), 0);
}

#[test]
fn every_fault_ends_in_an_unhealthy_pack_that_recovers() {
    let mut bench = with_torqeedo(TILLER, -1.0);
    let mut battery = Battery::new(Echo::Comes);
    let faults = [Fault::Silent, Fault::WrongChecksum, Fault::TooShort];
    assert_recovers_from(
        &mut bench,
        &mut battery,
        &faults,
        Fault::None,
        |battery, fault| battery.fault = fault,
        4_800 * MILLISECOND,
    );
}

#[test]
fn the_driver_is_enabled_while_the_board_sends() {
    let mut bench = with_torqeedo(MOTOR, 22.0);
    bench.record_pin(DRIVER_ENABLE);
    let mut motor = Motor::new(Echo::None);
    let sent = run_with(&mut bench, &mut motor, 10 * SECOND);
    let edges = bench.take_edges(DRIVER_ENABLE);
    // Each question has five bytes.
    let questions: Vec<&[SentByte]> = sent.chunks(5).collect();
    assert!(questions.len() >= 48, "{} questions", questions.len());
    assert_eq!(edges.len(), 2 * questions.len());
    let mut lates_us = Vec::new();
    for (pair, question) in edges.chunks(2).zip(questions) {
        let [(raised, true), (lowered, false)] = *pair else {
            panic!("{pair:?}");
        };
        let (first, last) = (question[0], question[4]);
        assert!(raised < first.start, "before the start bit");
        assert!(
            lowered >= last.end,
            "cut off {} cycles before the stop bit's end",
            last.end - lowered
        );
        lates_us.push((lowered - last.end) as f64 / CYCLES_PER_US);
    }
    lates_us.sort_by(f64::total_cmp);
    let (median_us, latest_us) = (lates_us[lates_us.len() / 2], lates_us[lates_us.len() - 1]);
    println!("driver off after {median_us:.0} us, at the latest {latest_us:.0} us");
    assert!(median_us <= 2.0 * BIT_US, "{lates_us:?}");
    assert!(latest_us <= 2_000.0, "{lates_us:?}");
}
