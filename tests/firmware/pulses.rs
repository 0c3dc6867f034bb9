//! Pulses of a fuel sensor on GP17.

use emulator::PinWire;
use support::frames::last_of;
use support::monitor_types::FUEL_FLOW;
use workbench::bench::{Bench, MILLISECOND, SECOND};

const FUEL_LEVEL_PWM: f32 = 12.0;

const PULSES: usize = 17;

fn with_tank(kind: f32, parameters: &[(&str, f32)]) -> Bench {
    let tank = [
        ("BATT2_MONITOR", kind),
        ("BATT2_CURR_PIN", 17.0),
        ("BATT2_CAPACITY", 2000.0),
        ("SR0_EXTRA1", 10.0),
    ];
    let mut bench = Bench::configured(2482, &[&tank[..], parameters].concat());
    bench.drive_pin(PULSES, PinWire::Low);
    bench
}

#[test]
// Requirement: AP-10
fn fast_pulses_are_not_lost() {
    let mut bench = with_tank(FUEL_FLOW, &[("BATT2_AMP_PERVLT", 0.1)]);
    let from_us = bench.time_us() + 100 * MILLISECOND;
    // 1 kHz, with a parameter list and nine other things to do meanwhile.
    bench.pulses(PULSES, from_us, 300, MILLISECOND, 5000);
    bench.run_for(8 * SECOND);
    let consumed_ml = last_of(&bench.frames(), 1).consumed_mah();
    assert!(consumed_ml.abs_diff(500) <= 1, "{consumed_ml} ml");
}

#[test]
fn the_width_of_pulses_is_timed_to_a_percent() {
    let mut bench = with_tank(FUEL_LEVEL_PWM, &[]);
    let from_us = bench.time_us() + MILLISECOND;
    bench.pulses(PULSES, from_us, 1500, 20 * MILLISECOND, 100);
    bench.run_for(SECOND);
    assert_eq!(last_of(&bench.frames(), 1).remaining_pct(), 50);
}
