//! From the voltage at GP26 to the voltage on the wire.

use emulator::{AdcFault, AdcInput, LogLevel};
use support::frames::{BATTERY_STATUS, BatteryStatus, SYS_STATUS, SysStatus, last_of, of_message, texts_of};
use support::requests::arm;
use workbench::bench::{Bench, CURRENT, DIVIDER_CODE, MILLISECOND, PACK, SECOND};

/// The converter's last code.
const FULL_SCALE: u16 = 4095;

const UNKNOWN: u16 = u16::MAX;

/// The voltage on the wire after the input has been there for a while.
fn reported_mv(bench: &mut Bench) -> u16 {
    bench.run_for(700 * MILLISECOND);
    let frames = bench.frames();
    let battery = of_message(&frames, BATTERY_STATUS);
    BatteryStatus(battery[battery.len() - 1]).voltage_mv(0)
}

#[test]
// Requirement: FR-13
fn the_voltage_follows_the_formula_of_the_requirement() {
    let mut bench = Bench::power_up(2482);
    for code in [700, 1500, 2482, 3000, 3555, 4094] {
        bench.adc_input(PACK, AdcInput::Code(code));
        let expected_mv = f64::from(code) / 4095.0 * 3.3 * 3.95 * 1000.0;
        let reported_mv = f64::from(reported_mv(&mut bench));
        assert!(
            (reported_mv - expected_mv).abs() <= 1.0,
            "{code} counts: {reported_mv} mV, not {expected_mv} mV"
        );
    }
    bench.assert_untroubled();
}

#[test]
// Requirement: S-3
fn a_divider_that_reads_full_scale_is_no_full_pack() {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.adc_input(PACK, AdcInput::Code(FULL_SCALE));
    bench.run_for(2 * SECOND);
    let texts = texts_of(&bench.frames());
    assert!(
        texts.contains(&"Battery 1 unhealthy: over range".into()),
        "{texts:?}"
    );
    assert!(texts_of(&bench.ask(&arm()))[0].starts_with("Arm: Battery 1 unhealthy"));
    bench.adc_input(PACK, AdcInput::Code(DIVIDER_CODE));
    bench.run_for(7 * SECOND);
    assert!(texts_of(&bench.frames()).contains(&"Battery 1 healthy again".into()));
}

#[test]
// Requirement: S-3
fn a_current_sensor_at_full_scale_leaves_the_voltage_and_is_announced_once() {
    let parameters = [("BATT_MONITOR", 4.0), ("BATT_CURR_PIN", 27.0)];
    let mut bench = Bench::configured(DIVIDER_CODE, &parameters);
    bench.run_for(2 * SECOND);
    for _ in 0..2 {
        bench.adc_input(CURRENT, AdcInput::Code(FULL_SCALE));
        bench.run_for(2 * SECOND);
        assert_eq!(last_of(&bench.frames(), 0).current_ca(), 5610, "17 A per volt");
        bench.adc_input(CURRENT, AdcInput::Code(0));
        bench.run_for(2 * SECOND);
    }
    let texts = texts_of(&bench.frames());
    let said = |start: &str| texts.iter().filter(|text| text.starts_with(start)).count();
    assert_eq!(
        said("Battery 1 current over range: consumption too low"),
        1,
        "{texts:?}"
    );
    assert_eq!(said("Battery 1 unhealthy"), 0, "{texts:?}");
}

#[test]
// Requirement: FR-11
fn a_reading_is_the_mean_of_its_burst() {
    let mut bench = Bench::power_up(2482);
    let mut high = false;
    bench.adc_input(
        PACK,
        AdcInput::CodeAt(Box::new(move |_| {
            high = !high;
            if high { 2600 } else { 2400 }
        })),
    );
    let expected_mv = 2500.0 / 4095.0 * 3.3 * 3.95 * 1000.0;
    assert!((f64::from(reported_mv(&mut bench)) - expected_mv).abs() <= 1.0);
}

