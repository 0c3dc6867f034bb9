//! Stacks on a BQ76952: what it measures, counts and is set up for, and what fails.

use std::rc::Rc;

use super::faults::Faulty;
use super::values::assert_measures;
use super::{BUS, DIVIDER_CODE, Second, after_a_second, shared, with_second_pack};
use emulator::Random;
use emulator::i2c_devices::{Access, Bq76952, Garbled, Ina226, Pec, Protection, Reads, SmartBattery};
use support::commands::REQUEST_MESSAGE;
use support::frames::{BATTERY_STATUS_V2, BatteryStatus, of_message, texts_of};
use support::monitor_types::SMART_BATTERY;
use support::requests::{arm, command_long_2};
use workbench::bench::{Bench, CYCLES_PER_US, MILLISECOND, SECOND};

const BQ76952: f32 = 32.0;

const ADDRESS: u8 = 0x08;

const SECOND_PACK: f32 = 1.0;

const DEEP_DISCHARGE: u32 = 1;
const CELL_FAIL: u32 = 4;

/// Units of 10 mV and 10 mA.
const CENTIVOLTS_AND_CENTIAMPERES: u8 = 0x06;

fn cells(status: &BatteryStatus<'_>, count: usize) -> Vec<u16> {
    (0..count).map(|cell| status.voltage_mv(cell)).collect()
}

#[test]
// Requirement: AP-7
fn a_stack_reports_its_cells_and_counts_charge_while_it_is_not_read() {
    let part = shared(Bq76952::new());
    part.borrow_mut().set(&[4000, 4010, 3990], 7.2, 31.0);
    let mut bench = with_second_pack(BQ76952, ADDRESS, &part, &[]);
    let before_mah = after_a_second(&mut bench, |status| {
        assert_eq!(cells(&status, 4), [4000, 4010, 3990, 65535]);
        assert_measures(&status, 4.0, 0.5e-3, 7.2, 1e-3);
        assert!(status.temperature_cdegc().abs_diff(3100) <= 5);
        status.consumed_mah()
    });
    // 7.2 A are 2 mAh a second.
    bench.i2c(BUS).detach(ADDRESS);
    bench.run_for(10 * SECOND);
    bench.i2c(BUS).attach(ADDRESS, Box::new(Rc::clone(&part)));
    let after_mah = after_a_second(&mut bench, |status| status.consumed_mah());
    assert!(
        (after_mah - before_mah).abs_diff(22) <= 1,
        "{} mAh",
        after_mah - before_mah
    );
    // It charges.
    part.borrow_mut().set(&[4000; 3], -7.2, 31.0);
    bench.run_for(9 * SECOND);
    after_a_second(&mut bench, |status| {
        assert_eq!(status.current_ca(), -720);
        assert!((after_mah - status.consumed_mah()).abs_diff(20) <= 1);
    });
}

#[test]
fn sixteen_cells_add_up_and_a_cell_that_fails_is_still_one() {
    let part = shared(Bq76952::new());
    part.borrow_mut().set(&[3650; 16], 2.0, 25.0);
    let mut bench = with_second_pack(BQ76952, ADDRESS, &part, &[]);
    let unused = vec![u16::MAX; 9];
    after_a_second(&mut bench, |status| {
        assert_eq!(cells(&status, 10), [vec![58_400], unused.clone()].concat());
        assert_eq!(status.fault_bitmask(), 0);
    });
    let mut failed = [3650; 16];
    failed[15] = 100;
    part.borrow_mut().set(&failed, 2.0, 25.0);
    bench.run_for(SECOND);
    after_a_second(&mut bench, |status| {
        assert_eq!(cells(&status, 10), [vec![54_850], unused].concat());
        assert_eq!(status.fault_bitmask(), DEEP_DISCHARGE | CELL_FAIL);
    });
}

#[test]
fn a_pack_of_large_currents_is_read_in_the_units_and_at_the_inputs_it_is_set_up_for() {
    let part = shared(Bq76952::new());
    let mut inputs = [0; 16];
    (inputs[0], inputs[1], inputs[2], inputs[15]) = (3900, 3800, 3700, 3600);
    part.borrow_mut().set(&inputs, 120.0, 25.0);
    part.borrow_mut().configure(CENTIVOLTS_AND_CENTIAMPERES, 0x8007);
    let mut bench = with_second_pack(BQ76952, ADDRESS, &part, &[]);
    let before_mah = after_a_second(&mut bench, |status| {
        assert_eq!(cells(&status, 5), [3900, 3800, 3700, 3600, 65535]);
        assert_eq!(status.current_ca(), 12_000);
        status.consumed_mah()
    });
    bench.run_for(8 * SECOND);
    let after_mah = after_a_second(&mut bench, |status| status.consumed_mah());
    assert!(
        (after_mah - before_mah).abs_diff(300) <= 4,
        "{} mAh",
        after_mah - before_mah
    );
    // It forgets how it was set up, and goes on in other units.
    part.borrow_mut().power_cycle();
    part.borrow_mut().set(&inputs, 20.0, 25.0);
    after_a_second(&mut bench, |status| {
        assert_eq!(status.current_ca(), 2000);
        assert!((status.consumed_mah() - after_mah).abs_diff(6) <= 12);
    });
}

