//! Power is cut in flash operations while parameters are being set: in one of six here, in each of them in `tests/endurance`.

use emulator::FlashCut;
use workbench::runs::power_cuts;

const STEP: usize = 6;

#[test]
fn a_cut_before_an_operation_loses_nothing() {
    power_cuts::run(FlashCut::Before, (1..).step_by(STEP));
}

#[test]
// Requirement: FR-16
fn a_cut_that_leaves_a_prefix_of_an_operation_loses_nothing() {
    power_cuts::run(FlashCut::Prefix, (2..).step_by(STEP));
}

#[test]
fn a_cut_that_leaves_scattered_bits_of_an_operation_loses_nothing() {
    power_cuts::run(FlashCut::ScatteredBits, (3..).step_by(STEP));
}

#[test]
fn a_cut_after_an_operation_loses_nothing() {
    power_cuts::run(FlashCut::After, (4..).step_by(STEP));
}
