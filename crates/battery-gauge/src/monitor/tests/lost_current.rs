//! Currents that were measured and are lost, while the pack gives voltage.

use super::rover::{Pack, Rover, Sensors};
use super::*;
use crate::Gap;

/// For how long a current may be unknown, in seconds.
const TIMEOUT_S: f32 = 12.0;

/// A rover that drives on a full pack.
fn driven() -> Rover {
    let mut rover = Rover::with(Pack::rested(Chemistry::LiPo, 1.0));
    rover.bench.load_state = LoadState::On;
    rover
}

/// Stop and go for some seconds at a mean of 2 A, which is measured or not.
fn drive(rover: &mut Rover, seconds: f32, is_known: bool) -> BatteryState {
    rover.sensors = if is_known {
        Sensors::VoltageAndCurrent
    } else {
        Sensors::Voltage
    };
    let end_s = (seconds * 10.0) as u32;
    for tick in 0..end_s {
        rover.run(0.1, if (tick / 40) % 2 == 0 { 0.0 } else { 4.0 });
    }
    rover.bench.state
}

#[test]
// Requirement: S-8
fn the_percentage_goes_on_by_voltage_when_the_current_is_lost() {
    let mut rover = driven();
    drive(&mut rover, 600.0, true);
    let before = rover.bench.state;
    let state = drive(&mut rover, TIMEOUT_S, false);
    assert_eq!(rover.bench.events, [], "it may come back");
    assert_eq!((state.consumed, state.readings.current_a), (None, None));
    let state = drive(&mut rover, 1500.0, false);
    assert_eq!(rover.bench.events, [PackEvent::CurrentLost], "once");
    assert_eq!(state.status, PackStatus::Healthy, "no threshold needs it");
    assert_about(state.readings.remaining_pct, 100.0 * rover.pack.soc, 12.0);
    assert!(state.readings.remaining_pct < before.readings.remaining_pct);
    // It is counted once more from there.
    let at_return_pct = state.readings.remaining_pct.expect("known");
    let state = drive(&mut rover, 300.0, true);
    assert_about(state.readings.remaining_pct, at_return_pct - 7.6, 3.0);
    assert!(state.consumed_mah() >= before.consumed_mah());
    let gap = |event: &PackEvent| {
        matches!(
            event,
            PackEvent::Gap(Gap {
                counted_mah: None,
                ..
            })
        )
    };
    assert!(
        rover.bench.events.iter().skip(1).all(gap),
        "{:?}",
        rover.bench.events
    );
}

#[test]
// Requirement: S-8, L-12
fn a_lost_current_is_unhealthy_while_a_threshold_needs_it() {
    for (threshold_mah, threshold_pct) in [(Some(500.0), None), (None, Some(20.0))] {
        let mut rover = driven();
        rover.bench.settings.failsafe.low.remaining_mah = threshold_mah;
        rover.bench.settings.failsafe.critical.usable_pct = threshold_pct;
        drive(&mut rover, 60.0, true);
        let state = drive(&mut rover, TIMEOUT_S - 0.5, false);
        assert_eq!(state.status, PackStatus::Healthy);
        let state = drive(&mut rover, 1.0, false);
        assert_eq!(state.status, PackStatus::Unhealthy);
        let failed = PackEvent::SensorFailed(ReadError::CurrentLost);
        assert_eq!(rover.bench.count_of(failed), 1);
        assert_eq!(rover.bench.count_of(PackEvent::CurrentLost), 0);
        let state = drive(&mut rover, 6.0, false);
        assert_eq!(state.failsafe, FailsafeLevel::Unhealthy);
        let state = drive(&mut rover, 6.0, true);
        assert_eq!(state.status, PackStatus::Healthy);
        assert!(rover.bench.events.contains(&PackEvent::SensorRecovered));
    }
}

#[test]
fn what_never_was_or_is_of_another_source_is_not_lost() {
    let mut rover = driven();
    rover.bench.settings.failsafe.low.remaining_mah = Some(100.0);
    let state = drive(&mut rover, 60.0, false);
    assert_eq!((state.status, rover.bench.events.len()), (PackStatus::Healthy, 0));
    drive(&mut rover, 60.0, true);
    // Its pin was changed.
    rover.measuring.scale.amperes_per_volt *= 2.0;
    let state = drive(&mut rover, 60.0, false);
    assert_eq!((state.status, rover.bench.events.len()), (PackStatus::Healthy, 0));
}

#[test]
fn a_current_is_not_missed_while_something_else_counts() {
    for has_counter in [true, false] {
        let mut bench = MonitorBench::new();
        bench.settings.failsafe.low.remaining_mah = Some(100.0);
        for tick in 0..1200 {
            let counted = Counted::TotalCharge(tick as f32 * 0.03);
            bench.tick(Ok(Measurement {
                current_a: (tick < 600).then_some(1.0),
                counted: has_counter.then_some(counted),
                state_of_charge: (!has_counter).then_some(0.5),
                ..volts(11.5)
            }));
        }
        assert_eq!((bench.state.status, bench.events), (PackStatus::Healthy, vec![]));
    }
}

#[test]
fn readings_without_a_current_between_others_lose_no_charge() {
    for unknown in 1..=4 {
        let mut bench = MonitorBench::new();
        bench.run(30.0, loaded(12.6, 0.0));
        bench.load_state = LoadState::On;
        // A second each, by 7.2 A: half of the pack.
        for second in 0..550 {
            let soc = 1.0 - second as f32 * 2.0 / 2200.0;
            let voltage_v = 3.0 * Chemistry::LiPo.cell().curve.voltage_v(soc) - 0.2;
            let is_known = second % (unknown + 1) == 0;
            let reading = Measurement {
                current_a: is_known.then_some(7.2),
                ..volts(voltage_v)
            };
            bench.tick_after(1.0, Ok(reading));
        }
        println!("{unknown} of {}", unknown + 1);
        assert_about(bench.state.readings.remaining_pct, 50.0, 2.0);
    }
}
