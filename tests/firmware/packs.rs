//! Up to nine packs: how they are measured, counted and reported.

use emulator::{AdcInput, LogLevel};
use support::frames::last_of;
use workbench::bench::{Bench, CURRENT, PACK, SECOND};

/// 1241 counts are 1.0 V at a pin: 17 A by ArduPilot's default sensor.
const ONE_VOLT: u16 = 1241;

/// Three LiPo cells at 3.8 V: some 50 %.
const HALF_FULL_3S: u16 = 3582;

/// At 4.15 V a cell.
const FULL_3S: u16 = 3912;

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

/// A rover that has used some 100 mAh, and is parked.
fn parked() -> Bench {
    let mut bench = Bench::configured(HALF_FULL_3S, &WITH_CURRENT);
    bench.adc_input(CURRENT, AdcInput::Code(ONE_VOLT));
    bench.run_for(22 * SECOND);
    bench.adc_input(CURRENT, AdcInput::Code(0));
    bench.run_for(30 * SECOND);
    let frames = bench.frames();
    assert!(last_of(&frames, 0).consumed_mah() > 95);
    bench
}

/// Power fails for a moment, and RAM holds what it held, but for these bits of every thousand.
fn dip_power(bench: &mut Bench, lost_permille: usize) {
    let uninit = bench.section(".uninit");
    let mut kept = bench.read_memory(uninit.start, uninit.len());
    for bit in 0..kept.len() * 8 * lost_permille / 1000 {
        let at = bit.wrapping_mul(7919) % (kept.len() * 8);
        kept[at / 8] ^= 1 << (at % 8);
    }
    bench.power_cycle();
    bench.write_memory(uninit.start, &kept);
}

fn consumed_mah(bench: &mut Bench) -> i32 {
    bench.forget_sent();
    bench.run_for(2 * SECOND);
    let frames = bench.frames();
    last_of(&frames, 0).consumed_mah()
}

#[test]
// Requirement: PX-6, L-11
fn a_count_goes_with_its_pack_over_a_dip_of_power() {
    let parked = parked();
    for (code, current, lost_permille, is_kept) in [
        (HALF_FULL_3S, 0, 0, true),
        (HALF_FULL_3S, ONE_VOLT, 0, true),
        (FULL_3S, 0, 0, false),
        (FULL_3S, ONE_VOLT, 0, false),
        (HALF_FULL_3S, 0, 10, false),
    ] {
        let mut bench = parked.clone();
        bench.adc_input(PACK, AdcInput::Code(code));
        bench.adc_input(CURRENT, AdcInput::Code(current));
        dip_power(&mut bench, lost_permille);
        bench.run_for(3 * SECOND);
        let consumed_mah = consumed_mah(&mut bench);
        let what = format!("{code} {current} {lost_permille}: {consumed_mah} mAh");
        assert_eq!(consumed_mah > 95, is_kept, "{what}");
        assert!(is_kept || consumed_mah < 35, "{what}");
    }
}

#[test]
// Requirement: PX-6, L-11
fn after_a_restart_without_a_pack_the_next_one_has_a_count_of_its_own() {
    let mut unplugged = parked();
    unplugged.adc_input(PACK, AdcInput::Code(0));
    unplugged.run_for(3 * SECOND);
    unplugged.reset_by(2 * SECOND, |bench| bench.hang_program());
    unplugged.run_for(3 * SECOND);
    for (code, is_kept) in [(HALF_FULL_3S, true), (FULL_3S, false)] {
        let mut bench = unplugged.clone();
        bench.adc_input(PACK, AdcInput::Code(code));
        bench.run_for(4 * SECOND);
        let consumed_mah = consumed_mah(&mut bench);
        assert_eq!(consumed_mah > 95, is_kept, "{code}: {consumed_mah} mAh");
    }
}

#[test]
fn nothing_is_continued_after_run_was_pressed() {
    let mut bench = parked();
    bench.press_run();
    bench.run_for(SECOND);
    assert!(consumed_mah(&mut bench) < 5);
}
