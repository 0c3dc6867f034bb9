use super::rover::{IDLE_A, Pack, Rover, TRUE_SCALE};
use super::*;
use crate::learnt::LearntCapacity;

/// Flash holds a pack with so many cells, under this serial number.
fn of_cells(cell_count: u8, serial_number: Option<i32>) -> LearntPack {
    LearntPack {
        cell_count,
        capacity: Some(LearntCapacity {
            capacity_mah: 2000.0,
            sigma: 0.02,
            seen_mah: 0.0,
            seen_sigma: 0.0,
        }),
        ..LearntPack::of(serial_number)
    }
}

/// Cells are detected, and flash holds a pack with so many.
fn bench(kept: u8) -> MonitorBench {
    let mut bench = MonitorBench::new();
    bench.settings.cell_count = None;
    bench.monitor.restore_learnt(of_cells(kept, None));
    bench
}

/// Whether the voltage does not fit the cells, which refuses arming.
fn misfits(bench: &MonitorBench) -> bool {
    bench.state.readings.faults.contains(Faults::CELLS_CONFIGURATION)
}

#[track_caller]
fn assert_unclear(bench: &MonitorBench) {
    let state = bench.state;
    assert_eq!((state.cell_count, state.readings.remaining_pct), (None, None));
    assert_eq!(state.readings.faults, Faults::CELLS_CONFIGURATION);
    assert!(state.has_unclear_cells());
}

#[test]
// Requirement: L-11
fn fewer_cells_than_kept_are_unclear_if_as_many_empty_ones_fit() {
    for (kept, chemistry, voltage_v) in [
        (3, Chemistry::LiPo, 8.5),
        (3, Chemistry::LiPo, 6.1),
        (2, Chemistry::LiPo, 4.1),
        (4, Chemistry::LiPo, 12.6),
        (3, Chemistry::LiIon, 8.4),
    ] {
        let mut bench = bench(kept);
        bench.settings.chemistry = chemistry;
        bench.run(120.0, volts(voltage_v));
        assert_unclear(&bench);
        let expected = [
            PackEvent::CellsAmbiguous { voltage_v },
            PackEvent::Faults(Faults::CELLS_CONFIGURATION),
        ];
        assert_eq!(bench.events, expected, "{kept} cells");
        assert_eq!(bench.monitor.learnt(), Some(&of_cells(kept, None)));
        assert_eq!(bench.monitor.unsaved_learnt(), None);
    }
}

#[test]
fn what_no_empty_cells_explain_is_another_pack() {
    // Three cells are not at 3.9 V, and a fuller pack is another one.
    for (kept, voltage_v, count) in [(3, 3.9, 1), (2, 11.4, 3), (2, 8.2, 2), (0, 8.5, 2)] {
        let mut bench = bench(kept);
        let state = bench.run(5.0, volts(voltage_v));
        assert_eq!(state.cell_count, Some(count), "{kept} cells, {voltage_v} V");
        assert!(!misfits(&bench));
    }
}

#[test]
fn set_cells_another_number_or_erasing_end_the_doubt_at_once() {
    type End = fn(&mut MonitorBench);
    let ends: [(End, u8); 3] = [
        (|bench| bench.settings.cell_count = Some(3), 3),
        (|bench| bench.monitor.restore_learnt(of_cells(2, Some(7))), 2),
        (|bench| bench.monitor.erase_learnt(), 2),
    ];
    for (end, count) in ends {
        let mut bench = bench(3);
        bench.run(10.0, volts(8.5));
        assert_unclear(&bench);
        end(&mut bench);
        let state = bench.run(0.1, volts(8.5));
        assert_eq!(
            (state.cell_count, state.readings.faults),
            (Some(count), Faults::empty())
        );
        assert!(!misfits(&bench));
        let remaining_pct = bench.run(1.2, volts(8.5)).readings.remaining_pct.expect("known");
        assert!((remaining_pct > 90.0) == (count == 2), "{remaining_pct} %");
    }
}

#[test]
fn a_voltage_failsafe_acts_on_a_pack_with_unclear_cells() {
    let mut bench = bench(3);
    bench.settings.failsafe.timer_s = Some(1.0);
    bench.settings.failsafe.low.voltage_v = Some(9.0);
    bench.run(5.0, volts(8.5));
    bench.load_state = LoadState::On;
    assert_eq!(bench.run(3.0, volts(8.5)).failsafe, FailsafeLevel::Low);
}

