//! Power is cut in flash operations while the ring of logs rotates: sectors of the oldest file are erased, a file is begun,
//! written and ended.

use std::sync::OnceLock;

use rover_battmon::memory::flash_map;

use super::flash_cuts::Leader;
use crate::bench::{Bench, MILLISECOND, PARAMETER_BYTES, PARAMETER_OFFSET, SECOND};
use crate::log_flash::{LogFlash, files_in};
use crate::log_records::{named, records_of_torn};
use emulator::FlashCut;
use support::requests::{arm_by_force, disarm};

/// Three cells at 3.8 V.
const CODE: u16 = 3582;

/// At the start a few sectors are erased ahead, then those of the oldest file are.
const BEFORE_ARMING_US: u64 = 1_000 * MILLISECOND;

/// The file is begun, and grows for a while.
const ARMED_US: u64 = 4_000 * MILLISECOND;

/// More sectors are erased while the file still grows.
const DISARMED_US: u64 = 500 * MILLISECOND;

/// The logs are looked for, and an erase that was cut is repeated.
const RESTART_US: u64 = 400 * MILLISECOND;

/// What may be lost.
const LOST_US: u64 = SECOND;

/// A board's time is known so well when the power goes.
const STEP_US: u64 = 10 * MILLISECOND;

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

/// Boards that lose power while the ring rotates, and what is looked at then.
struct Rotation<I: Iterator<Item = u64>> {
    leader: Leader<I>,
    cut: FlashCut,
    /// The files and the parameters at the start.
    files: Vec<(u16, Vec<u8>)>,
    parameters: Vec<u8>,
    armed_us: Option<u64>,
    cuts: usize,
}

impl<I: Iterator<Item = u64>> Rotation<I> {
    fn run_for(&mut self, length_us: u64) {
        // In steps, as the time of a board without power is unknown.
        for _ in 0..length_us / STEP_US {
            let at_us = board_us(&mut self.leader.bench);
            let mut boards = Vec::new();
            let step = |bench: &mut Bench| bench.run_for(STEP_US);
            self.leader
                .step(step, |bench, operation| boards.push((bench, operation)));
            for (bench, operation) in boards {
                self.assert_recorded(bench, operation, at_us);
            }
        }
    }

    fn arm(&mut self) {
        let bench = &mut self.leader.bench;
        let now_us = bench.time_us();
        bench.uart_send(0, now_us, &arm_by_force());
        self.armed_us = Some(board_us(bench));
    }

    fn disarm(&mut self) {
        let bench = &mut self.leader.bench;
        let now_us = bench.time_us();
        bench.uart_send(0, now_us, &disarm());
    }

    /// Before the board is switched on again, and after that.
    fn assert_recorded(&mut self, mut bench: Bench, operation: u64, at_us: u64) {
        let at = format!("operation {operation}, {:?}", self.cut);
        let armed_us = self.armed_us;
        let what = Cut { at_us, armed_us };
        assert_recorded(&files(&bench), &self.files, &what, &at);
        bench.power_cycle();
        bench.run_for(RESTART_US);
        assert_recorded(&files(&bench), &self.files, &what, &at);
        let kept = bench.read_flash(PARAMETER_OFFSET, PARAMETER_BYTES);
        assert!(kept == self.parameters, "{at}: parameters");
        self.cuts += 1;
        if self.cuts.is_multiple_of(CUTS_BETWEEN_LINES) {
            println!("power cuts of the log ({:?}): {}", self.cut, self.cuts);
        }
    }
}

/// Cuts the power in these operations of a rotation: arms, disarms.
pub fn run(cut: FlashCut, operations: impl Iterator<Item = u64>) {
    let bench = Bench::power_up_with_flash(CODE, flash_map::LOG.start, full_ring().bytes());
    let mut rotation = Rotation {
        cut,
        files: files(&bench),
        parameters: bench.read_flash(PARAMETER_OFFSET, PARAMETER_BYTES),
        leader: Leader::new(bench, cut, operations),
        armed_us: None,
        cuts: 0,
    };
    rotation.run_for(BEFORE_ARMING_US);
    rotation.arm();
    rotation.run_for(ARMED_US);
    rotation.disarm();
    rotation.run_for(DISARMED_US);
    assert!(rotation.leader.begun() > 60, "no rotation");
    println!(
        "{} operations of a rotation cut ({cut:?}), no older file touched, at most a second lost",
        rotation.cuts
    );
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
