//! A current that is measured counts, whatever the voltage does.

use super::rover::{IDLE_A, Pack, Rover};
use super::*;

/// A drive's, in amperes.
const LOAD_A: f32 = 4.4;

/// Reading of a current sensor for both directions without its supply, in amperes.
const UNPOWERED_A: f32 = -3.0;

/// A wire is loose: the pack supplies the load as before.
fn voltage_missing(current_a: f32) -> Measurement {
    loaded(0.2, current_a)
}

/// A pack of 2200 mAh that is full by a battery reset, driven for a minute.
fn driving() -> MonitorBench {
    let mut bench = MonitorBench::new();
    bench.run(30.0, loaded(12.4, 0.1));
    bench.reset(100.0);
    bench.load_state = LoadState::On;
    bench.run(60.0, loaded(11.9, LOAD_A));
    bench.events.clear();
    bench
}

fn gaps(bench: &MonitorBench) -> usize {
    let is_gap = |event: &&PackEvent| matches!(event, PackEvent::Gap(_));
    bench.events.iter().filter(is_gap).count()
}

fn drawn_mah(seconds: f32) -> f32 {
    LOAD_A * seconds / 3.6
}

#[test]
// Requirement: L-11
fn a_loose_wire_at_the_voltage_hides_no_charge() {
    let mut bench = driving();
    let before = bench.state;
    let state = bench.run(300.0, voltage_missing(LOAD_A));
    assert_eq!(
        (state.status, state.readings.voltage_v),
        (PackStatus::NotConnected, None)
    );
    assert_eq!(state.readings.current_a, Some(LOAD_A));
    let drawn_mah = drawn_mah(300.0);
    assert_about(
        state.consumed_mah(),
        before.consumed_mah().expect("counted") + drawn_mah,
        1.0,
    );
    let expected_pct = before.readings.remaining_pct.expect("known") - drawn_mah / 22.0;
    assert_about(state.readings.remaining_pct, expected_pct, 1.0);
    bench.run(5.0, loaded(11.6, LOAD_A));
    assert_about(bench.state.readings.remaining_pct, expected_pct, 3.0);
    let lost = |event: &PackEvent| {
        matches!(
            event,
            PackEvent::ContactLost
                | PackEvent::Failsafe {
                    level: FailsafeLevel::Unhealthy,
                    ..
                }
        )
    };
    assert!(bench.events.iter().all(lost), "{:?}", bench.events);
}

#[test]
// Requirement: AP-18
fn a_threshold_in_mah_acts_while_the_voltage_is_missing() {
    let mut bench = driving();
    bench.settings.failsafe.low.remaining_mah = Some(2000.0);
    let mut seconds = 0.0;
    while !bench.events.iter().any(|event| {
        matches!(
            event,
            PackEvent::Failsafe {
                level: FailsafeLevel::Low,
                ..
            }
        )
    }) {
        bench.run(1.0, voltage_missing(LOAD_A));
        seconds += 1.0;
        assert!(seconds < 300.0, "{:?}", bench.state);
    }
    // 2200 mAh less those of the first minute and of these seconds.
    assert_about(Some(drawn_mah(60.0 + seconds)), 200.0, 10.0);
}

#[test]
// Requirement: L-7
fn without_an_estimate_no_threshold_in_mah_acts_while_the_voltage_is_missing() {
    let mut bench = MonitorBench::new();
    bench.settings.failsafe.low.remaining_mah = Some(2100.0);
    bench.load_state = LoadState::On;
    bench.run(400.0, voltage_missing(LOAD_A));
    assert_eq!(bench.state.readings.remaining_pct, None);
    assert!(
        bench.state.failsafe <= FailsafeLevel::Unhealthy,
        "{:?}",
        bench.state
    );
}

