//! Nine packs of all kinds at once.

use workbench::bench::SECOND;
use workbench::runs::mixed_packs::{self, MIXED, MIXED_MV};

/// A minute in `tests/endurance`.
const LENGTH_US: u64 = 10 * SECOND;

#[test]
// Requirement: AP-13
fn nine_packs_of_mixed_kinds_keep_10_hz() {
    mixed_packs::run(&MIXED, &MIXED_MV, LENGTH_US);
}
