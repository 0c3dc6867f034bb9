//! The estimate of a pack at rest, as it relaxes and while the board stays on.

use super::rover::{IDLE_A, Pack, Rover, STEEP, Sensors};
use super::*;

/// A pack that was taken off its charger at this charge, and reads too full by this much, in volts of a cell.
fn just_charged(chemistry: Chemistry, soc: f32, surface_v: f32) -> Pack {
    Pack {
        surface_v,
        ..Pack::rested(chemistry, soc)
    }
}

/// The charge with its standard deviation, as reported.
fn estimate_pct(rover: &Rover) -> Option<(f32, f32)> {
    let readings = rover.bench.state.readings;
    readings.remaining_pct.zip(readings.remaining_sigma_pct)
}

/// The charge is within two stated standard deviations, or unknown.
#[track_caller]
fn assert_honest(rover: &Rover, what: &str) {
    let is_within = |(remaining_pct, sigma_pct): (f32, f32)| {
        (remaining_pct - 100.0 * rover.pack.soc).abs() <= 2.0 * sigma_pct
    };
    let estimate = estimate_pct(rover);
    assert!(
        estimate.is_none_or(is_within),
        "{what}: {estimate:?} instead of {}",
        100.0 * rover.pack.soc
    );
}

#[test]
// Requirement: PX-6, L-11
fn a_pack_taken_off_its_charger_early_is_found_out_as_it_relaxes() {
    for (chemistry, soc, surface_v) in [(Chemistry::LiPo, 0.80, 0.10), (Chemistry::LiIon, 0.75, 0.13)] {
        let mut rover = Rover::with(just_charged(chemistry, soc, surface_v));
        for minute in 1..=60 {
            rover.run(60.0, 0.02);
            assert_honest(&rover, &format!("{chemistry:?} after {minute} minutes"));
        }
        rover.assert_error_below(3.0, &format!("{chemistry:?}"));
    }
}

#[test]
// Requirement: PX-6, L-11
fn a_curve_with_a_plateau_makes_no_pack_full_before_it_has_relaxed() {
    let pack = just_charged(Chemistry::LiFe, 0.70, 0.12);
    let mut rover = Rover::with(pack.clone());
    for seconds in [3.0, 60.0, 600.0, 3600.0] {
        rover.run(seconds, 0.02);
        assert_honest(&rover, &format!("{seconds} s later"));
    }
    rover.power_cycle();
    rover.run(60.0, IDLE_A);
    assert_honest(&rover, "switched on once more");
    rover.drive_to(0.1);
    assert_honest(&rover, "driven");
    let mut rover = Rover::with(pack);
    rover.drive_to(0.1);
    assert_honest(&rover, "driven at once");
}

#[test]
// Requirement: PX-6
fn a_full_pack_with_a_plateau_is_certain_once_it_has_kept_its_voltage_or_relaxed() {
    const HOURS_S: f32 = 3600.0;
    for (chemistry, soc, surface_v, times) in [
        (Chemistry::LiFe, 1.0, 0.05, [(20.0, false), (15.0, true)]),
        (
            Chemistry::LiFe,
            1.0,
            -0.12,
            [(60.0, false), (4.0 * HOURS_S, true)],
        ),
        // From its charger, and taken off early.
        (Chemistry::NiMh, 1.0, 0.07, [(20.0, false), (20.0, true)]),
        (Chemistry::NiMh, 0.7, 0.07, [(20.0, false), (20.0, false)]),
    ] {
        let mut rover = Rover::with(just_charged(chemistry, soc, surface_v));
        for (seconds, is_certain) in times {
            rover.run(seconds, 0.0);
            let estimate = estimate_pct(&rover);
            let what = format!("{chemistry:?} {soc} {surface_v}, {seconds} s later: {estimate:?}");
            assert_honest(&rover, &what);
            if is_certain {
                assert!(
                    estimate.is_some_and(|(pct, sigma_pct)| pct > 99.0 && sigma_pct < 2.0),
                    "{what}"
                );
                rover.drive_to(0.4);
                rover.assert_error_below(4.0, &what);
                assert_honest(&rover, &what);
            } else {
                assert!(estimate.is_none_or(|(_, sigma_pct)| sigma_pct > 10.0), "{what}");
            }
        }
    }
}

