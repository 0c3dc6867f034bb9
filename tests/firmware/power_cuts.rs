//! Power is cut in flash operations while parameters are being set: in one of six here, in each of them in `tests/endurance`.

use emulator::FlashCut;
use workbench::runs::power_cuts;

const STEP: usize = 6;

#[test]
// Requirement: FR-16
fn a_cut_that_leaves_a_prefix_of_an_operation_loses_nothing() {
    power_cuts::run(FlashCut::Prefix, (2..).step_by(STEP));
}
