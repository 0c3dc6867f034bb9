//! Torqeedo's TQ bus at the second serial port, UART1 at GP4 (out) and GP5 (in): its battery as the master, built from the
//! messages of ArduPilot's libraries/AP_Torqeedo/AP_Torqeedo_TQBus.h and .cpp. The bus is RS-485, so bytes of the board come
//! back as an echo.

use emulator::{LogLevel, SentByte, UartPins};
use support::frames::last_of;
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, TestedVehicle};

const TORQEEDO: f32 = 23.0;
const TILLER: f32 = 1.0;

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

/// A battery: asks the tiller for its speed every 50 ms, and instead each fourth time sends its state to the display.
#[derive(Default)]
struct Battery {
    /// Bytes of the board, up to the end of each frame.
    received: Vec<u8>,
    next_us: u64,
    turns: u64,
    asked_us: Option<u64>,
    answers: usize,
    latest_answer_us: u64,
}

impl Battery {
    fn take_answer(&mut self, answer: &[u8], now_us: u64) {
        assert_eq!(answer, [0x00, 0x00, 0x05, 0x00, 0x00, 0x00], "speed 0");
        let asked_us = self.asked_us.take().expect("only if it was asked");
        self.latest_answer_us = self.latest_answer_us.max(now_us - asked_us);
        self.answers += 1;
    }

    /// Takes what the board has sent, and returns what is put on the wire at `now_us`.
    fn turn(&mut self, sent: &[u8], now_us: u64) -> Vec<u8> {
        self.received.extend(sent);
        if self.received.last() == Some(&0xAD) {
            let answer = content(&std::mem::take(&mut self.received));
            self.take_answer(&answer, now_us);
        }
        if !sent.is_empty() {
            return sent.to_vec();
        }
        if now_us < self.next_us {
            return Vec::new();
        }
        self.next_us = now_us + 50 * MILLISECOND;
        self.turns += 1;
        if self.turns.is_multiple_of(4) {
            return frame(&STATE);
        }
        self.asked_us = Some(now_us);
        frame(&[0x14, 0x01])
    }
}

/// Flags (the charge is valid), error code, the motor's values, 87 %, the battery's values (25.94 V and 12.3 A), range, 31 °C
/// and 44 °C.
#[rustfmt::skip]
const STATE: [u8; 29] = [
    0x20, 0x41, 0x02, 0x00, 0, 0,
    0x0B, 0xB8, 0, 100, 0, 250, 0x03, 0xE8, 40, 45, 87,
    0x0A, 0x22, 0, 123,
    0, 0xAC, 0, 0xAD, 0, 0xAE, 31, 44,
];

const PORT: usize = 1;

const BAUD: u32 = 19_200;

/// Time between two turns of the battery, in microseconds.
const TURN_US: u64 = 1_000;

/// Runs a board with the battery, and returns what the board sent.
fn run_with(bench: &mut Bench, peer: &mut Battery, duration_us: u64) -> Vec<SentByte> {
    let end_us = bench.time_us() + duration_us;
    let mut all = Vec::new();
    while bench.time_us() < end_us {
        bench.run_for(TURN_US);
        let sent = bench.uart(PORT).take_sent();
        let bytes: Vec<u8> = sent.iter().map(|sent| sent.byte).collect();
        let now_us = bench.time_us();
        let answer = peer.turn(&bytes, now_us);
        if !answer.is_empty() {
            bench.uart_send_at_baud(PORT, now_us, &answer, BAUD);
        }
        all.extend(sent);
    }
    all
}

#[test]
// Requirement: AP-9
fn a_battery_is_read_and_answered_while_the_driver_is_enabled() {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.wire_uart(PORT, UartPins { tx: 4, rx: 5 });
    bench.set_all(&[
        ("BATT2_MONITOR", TORQEEDO),
        ("SR0_EXTRA1", 10.0),
        ("SERIAL1_PROTOCOL", 39.0),
        ("TRQD1_TYPE", TILLER),
        ("TRQD1_DE_PIN", 22.0),
    ]);
    bench.reboot();
    // Bytes from before belong to no request.
    bench.uart(PORT).take_sent();
    let mut battery = Battery::default();
    run_with(&mut bench, &mut battery, SECOND);
    bench.record_pin(DRIVER_ENABLE);
    battery.answers = 0;
    let from_us = bench.time_us();
    let sent = run_with(&mut bench, &mut battery, 4 * SECOND);
    let frames = bench.frames();
    let status = last_of(&frames, 1);
    assert_eq!((status.voltage_mv(0), status.current_ca()), (25_940, 1230));
    // Three of four turns are questions.
    let answers = battery.answers;
    assert!((58..=61).contains(&answers), "{answers} answers");
    assert!(battery.latest_answer_us <= 25 * MILLISECOND);
    assert_eq!(bench.resets().len(), 1, "{:?}", bench.resets());
    let mut warnings = bench.logged(LogLevel::Warn, "");
    warnings.retain(|(at_us, _)| *at_us > from_us);
    assert!(warnings.is_empty(), "{warnings:?}");

    let edges = bench.take_edges(DRIVER_ENABLE);
    let answers: Vec<&[SentByte]> = sent.chunks(9).collect();
    assert_eq!(edges.len(), 2 * answers.len());
    let mut lates_us = Vec::new();
    for (pair, answer) in edges.chunks(2).zip(answers) {
        let [(raised, true), (lowered, false)] = *pair else {
            panic!("{pair:?}");
        };
        let (first, last) = (answer[0], answer[8]);
        assert!(raised < first.start && lowered >= last.end, "bits are cut off");
        lates_us.push((lowered - last.end) as f64 / CYCLES_PER_US);
    }
    lates_us.sort_by(f64::total_cmp);
    let (median_us, latest_us) = (lates_us[lates_us.len() / 2], lates_us[lates_us.len() - 1]);
    println!("driver off after {median_us:.0} us, at the latest {latest_us:.0} us");
    assert!(median_us <= 2.0 * BIT_US && latest_us <= 2_000.0, "{lates_us:?}");
}
