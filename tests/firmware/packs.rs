//! Up to nine packs: how they are measured, counted and reported.

use emulator::{AdcInput, LogLevel};
use support::frames::last_of;
use workbench::bench::{Bench, CURRENT, SECOND};

/// 1241 counts are 1.0 V at a pin: 17 A by ArduPilot's default sensor.
const ONE_VOLT: u16 = 1241;

/// Three LiPo cells at 3.8 V: some 50 %.
const HALF_FULL_3S: u16 = 3582;

const WITH_CURRENT: [(&str, f32); 4] = [
    ("BATT_MONITOR", 4.0),
    ("BATT_CURR_PIN", 27.0),
    ("BATT_CELLS", 3.0),
    ("BATT_CAPACITY", 2200.0),
];

#[test]
fn what_was_consumed_survives_a_watchdog_reset_but_not_a_power_cycle() {
    let mut bench = Bench::configured(HALF_FULL_3S, &WITH_CURRENT);
    bench.adc_input(CURRENT, AdcInput::Code(ONE_VOLT));
    bench.run_for(30 * SECOND);
    let frames = bench.frames();
    let before = last_of(&frames, 0);
    assert!(before.consumed_mah() > 130);

    bench.reset_by(2 * SECOND, |bench| bench.hang_program());
    bench.run_for(SECOND);
    let frames = bench.frames();
    let after = last_of(&frames, 0);
    let lost_mah = before.consumed_mah() - after.consumed_mah();
    // What is recorded is up to a second old: 4.7 mAh. Since the restart at least half as much was drawn and reported.
    assert!((-12..=3).contains(&lost_mah), "{lost_mah} mAh");
    assert!(after.remaining_pct().abs_diff(before.remaining_pct()) <= 1);
    assert!(!bench.logged(LogLevel::Info, "consumption kept").is_empty());

    bench.power_cycle();
    bench.run_for(2 * SECOND);
    let status_after_power_up = bench.frames();
    assert!(last_of(&status_after_power_up, 0).consumed_mah() < 15);
}
