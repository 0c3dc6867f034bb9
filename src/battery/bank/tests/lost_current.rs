//! Currents that were measured and are lost, of packs and their sum.

use super::*;
use crate::battery::{PackEvent, PackStatus, ReadError};

fn volts(voltage_v: f32) -> Measurement {
    Measurement {
        voltage_v: Some(voltage_v),
        ..Measurement::default()
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
            load_state: LoadState::On,
        };
        for (pack, is_known) in [(Pack::First, true), (Pack::Second, second < 300)] {
            let reading = Measurement {
                current_a: is_known.then_some(3.6),
                ..volts(11.5)
            };
            let update = bank.update(pack, tick, Ok(reading), &settings);
            named.extend(update.events.iter().map(|event| (pack, *event)));
        }
        let sum = bank.sum(Pack::Third, BOTH, PackSet::ALL, SumVoltage::Mean, LoadState::On);
        let update = bank.update(Pack::Third, tick, sum, &settings);
        named.extend(update.events.iter().map(|event| (Pack::Third, *event)));
        reported.extend(bank.state(Pack::Third).consumed_mah());
    }
    assert!(reported.is_sorted(), "{reported:?}");
    assert_about(*reported.last().expect("counted"), 600.0 + 300.0, 5.0);
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
            let load_state = LoadState::On;
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
                let update = bank.update(pack, Tick { now, load_state }, reading, &settings);
                for event in &update.events {
                    if let PackEvent::Gap(gap) = event {
                        assumed_mah[index] += gap.counted_mah.unwrap_or(0.0);
                    }
                }
            }
            let sum = bank.sum(Pack::Third, BOTH, PackSet::ALL, SumVoltage::Mean, load_state);
            let _ = bank.update(Pack::Third, Tick { now, load_state }, sum, &settings);
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
