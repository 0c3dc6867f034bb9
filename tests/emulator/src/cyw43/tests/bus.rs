//! Pins, words and registers.

use super::super::pins::{POWER, SELECT};
use super::super::{ChipPart, RadioFault};
use super::master::{BACKPLANE, BUS, Master, PROGRAM, WLAN, command};

const TEST_PATTERN: u32 = 0xfeed_bead;

#[test]
fn the_test_pattern_comes_in_16_bit_words_150_ms_after_power() {
    let mut master = Master::new();
    assert!(!master.chip.is_powered());
    assert_eq!(master.read_register(BUS, 0x14, 4), 0);
    master.set(POWER, true);
    assert!(master.chip.is_powered());
    master.wait_us(140_000);
    assert_eq!(master.read_register(BUS, 0x14, 4), 0);
    master.wait_us(10_000);
    assert_eq!(master.read_register(BUS, 0x14, 4), TEST_PATTERN);
}

#[test]
fn words_have_32_bits_once_the_control_register_says_so() {
    let mut master = Master::set_up();
    assert_eq!(master.read_register(BUS, 0x14, 4), TEST_PATTERN);
    master.write_register(BUS, 0x18, 4, 0x1234_5678);
    assert_eq!(master.read_register(BUS, 0x18, 4), 0x1234_5678);
    assert_eq!(master.read_register(BUS, 0x19, 1), 0x56);
    master.write_register(BUS, 0x14, 4, 0);
    assert_eq!(master.read_register(BUS, 0x14, 4), TEST_PATTERN, "read only");
}

#[test]
fn at_high_speed_a_bit_is_missed_once_the_clock_has_risen() {
    const CONTROL_AT_HIGH_SPEED: u32 = 0x31;
    let mut master = Master::set_up();
    let read = command(0, BUS, 0x14, 4);
    master.write_register(BUS, 0, 1, CONTROL_AT_HIGH_SPEED);
    assert_eq!(master.transfer(&[read], 1), [TEST_PATTERN]);
    master.looks_late = true;
    assert_eq!(master.transfer(&[read], 1), [TEST_PATTERN << 1]);
    master.looks_late = false;
    master.write_register(BUS, 0, 1, CONTROL_AT_HIGH_SPEED & !0x10);
    master.looks_late = true;
    assert_eq!(
        master.transfer(&[read], 1),
        [TEST_PATTERN],
        "else it holds until the clock falls"
    );
}

#[test]
fn without_power_everything_is_forgotten() {
    let mut master = Master::set_up();
    master.set(POWER, false);
    assert_eq!(master.data(), None);
    master.power_up();
    assert_eq!(master.read_register(BUS, 0x14, 4), TEST_PATTERN, "16 bits again");
}

#[test]
fn answers_of_the_backplane_come_after_a_delay_and_before_the_status() {
    let mut master = Master::set_up();
    master.write_register(BACKPLANE, 0x1_0008, 1, 0x10);
    let read = command(0, BACKPLANE, 0x1_0008, 1);
    assert_eq!(master.transfer(&[read], 3), [0, 0x10, 0]);
    master.write_register(BUS, 0x1d, 1, 0);
    assert_eq!(master.transfer(&[read], 2), [0x10, 0]);
}

#[test]
fn the_low_power_clock_is_there_when_asked_for() {
    let mut master = Master::set_up();
    assert_eq!(master.read_register(BACKPLANE, 0x1_000e, 1), 0);
    master.write_register(BACKPLANE, 0x1_000e, 1, 0x08);
    assert_eq!(master.read_register(BACKPLANE, 0x1_000e, 1), 0x48);
}