#[test]
// Requirement: PX-6
fn a_charger_at_its_voltage_makes_a_pack_of_any_lithium_chemistry_full() {
    for chemistry in [Chemistry::LiPo, Chemistry::LiIon, Chemistry::LiFe] {
        let mut rover = Rover::parked(Pack::rested(chemistry, 0.6));
        let charged_v = 3.0
            * chemistry
                .charged_cell_voltage_v()
                .expect("chargers end by voltage");
        while rover.pack.voltage_v(-1.1) < charged_v && rover.pack.soc < 1.0 {
            rover.run(5.0, -1.1);
        }
        assert_honest(&rover, &format!("{chemistry:?} charged"));
        rover.bench.run(60.0, loaded(charged_v, -0.15));
        rover.pack.soc = 1.0;
        rover.assert_error_below(1.0, &format!("{chemistry:?}"));
    }
}

#[test]
// Requirement: PX-6, L-11
fn a_load_that_the_sensor_does_not_see_is_found_at_rest() {
    for chemistry in STEEP {
        for start in [0.6, 1.0] {
            let mut rover = Rover::parked(Pack::rested(chemistry, start));
            rover.sensors = Sensors::VoltageAndInsensitiveCurrent;
            for hour in 1..=20 {
                rover.run(3600.0, 0.022);
                assert_honest(&rover, &format!("{chemistry:?} from {start}, after {hour} hours"));
            }
        }
    }
}

#[test]
// Requirement: PX-6
fn parking_with_a_good_sensor_costs_a_certain_count_little() {
    for chemistry in STEEP {
        // As far from the curve as makes usually are.
        let sigma_v = chemistry.cell().curve_sigma_v;
        let mut rover = Rover::parked(Pack {
            offsets_v: [sigma_v, sigma_v],
            ..Pack::rested(chemistry, 1.0)
        });
        rover.drive_to(0.5);
        let driven_pct = rover.error_pct();
        for _ in 0..5 {
            rover.run(60.0, 1.1);
            rover.run(300.0, IDLE_A);
        }
        let what = format!("{chemistry:?}: off by {driven_pct}, then {} %", rover.error_pct());
        assert!((rover.error_pct() - driven_pct).abs() <= 2.0, "{what}");
    }
}

/// Obstacles to a lesson, in the order of the reports.
fn obstacles(rover: &Rover) -> Vec<LessonObstacle> {
    let obstacle = |event: &PackEvent| match event {
        PackEvent::NotLearnt(obstacle) => Some(*obstacle),
        _ => None,
    };
    rover.bench.events.iter().filter_map(obstacle).collect()
}

#[test]
// Requirement: PX-6
fn a_drive_that_taught_nothing_says_why() {
    let full = || Rover::parked(Pack::rested(Chemistry::LiPo, 1.0));
    let mut rover = full();
    rover.run(200.0, IDLE_A);
    assert_eq!(obstacles(&rover), [], "not driven");
    rover.drive_to(0.9);
    rover.run(200.0, IDLE_A);
    assert_eq!(obstacles(&rover), [LessonObstacle::LittleDrawn]);
    rover.drive_to(0.4);
    rover.run(20.0, IDLE_A);
    assert_eq!(
        obstacles(&rover),
        [LessonObstacle::LittleDrawn, LessonObstacle::NoRest]
    );
    rover.run(200.0, IDLE_A);
    assert_eq!(obstacles(&rover).len(), 2, "learnt by this rest");
    assert!(rover.bench.state.learnt_capacity_mah.is_some());

    for (obstacle, change) in [
        (
            LessonObstacle::NoCapacity,
            (|rover| rover.bench.settings.capacity_mah = None) as fn(&mut Rover),
        ),
        (LessonObstacle::NoCurrent, |rover| {
            rover.bench.restart();
            rover.bench.monitor.restore_learnt(LearntPack::UNKNOWN);
            rover.sensors = Sensors::Voltage;
        }),
        (LessonObstacle::UnknownStart, |rover| {
            rover.bench.reset(100.0);
        }),
        (LessonObstacle::Implausible, |rover| {
            rover.bench.settings.capacity_mah = Some(1010.0)
        }),
    ] {
        let mut rover = full();
        change(&mut rover);
        rover.drive_to(0.4);
        rover.run(200.0, IDLE_A);
        assert_eq!(obstacles(&rover).last(), Some(&obstacle));
    }
}

