//! The ring of files: what is erased, and when.

use rover_battmon::memory::flash_map;

use emulator::{FlashOperation, FlashOperationKind, FlashTiming};
use support::frames::{HEARTBEAT, of_message};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND};

fn erases(operations: &[FlashOperation]) -> Vec<&FlashOperation> {
    let is_erase = |operation: &&FlashOperation| operation.kind == FlashOperationKind::SectorErase;
    operations.iter().filter(is_erase).collect()
}

fn filled_with(byte: u8) -> Bench {
    let flash = vec![byte; flash_map::LOG.len()];
    Bench::power_up_with_flash(DIVIDER_CODE, flash_map::LOG.start, &flash)
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
