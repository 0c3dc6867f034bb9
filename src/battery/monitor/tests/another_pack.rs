//! Packs that are taken out, charged and put in again while the board stays on.

use proptest::strategy::ValueTree;

use super::rover::{IDLE_A, Pack, Rover, STEEP};
use super::*;

#[test]
// Requirement: PX-6, L-11
fn another_pack_is_estimated_by_its_own_voltage() {
    for chemistry in STEEP {
        for (before, other) in [(0.6, 0.3), (0.6, 0.9), (0.83, 0.98), (0.3, 0.8)] {
            let mut rover = Rover::parked(Pack::rested(chemistry, 1.0));
            rover.drive_to(before);
            rover.run(120.0, IDLE_A);
            rover.assert_error_below(5.0, &format!("{chemistry:?} at {before}"));
            rover.swap(Pack::rested(chemistry, other), 60.0);
            rover.run(65.0, IDLE_A);
            let what = format!(
                "{chemistry:?}: {before} before, {other}: {} %",
                rover.reported_pct()
            );
            println!("{what}");
            rover.assert_error_below(5.0, &what);
            let swaps = rover.bench.count_of(PackEvent::Swapped);
            assert_eq!(rover.restarts() + swaps, 1, "{what}");
            // Of a pack that was swapped for certain nothing is kept until it is known.
            let is_its_own = |kept: f32| (kept - other).abs() < 0.05;
            assert!(rover.kept_charge().map_or(swaps == 1, is_its_own), "{what}");
        }
    }
}

#[test]
// Requirement: L-10
fn a_pack_put_in_is_announced_as_low_only_if_it_is() {
    for by_failsafe in [false, true] {
        for (before, limit_pct) in [(0.3, 40.0), (0.6, 65.0), (0.8, 85.0)] {
            for (other, is_low) in [(1.0, false), (0.2, true)] {
                let mut rover = Rover::parked(Pack::rested(Chemistry::LiPo, 1.0));
                let settings = &mut rover.bench.settings;
                settings.charge_limits.low_pct = Some(limit_pct);
                if by_failsafe {
                    settings.failsafe.low.remaining_mah = Some(22.0 * limit_pct);
                }
                rover.drive_to(before);
                rover.run(120.0, IDLE_A);
                let is_of_charge = |event: &PackEvent| matches!(event, PackEvent::Charge { .. });
                let what = format!("{before} before, {other}, {by_failsafe}");
                let expected = if by_failsafe {
                    FailsafeLevel::Low
                } else {
                    FailsafeLevel::None
                };
                assert_eq!(rover.bench.state.failsafe, expected, "{what}");
                assert_eq!(rover.bench.state.charge_state, ChargeState::Low, "{what}");
                rover.bench.events.clear();
                rover.swap(Pack::rested(Chemistry::LiPo, other), 5.0);
                rover.run(60.0, IDLE_A);
                let announced = rover
                    .bench
                    .events
                    .iter()
                    .filter(|event| is_of_charge(event))
                    .count();
                // A level that stays latched has been announced.
                let is_latched = rover.bench.state.failsafe != FailsafeLevel::None;
                let expected = usize::from(is_low && !is_latched);
                assert_eq!(announced, expected, "{what}: {:?}", rover.bench.events);
            }
        }
    }
}

#[test]
// Requirement: PX-6, L-11
fn the_same_pack_goes_on() {
    for chemistry in [Chemistry::LiPo, Chemistry::LiIon, Chemistry::LiFe] {
        for parked_s in [1.0, 60.0, 1000.0] {
            for outages_s in [&[0.5][..], &[5.0], &[120.0], &[1.1, 1.1], &[590.0]] {
                let mut rover = Rover::rested(chemistry);
                rover.drive_to(0.6);
                rover.run(parked_s, IDLE_A);
                let before_pct = rover.reported_pct();
                for outage_s in outages_s {
                    rover.unplug(*outage_s);
                    rover.run(30.0, IDLE_A);
                }
                let what = format!(
                    "{chemistry:?} parked for {parked_s} s, out for {outages_s:?}: {before_pct}, {} %",
                    rover.reported_pct()
                );
                assert_eq!(rover.restarts(), 0, "{what}");
                assert!((rover.reported_pct() - before_pct).abs() < 1.0, "{what}");
                rover.drive_to(0.05);
                rover.run(1000.0, IDLE_A);
                // A longer gap is too uncertain to learn from, and a flat curve teaches nothing.
                let is_short = outages_s.iter().all(|outage_s| *outage_s < 100.0);
                let is_learnt = rover.bench.state.learnt_capacity_mah.is_some();
                assert!(is_learnt || !is_short || chemistry == Chemistry::LiFe, "{what}");
            }
        }
    }
}

