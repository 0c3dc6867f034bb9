//! Up to nine packs: how they are measured, counted and reported.

use emulator::{AdcInput, LogLevel};
use support::commands::{ACCEPTED, BATTERY_RESET, REQUEST_MESSAGE};
use support::frames::{
    BATTERY_STATUS, BatteryStatus, Frame, HEARTBEAT, NAMED_VALUE_FLOAT, SYS_STATUS, SysStatus, acknowledged,
    last_of, of_message, result_of, texts_of,
};
use support::requests::command_long_2;
use workbench::bench::{Bench, CURRENT, MILLISECOND, PACK, SECOND};

/// 1241 counts are 1.0 V at a pin: 17 A by ArduPilot's default sensor.
const ONE_VOLT: u16 = 1241;
const LOAD_A: f64 = 17.0;

/// Three LiPo cells at 3.8 V: some 50 %.
const HALF_FULL_3S: u16 = 3582;

const WITH_CURRENT: [(&str, f32); 4] = [
    ("BATT_MONITOR", 4.0),
    ("BATT_CURR_PIN", 27.0),
    ("BATT_CELLS", 3.0),
    ("BATT_CAPACITY", 2200.0),
];

fn count_of(frames: &[Frame], instance: u8) -> usize {
    let of_pack = |frame: &&&Frame| BatteryStatus(frame).instance() == instance;
    of_message(frames, BATTERY_STATUS).iter().filter(of_pack).count()
}

#[test]
fn a_battery_reset_just_before_a_restart_holds() {
    let mut bench = Bench::configured(HALF_FULL_3S, &WITH_CURRENT);
    // Between two records of what a restart retains, a second apart.
    for after_ms in [150, 450, 750] {
        let from_us = bench.time_us().next_multiple_of(SECOND) + SECOND;
        bench.run_until_time(from_us + after_ms * MILLISECOND);
        let percent = 90.0 - after_ms as f32 / 10.0;
        assert_eq!(
            bench.result_of(&command_long_2(BATTERY_RESET, 65535.0, percent)),
            ACCEPTED
        );
        bench.reboot();
        let frames = bench.frames();
        let remaining_pct = last_of(&frames, 0).remaining_pct();
        assert!(
            (f32::from(remaining_pct) - percent).abs() <= 1.0,
            "{percent}: {remaining_pct}"
        );
    }
}

#[test]
// Requirement: FR-11
fn nine_packs_are_sampled_and_reported_at_10_hz() {
    const SECONDS: u64 = 20;
    const TICKS: usize = 10 * SECONDS as usize;
    let mut parameters: Vec<(String, f32)> =
        (2..=9).map(|pack| (format!("BATT{pack}_MONITOR"), 3.0)).collect();
    parameters.push(("BATT9_MONITOR".into(), 10.0));
    parameters.push(("BATT9_SUM_MASK".into(), 3.0));
    for pack in 2..=4 {
        parameters.push((format!("BATT{pack}_MONITOR"), 4.0));
        parameters.push((format!("BATT{pack}_CURR_PIN"), 27.0));
    }
    parameters.push(("SR0_EXTRA1".into(), 10.0));
    let named: Vec<_> = parameters
        .iter()
        .map(|(name, value)| (name.as_str(), *value))
        .collect();
    let mut bench = Bench::configured(2482, &named);
    bench.adc_input(CURRENT, AdcInput::Code(100));

    let from_us = bench.time_us();
    let (conversions, awake, log_lines) = (
        bench.adc_conversions(),
        bench.awake_cycles(),
        bench.log_lines().len(),
    );
    bench.run_for(SECONDS * SECOND);
    let frames = bench.frames_since(from_us);
    for instance in 0..9 {
        let count = count_of(&frames, instance);
        assert!(
            count.abs_diff(TICKS) <= 1,
            "{count} of pack {instance} in {SECONDS} s"
        );
        assert_eq!(last_of(&frames, instance).voltage_mv(0), 7901, "pack {instance}");
    }
    assert!(of_message(&frames, SYS_STATUS).len().abs_diff(TICKS) <= 1);
    assert_eq!(of_message(&frames, HEARTBEAT).len() as u64, SECONDS);
    // Each tick reads each of the two pins once, for all packs that use it.
    assert_eq!((bench.adc_conversions() - conversions).div_ceil(32), TICKS as u64);
    let samples = bench.log_lines()[log_lines..]
        .iter()
        .filter(|line| line.text.contains("10 samples/s"));
    assert!(samples.count() as u64 >= SECONDS - 2, "10 ticks in each second");
    let awake_permille = (bench.awake_cycles() - awake) * 1000 / (SECONDS * SECOND * 125);
    println!("nine packs, SR0_EXTRA1 10: awake {awake_permille} permille of the time");
    assert!(bench.logged(LogLevel::Warn, "too slow").is_empty());
}