#[test]
fn a_sealed_part_is_read_in_the_units_it_has_by_default() {
    let part = shared(Bq76952::new());
    part.borrow_mut().set(&[4000; 3], 5.0, 25.0);
    part.borrow_mut().set_access(Access::Sealed);
    let mut bench = with_second_pack(BQ76952, ADDRESS, &part, &[]);
    after_a_second(&mut bench, |status| {
        assert_eq!(cells(&status, 4), [4000, 4000, 4000, 65535]);
        assert_eq!(status.current_ca(), 500);
    });
}

/// `status_flags` of BATTERY_STATUS_V2 of the second pack.
fn status_flags(bench: &mut Bench) -> u32 {
    let answers = bench.ask(&command_long_2(
        REQUEST_MESSAGE,
        BATTERY_STATUS_V2 as f32,
        SECOND_PACK,
    ));
    of_message(&answers, BATTERY_STATUS_V2)[0].u32(20)
}

#[test]
// Requirement: V2-2
fn what_its_protection_does_is_reported_and_does_not_refuse_arming() {
    let part = shared(Bq76952::new());
    part.borrow_mut().set(&[4000; 3], 1.0, 25.0);
    let mut bench = with_second_pack(BQ76952, ADDRESS, &part, &[]);
    bench.run_for(SECOND);
    assert_eq!(status_flags(&mut bench), 0);
    // It balances; protections are enabled (FET_EN).
    let enabled = Protection {
        manufacturing: 1 << 4,
        ..Protection::default()
    };
    part.borrow_mut().set_protection(Protection {
        alarms: 1 << 2,
        ..enabled
    });
    bench.run_for(5 * SECOND);
    assert_eq!(status_flags(&mut bench), 128 | 4);
    // A short circuit; it has switched the discharge off.
    part.borrow_mut().set_protection(Protection {
        safety: [1 << 7, 0, 0],
        alarms: 1 << 14 | 1 << 5,
        ..enabled
    });
    bench.run_for(5 * SECOND);
    assert_eq!(status_flags(&mut bench), 128 | 256 | 16_384);
    // The first of two STATUSTEXT.
    let text = "Battery 2 reports: switched off by its protection,".to_owned();
    assert!(texts_of(&bench.frames()).contains(&text));
    // A discharge switched off by a command is not a fault.
    part.borrow_mut().set_protection(Protection {
        alarms: 1 << 5,
        ..enabled
    });
    bench.run_for(5 * SECOND);
    assert_eq!(status_flags(&mut bench), 128);
    assert_eq!(bench.result_of(&arm()), 0, "accepted");
}

type Stack = Garbled<Bq76952>;

/// The second pack is a stack of 12 V that can go mad, the third a smart battery, which is fine.
fn with_stack() -> Faulty<Stack> {
    let part = shared(Garbled::new(Bq76952::new(), Reads::Own));
    part.borrow_mut().set(&[4000; 3], 1.0, 25.0);
    let mut bench = Bench::running(DIVIDER_CODE);
    bench
        .i2c(BUS)
        .attach(0x0b, Box::new(SmartBattery::new(Pec::Right)));
    let second = Second {
        kind: BQ76952,
        address: ADDRESS,
    };
    second.configure(&mut bench, &part, &[("BATT3_MONITOR", SMART_BATTERY)]);
    bench.run_for(2 * SECOND);
    let faulty = Faulty { bench, part };
    faulty.assert_all_fine();
    faulty
}

fn plug_in(faulty: &mut Faulty<Stack>) {
    let part = Rc::clone(&faulty.part);
    faulty.bench.i2c(BUS).attach(ADDRESS, Box::new(part));
}

#[test]
fn a_stack_that_is_unplugged_and_plugged_in_again() {
    let mut faulty = with_stack();
    faulty.assert_survives(
        "no answer",
        |faulty| faulty.bench.i2c(BUS).detach(ADDRESS),
        |faulty| {
            faulty.part.borrow_mut().power_cycle();
            plug_in(faulty);
        },
    );
    faulty.assert_neighbour_is_read();
}

#[test]
fn a_stack_that_answers_only_ones_or_zeros_or_noise() {
    for reads in [Reads::Fixed(0xff), Reads::Fixed(0), Reads::Noise(Random::new(9))] {
        let mut faulty = with_stack();
        faulty.assert_survives(
            "unknown part",
            |faulty| faulty.part.borrow_mut().set_reads(reads),
            |faulty| faulty.part.borrow_mut().set_reads(Reads::Own),
        );
        faulty.assert_neighbour_is_read();
    }
}

#[test]
fn another_part_at_the_address_of_the_stack() {
    let mut faulty = with_stack();
    faulty.assert_survives(
        "unknown part",
        |faulty| {
            faulty.bench.i2c(BUS).detach(ADDRESS);
            let other = Box::new(Ina226::new(0.0005));
            faulty.bench.i2c(BUS).attach(ADDRESS, other);
        },
        plug_in,
    );
    faulty.assert_neighbour_is_read();
}

#[test]
fn a_stack_whose_part_hangs() {
    let mut faulty = with_stack();
    faulty.assert_survives(
        "no reading in time",
        |faulty| {
            faulty
                .part
                .borrow_mut()
                .set_stretch(50 * MILLISECOND * CYCLES_PER_US)
        },
        |faulty| faulty.part.borrow_mut().set_stretch(0),
    );
}
