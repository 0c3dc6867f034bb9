//! Currents that were measured and are lost, while the pack gives voltage.

use super::*;
use crate::Gap;

/// For how long a current may be unknown, in seconds.
const TIMEOUT_S: f32 = 12.0;

/// A driven 3S pack of 2200 mAh with 30 mΩ.
struct Driven {
    bench: MonitorBench,
    left_mah: f32,
}

impl Driven {
    fn new() -> Self {
        let mut bench = MonitorBench::new();
        bench.load_state = LoadState::On;
        Self {
            bench,
            left_mah: 2200.0,
        }
    }

    /// Some seconds at this current, which is known or not.
    fn run(&mut self, seconds: f32, current_a: f32, is_known: bool) -> BatteryState {
        for tick in 0..(seconds * 10.0) as u32 {
            // Stop and go.
            let current_a = current_a * 2.0 * ((tick / 40) % 2) as f32;
            self.left_mah -= current_a * 0.1 / 3.6;
            let resting_v = 3.0 * Chemistry::LiPo.cell().curve.voltage_v(self.left_mah / 2200.0);
            self.bench.tick(Ok(Measurement {
                current_a: is_known.then_some(current_a),
                ..volts(resting_v - 0.03 * current_a)
            }));
        }
        self.bench.state
    }

    fn soc_pct(&self) -> f32 {
        self.left_mah / 22.0
    }
}

#[test]
// Requirement: S-8
fn the_percentage_goes_on_by_voltage_when_the_current_is_lost() {
    let mut pack = Driven::new();
    pack.run(600.0, 2.0, true);
    let before = pack.bench.state;
    let state = pack.run(TIMEOUT_S, 2.0, false);
    assert_eq!(pack.bench.events, [], "it may come back");
    assert_eq!((state.consumed, state.readings.current_a), (None, None));
    let state = pack.run(1500.0, 2.0, false);
    assert_eq!(pack.bench.events, [PackEvent::CurrentLost], "once");
    assert_eq!(state.status, PackStatus::Healthy, "no threshold needs it");
    assert_about(state.readings.remaining_pct, pack.soc_pct(), 12.0);
    assert!(state.readings.remaining_pct < before.readings.remaining_pct);
    // It is counted once more from there.
    let at_return_pct = state.readings.remaining_pct.expect("known");
    let state = pack.run(300.0, 2.0, true);
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
        pack.bench.events.iter().skip(1).all(gap),
        "{:?}",
        pack.bench.events
    );
}

#[test]
// Requirement: S-8, L-12
fn a_lost_current_is_unhealthy_while_a_threshold_needs_it() {
    for (threshold_mah, threshold_pct) in [(Some(500.0), None), (None, Some(20.0))] {
        let mut pack = Driven::new();
        pack.bench.settings.failsafe.low.remaining_mah = threshold_mah;
        pack.bench.settings.failsafe.critical.usable_pct = threshold_pct;
        pack.run(60.0, 2.0, true);
        let state = pack.run(TIMEOUT_S - 0.5, 2.0, false);
        assert_eq!(state.status, PackStatus::Healthy);
        let state = pack.run(1.0, 2.0, false);
        assert_eq!(state.status, PackStatus::Unhealthy);
        let failed = PackEvent::SensorFailed(ReadError::CurrentLost);
        assert_eq!(pack.bench.count_of(failed), 1);
        assert_eq!(pack.bench.count_of(PackEvent::CurrentLost), 0);
        let state = pack.run(6.0, 2.0, false);
        assert_eq!(state.failsafe, FailsafeLevel::Unhealthy);
        let state = pack.run(6.0, 2.0, true);
        assert_eq!(state.status, PackStatus::Healthy);
        assert!(pack.bench.events.contains(&PackEvent::SensorRecovered));
    }
}

#[test]
fn what_never_was_or_is_of_another_source_is_not_lost() {
    let mut pack = Driven::new();
    pack.bench.settings.failsafe.low.remaining_mah = Some(100.0);
    pack.bench.monitor.follow_current(1);
    let state = pack.run(60.0, 2.0, false);
    assert_eq!((state.status, pack.bench.events.len()), (PackStatus::Healthy, 0));
    pack.run(60.0, 2.0, true);
    // Its pin was changed.
    pack.bench.monitor.follow_current(2);
    let state = pack.run(60.0, 2.0, false);
    assert_eq!((state.status, pack.bench.events.len()), (PackStatus::Healthy, 0));
}

#[test]
fn a_current_is_not_missed_while_something_else_counts() {
    let reading = |current_a, counted_mah| Measurement {
        current_a,
        counted: Some(Counted::TotalCharge(counted_mah)),
        ..volts(11.5)
    };
    let by_percentage = |current_a| Measurement {
        current_a,
        state_of_charge: Some(0.5),
        ..volts(11.5)
    };
    let mut counted = MonitorBench::new();
    counted.settings.failsafe.low.remaining_mah = Some(100.0);
    let mut reported = MonitorBench::new();
    reported.settings.failsafe = counted.settings.failsafe;
    for tick in 0..1200 {
        let is_known = tick < 600;
        let current_a = is_known.then_some(1.0);
        counted.tick(Ok(reading(current_a, tick as f32 * 0.03)));
        reported.tick(Ok(by_percentage(current_a)));
    }
    for bench in [counted, reported] {
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