#[test]
// Requirement: PX-6
fn a_capacity_that_no_such_pack_has_is_announced_once() {
    for (label_mah, announced) in [(2200.0, 0), (1800.0, 1)] {
        let mut rover = Rover::parked(Pack::rested(Chemistry::LiPo, 1.0));
        rover.bench.settings.capacity_mah = Some(label_mah);
        for _ in 0..3 {
            rover.pack.soc = 1.0;
            rover.pack.slow_a = [0.0; 3];
            rover.power_cycle();
            rover.run(40.0, IDLE_A);
            rover.drive_to(0.2);
            rover.run(1000.0, IDLE_A);
        }
        assert_eq!(
            rover.bench.count_of(PackEvent::CapacityAboveLabel(None)),
            announced,
            "{label_mah}: {:?}",
            rover.bench.state.learnt_capacity_mah
        );
    }
}

/// A full pack that was driven to this charge and switched off at once.
fn switched_off_at(chemistry: Chemistry, soc: f32) -> Rover {
    let mut rover = Rover::parked(Pack::rested(chemistry, 1.0));
    rover.drive_to(soc);
    rover.run(3.0, IDLE_A);
    rover
}

/// The capacity that a start finds after a night with this charge.
fn learnt_mah_next_day(rover: &mut Rover, soc: f32) -> Option<f32> {
    rover.power_cycle();
    rover.pack = Pack::rested(rover.pack.chemistry, soc);
    rover.run(60.0, IDLE_A);
    rover.bench.state.learnt_capacity_mah
}

#[test]
// Requirement: PX-6
fn the_next_start_ends_a_drive_that_did_not_rest() {
    for chemistry in STEEP {
        let mut rover = switched_off_at(chemistry, 0.35);
        assert_eq!(rover.bench.state.learnt_capacity_mah, None);
        let learnt_mah = learnt_mah_next_day(&mut rover, 0.35).expect("learnt");
        assert_about(Some(learnt_mah), 2200.0, 0.05 * 2200.0);
        assert!(
            rover.bench.monitor.learnt().is_some_and(LearntPack::has_curve),
            "{chemistry:?}"
        );
        let again_mah = learnt_mah_next_day(&mut rover, 0.35);
        assert_eq!(again_mah, Some(learnt_mah), "a drive teaches once");
    }
}

#[test]
// Requirement: PX-6
fn a_pack_that_was_charged_or_is_another_one_ends_no_drive() {
    for chemistry in STEEP {
        for soc in [1.0, 0.75, 0.2] {
            let mut rover = switched_off_at(chemistry, 0.5);
            assert_eq!(learnt_mah_next_day(&mut rover, soc), None, "{chemistry:?} {soc}");
            // Nor does it later.
            assert_eq!(learnt_mah_next_day(&mut rover, 0.5), None, "{chemistry:?} {soc}");
        }
    }
}

#[test]
// Requirement: PX-6
fn a_drive_that_goes_on_before_a_power_cut_is_not_ended_by_the_next_start() {
    for chemistry in STEEP {
        let mut rover = switched_off_at(chemistry, 0.5);
        rover.bench.load_state = LoadState::On;
        rover.run(600.0, 2.2);
        let soc = rover.pack.soc;
        assert_eq!(learnt_mah_next_day(&mut rover, soc), None, "{chemistry:?}");
    }
}

