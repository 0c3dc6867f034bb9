//! From the voltage at GP26 to the voltage on the wire.

use emulator::{AdcFault, AdcInput};
use support::frames::last_of;
use workbench::bench::{Bench, CURRENT, MILLISECOND, PACK, SECOND};

/// The voltage on the wire after the input has been there for a while.
fn reported_mv(bench: &mut Bench) -> u16 {
    bench.run_for(700 * MILLISECOND);
    last_of(&bench.frames(), 0).voltage_mv(0)
}

#[test]
// Requirement: FR-14
fn the_mean_error_over_the_range_stays_within_ten_counts() {
    const POINTS: u32 = 30;
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

/// A conversion of GP26 that has timed out ends while GP27 is read: whenever that is, it does not count as one of GP27's.
#[test]
fn a_conversion_that_ends_late_is_no_reading_of_the_next_pin() {
    let parameters = [
        ("BATT2_MONITOR", 31.0),
        ("BATT2_CURR_PIN", 27.0),
        ("BATT2_AMP_PERVLT", 100.0),
        ("BATT2_AMP_OFFSET", 0.0),
    ];
    let mut bench = Bench::configured(2482, &parameters);
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
        let mut log = bench.take_log();
        log.retain(|line| line.text.contains("battery 1: read failed"));
        failed_reads += log.len();
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