#[test]
// Requirement: PX-6
fn a_pack_charged_elsewhere_keeps_what_was_learnt_once_its_resistance_fits() {
    for chemistry in STEEP {
        for (capacity_ah, is_the_same) in [(2.2, true), (1.2, false)] {
            let mut rover = Rover::parked(Pack::rested(chemistry, 1.0));
            rover.drive_to(0.2);
            rover.run(1000.0, IDLE_A);
            let learnt_mah = |rover: &Rover| rover.bench.state.learnt_capacity_mah;
            let kept_mah = learnt_mah(&rover).expect("learnt");
            let charged = Pack {
                capacity_ah,
                ..Pack::rested(chemistry, 1.0)
            };
            rover.swap(charged, 60.0);
            rover.run(60.0, IDLE_A);
            assert!(rover.bench.events.contains(&PackEvent::Swapped), "{chemistry:?}");
            assert_eq!(learnt_mah(&rover), None, "{chemistry:?} {capacity_ah}");
            rover.drive_to(0.9);
            let expected_mah = is_the_same.then_some(kept_mah);
            assert_eq!(learnt_mah(&rover), expected_mah, "{chemistry:?} {capacity_ah}");
        }
    }
}

#[test]
// Requirement: PX-6
fn the_charge_of_the_pack_before_is_not_kept_for_one_that_has_not_rested() {
    for chemistry in STEEP {
        let mut rover = Rover::parked(Pack::rested(chemistry, 1.0));
        rover.drive_to(0.6);
        rover.run(120.0, IDLE_A);
        let before = rover.kept_charge().expect("kept at the rest");
        rover.swap(Pack::rested(chemistry, 0.3), 20.0);
        // Under way before it has rested.
        rover.run(0.5, IDLE_A);
        rover.bench.arm_state = ArmState::Armed;
        rover.run(60.0, 2.2);
        assert_eq!(rover.retained_charge(), None, "{chemistry:?}");
        assert_eq!(rover.restarts(), 0, "nothing restarts while armed");
        rover.bench.arm_state = ArmState::Disarmed;
        rover.run(1.0, IDLE_A);
        assert_eq!(rover.retained_charge(), None, "{chemistry:?}");
        assert_eq!(rover.kept_charge(), Some(before), "{chemistry:?}");
        rover.run(100.0, IDLE_A);
        rover.assert_error_below(5.0, &format!("{chemistry:?}"));
        for kept in [rover.retained_charge(), rover.kept_charge()] {
            let kept = kept.expect("kept once it has rested");
            assert!((kept - rover.pack.soc).abs() < 0.05, "{chemistry:?}: {kept}");
        }
    }
}

#[test]
// Requirement: PX-6
fn a_battery_reset_says_whose_charge_it_is() {
    let mut rover = Rover::parked(Pack::rested(Chemistry::LiPo, 1.0));
    rover.drive_to(0.6);
    rover.run(120.0, IDLE_A);
    rover.swap(Pack::rested(Chemistry::LiPo, 0.3), 20.0);
    rover.run(0.5, IDLE_A);
    rover.bench.reset(40.0);
    rover.run(60.0, IDLE_A);
    assert_eq!(rover.restarts(), 0);
    assert_about(Some(rover.reported_pct()), 40.0, 1.0);
}

