//! How often the flash is written and erased.

use emulator::FlashOperationKind;
use support::requests::param_set;
use workbench::bench::{Bench, MILLISECOND, PARAMETER_BYTES, SECOND, SECTOR_BYTES};

const SETS: usize = 1_000;
/// Enough for an erase.
const BETWEEN_SETS_US: u64 = 100 * MILLISECOND;

/// A sector takes 680 records, and what is in force when it is full goes into the next one, which is erased in two parts.
const ERASES: usize = 4;
/// A page for each, and the ones that go into the next sector.
const PROGRAMS: usize = SETS + 100;

#[test]
// Requirement: W-1
fn a_thousand_parameter_sets_cost_four_erases_in_turn() {
    let mut bench = Bench::running(2482);
    for number in 0..SETS {
        let now_us = bench.time_us();
        bench.uart_send(0, now_us, &param_set("BATT_SERIAL_NUM", number as f32));
        bench.run_for(BETWEEN_SETS_US);
    }
    let operations = bench.flash_operations();
    let is_program = |kind| kind == FlashOperationKind::PageProgram;
    let programs = operations
        .iter()
        .filter(|operation| is_program(operation.kind))
        .count();
    let erases = operations.len() - programs;
    let most = bench.flash_erase_counts().values().max();
    println!("{SETS} sets: {programs} pages written, {erases} erases, {most:?} of one sector");
    assert!(programs >= SETS, "each is written");
    assert!(programs <= PROGRAMS && (1..=ERASES).contains(&erases));
    let sectors = PARAMETER_BYTES / SECTOR_BYTES;
    assert!(
        most.is_some_and(|most| *most as usize <= erases.div_ceil(sectors)),
        "in turn"
    );
}

#[test]
// Requirement: W-1
fn starts_and_requests_write_nothing() {
    let mut bench = Bench::running(2482);
    bench.set("SR0_EXTRA1", 4.0);
    bench.run_for(SECOND);
    bench.take_flash_operations();
    for _ in 0..50 {
        bench.power_cycle();
        bench.run_for(SECOND / 2);
        bench.set("SR0_EXTRA1", 4.0);
    }
    let operations = bench.flash_operations();
    assert!(operations.is_empty(), "{operations:?}");
}