#[test]
// Requirement: L-11
fn dropouts_are_counted_and_their_gaps_announced_once_in_30_seconds() {
    let mut bench = driving();
    let before_mah = bench.state.consumed_mah().expect("counted");
    let mut seconds = 0.0;
    for dropout in 0..40u8 {
        let without_s = 0.2 + 0.07 * f32::from(dropout);
        bench.run(without_s, voltage_missing(LOAD_A));
        // Of every other one the current is missing, too.
        let unread_s = if dropout % 2 == 0 { 2.5 } else { 0.0 };
        bench.run(unread_s, voltage_missing(UNPOWERED_A));
        bench.run(3.0, loaded(11.7, LOAD_A));
        seconds += [without_s, unread_s, 3.0]
            .map(|duration_s| (duration_s * 10.0).floor() / 10.0)
            .iter()
            .sum::<f32>();
    }
    assert_about(
        bench.state.consumed_mah(),
        before_mah + drawn_mah(seconds),
        0.03 * drawn_mah(seconds),
    );
    let gaps = gaps(&bench);
    let at_most = (seconds / 30.0) as usize + 1;
    assert!((2..=at_most).contains(&gaps), "{gaps} in {seconds} s");
}

#[test]
// Requirement: L-11
fn an_unpowered_sensor_draws_nothing() {
    // The first tick after a plug is pulled is a mean of the time before and after.
    for (first_a, offset_a, gap_a) in [
        (UNPOWERED_A, UNPOWERED_A, LOAD_A),
        (0.0, 0.0, LOAD_A),
        (0.5, 0.5, LOAD_A),
        (0.15 * LOAD_A, 0.0, 0.575 * LOAD_A),
    ] {
        let mut bench = driving();
        let before_mah = bench.state.consumed_mah().expect("counted");
        let at_first = bench.run(0.1, voltage_missing(first_a)).consumed;
        let state = bench.run(30.0, voltage_missing(offset_a));
        let readings = state.readings;
        assert_eq!((readings.current_a, readings.remaining_pct), (None, None));
        assert_eq!(state.consumed, at_first);
        // A gap is the mean of the currents around it.
        bench.run(1.0, loaded(11.7, LOAD_A));
        let expected_mah = before_mah + (gap_a * 30.0 + LOAD_A) / 3.6;
        assert_about(bench.state.consumed_mah(), expected_mah, 1.0);
        assert!(gaps(&bench) > 0, "{:?}", bench.events);
    }
}

#[test]
// Requirement: L-11
fn a_rover_that_stands_with_a_loose_wire_draws_what_its_sensor_shows() {
    for standing_a in [0.1, 0.5, -0.5] {
        let mut bench = driving();
        let before_mah = bench.state.consumed_mah().expect("counted");
        for _ in 0..5 {
            bench.run(20.0, voltage_missing(LOAD_A));
            let state = bench.run(30.0, voltage_missing(standing_a));
            assert_eq!(state.readings.current_a, Some(standing_a));
        }
        bench.run(0.1, loaded(12.0, standing_a));
        let expected_mah = before_mah + drawn_mah(100.0) + standing_a * 150.0 / 3.6;
        assert_about(bench.state.consumed_mah(), expected_mah, 1.0);
        assert_eq!(gaps(&bench), 0, "{standing_a} A");
    }
}

#[test]
// Requirement: L-11
fn a_sensor_that_loses_its_power_draws_nothing_until_it_shows_a_load_again() {
    let mut bench = driving();
    bench.run(20.0, voltage_missing(LOAD_A));
    let before_mah = bench.state.consumed_mah().expect("counted");
    bench.run(5.0, voltage_missing(-0.51));
    // It may be powered again: a load shows it, as at first.
    assert_eq!(bench.run(5.0, voltage_missing(0.4)).readings.current_a, None);
    bench.run(20.0, voltage_missing(LOAD_A));
    assert_about(bench.state.consumed_mah(), before_mah + drawn_mah(30.0), 1.0);
    let standing = bench.run(5.0, voltage_missing(0.4));
    assert_eq!(standing.readings.current_a, Some(0.4));
    // In another loss the sensor has to show it again, and a disarmed rover may have lost its pack.
    bench.run(0.5, loaded(11.9, LOAD_A));
    assert_eq!(bench.run(1.0, voltage_missing(0.4)).readings.current_a, None);
    bench.run(1.0, voltage_missing(LOAD_A));
    bench.load_state = LoadState::Off;
    bench.run(1.0, voltage_missing(0.4));
    bench.load_state = LoadState::On;
    assert_eq!(bench.run(1.0, voltage_missing(0.4)).readings.current_a, None);
}