#[test]
// Requirement: PX-6
fn on_a_flat_curve_another_pack_is_the_same_or_unknown() {
    for (other, restarts) in [(0.65, 0), (0.5, 1)] {
        let mut rover = Rover::parked(Pack::rested(Chemistry::LiFe, 1.0));
        rover.drive_to(0.7);
        rover.run(600.0, IDLE_A);
        let before_pct = rover.reported_pct();
        rover.swap(Pack::rested(Chemistry::LiFe, other), 60.0);
        rover.run(65.0, IDLE_A);
        assert_eq!(rover.restarts(), restarts, "{other}");
        match rover.bench.state.readings.remaining_pct {
            Some(reported_pct) => assert!(
                restarts == 0 && (reported_pct - before_pct).abs() < 1.0,
                "{other}: {reported_pct}"
            ),
            None => assert_eq!(restarts, 1, "{other}"),
        }
    }
}

/// A step of an owner's day.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// Until this charge is left, if there is more.
    Drive(f32),
    /// For some seconds.
    Park(f32),
    /// The other pack, after some seconds.
    Swap(f32),
    PutBack(f32),
    /// Charged outside, up to this.
    Charge(f32),
}

/// Full, or charged to less than what counts as full with a curve of any make.
fn any_charged_soc() -> impl Strategy<Value = f32> {
    prop_oneof![Just(1.0), 0.4_f32..0.92]
}

fn any_step() -> impl Strategy<Value = Step> {
    prop_oneof![
        3 => (0.15_f32..0.9).prop_map(Step::Drive),
        2 => (1.0_f32..900.0).prop_map(Step::Park),
        2 => (2.0_f32..300.0).prop_map(Step::Swap),
        1 => (0.2_f32..300.0).prop_map(Step::PutBack),
        1 => any_charged_soc().prop_map(Step::Charge),
    ]
}

/// A pack whose curve and slow sag are those of any make.
fn any_pack(chemistry: Chemistry) -> impl Strategy<Value = Pack> {
    let cell = chemistry.cell();
    let sigma_v = cell.curve_sigma_v;
    let normal = || prop::array::uniform12(-0.5_f32..0.5).prop_map(|parts| parts.iter().sum::<f32>());
    (any_charged_soc(), normal(), normal(), normal()).prop_map(move |(soc, empty, full, slow)| Pack {
        offsets_v: [empty * sigma_v, full * sigma_v],
        slow_share: (cell.slow_share + slow * cell.slow_share_sigma).max(0.0),
        ..Pack::rested(chemistry, soc)
    })
}

#[test]
// Requirement: PX-6, L-11
fn two_deviations_cover_the_charge_in_any_order_of_packs() {
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    for chemistry in STEEP {
        let days = (
            any_pack(chemistry),
            any_pack(chemistry),
            prop::collection::vec(any_step(), 1..10),
        );
        let (mut known, mut covered) = (0, 0);
        for _ in 0..150 {
            let (pack, mut other, steps) = days.new_tree(&mut runner).expect("a day").current();
            let mut rover = Rover::parked(pack);
            for step in &steps {
                match *step {
                    Step::Drive(soc) => rover.drive_to(soc),
                    Step::Park(seconds) => rover.run(seconds, IDLE_A),
                    Step::Swap(seconds) => {
                        let before = rover.pack.clone();
                        rover.swap(core::mem::replace(&mut other, before), seconds);
                    }
                    Step::PutBack(seconds) => rover.unplug(seconds),
                    Step::Charge(soc) => {
                        rover.unplug(600.0);
                        rover.pack.soc = rover.pack.soc.max(soc);
                        rover.pack.slow_a = [0.0; 3];
                    }
                }
                rover.run(65.0, IDLE_A);
                if let Some(sigma_pct) = rover.bench.state.readings.remaining_sigma_pct {
                    known += 1;
                    covered += u32::from(rover.error_pct().abs() <= 2.0 * sigma_pct);
                }
            }
        }
        println!("{chemistry:?}: {covered} of {known}");
        assert!(
            f64::from(covered) >= 0.95 * f64::from(known),
            "{chemistry:?}: {covered} of {known}"
        );
    }
}
