//! Sampling and motors are as punctual with a log as without.

use crate::rover::{GOOD_3S, VEHICLE_ID, drive_for};
use emulator::AdcInput;
use support::motor_poles::LEFT;
use support::requests::{arm_by_force, manual_control, manual_mode};
use workbench::bench::{Bench, CURRENT, CYCLES_PER_US, MILLISECOND, SECOND, TestedVehicle};
use workbench::rover_circuit::{THREE_CELLS_V, connect};

const TICK_US: u64 = 100 * MILLISECOND;

/// A reading ends when it was due as long as its tick is less than 20 ms late.
const SAMPLING_GOAL_US: f64 = 10_000.0;

/// So long is driven.
const DRIVE_US: u64 = 30 * SECOND;

/// How late something was, in µs.
#[derive(Debug)]
struct Lateness {
    mean_us: f64,
    longest_us: f64,
}

impl Lateness {
    fn of(late_cycles: &[u64]) -> Self {
        let us = |cycles: u64| cycles as f64 / CYCLES_PER_US as f64;
        let sum: u64 = late_cycles.iter().sum();
        Self {
            mean_us: us(sum) / late_cycles.len() as f64,
            longest_us: us(late_cycles.iter().copied().max().expect("something was measured")),
        }
    }
}

/// An armed rover with nine packs on the converter.
fn armed(log_bitmask: f32) -> Bench {
    let mut parameters = vec![
        ("LOG_BITMASK".to_owned(), log_bitmask),
        ("MOT_SLEWRATE".to_owned(), 0.0),
        ("SERIAL0_BAUD".to_owned(), 460.0),
    ];
    for number in 1..=9 {
        let pack = match number {
            1 => "BATT".to_owned(),
            _ => format!("BATT{number}"),
        };
        for (name, value) in [("MONITOR", 4.0), ("CURR_PIN", 27.0), ("CELLS", 3.0)] {
            parameters.push((format!("{pack}_{name}"), value));
        }
    }
    let parameters: Vec<_> = parameters
        .iter()
        .map(|(name, value)| (name.as_str(), *value))
        .collect();
    let mut bench = Bench::configured(GOOD_3S, &parameters);
    connect(&mut bench, THREE_CELLS_V);
    bench.adc_input(CURRENT, AdcInput::Code(300));
    bench.run_for(2 * SECOND);
    bench.ask(&arm_by_force());
    bench.ask(&manual_mode());
    bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    // The opening of the file is written.
    drive_for(&mut bench, 2 * SECOND, 0);
    bench
}

/// Drives, and returns how late sampling ticks and changes of a motor were.
fn drive(bench: &mut Bench) -> (Lateness, Lateness) {
    let pin = LEFT[0].positive;
    bench.record_pin(pin);
    bench.take_ticks();
    bench.take_pwm_changes(pin);
    let (mut ticks, mut motors) = (Vec::new(), Vec::new());
    let begin_us = bench.time_us();
    let mut step = 0;
    while bench.time_us() < begin_us + DRIVE_US {
        // At any time between two ticks.
        step += 1;
        let throttle = if step % 2 == 0 { 500 } else { 600 };
        let now_us = bench.time_us();
        let arrived_us = bench.uart_send(0, now_us, &manual_control(VEHICLE_ID, 0, throttle));
        bench.run_for(73 * MILLISECOND + 97);
        let changes = bench.take_pwm_changes(pin);
        let change = changes.iter().find(|(at, _)| *at > arrived_us * CYCLES_PER_US);
        let (at, _) = change.expect("the motor follows");
        motors.push(at - arrived_us * CYCLES_PER_US);
        ticks.extend(bench.take_ticks().iter().map(|tick_us| tick_us * CYCLES_PER_US));
    }
    // One that goes on while it is asked for comes twice.
    ticks.dedup_by(|next, before| *next - *before < MILLISECOND * CYCLES_PER_US);
    (ticks_late(&ticks), Lateness::of(&motors))
}

/// Delays of ticks against a time base that is never early.
fn ticks_late(begins: &[u64]) -> Lateness {
    let tick = TICK_US * CYCLES_PER_US;
    let due = |number: usize| number as u64 * tick;
    let offsets = || begins.iter().enumerate().map(|(number, at)| at - due(number));
    let earliest = offsets().min().expect("ticks");
    let late: Vec<_> = offsets().map(|at| at - earliest).collect();
    Lateness::of(&late)
}

#[test]
fn sampling_and_motors_are_as_punctual_with_a_log_as_without() {
    let [(sampling_without, motors_without), (sampling, motors)] =
        [0.0, 520.0].map(|log_bitmask| drive(&mut armed(log_bitmask)));
    println!("sampling late: without {sampling_without:?}, with {sampling:?}");
    println!("motors late: without {motors_without:?}, with {motors:?}");
    assert!(sampling.longest_us <= SAMPLING_GOAL_US, "{sampling:?}");
    assert!(motors.mean_us <= 1.1 * motors_without.mean_us, "{motors:?}");
}
