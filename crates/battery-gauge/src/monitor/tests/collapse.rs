//! A pack that collapses under load earlier than expected, and the drives after it.

use std::collections::VecDeque;

use proptest::prelude::*;

use super::rover::{Pack, Rover, Sensors};
use super::*;

/// The end of a Li-ion cell under load, in volts.
const END_V: f32 = 3.0;

/// Figures of a drive to the end.
#[derive(Debug)]
struct ToTheEnd {
    /// Charge left at the end, in percent.
    left_pct: f32,
    /// Time before the end at which 15 % were usable, in seconds.
    warned_s: f32,
    /// Usable charge with half of the pack left, in percent.
    halfway_pct: f32,
}

fn weak(weak_below: f32, resistance: f32) -> Pack {
    Pack {
        weak_below,
        resistance,
        ..Pack::rested(Chemistry::LiIon, 1.0)
    }
}

/// Drives until the mean of ten seconds is below the end, or this charge is left; then the pack is parked, charged elsewhere and
/// the board switched on again.
fn drive_to_the_end(rover: &mut Rover, lowest_soc: f32) -> ToTheEnd {
    rover.run(40.0, 0.1);
    rover.bench.load_state = LoadState::On;
    let (mut driven_s, mut warned_at_s, mut halfway_pct) = (0.0, None, 0.0);
    loop {
        let mut sum_v = 0.0;
        for current_a in [4.4, 1.1] {
            rover.run(5.0, current_a);
            sum_v += rover.pack.voltage_v(current_a);
        }
        driven_s += 10.0;
        let usable_pct = rover.bench.state.readings.usable_pct.expect("known");
        if usable_pct < 15.0 && warned_at_s.is_none() {
            warned_at_s = Some(driven_s);
        }
        if rover.pack.soc > 0.5 {
            halfway_pct = usable_pct;
        }
        if sum_v / 6.0 < END_V || rover.pack.soc <= lowest_soc {
            break;
        }
    }
    let drive = ToTheEnd {
        left_pct: rover.pack.soc * 100.0,
        warned_s: warned_at_s.map_or(0.0, |warned_at_s| driven_s - warned_at_s),
        halfway_pct,
    };
    rover.bench.load_state = LoadState::Off;
    rover.run(1800.0, 0.1);
    rover.power_cycle();
    rover.pack = rover.pack.recharged();
    drive
}

#[test]
// Requirement: PX-6
fn after_an_early_collapse_the_next_drive_warns_in_time() {
    let mut rover = Rover::with(weak(0.35, 0.7));
    let first = drive_to_the_end(&mut rover, 0.0);
    let next = drive_to_the_end(&mut rover, 0.0);
    assert!(first.left_pct > 10.0, "{first:?} is no early collapse");
    assert!(next.warned_s > first.warned_s + 60.0, "{first:?}, then {next:?}");
}

#[test]
// Requirement: PX-6
fn a_collapse_stays_when_its_load_ends() {
    for later_s in 0..10 {
        let mut rover = Rover::with(weak(0.35, 1.5));
        rover.run(40.0, 0.1);
        rover.bench.load_state = LoadState::On;
        let mut end_s = 0.0;
        while end_s < 10.0 {
            rover.run(1.0, 4.4);
            let is_below = rover.pack.voltage_v(4.4) < 3.0 * END_V;
            end_s = if is_below { end_s + 1.0 } else { 0.0 };
        }
        rover.run(later_s as f32, 4.4);
        rover.bench.load_state = LoadState::Off;
        for _ in 0..10 {
            rover.run(60.0, 0.1);
            let usable_pct = rover.bench.state.readings.usable_pct.expect("known");
            assert!(usable_pct < 3.0, "{later_s} s: {usable_pct} %");
        }
        let learnt = rover.bench.monitor.learnt().and_then(|learnt| learnt.collapse);
        assert!(learnt.is_some(), "{later_s} s later");
    }
}

#[test]
// Requirement: PX-6
fn a_collapse_is_forgotten_once_a_drive_has_passed_its_charge() {
    // It has learnt from as many drives.
    let mut sound = Rover::with(weak(0.0, 0.7));
    for lowest_soc in [0.35, 0.05] {
        drive_to_the_end(&mut sound, lowest_soc);
    }
    let never = drive_to_the_end(&mut sound, 0.45);
    let first_halfway_pct = drive_to_the_end(&mut Rover::with(weak(0.0, 0.7)), 0.45).halfway_pct;
    let mut rover = Rover::with(weak(0.35, 0.7));
    drive_to_the_end(&mut rover, 0.0);
    rover.pack.weak_below = 0.0;
    let passing = drive_to_the_end(&mut rover, 0.05);
    let after = drive_to_the_end(&mut rover, 0.45);
    assert!(passing.halfway_pct < first_halfway_pct - 5.0, "{passing:?}");
    assert!(
        (after.halfway_pct - never.halfway_pct).abs() < 3.0,
        "{after:?} after {passing:?}, {never:?}"
    );
}

#[test]
// Requirement: PX-6
fn a_collapse_in_the_cold_hardly_warns_on_a_warm_day() {
    let mut rover = Rover::with(weak(0.0, 0.7));
    let warm = drive_to_the_end(&mut rover, 0.3);
    rover.pack = weak(0.35, 2.1);
    let cold = drive_to_the_end(&mut rover, 0.0);
    rover.pack = weak(0.0, 0.7);
    let after = drive_to_the_end(&mut rover, 0.3);
    assert!(cold.left_pct > 15.0, "{cold:?}");
    assert!(
        after.halfway_pct > warm.halfway_pct - 12.0,
        "{after:?} after {cold:?}, {warm:?}"
    );
}

