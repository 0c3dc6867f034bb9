//! A MegaSquirt engine control unit, as ArduPilot's libraries/SITL/SIM_EFI_MegaSquirt.cpp plays it.

use super::{
    Peer, UNHEALTHY, after_a_second, assert_recovers_from, assert_untroubled, run_with, with_second_pack,
};
use workbench::bench::{Bench, MILLISECOND, SECOND};

const EFI: f32 = 27.0;

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| crc >> 1 ^ if crc & 1 != 0 { 0xEDB8_8320 } else { 0 };
    let add = |crc, byte: &u8| (0..8).fold(crc ^ u32::from(*byte), step);
    !bytes.iter().fold(u32::MAX, add)
}

fn wrapped(content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u16).to_be_bytes();
    [&length, content, &crc32(content).to_be_bytes()].concat()
}

/// What is wrong with the unit, or its wire.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    Silent,
    WrongChecksum,
    /// It answers with a byte less.
    TooShort,
    /// It refuses every request.
    Refuses,
    /// Bytes that are not an answer before each one.
    Noise,
}

pub struct Unit {
    injection_us: u16,
    speed_rpm: u16,
    fault: Fault,
    received: Vec<u8>,
    requests: usize,
}

impl Unit {
    pub fn new(injection_us: u16, speed_rpm: u16) -> Self {
        Self {
            injection_us,
            speed_rpm,
            fault: Fault::None,
            received: Vec::new(),
            requests: 0,
        }
    }

    /// Table 7: uptime, injection of both banks, speed, and what is not used here.
    fn table(&self) -> Vec<u8> {
        let words = [1234, self.injection_us, 4321, self.speed_rpm];
        let mut table: Vec<u8> = words.into_iter().flat_map(u16::to_be_bytes).collect();
        table.resize(130, 0x5A);
        table
    }

    fn answer(&self, request: &[u8]) -> Vec<u8> {
        let word = |at: usize| usize::from(u16::from_be_bytes([request[at], request[at + 1]]));
        assert_eq!(request[..5], [0, 7, b'r', 0, 7]);
        assert_eq!(request[9..], crc32(&request[2..9]).to_be_bytes());
        let (offset, size) = (word(5), word(7));
        let table = self.table();
        let mut content = vec![0];
        content.extend(&table[offset..offset + size]);
        match self.fault {
            Fault::None => wrapped(&content),
            Fault::Silent => Vec::new(),
            Fault::WrongChecksum => {
                let mut answer = wrapped(&content);
                *answer.last_mut().unwrap() ^= 1;
                answer
            }
            Fault::TooShort => wrapped(&content[..size]),
            Fault::Refuses => wrapped(&[0x84]),
            Fault::Noise => [&[0x00, 0x07, 0x00, 0xFF, 0x00, 0x07][..], &wrapped(&content)].concat(),
        }
    }
}

impl Peer for Unit {
    const BAUD: u32 = 115_200;

    fn turn(&mut self, sent: &[u8], _: u64) -> Vec<u8> {
        self.received.extend(sent);
        if self.received.len() < 13 {
            return Vec::new();
        }
        let request: Vec<u8> = self.received.drain(..13).collect();
        self.requests += 1;
        self.answer(&request)
    }
}

/// A tank of 2000 ml, and 0.8 cm³ a minute for each percent of duty cycle, less 2.
fn with_engine() -> Bench {
    let parameters = [
        ("SERIAL1_PROTOCOL", 24.0),
        ("EFI_TYPE", 1.0),
        ("EFI_COEF1", 0.8),
        ("EFI_COEF2", 2.0),
        ("BATT2_CAPACITY", 2000.0),
    ];
    with_second_pack(EFI, &parameters)
}

#[test]
// Requirement: AP-9
fn flow_and_volume_follow_injection_and_speed() {
    let mut bench = with_engine();
    // 24 ms in each 20 ms and more: 120 %, so 94 cm³ a minute, 5.64 l/h.
    let mut unit = Unit::new(24_000, 3000);
    run_with(&mut bench, &mut unit, SECOND);
    let from_us = bench.time_us();
    run_with(&mut bench, &mut unit, 18 * SECOND);
    after_a_second(&mut bench, &mut unit, |status| {
        assert!(
            status.current_ca().abs_diff(564) <= 1,
            "{} cA",
            status.current_ca()
        );
        // 31.3 ml in 20 s.
        assert!(
            (30..=32).contains(&status.consumed_mah()),
            "{} ml",
            status.consumed_mah()
        );
        assert_eq!(status.voltage_mv(0), u16::MAX, "a tank has none");
        assert_eq!(status.remaining_pct(), 98);
    });
    assert!(unit.requests.abs_diff(200) <= 3, "{} requests", unit.requests);
    unit.speed_rpm = 90;
    after_a_second(&mut bench, &mut unit, |status| assert_eq!(status.current_ca(), 0));
    assert_untroubled(&bench, from_us);
}

#[test]
fn noise_between_answers_costs_none() {
    let mut bench = with_engine();
    let mut unit = Unit::new(3_000, 3000);
    unit.fault = Fault::Noise;
    run_with(&mut bench, &mut unit, SECOND);
    let from_us = bench.time_us();
    run_with(&mut bench, &mut unit, 2 * SECOND);
    // 15 %: 10 cm³ a minute, 0.6 l/h.
    after_a_second(&mut bench, &mut unit, |status| {
        assert!(status.current_ca().abs_diff(60) <= 1)
    });
    assert_untroubled(&bench, from_us);
}

#[test]
fn every_fault_ends_in_an_unhealthy_pack_that_recovers() {
    let mut bench = with_engine();
    let mut unit = Unit::new(3_000, 3000);
    let faults = [
        Fault::Silent,
        Fault::WrongChecksum,
        Fault::TooShort,
        Fault::Refuses,
    ];
    assert_recovers_from(
        &mut bench,
        &mut unit,
        &faults,
        Fault::None,
        |unit, fault| unit.fault = fault,
        1_200 * MILLISECOND,
    );
}

#[test]
fn without_calibration_the_flow_is_unknown() {
    let mut bench = with_engine();
    bench.set("EFI_COEF1", 0.0);
    let mut unit = Unit::new(3_000, 3000);
    run_with(&mut bench, &mut unit, SECOND);
    after_a_second(&mut bench, &mut unit, |status| {
        assert_eq!(status.charge_state(), UNHEALTHY)
    });
    bench.set("EFI_COEF1", 0.8);
    run_with(&mut bench, &mut unit, SECOND);
    after_a_second(&mut bench, &mut unit, |status| {
        assert!(status.current_ca().abs_diff(60) <= 1)
    });
}
