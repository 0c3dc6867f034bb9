//! The ring of files: what is erased, and when.

use rover_battmon::memory::flash_map;

use emulator::{FlashOperationKind, FlashTiming};
use support::frames::{HEARTBEAT, of_message};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, count_of};

#[test]
fn the_slowest_erases_starve_neither_watchdog_nor_telemetry() {
    let filled = vec![0; flash_map::LOG.len()];
    let mut bench = Bench::power_up_with_flash(DIVIDER_CODE, flash_map::LOG.start, &filled);
    bench.flash_timing(FlashTiming::MAXIMUM);
    bench.run_for(8 * SECOND);
    let erased = count_of(FlashOperationKind::SectorErase, bench.flash_operations());
    assert!((6..=10).contains(&erased), "{erased}");
    let slack_us = bench.smallest_watchdog_slack_us().expect("it was fed");
    println!("{erased} erases of 400 ms: the watchdog was fed with {slack_us} us left");
    assert!(slack_us >= 400 * MILLISECOND, "{slack_us}");
    let frames = bench.frames();
    assert!(of_message(&frames, HEARTBEAT).len() >= 7);
    assert!(bench.resets().is_empty());
}