#[test]
// Requirement: PX-6
fn stops_soon_after_a_full_start_leave_the_lesson_as_it_began() {
    for chemistry in STEEP {
        let mut rover = Rover::parked(Pack::rested(chemistry, 1.0));
        rover.bench.load_state = LoadState::On;
        // Half a minute's stop for each 3 %.
        while rover.pack.soc > 0.3 {
            rover.run(54.0, 4.4);
            rover.run(35.0, IDLE_A);
        }
        rover.bench.load_state = LoadState::Off;
        rover.run(600.0, IDLE_A);
        let learnt_mah = rover.bench.state.learnt_capacity_mah;
        assert_about(learnt_mah, 2200.0, 0.04 * 2200.0);
    }
}

#[test]
// Requirement: PX-6
fn equal_drives_with_several_rests_teach_the_same_capacity() {
    // Cells that differ from what is typical: half of the slow sag, and another curve.
    for (chemistry, slow, full_v) in [(Chemistry::LiIon, 0.5, 0.0), (Chemistry::LiPo, 1.0, 0.05)] {
        let pack = Pack {
            slow_share: slow * chemistry.cell().slow_share,
            offsets_v: [0.0, full_v],
            ..Pack::rested(chemistry, 1.0)
        };
        let mut rover = Rover::parked(pack.clone());
        let mut learnt_mah = Vec::new();
        for _ in 0..8 {
            for soc in [0.6, 0.5, 0.4, 0.3, 0.2] {
                rover.drive_to(soc);
                rover.run(130.0, IDLE_A);
            }
            learnt_mah.push(rover.bench.state.learnt_capacity_mah.expect("learnt"));
            rover.power_cycle();
            rover.pack = pack.clone();
            rover.run(40.0, IDLE_A);
        }
        for mah in &learnt_mah {
            assert!((mah / 2200.0 - 1.0).abs() < 0.03, "{chemistry:?}: {learnt_mah:?}");
            assert!(
                (mah / learnt_mah[0] - 1.0).abs() < 0.01,
                "{chemistry:?}: {learnt_mah:?}"
            );
        }
    }
}

#[test]
// Requirement: PX-6
fn a_count_from_full_stays_where_a_cell_has_another_curve() {
    for chemistry in STEEP {
        for offsets_v in [[0.12, 0.0], [-0.12, 0.0], [0.2, 0.0]] {
            let mut rover = Rover::parked(Pack {
                offsets_v,
                ..Pack::rested(chemistry, 1.0)
            });
            for soc in [0.8, 0.6, 0.4, 0.2] {
                rover.drive_to(soc);
                rover.assert_error_below(4.5, &format!("{chemistry:?} {offsets_v:?} at {soc}"));
            }
        }
    }
}

#[test]
// Requirement: PX-6
fn a_capacity_by_its_label_is_known_to_eight_percent() {
    let mut rover = Rover::parked(Pack::rested(Chemistry::LiIon, 1.0));
    rover.drive_to(0.2);
    let (_, sigma_pct) = estimate_pct(&rover).expect("known");
    assert!((6.4..8.0).contains(&sigma_pct), "± {sigma_pct} %");
    rover.run(1000.0, IDLE_A);
    rover.power_cycle();
    rover.pack = rover.pack.recharged();
    rover.run(40.0, IDLE_A);
    rover.drive_to(0.2);
    let (_, learnt_sigma_pct) = estimate_pct(&rover).expect("known");
    assert!(
        learnt_sigma_pct < sigma_pct - 1.5,
        "± {learnt_sigma_pct} % after ± {sigma_pct} %"
    );
}

#[test]
// Requirement: PX-6
fn an_aged_pack_that_was_parked_with_a_third_left_is_known() {
    for chemistry in STEEP {
        let aged = Pack {
            capacity_ah: 1.76,
            ..Pack::rested(chemistry, 1.0)
        };
        let mut rover = Rover::parked(aged.clone());
        rover.drive_to(0.3);
        rover.run(600.0, IDLE_A);
        rover.power_cycle();
        rover.pack = aged;
        rover.run(40.0, IDLE_A);
        rover.drive_to(0.1);
        rover.assert_error_below(9.0, &format!("{chemistry:?}"));
    }
}