#[test]
// Requirement: L-11
fn a_voltage_missing_from_the_start_counts_a_load_and_then_what_the_sensor_shows() {
    let mut bench = MonitorBench::new();
    bench.load_state = LoadState::On;
    assert_eq!(bench.run(5.0, voltage_missing(0.4)).consumed, None);
    bench.run(10.0, voltage_missing(LOAD_A));
    bench.run(10.0, voltage_missing(0.4));
    let expected_mah = drawn_mah(10.0) + 4.0 / 3.6;
    assert_about(bench.state.consumed_mah(), expected_mah, 1.0);
}

/// A rover on a full pack whose wire is loose, and holds again, while it stands for 30 s, in each of some stops.
fn loose_at_stops(stops: u32, missing: Result<Measurement, ReadError>) -> Option<LessonObstacle> {
    let mut rover = Rover::parked(Pack::rested(Chemistry::LiPo, 1.0));
    rover.drive_to(0.75);
    rover.bench.load_state = LoadState::On;
    for _ in 0..stops {
        for _ in 0..300 {
            rover.pack.draw(IDLE_A, 0.1);
            rover.bench.tick(missing);
        }
        rover.run(10.0, LOAD_A);
    }
    rover.drive_to(0.2);
    let MonitorBench {
        monitor,
        state,
        settings,
        ..
    } = &rover.bench;
    monitor.lesson_obstacle(state, settings)
}

#[test]
// Requirement: L-11
fn a_lesson_ends_when_much_of_its_charge_was_assumed() {
    let loose = Ok(voltage_missing(0.1));
    // Each stop is 1.7 % of the capacity.
    for (stops, obstacle) in [(2, LessonObstacle::NoRest), (6, LessonObstacle::UnknownStart)] {
        for missing in [loose, Err(ReadError::Conversion)] {
            assert_eq!(loose_at_stops(stops, missing), Some(obstacle), "{stops} stops");
        }
    }
}

#[test]
// Requirement: L-11
fn while_disarmed_a_voltage_that_is_missing_is_a_gap() {
    let mut bench = driving();
    bench.load_state = LoadState::Off;
    bench.run(10.0, loaded(12.1, 0.1));
    let before = bench.state;
    let state = bench.run(100.0, voltage_missing(LOAD_A));
    assert_eq!(
        (state.readings.current_a, state.consumed),
        (None, before.consumed)
    );
    bench.run(1.0, loaded(12.1, 0.1));
    let gap = bench.events.iter().find_map(|event| match event {
        PackEvent::Gap(gap) => Some(gap.counted_mah),
        _ => None,
    });
    assert_eq!(gap, Some(None), "too long to be known");
}

#[test]
// Requirement: L-11
fn what_a_source_counts_is_counted_without_a_voltage() {
    let counts = |voltage_v, charge_mah| Measurement {
        counted: Some(Counted::Increment(Consumed {
            charge_mah,
            energy_wh: 0.0,
        })),
        ..loaded(voltage_v, -1.0)
    };
    let mut bench = driving();
    let before_mah = bench.state.consumed_mah().expect("counted");
    bench.run(10.0, counts(0.2, 0.5));
    assert_about(bench.state.consumed_mah(), before_mah + 50.0, 0.1);
    assert_eq!(bench.state.readings.current_a, None, "its offset");
}