#[test]
fn a_part_that_never_gets_ready_leaves_the_bus_alone() {
    let mut master = Master::set_up();
    master
        .chip
        .set_fault(Some(RadioFault::NotReady(ChipPart::LowPowerClock)));
    master.write_register(BACKPLANE, 0x1_000e, 1, 0x08);
    assert_eq!(master.read_register(BACKPLANE, 0x1_000e, 1), 0x08);
    for part in [ChipPart::WlanCore, ChipPart::Packets] {
        let mut master = Master::set_up();
        master.chip.set_fault(Some(RadioFault::NotReady(part)));
        master.download(&PROGRAM, 3 | !3 << 16);
        master.wait_us(2_000_000);
        let is_held = master.read_behind(0x1810_3800) & 1 == 1;
        assert_eq!(is_held, part == ChipPart::WlanCore);
        assert!(!master.chip.is_running(), "{part:?}");
    }
}

#[test]
fn behind_the_window_is_the_chips_identity() {
    let mut master = Master::set_up();
    assert_eq!(master.read_behind(0x1800_0000), 43_439);
    master.write_behind(0x1800_2024, 4, 0xf0);
    assert_eq!(master.read_behind(0x1800_2024), 0xf0);
}

#[test]
fn the_data_line_is_the_interrupt_until_the_packet_is_fetched() {
    let mut master = Master::running();
    assert_eq!(master.data(), Some(false));
    assert!(!master.chip.send(&[1; 60]), "no network");
    master.send_packet(0, &[0; 16]);
    assert_eq!(master.data(), Some(false), "everything was fetched");
    let message = [262_u32, 4, 0, 0].map(u32::to_le_bytes).concat();
    let content = [&message[..], &[0; 4]].concat();
    let length = 12 + content.len() as u32;
    let header = [length | (!length << 16), 1, 0].map(u32::to_le_bytes).concat();
    let mut words = vec![command(1 << 31, WLAN, 0, length)];
    let header = [&header[..7], &[12], &header[8..]].concat();
    words.extend(super::super::serial::words_of(&[header, content].concat()));
    master.transfer(&words, 1);
    assert_eq!(master.data(), Some(false), "the answer takes its time");
    master.wait_us(1_000);
    assert_eq!(master.data(), Some(true));
    assert_eq!(master.read_register(BUS, 4, 2) & 1 << 5, 1 << 5);
    master.set(SELECT, false);
    assert_eq!(master.data(), None, "it listens");
    master.set(SELECT, true);
    assert!(master.packet().is_some());
    assert_eq!(master.data(), Some(false));
}

#[test]
fn reading_without_a_packet_latches_an_interrupt() {
    let mut master = Master::running();
    master.transfer(&[command(0, WLAN, 0, 4)], 1);
    assert_eq!(master.read_register(BUS, 4, 2), 1);
    master.write_register(BUS, 4, 2, 1);
    assert_eq!(master.read_register(BUS, 4, 2), 0);
}

#[test]
fn a_missing_chip_keeps_the_line_low() {
    let mut master = Master::set_up();
    master.chip.set_fault(Some(RadioFault::Missing));
    assert_eq!(master.read_register(BUS, 0x14, 4), 0);
    master.chip.set_fault(None);
    assert_eq!(master.read_register(BUS, 0x14, 4), TEST_PATTERN);
}

#[test]
fn a_chip_falls_silent_after_so_many_commands() {
    let mut master = Master::set_up();
    master.chip.set_fault(Some(RadioFault::SilentAfter(3)));
    let answers: Vec<u32> = (0..4).map(|_| master.read_register(BUS, 0x14, 4)).collect();
    assert_eq!(answers[..2], [TEST_PATTERN; 2]);
    assert_eq!(answers[3], 0);
}

#[test]
fn noise_is_anything_but_an_answer() {
    let mut master = Master::set_up();
    master.chip.set_fault(Some(RadioFault::Noise));
    let answers: Vec<u32> = (0..4).map(|_| master.read_register(BUS, 0x14, 4)).collect();
    assert!(answers.iter().all(|&answer| answer != TEST_PATTERN));
    assert_ne!(answers[0], answers[1]);
}