#[test]
// Requirement: PX-6
fn a_pack_with_a_board_that_draws_much_is_learnt() {
    for chemistry in STEEP {
        for idle_a in [0.3, 0.42] {
            let mut rover = Rover::with(Pack::rested(chemistry, 1.0));
            rover.run(100.0, idle_a);
            rover.drive_to(0.3);
            rover.run(1000.0, idle_a);
            let learnt_mah = rover.bench.state.learnt_capacity_mah.expect("learnt");
            assert_about(Some(learnt_mah), 2200.0, 0.05 * 2200.0);
        }
    }
}

#[test]
fn the_charge_of_cells_that_rest_off_their_chemistrys_curve_is_right_with_a_measured_one() {
    for sensors in [Sensors::Voltage, Sensors::VoltageAndCurrent] {
        let errors_pct = [false, true].map(|is_measured| {
            let mut pack = Pack::rested(Chemistry::LiIon, 0.5);
            pack.offsets_v = [0.3, 0.2];
            let mut rover = Rover::with(pack);
            rover.sensors = sensors;
            rover.bench.settings.cell_count = Some(3);
            if is_measured {
                let curve = &Chemistry::LiIon.cell().curve;
                // The other points lie between.
                rover.bench.settings.curve_v = [
                    Some((0.1, 0.29)),
                    None,
                    Some((0.5, 0.25)),
                    None,
                    Some((0.9, 0.21)),
                ]
                .map(|point| point.map(|(soc, height_v)| curve.voltage_v(soc) + height_v));
            }
            rover.run(120.0, IDLE_A);
            let at_rest = rover.error_pct();
            rover.drive_to(0.3);
            rover.run(1800.0, IDLE_A);
            [at_rest, rover.error_pct()].map(f32::abs)
        });
        let [by_chemistry, by_curve] = errors_pct;
        assert!(
            by_chemistry.iter().all(|error| *error > 10.0),
            "{sensors:?} {errors_pct:?}"
        );
        assert!(
            by_curve.iter().all(|error| *error < 4.0),
            "{sensors:?} {errors_pct:?}"
        );
    }
}

#[test]
fn a_measured_curve_waits_for_the_number_of_cells() {
    let mut pack = Pack::rested(Chemistry::LiIon, 0.5);
    pack.offsets_v = [0.25, 0.25];
    let mut rover = Rover::with(pack);
    rover.bench.settings.curve_v[2] = Some(Chemistry::LiIon.cell().curve.voltage_v(0.5) + 0.25);
    rover.bench.settings.cell_count = None;
    rover.run(1.0, IDLE_A);
    let state = rover.bench.state;
    assert_eq!((state.cell_count, state.readings.remaining_pct), (None, None));
    rover.run(60.0, IDLE_A);
    assert_eq!(rover.bench.state.cell_count, Some(3));
    assert!(rover.error_pct().abs() < 4.0, "{}", rover.error_pct());
}

#[test]
fn a_curve_that_falls_or_is_of_another_chemistry_is_not_used() {
    for (curve_v, is_possible) in [
        ([None; 5], true),
        ([Some(3.3), None, Some(3.7), None, Some(4.1)], true),
        ([None, None, Some(3.7), None, None], true),
        ([Some(3.3), None, Some(3.2), None, None], false),
        ([None, Some(3.7), Some(3.7), None, None], false),
        ([None, None, Some(4.36), None, None], false),
        ([Some(1.79), None, None, None, None], false),
    ] {
        let settings = PackSettings {
            chemistry: Chemistry::LiIon,
            curve_v,
            ..PackSettings::default()
        };
        assert_eq!(settings.is_curve_possible(), is_possible, "{curve_v:?}");
        let is_used = crate::charge::measured_offsets(&settings).is_some();
        assert_eq!(is_used, is_possible && curve_v != [None; 5], "{curve_v:?}");
    }
}
