//! The download, and what it takes to start it.

use super::super::RadioFault;
use super::master::{BACKPLANE, BUS, Master, PROGRAM};

const NVRAM_OF_3_WORDS: u32 = 3 | !3 << 16;

fn has_high_clock(master: &mut Master) -> bool {
    master.read_register(BACKPLANE, 0x1_000e, 1) & 0x80 != 0
}

#[test]
fn the_expected_program_starts_and_takes_packets() {
    let mut master = Master::set_up();
    master.download(&PROGRAM, NVRAM_OF_3_WORDS);
    assert!(!has_high_clock(&mut master));
    master.wait_us(29_000);
    assert!(has_high_clock(&mut master));
    assert_eq!(master.read_register(BUS, 8, 4) & 1 << 5, 0);
    assert!(!master.chip.is_running());
    master.wait_us(11_000);
    assert_eq!(master.read_register(BUS, 8, 4) & 1 << 5, 1 << 5);
    assert!(master.chip.is_running() && !master.chip.refused_download());
}

fn is_refused(program: &[u8], nvram_length: u32, fault: Option<RadioFault>) -> bool {
    let mut master = Master::set_up();
    master.chip.set_fault(fault);
    master.download(program, nvram_length);
    master.wait_us(1_000_000);
    assert_ne!(has_high_clock(&mut master), master.chip.refused_download());
    master.chip.refused_download()
}

#[test]
fn another_program_is_refused() {
    let mut program = PROGRAM;
    program[99] ^= 1;
    assert!(is_refused(&program, NVRAM_OF_3_WORDS, None));
    assert!(is_refused(&PROGRAM[..96], NVRAM_OF_3_WORDS, None));
}

#[test]
fn the_length_of_the_nvram_has_its_complement() {
    assert!(is_refused(&PROGRAM, 3, None));
    assert!(is_refused(&PROGRAM, !0 << 16, None));
}

#[test]
fn a_flipped_bit_of_the_download_is_noticed() {
    let fault = RadioFault::FlippedBits { one_in: 5 };
    assert!(is_refused(&PROGRAM, NVRAM_OF_3_WORDS, Some(fault)));
}

#[test]
fn the_ram_takes_nothing_while_its_core_is_held() {
    let mut master = Master::set_up();
    master.write_behind(0x100, 4, 0x1234_5678);
    assert_eq!(master.read_behind(0x100), 0);
    master.start_core(0x1810_4000);
    master.write_behind(0x100, 4, 0x1234_5678);
    assert_eq!(master.read_behind(0x100), 0x1234_5678);
}

#[test]
fn a_program_that_is_held_again_stops() {
    let mut master = Master::running();
    master.write_behind(0x1810_3800, 1, 1);
    assert!(!master.chip.is_running());
}
