//! What a board with a signing key writes to flash when nothing is set.

use super::progress::Progress;
use crate::bench::{Bench, DIVIDER_CODE, MINUTE, PARAMETER_OFFSET, SIGNING_OFFSET, is_learnt};
use crate::signing_key::protected;
use emulator::FlashOperationKind;

/// Writes the time down once a minute, in two records, and nothing else but what is learnt of the pack. Without a key there is nothing to write down.
pub fn run(length_us: u64) {
    let minutes = length_us / MINUTE;
    let mut bench = protected();
    bench.take_flash_operations();
    run_for(&mut bench, "with a signing key", minutes);
    let mut operations = bench.take_flash_operations();
    operations.retain(|operation| !is_learnt(operation));
    let marks = operations.len() as u64;
    println!("{marks} records of time in {minutes} minutes");
    assert!((1..=2 * minutes).contains(&marks), "{marks}");
    for operation in operations {
        assert_eq!(operation.kind, FlashOperationKind::PageProgram);
        let is_signing = (SIGNING_OFFSET..PARAMETER_OFFSET).contains(&operation.offset);
        assert!(is_signing, "{:#x}", operation.offset);
    }

    let mut bench = Bench::running(DIVIDER_CODE);
    bench.take_flash_operations();
    run_for(&mut bench, "without a signing key", minutes);
    assert!(bench.flash_operations().iter().all(is_learnt));
}

fn run_for(bench: &mut Bench, name: &str, minutes: u64) {
    let mut progress = Progress::new(name, bench.time_us());
    for _ in 0..minutes {
        bench.run_for(MINUTE);
        progress.at(bench.time_us());
    }
}