#[test]
fn the_current_is_measured_and_counted() {
    let mut bench = Bench::configured(HALF_FULL_3S, &WITH_CURRENT);
    bench.run_for(SECOND);
    let frames = bench.frames();
    let idle = last_of(&frames, 0);
    assert_eq!((idle.current_ca(), idle.consumed_mah()), (0, 0));
    assert!(
        (45..=55).contains(&idle.remaining_pct()),
        "half full: {} %",
        idle.remaining_pct()
    );

    bench.adc_input(CURRENT, AdcInput::Code(ONE_VOLT));
    bench.run_for(20 * SECOND);
    let frames = bench.frames();
    let loaded = last_of(&frames, 0);
    assert!(
        loaded.current_ca().abs_diff(1700) <= 1,
        "{} cA",
        loaded.current_ca()
    );
    let expected_mah = LOAD_A * 20.0 / 3.6;
    assert!(
        (f64::from(loaded.consumed_mah()) - expected_mah).abs() < 4.0,
        "{} mAh",
        loaded.consumed_mah()
    );
    let sys_status = of_message(&frames, SYS_STATUS);
    assert!(sys_status[sys_status.len() - 1].i16(16).abs_diff(1700) <= 1);
}

#[test]
fn a_current_without_a_voltage_and_one_without_a_sensor() {
    let mut bench = Bench::configured(
        2482,
        &[
            ("BATT_MONITOR", 31.0),
            ("BATT_CURR_PIN", 27.0),
            ("BATT2_MONITOR", 25.0),
            ("BATT2_AMP_OFFSET", 0.5),
        ],
    );
    // The estimate from the voltage before the restart would be kept.
    bench.power_cycle();
    bench.adc_input(CURRENT, AdcInput::Code(ONE_VOLT));
    bench.run_for(2 * SECOND);
    let frames = bench.frames();
    let current_only = last_of(&frames, 0);
    assert_eq!(current_only.voltage_mv(0), u16::MAX);
    assert!(current_only.current_ca().abs_diff(1700) <= 1);
    assert_eq!(current_only.remaining_pct(), -1, "its state of charge is unknown");
    // No throttle: the offset alone.
    let synthetic = last_of(&frames, 1);
    assert_eq!((synthetic.voltage_mv(0), synthetic.current_ca()), (7901, 50));
}

#[test]
// Requirement: AP-4
fn a_sum_is_of_the_others() {
    let mut bench = Bench::configured(
        2482,
        &[
            ("BATT_MONITOR", 10.0),
            ("BATT2_MONITOR", 3.0),
            ("BATT3_MONITOR", 3.0),
            ("BATT3_VOLT_PIN", 27.0),
        ],
    );
    bench.adc_input(CURRENT, AdcInput::Code(2382));
    bench.run_for(SECOND);
    let mv = |bench: &mut Bench| last_of(&bench.frames(), 0).voltage_mv(0);
    assert_eq!(mv(&mut bench), 7741, "the mean");
    bench.set("BATT_OPTIONS", 512.0);
    bench.run_for(SECOND);
    assert_eq!(mv(&mut bench), 7582, "the lowest");
    bench.set("BATT_SUM_MASK", 2.0);
    bench.run_for(SECOND);
    assert_eq!(mv(&mut bench), 7901, "the second alone");
}

#[test]
// Requirement: AP-16
fn a_battery_reset_is_read_back_exactly() {
    let mut bench = Bench::configured(HALF_FULL_3S, &WITH_CURRENT);
    for percent in [56, 97, 0, 100] {
        let answers = bench.ask(&command_long_2(BATTERY_RESET, 65535.0, percent as f32));
        assert_eq!(acknowledged(&answers)[0], (BATTERY_RESET, ACCEPTED));
        bench.run_for(SECOND);
        let frames = bench.frames();
        let status = last_of(&frames, 0);
        assert_eq!(status.remaining_pct(), percent);
        assert_eq!(status.consumed_mah(), 22 * (100 - i32::from(percent)));
    }
}

#[test]
fn a_reset_of_a_sum_reaches_its_packs() {
    let mut parameters = WITH_CURRENT.to_vec();
    parameters.extend([
        ("BATT2_MONITOR", 10.0),
        ("BATT2_SUM_MASK", 1.0),
        ("BATT2_CAPACITY", 2200.0),
        ("BATT2_CELLS", 3.0),
    ]);
    let mut bench = Bench::configured(HALF_FULL_3S, &parameters);
    for percent in [56, 97, 0, 100] {
        let answers = bench.ask(&command_long_2(BATTERY_RESET, 2.0, percent as f32));
        assert_eq!(acknowledged(&answers)[0], (BATTERY_RESET, ACCEPTED));
        bench.run_for(SECOND);
        let frames = bench.frames();
        for instance in [0, 1] {
            let status = last_of(&frames, instance);
            assert_eq!(status.remaining_pct(), percent, "pack {instance}");
            let consumed_mah = 22 * (100 - i32::from(percent));
            assert_eq!(status.consumed_mah(), consumed_mah, "pack {instance}");
        }
    }
}

