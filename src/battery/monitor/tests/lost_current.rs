//! Currents that were measured and are lost, while the pack gives voltage.

use super::*;
use crate::battery::bank::SumVoltage;
use crate::battery::{BatteryBank, Gap};
use crate::pack::Pack;

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
        bench.arm_state = ArmState::Armed;
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
        bench.arm_state = ArmState::Armed;
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

#[test]
// Requirement: AP-10
fn a_sum_keeps_what_was_drawn_from_a_pack_that_loses_its_current() {
    let mut bank = BatteryBank::default();
    let settings = PackSettings {
        cell_count: Some(3),
        capacity_mah: Some(2200.0),
        ..PackSettings::default()
    };
    let mut now = Instant::EPOCH;
    let mut reported = Vec::new();
    let mut named = Vec::new();
    for second in 0..600 {
        now = now.after_us(1_000_000);
        let tick = Tick {
            now,
            arm_state: ArmState::Armed,
        };
        for (pack, is_known) in [(Pack::First, true), (Pack::Second, second < 300)] {
            let reading = Measurement {
                current_a: is_known.then_some(3.6),
                ..volts(11.5)
            };
            let update = bank.update(pack, tick, Ok(reading), &settings);
            named.extend(update.events.iter().map(|event| (pack, *event)));
        }
        let sum = bank.sum(Pack::Third, 0b11, 0b111, SumVoltage::Mean, ArmState::Armed);
        let update = bank.update(Pack::Third, tick, sum, &settings);
        named.extend(update.events.iter().map(|event| (Pack::Third, *event)));
        reported.extend(bank.state(Pack::Third).consumed_mah());
    }
    assert!(reported.is_sorted(), "{reported:?}");
    assert_about(reported.last().copied(), 600.0 + 300.0, 5.0);
    let lost = [
        (Pack::Second, PackEvent::CurrentLost),
        (Pack::Third, PackEvent::CurrentLost),
    ];
    assert_eq!(named, lost);
}

/// A reading that is lost for some time.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lost {
    Voltage,
    Current,
    Device,
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// However readings are lost, of a pack alone and of a sum of it and another: the consumption never falls, and exceeds
    /// what flowed by no more than what was announced as assumed; no charge is unknown for long without being unhealthy.
    #[test]
    fn lost_readings_lower_no_consumption_and_leave_no_threshold_without_effect(
        losses in prop::collection::vec(
            (0..2usize, prop_oneof![Just(Lost::Voltage), Just(Lost::Current), Just(Lost::Device)], 0..900u32, 1..60u32),
            1..12,
        ),
    ) {
        let mut bank = BatteryBank::default();
        let mut settings = PackSettings {
            cell_count: Some(3),
            capacity_mah: Some(5000.0),
            ..PackSettings::default()
        };
        settings.failsafe.low.remaining_mah = Some(500.0);
        let packs = [Pack::First, Pack::Second];
        let mut now = Instant::EPOCH;
        let mut flowed_mah = [0.0f32; 2];
        let mut assumed_mah = [0.0f32; 2];
        let mut reported_mah = [0.0f32; 3];
        let mut uncounted_s = [0.0f32; 3];
        let mut was_counted = [false; 3];
        let mut was_lost = [false; 2];
        for tick in 0..10_000u32 {
            now = now.after_us(100_000);
            let arm_state = ArmState::Armed;
            let second = tick / 10;
            let load_a = 6.0 * ((second / 7) % 3) as f32;
            for (index, pack) in packs.into_iter().enumerate() {
                flowed_mah[index] += load_a * 0.1 / 3.6;
                let lost: Vec<_> = losses
                    .iter()
                    .filter(|(of, _, from, for_s)| *of == index && (*from..from + for_s).contains(&second))
                    .map(|(_, lost, ..)| *lost)
                    .collect();
                let is_lost = !lost.is_empty();
                if was_lost[index] && !is_lost {
                    // Up to two seconds are counted by the reading behind them.
                    assumed_mah[index] += 12.0 * 2.0 / 3.6;
                }
                was_lost[index] = is_lost;
                let reading = if lost.contains(&Lost::Device) {
                    Err(ReadError::Timeout)
                } else {
                    Ok(Measurement {
                        current_a: (!lost.contains(&Lost::Current)).then_some(load_a),
                        ..volts(if lost.contains(&Lost::Voltage) { 0.3 } else { 11.6 - 0.03 * load_a })
                    })
                };
                let update = bank.update(pack, Tick { now, arm_state }, reading, &settings);
                for event in &update.events {
                    if let PackEvent::Gap(gap) = event {
                        assumed_mah[index] += gap.counted_mah.unwrap_or(0.0);
                    }
                }
            }
            let sum = bank.sum(Pack::Third, 0b11, 0b111, SumVoltage::Mean, arm_state);
            let _ = bank.update(Pack::Third, Tick { now, arm_state }, sum, &settings);
            for (index, pack) in [Pack::First, Pack::Second, Pack::Third].into_iter().enumerate() {
                let state = bank.state(pack);
                if let Some(consumed_mah) = state.consumed_mah() {
                    prop_assert!(consumed_mah >= reported_mah[index] - 0.01, "{pack:?} fell at {second} s");
                    reported_mah[index] = consumed_mah;
                }
                was_counted[index] |= state.readings.current_a.is_some();
                let is_counted = state.readings.current_a.is_some() || state.status != PackStatus::Healthy;
                uncounted_s[index] = if is_counted || !was_counted[index] { 0.0 } else { uncounted_s[index] + 0.1 };
                prop_assert!(uncounted_s[index] < TIMEOUT_S + 1.0, "{pack:?} at {second} s");
            }
        }
        // Gaps that follow one another are announced together after a while: none was lost in the last minute.
        for index in 0..2 {
            let excess_mah = reported_mah[index] - flowed_mah[index];
            prop_assert!(excess_mah <= assumed_mah[index] + 1.0, "{index}: {excess_mah} mAh too much");
        }
        let sum_mah = reported_mah[2] - flowed_mah.iter().sum::<f32>();
        prop_assert!(sum_mah <= assumed_mah.iter().sum::<f32>() + 1.0, "sum: {sum_mah} mAh too much");
    }
}