#[test]
fn a_swapped_pack_is_compared_with_the_one_that_flash_holds() {
    let mut bench = bench(3);
    bench.run(5.0, volts(11.4));
    bench.run(2.0, volts(0.3));
    bench.run(10.0, volts(8.5));
    assert!(bench.events.contains(&PackEvent::Swapped), "{:?}", bench.events);
    assert_unclear(&bench);
    // Another one, full.
    bench.run(2.0, volts(0.3));
    assert_eq!(bench.run(10.0, volts(12.4)).cell_count, Some(3));
    assert!(!misfits(&bench));
}

#[test]
fn doubt_comes_with_what_is_read_later_and_outlasts_a_reset() {
    let mut before = MonitorBench::new();
    before.settings.cell_count = None;
    assert!(before.run(10.0, volts(8.5)).readings.remaining_pct.is_some());
    before.monitor.restore_learnt(of_cells(3, None));
    before.run(0.1, volts(8.5));
    assert_unclear(&before);
    let mut after = bench(3);
    after.monitor.restore(&before.record());
    after.run(5.0, volts(8.5));
    assert_unclear(&after);
}

/// Rests at each of these voltages in turn, under a load between.
fn rest_at(bench: &mut MonitorBench, voltages_v: &[f32]) -> Option<u8> {
    for voltage_v in voltages_v {
        bench.run(1.0, loaded(*voltage_v, 3.0));
        bench.run(5.0, loaded(*voltage_v, 0.1));
    }
    bench.state.cell_count
}

#[test]
// Requirement: L-11
fn a_later_rest_that_fits_one_number_alone_ends_the_doubt() {
    let cases: [(u8, &[f32], Option<u8>); 11] = [
        // Charged in place, or below as many empty cells.
        (3, &[8.5, 12.5], Some(3)),
        (3, &[8.5, 9.05], Some(3)),
        (3, &[8.5, 5.9], Some(2)),
        (3, &[8.5, 6.1], None),
        (3, &[8.5, 8.85], None),
        // Neither kept nor clear.
        (0, &[8.85, 9.1], Some(3)),
        (0, &[8.85, 12.5], Some(3)),
        (0, &[8.85, 8.6], None),
        (0, &[8.85, 8.6, 9.2], Some(3)),
        (0, &[4.7, 4.2], None),
        (0, &[14.8, 12.0], None),
    ];
    for (kept, voltages_v, count) in cases {
        let mut bench = bench(kept);
        assert_eq!(
            rest_at(&mut bench, voltages_v),
            count,
            "{kept} cells, {voltages_v:?} V"
        );
        assert_eq!(!misfits(&bench), count.is_some() || kept == 0);
        let announced = bench
            .events
            .iter()
            .filter(|event| matches!(event, PackEvent::CellsAmbiguous { .. }));
        assert_eq!(announced.count(), 1, "{voltages_v:?} V");
        // A number that is certain is not judged again.
        if let Some(count) = count {
            assert_eq!(rest_at(&mut bench, &[8.85, 8.5]), Some(count));
        }
    }
}

#[test]
// Requirement: L-11
fn what_a_pack_has_rested_at_excludes_fewer_cells_after_a_reset_but_not_after_a_swap() {
    let mut before = bench(0);
    assert_eq!(rest_at(&mut before, &[8.85]), None);
    let mut after = before.after_processor_reset();
    assert_eq!(rest_at(&mut after, &[8.6]), None);
    assert_eq!(rest_at(&mut after, &[9.2]), Some(3));
    before.run(2.0, volts(0.3));
    assert_eq!(rest_at(&mut before, &[8.0]), Some(2), "another pack");
}

#[test]
// Requirement: L-11, S-7
fn a_calibration_judges_unclear_cells_once_more() {
    let mut rover = Rover::with(Pack::rested(Chemistry::LiPo, 0.9));
    rover.bench.settings.cell_count = None;
    let true_v = rover.pack.voltage_v(IDLE_A);
    rover.measuring.scale.volt_multiplier *= 14.8 / true_v;
    rover.run(10.0, IDLE_A);
    assert_eq!(rover.bench.state.cell_count, None);
    rover.measuring.scale = TRUE_SCALE;
    rover.run(10.0, IDLE_A);
    assert_eq!(rover.bench.state.cell_count, Some(3));
}

#[test]
fn a_battery_reset_does_not_say_how_full_unclear_cells_are() {
    let mut bench = bench(3);
    bench.run(5.0, loaded(8.5, 0.1));
    bench.reset(100.0);
    bench.run(5.0, loaded(8.5, 0.1));
    assert_unclear(&bench);
}
