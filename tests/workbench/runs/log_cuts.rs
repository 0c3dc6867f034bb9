//! Power is cut in flash operations while the ring of logs rotates: sectors of the oldest file are erased, a file is begun,
//! written and ended.

use std::sync::OnceLock;

use rover_battmon::flash_map;

use crate::bench::log_flash::{LogFlash, files_in};
use crate::bench::{Bench, MILLISECOND, PARAMETER_BYTES, PARAMETER_OFFSET, SECOND};
use crate::log_records::{named, records_of_torn};
use crate::support::requests::{command_long_2, disarm};
use emulator::FlashCut;

const ARM_DISARM: u16 = 400;
const FORCED: f32 = 21_196.0;

/// Three cells at 3.8 V.
const CODE: u16 = 3582;

/// At the start a few sectors are erased ahead, then those of the oldest file are.
const BEFORE_ARMING_US: u64 = 1_000 * MILLISECOND;

/// The file is begun, and grows for a while.
const ARMED_US: u64 = 4_000 * MILLISECOND;

/// More sectors are erased while the file still grows.
const DISARMED_US: u64 = 500 * MILLISECOND;

/// The logs are looked for, and an erase that was cut is done anew.
const RESTART_US: u64 = 400 * MILLISECOND;

/// What may be lost.
const LOST_US: u64 = SECOND;

const CUTS_BETWEEN_LINES: usize = 50;

/// The lower half of the time since the reset, in µs (RP2040 datasheet 4.6.5).
const TIMERAWL: u32 = 0x4005_4028;

/// Of its files the first is erased in the course of a run.
fn full_ring() -> &'static LogFlash {
    static FULL: OnceLock<LogFlash> = OnceLock::new();
    FULL.get_or_init(LogFlash::full)
}

/// The files of a board's flash.
fn files(bench: &Bench) -> Vec<(u16, Vec<u8>)> {
    let ring = bench.read_flash(flash_map::LOG.start, flash_map::LOG.len());
    files_in(&ring)
}

fn board_us(bench: &mut Bench) -> u64 {
    bench.read_register(TIMERAWL).into()
}

/// What has happened when the power went.
struct Cut {
    /// Time of the board.
    at_us: u64,
    armed_us: Option<u64>,
}

/// Arms, disarms, and lets the power be cut in flash operation `operation`. `None`: it was over before.
fn run_until_cut(bench: &mut Bench, operation: u64, cut: FlashCut) -> Option<Cut> {
    bench.cut_power_at_flash_operation(operation, cut);
    let mut armed_us = None;
    let mut at_us = 0;
    let mut run = |bench: &mut Bench, length_us: u64| {
        // In steps, as the time of a board without power is unknown.
        for _ in 0..length_us / (10 * MILLISECOND) {
            if bench.is_powered() {
                at_us = board_us(bench);
                bench.run_for(10 * MILLISECOND);
            }
        }
        at_us
    };
    run(bench, BEFORE_ARMING_US);
    if bench.is_powered() {
        let now_us = bench.time_us();
        bench.uart_send(0, now_us, &command_long_2(ARM_DISARM, 1.0, FORCED));
        armed_us = Some(board_us(bench));
        run(bench, ARMED_US);
    }
    if bench.is_powered() {
        let now_us = bench.time_us();
        bench.uart_send(0, now_us, &disarm());
    }
    let at_us = run(bench, DISARMED_US);
    (!bench.is_powered()).then_some(Cut { at_us, armed_us })
}

/// Cuts the power in these operations, until there is none of that number.
pub fn run(cut: FlashCut, operations: impl Iterator<Item = u64>) {
    let before = files_in(full_ring().bytes());
    let mut cuts = 0;
    for operation in operations {
        let mut bench = Bench::power_up_with_flash(CODE, flash_map::LOG.start, full_ring().bytes());
        let parameters = bench.read_flash(PARAMETER_OFFSET, PARAMETER_BYTES);
        let at = format!("operation {operation}, {cut:?}");
        let Some(what) = run_until_cut(&mut bench, operation, cut) else {
            assert!(bench.flash_operations().len() > 60, "no rotation");
            break;
        };
        assert_recorded(&files(&bench), &before, &what, &at);
        bench.power_cycle();
        bench.run_for(RESTART_US);
        assert_recorded(&files(&bench), &before, &what, &at);
        let kept = bench.read_flash(PARAMETER_OFFSET, PARAMETER_BYTES);
        assert!(kept == parameters, "{at}: parameters");
        cuts += 1;
        if cuts % CUTS_BETWEEN_LINES == 0 {
            println!("power cuts of the log ({cut:?}): {cuts}");
        }
    }
    println!("{cuts} operations of a rotation cut ({cut:?}), no older file touched, at most a second lost");
}

/// Panics unless older files are as they were, but for the oldest, which may be gone, and the newest lacks at most a second.
fn assert_recorded(after: &[(u16, Vec<u8>)], before: &[(u16, Vec<u8>)], cut: &Cut, at: &str) {
    let newest = before.last().expect("the ring is full").0;
    let (old, new): (Vec<_>, Vec<_>) = after.iter().partition(|(number, _)| *number <= newest);
    assert!(old.len() + 2 >= before.len(), "{at}: {} files", old.len());
    for ((number, content), (expected, expected_content)) in old.iter().rev().zip(before.iter().rev()) {
        assert_eq!(number, expected, "{at}");
        assert!(content == expected_content, "{at}: file {number} has changed");
    }
    let Some(armed_us) = cut.armed_us.filter(|armed_us| armed_us + LOST_US < cut.at_us) else {
        return;
    };
    assert_eq!(new.len(), 1, "{at}: no file since arming at {armed_us} us");
    let records = records_of_torn(&new[0].1);
    let times = records.iter().filter_map(|record| record.timestamp_usec);
    let last_us = times.max().expect("records with a time");
    assert!(
        last_us + LOST_US >= cut.at_us,
        "{at}: the last record is of {last_us} us, the cut of {} us",
        cut.at_us
    );
    assert!(named(&records, "PARM").count() > 50, "{at}: parameters");
}