#[test]
// Requirement: FR-14
fn the_mean_error_over_the_range_stays_within_ten_counts() {
    const POINTS: u32 = 150;
    let mut bench = Bench::power_up(2482);
    bench.adc_noise(0.001);
    let (mut sum, mut worst) = (0.0, 0.0f64);
    for point in 0..POINTS {
        // From just above "not connected" to just below full scale.
        let volts = 0.55 + 2.7 * f64::from(point) / f64::from(POINTS);
        bench.adc_input(PACK, AdcInput::Volts(volts));
        let error = f64::from(reported_mv(&mut bench)) / 3950.0 / 3.3 * 4095.0 - volts / 3.3 * 4095.0;
        sum += error.abs();
        worst = worst.max(error.abs());
    }
    let mean = sum / f64::from(POINTS);
    println!("converter error over the range: mean {mean:.1} counts, worst {worst:.1} counts");
    assert!(mean <= 10.0, "{mean}");
}

#[test]
// Requirement: PX-5
fn usb_power_is_no_pack_and_not_a_flat_one() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(2 * SECOND);
    // 0.5 V at the pin are 1.98 V at the terminals.
    bench.adc_input(PACK, AdcInput::Volts(0.5));
    assert_eq!(reported_mv(&mut bench), UNKNOWN);
    let frames = bench.frames();
    let battery = of_message(&frames, BATTERY_STATUS);
    assert_eq!(BatteryStatus(battery[battery.len() - 1]).charge_state(), 0);
    let sys_status = of_message(&frames, SYS_STATUS);
    let last = SysStatus(sys_status[sys_status.len() - 1]);
    assert_eq!((last.voltage_mv(), last.is_battery_healthy()), (UNKNOWN, true));
    assert_eq!(bench.logged(LogLevel::Warn, "not connected").len(), 1);

    bench.adc_input(PACK, AdcInput::Volts(2.0));
    assert!(reported_mv(&mut bench) > 7000);
}

#[test]
fn no_voltage_is_invented_before_the_first_reading() {
    let mut bench = Bench::power_up(2482);
    bench.adc_fault(AdcFault::Stalled);
    bench.run_for(5 * SECOND);
    let frames = bench.frames();
    let battery = of_message(&frames, BATTERY_STATUS);
    assert_eq!(battery.len(), 10);
    assert!(
        battery
            .iter()
            .all(|frame| BatteryStatus(frame).voltage_mv(0) == UNKNOWN)
    );
    assert_eq!(BatteryStatus(battery[0]).charge_state(), 0);
    assert_eq!(BatteryStatus(battery[9]).charge_state(), 6);
}

/// A conversion of GP26 that has timed out ends while GP27 is read: whenever that is, it does not count as one of GP27's.
#[test]
fn a_conversion_that_ends_late_is_no_reading_of_the_next_pin() {
    let mut bench = Bench::configured(
        2482,
        &[
            ("BATT2_MONITOR", 31.0),
            ("BATT2_CURR_PIN", 27.0),
            ("BATT2_AMP_PERVLT", 100.0),
            ("BATT2_AMP_OFFSET", 0.0),
        ],
    );
    bench.adc_input(CURRENT, AdcInput::Code(0));
    bench.run_for(SECOND);
    let mut failed_reads = 0;
    for stalled_us in (2..100).step_by(2) {
        let conversions = bench.adc_conversions();
        assert!(bench.run_until(SECOND, |board| board.adc_conversions() > conversions));
        bench.adc_fault(AdcFault::Stalled);
        bench.run_for(stalled_us);
        bench.adc_fault(AdcFault::None);
        // A sound tick follows each one with the fault.
        bench.run_for(150 * MILLISECOND);
        failed_reads += bench
            .take_log()
            .iter()
            .filter(|line| line.text.contains("battery 1: read failed"))
            .count();
    }
    println!("{failed_reads} of 49 bursts of GP26 failed");
    let frames = bench.frames();
    assert_eq!(last_of(&frames, 0).voltage_mv(0), 7901);
    let current = last_of(&frames, 1);
    assert_eq!((current.current_ca(), current.consumed_mah()), (0, 0));
    assert!(
        (1..49).contains(&failed_reads),
        "some faults end before the time-out"
    );
}
