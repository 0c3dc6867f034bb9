//! The ring of files: what is erased, and when.

use rover_battmon::memory::flash_map;

use crate::rover::GOOD_3S;
use emulator::{FlashOperation, FlashOperationKind, FlashTiming};
use support::frames::{HEARTBEAT, of_message, texts_of};
use support::requests::{arm_by_force, disarm};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND};
use workbench::downloads::list;
use workbench::log_flash::{LogFlash, files_in};

fn erases(operations: &[FlashOperation]) -> Vec<&FlashOperation> {
    let is_erase = |operation: &&FlashOperation| operation.kind == FlashOperationKind::SectorErase;
    operations.iter().filter(is_erase).collect()
}

fn files(bench: &Bench) -> Vec<(u16, Vec<u8>)> {
    files_in(&bench.read_flash(flash_map::LOG.start, flash_map::LOG.len()))
}

#[test]
fn the_oldest_file_goes_whole_nothing_is_erased_while_armed_and_a_full_log_is_announced() {
    let log = LogFlash::full();
    let before = files_in(log.bytes());
    let mut bench = Bench::power_up_with_flash(GOOD_3S, flash_map::LOG.start, log.bytes());
    bench.run_for(SECOND);
    // Those of the first file.
    let erased = erases(bench.flash_operations()).len();
    assert!((6..15).contains(&erased), "{erased}");
    let listed: Vec<_> = list(&mut bench)
        .into_iter()
        .map(|(_, bytes)| bytes as usize)
        .collect();
    let expected: Vec<_> = before[1..].iter().map(|(_, content)| content.len()).collect();
    assert_eq!(listed, expected, "the oldest file is not listed in part");

    bench.ask(&arm_by_force());
    bench.take_flash_operations();
    let armed_us = bench.time_us();
    let is_full = (0..400).any(|_| {
        bench.run_for(SECOND);
        bench.run_until_silent();
        let texts = texts_of(&bench.frames());
        bench.forget_sent();
        texts.iter().any(|text| text == "Log full until disarmed")
    });
    assert!(is_full);
    println!("full {} s after arming", (bench.time_us() - armed_us) / SECOND);
    assert!(erases(bench.flash_operations()).is_empty(), "erased while armed");
    let after = files(&bench);
    assert!(after[..before.len() - 1] == before[1..], "older files");
    // All that was erased ahead, without the front of each sector, and without what the last records would have taken.
    let recorded = after.last().expect("a file").1.len();
    assert!(recorded > 4000 * erased, "{recorded} bytes");

    bench.ask(&disarm());
    bench.run_for(5 * SECOND);
    assert!(erases(bench.flash_operations()).len() > 30);
    assert!(bench.resets().is_empty());
}

fn filled_with(byte: u8) -> Bench {
    let flash = vec![byte; flash_map::LOG.len()];
    Bench::power_up_with_flash(DIVIDER_CODE, flash_map::LOG.start, &flash)
}

#[test]
fn an_empty_ring_is_prepared_once_and_what_is_blank_is_not_erased() {
    for (byte, expected) in [(0xff, 0), (0, 309)] {
        let mut bench = filled_with(byte);
        bench.run_for(40 * SECOND);
        let operations = bench.take_flash_operations();
        assert_eq!(erases(&operations).len(), expected);
        assert_eq!(operations.len(), 309 + expected, "each has its mark");
        bench.power_cycle();
        bench.run_for(5 * SECOND);
        assert!(bench.flash_operations().is_empty(), "{byte:#x}");
    }
}

#[test]
fn the_slowest_erases_starve_neither_watchdog_nor_telemetry() {
    let mut bench = filled_with(0);
    bench.flash_timing(FlashTiming::MAXIMUM);
    bench.run_for(8 * SECOND);
    let erased = erases(bench.flash_operations()).len();
    assert!((6..=10).contains(&erased), "{erased}");
    let slack_us = bench.smallest_watchdog_slack_us().expect("it was fed");
    println!("{erased} erases of 400 ms: the watchdog was fed with {slack_us} us left");
    assert!(slack_us >= 400 * MILLISECOND, "{slack_us}");
    let frames = bench.frames();
    assert!(of_message(&frames, HEARTBEAT).len() >= 7);
    assert!(bench.resets().is_empty());
}