#[test]
// Requirement: PX-6
fn a_stalled_motor_is_no_collapse() {
    let mut rover = Rover::with(weak(0.0, 0.7));
    rover.run(40.0, 0.1);
    rover.bench.load_state = LoadState::On;
    rover.run(600.0, 2.2);
    rover.run(20.0, 40.0);
    assert!(rover.pack.voltage_v(40.0) < 3.0 * END_V);
    rover.bench.load_state = LoadState::Off;
    rover.run(120.0, 0.1);
    assert_eq!(
        rover.bench.monitor.learnt().and_then(|learnt| learnt.collapse),
        None
    );
}

fn usable_pct(rover: &Rover) -> f32 {
    rover.bench.state.readings.usable_pct.expect("known")
}

/// Charge that this current can still draw, relative to what it draws from a full pack, in percent.
fn true_usable_pct(pack: &Pack, current_a: f32) -> f32 {
    let draws = |mut pack: Pack| {
        let start_soc = pack.soc;
        while pack.voltage_v(current_a) > 3.0 * END_V && pack.soc > 0.0 {
            pack.draw(current_a, 1.0);
        }
        start_soc - pack.soc
    };
    100.0 * draws(pack.clone()) / draws(pack.recharged())
}

#[test]
// Requirement: PX-6
fn usable_charge_rises_slowly_after_a_load_has_fallen() {
    for resistance in [1.0, 3.0] {
        let mut rover = Rover::with(weak(0.0, resistance));
        rover.run(40.0, 0.1);
        rover.bench.load_state = LoadState::On;
        rover.run(900.0, 2.1);
        let mut reported_pct = Vec::new();
        for _ in 0..120 {
            rover.run(60.0, 0.5);
            reported_pct.push(usable_pct(&rover));
            let before_pct = reported_pct[reported_pct.len().saturating_sub(11)..]
                .iter()
                .copied()
                .fold(100.0, f32::min);
            assert!(usable_pct(&rover) <= before_pct + 3.0, "{reported_pct:?}");
        }
        let true_pct = true_usable_pct(&rover.pack, 0.5);
        assert!(
            (usable_pct(&rover) - true_pct).abs() < 5.0,
            "{true_pct}, not {}",
            usable_pct(&rover)
        );
    }
}

#[test]
// Requirement: PX-6
fn usable_charge_of_a_pack_found_under_load_rises_until_its_charge_is_found() {
    for sensors in [Sensors::VoltageAndCurrent, Sensors::Voltage] {
        let mut rover = Rover::with(Pack {
            soc: 0.7,
            slow_a: [2.2; 3],
            ..weak(0.0, 1.5)
        });
        rover.sensors = sensors;
        rover.bench.load_state = LoadState::On;
        rover.run(20.0, 4.4);
        rover.run(60.0, 0.5);
        let readings = rover.bench.state.readings;
        let (usable_pct, remaining_pct) = readings.usable_pct.zip(readings.remaining_pct).expect("known");
        assert!(
            usable_pct > remaining_pct - 10.0,
            "{sensors:?}: {usable_pct} of {remaining_pct} %"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    // Requirement: PX-6
    fn usable_charge_is_0_from_the_end_on_and_not_before(
        resistance in 0.5_f32..2.5,
        weak_below in 0.0_f32..0.4,
        bursts in prop::collection::vec((1.0_f32..20.0, 0.5_f32..4.4), 4..9),
        sensors in prop::sample::select(vec![Sensors::VoltageAndCurrent, Sensors::Voltage]),
    ) {
        let mut rover = Rover::with(weak(weak_below, resistance));
        rover.sensors = sensors;
        rover.run(40.0, 0.1);
        rover.bench.load_state = LoadState::On;
        let mut last_v = VecDeque::from([f32::INFINITY; 10]);
        let each_second = bursts
            .iter()
            .cycle()
            .flat_map(|(seconds, current_a)| std::iter::repeat_n(*current_a, *seconds as usize));
        for current_a in each_second {
            rover.run(1.0, current_a);
            last_v.pop_front();
            last_v.push_back(rover.pack.voltage_v(current_a));
            // The mean of a second is a little above its last voltage.
            match last_v.iter().sum::<f32>() / 30.0 - END_V {
                ..0.0 => break,
                0.005.. => prop_assert!(rover.pack.soc < 0.01 || usable_pct(&rover) > 0.0),
                _ => {}
            }
        }
        rover.run(10.0, 4.4);
        prop_assert_eq!(usable_pct(&rover), 0.0);
        rover.bench.load_state = LoadState::Off;
        for _ in 0..5 {
            rover.run(300.0, 0.1);
            prop_assert_eq!(usable_pct(&rover), 0.0);
        }
        // In place, by a charger that no current sensor sees, or one does.
        match sensors {
            Sensors::Voltage => rover.pack = rover.pack.recharged(),
            _ => rover.run(900.0, -2.2),
        }
        rover.run(900.0, 0.1);
        prop_assert!(usable_pct(&rover) > 0.0);
    }
}
