//! Whatever plausible sensors, settings and flash deliver, the estimates stay within their ranges.

use battery_gauge::{
    BatteryMonitor, BatteryState, Chemistry, Instant, LEARNT_WORDS, LearntPack, LoadState, Measurement,
    PackSettings, Tick,
};
use proptest::prelude::*;

/// A reading, this many seconds after the one before.
#[derive(Clone, Debug)]
struct Step {
    dt_s: f64,
    voltage_v: Option<f32>,
    current_a: Option<f32>,
    load_state: LoadState,
    /// Once more, as often.
    repeated: usize,
    reset_pct: Option<f32>,
}

prop_compose! {
    fn step()(
        dt_s in prop_oneof![Just(0.0), Just(0.1), Just(1.0), 0.0..20.0, 0.0..1e5],
        voltage_v in prop::option::weighted(0.9, prop_oneof![0.0f32..20.0, 3.0f32..4.3, -1000.0f32..=1000.0]),
        current_a in prop::option::weighted(
            0.8, prop_oneof![Just(0.0f32), -0.1f32..0.1, -5.0f32..50.0, -10_000.0f32..=10_000.0]),
        is_armed: bool,
        repeated in prop_oneof![Just(1usize), 1usize..100],
        reset_pct in prop::option::weighted(0.05, -10.0f32..110.0),
    ) -> Step {
        let load_state = if is_armed { LoadState::On } else { LoadState::Off };
        Step { dt_s, voltage_v, current_a, load_state, repeated, reset_pct }
    }
}

/// A finite value that is not negative, of any magnitude, or any bits at all.
fn word() -> impl Strategy<Value = u32> {
    prop_oneof![
        any::<u32>(),
        (0.0f32..1.0).prop_map(f32::to_bits),
        (-7.0f32..7.5).prop_map(|exponent| 10f32.powf(exponent).to_bits()),
    ]
}

prop_compose! {
    fn learnt()(words in prop::array::uniform::<_, LEARNT_WORDS>(word()), chemistry in 1u32..=4, cells in 0u32..=255) -> LearntPack {
        let mut words = words;
        words[0] = words[0] & !0xffff | cells << 8 | chemistry;
        LearntPack::from_words(&words).expect("a chemistry")
    }
}

prop_compose! {
    fn settings()(
        chemistry in 1..=4,
        cell_count in prop::option::weighted(0.8, prop_oneof![1u8..=6, 1u8..=255]),
        capacity_mah in prop::option::weighted(0.8, (0.0f32..7.0).prop_map(|exponent| 10f32.powf(exponent))),
    ) -> PackSettings {
        PackSettings {
            chemistry: Chemistry::from_number(chemistry).expect("a chemistry"),
            cell_count,
            capacity_mah,
            ..PackSettings::default()
        }
    }
}

fn check(state: &BatteryState) -> Result<(), TestCaseError> {
    let readings = &state.readings;
    let is_percent = |percent: Option<f32>| percent.is_none_or(|percent| (0.0..=100.0).contains(&percent));
    prop_assert!(is_percent(readings.remaining_pct), "{readings:?}");
    prop_assert!(is_percent(readings.usable_pct), "{readings:?}");
    let is_sigma = |sigma: f32| sigma > 0.0 && sigma <= 50.0;
    prop_assert!(readings.remaining_sigma_pct.is_none_or(is_sigma), "{readings:?}");
    let is_time = |time_s: f32| time_s >= 0.0 && time_s.is_finite();
    prop_assert!(readings.time_remaining_s.is_none_or(is_time), "{readings:?}");
    prop_assert!(
        state.learnt_capacity_mah.is_none_or(|mah| mah >= 1.0),
        "{:?}",
        state.learnt_capacity_mah
    );
    Ok(())
}

proptest! {
    #[test]
    fn estimates_stay_within_their_ranges(
        settings in settings(),
        learnt in learnt(),
        steps in prop::collection::vec(step(), 1..20),
    ) {
        let (mut monitor, mut battery) = (BatteryMonitor::new(), BatteryState::default());
        monitor.restore_learnt(learnt);
        let mut t_s = 0.0;
        for step in &steps {
            if let Some(percent) = step.reset_pct {
                monitor.reset(&mut battery, step.load_state, percent, &settings);
            }
            for _ in 0..step.repeated {
                t_s += step.dt_s;
                let tick = Tick { now: Instant::from_micros((t_s * 1e6) as u64), load_state: step.load_state };
                let reading = Measurement {
                    voltage_v: step.voltage_v,
                    current_a: step.current_a,
                    ..Measurement::default()
                };
                let _ = monitor.update(&mut battery, tick, Ok(reading), &settings);
                check(&battery)?;
                let learnt = *monitor.learnt().expect("restored");
                prop_assert_eq!(LearntPack::from_words(&learnt.to_words()), Some(learnt));
            }
        }
    }
}