#[test]
fn what_was_consumed_survives_a_watchdog_reset_but_not_a_power_cycle() {
    let mut bench = Bench::configured(HALF_FULL_3S, &WITH_CURRENT);
    bench.adc_input(CURRENT, AdcInput::Code(ONE_VOLT));
    bench.run_for(30 * SECOND);
    let frames = bench.frames();
    let before = last_of(&frames, 0);
    assert!(before.consumed_mah() > 130);

    bench.hang_program();
    let resets = bench.resets().len();
    assert!(bench.run_until(2 * SECOND, |board| board.resets().len() > resets));
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

#[test]
fn the_resting_voltage_is_sent_when_that_is_asked_for() {
    let mut bench = Bench::configured(HALF_FULL_3S, &WITH_CURRENT);
    bench.set("BATT_OPTIONS", 64.0);
    let estimates = command_long_2(REQUEST_MESSAGE, NAMED_VALUE_FLOAT as f32, 0.0);
    let names = |answers: &[Frame]| -> Vec<String> {
        let values = of_message(answers, NAMED_VALUE_FLOAT);
        values.iter().map(|value| value.text(8, 10)).collect()
    };
    let before = names(&bench.ask(&estimates));
    assert!(before.iter().all(|name| name == "BAT1_SIGMA"), "{before:?}");
    // 50 mΩ: 17 A take 0.85 V off the pack, 267 counts.
    for step in 0..6 {
        let (voltage, current) = if step % 2 == 0 {
            (HALF_FULL_3S - 267, ONE_VOLT)
        } else {
            (HALF_FULL_3S, 0)
        };
        bench.adc_input(PACK, AdcInput::Code(voltage));
        bench.adc_input(CURRENT, AdcInput::Code(current));
        bench.run_for(3 * SECOND);
    }
    bench.adc_input(PACK, AdcInput::Code(HALF_FULL_3S - 267));
    bench.adc_input(CURRENT, AdcInput::Code(ONE_VOLT));
    bench.run_for(SECOND);
    let frames = bench.frames();
    let resting_mv = last_of(&frames, 0).voltage_mv(0);
    assert!(resting_mv.abs_diff(11_402) < 60, "{resting_mv} mV");
    let sys_status = of_message(&frames, SYS_STATUS);
    assert!(
        SysStatus(sys_status[sys_status.len() - 1])
            .voltage_mv()
            .abs_diff(11_402)
            < 60
    );

    let answers = bench.ask(&estimates);
    assert_eq!(result_of(&answers), ACCEPTED);
    let values = of_message(&answers, NAMED_VALUE_FLOAT);
    assert_eq!(names(&answers), ["BAT1_RES", "BAT1_VREST", "BAT1_SIGMA"]);
    let (resistance_mohm, resting_v) = (values[0].f32(4), values[1].f32(4));
    assert!((resistance_mohm - 50.0).abs() < 3.0, "{resistance_mohm} mΩ");
    assert!((resting_v - 11.402).abs() < 0.06, "{resting_v} V");
    let age_ms = bench.time_us() / 1000 - u64::from(values[0].u32(0));
    assert!(
        age_ms < 5000,
        "{age_ms} ms since the restart with its settings are missing"
    );
}

#[test]
// Requirement: PX-6
fn cells_and_swaps_are_announced() {
    let mut bench = Bench::running(2482);
    bench.run_for(3 * SECOND);
    assert_eq!(
        texts_of(&bench.frames()),
        [
            "Battery failsafes are off: set BATT_LOW_VOLT",
            "Battery 1 has 2 cells (set BATT_CELLS to be sure)",
            "Set BATT_LOW_VOLT 7.00, BATT_CRT_VOLT 6.80"
        ]
    );
    bench.adc_input(PACK, AdcInput::Code(50));
    bench.run_for(2 * SECOND);
    bench.adc_input(PACK, AdcInput::Code(HALF_FULL_3S));
    // It has rested after two seconds; the number of cells takes two more.
    bench.run_for(5 * SECOND);
    assert_eq!(
        texts_of(&bench.frames())[3..],
        [
            "Battery 1 swapped: estimates restarted",
            "Battery 1 has 3 cells (set BATT_CELLS to be sure)",
            "Set BATT_LOW_VOLT 10.50, BATT_CRT_VOLT 10.20"
        ]
    );
}
