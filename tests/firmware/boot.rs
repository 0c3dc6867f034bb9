//! The start, and the log.

use crate::bench::{Bench, SECOND};
use crate::emulator::LogLevel;

#[test]
fn the_banner_names_version_and_reset_reason() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(SECOND / 10);
    let banner = format!("rover-battmon {}, started by PowerOn", env!("CARGO_PKG_VERSION"));
    assert_eq!(
        bench.logged(LogLevel::Info, &banner).len(),
        1,
        "{:?}",
        bench.log_lines()
    );

    bench.press_run();
    bench.run_for(SECOND / 10);
    assert_eq!(
        bench.logged(LogLevel::Info, "started by RunPin").len(),
        1,
        "{:?}",
        bench.log_lines()
    );
}

#[test]
fn two_lines_a_second_report_voltage_and_rates() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(10 * SECOND + SECOND / 2);
    let lines = bench.logged(LogLevel::Info, "samples/s");
    assert_eq!(lines.len(), 10);
    let packs = bench.logged(LogLevel::Info, "mV");
    assert_eq!(packs.len(), 10, "one pack: {packs:?}");
    let (_, last) = &packs[9];
    assert!(
        last.contains("battery 1: Healthy") && last.contains("7900"),
        "{last}"
    );
    let (_, last) = &lines[9];
    assert!(
        last.contains("10 samples/s") && last.contains("5 frames/s") && last.contains("0 dropped"),
        "{last}"
    );
}

/// An `Option` that is `None` holds whatever RAM held. The compiler may compare that before it looks whether it counts,
/// and a comparison of floats takes a few cycles more or less; nothing else comes of it.
const JITTER_US: u64 = 10;

#[test]
fn what_is_in_ram_at_power_up_makes_no_difference() {
    let run = |seed| {
        let mut bench = Bench::power_up_seeded(2482, seed);
        bench.run_for(5 * SECOND);
        bench.assert_untroubled();
        bench.sent().to_vec()
    };
    let first = run(1);
    assert!(!first.is_empty());
    for seed in 2..6 {
        let other = run(seed);
        assert_eq!(other.len(), first.len(), "RAM contents {seed}");
        for ((at_us, byte), (first_at_us, first_byte)) in other.into_iter().zip(&first) {
            assert_eq!(byte, *first_byte, "RAM contents {seed}, at {at_us} us");
            assert!(
                at_us.abs_diff(*first_at_us) <= JITTER_US,
                "RAM contents {seed}: {at_us} instead of {first_at_us} us"
            );
        }
    }
}

#[test]
fn nothing_is_used_that_the_emulator_does_not_model() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(3 * SECOND);
    let unmodelled: Vec<_> = bench.unmodelled().keys().copied().collect();
    assert!(unmodelled.is_empty(), "{unmodelled:?}");
}
