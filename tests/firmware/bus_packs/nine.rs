//! Nine packs of all kinds at once.

use crate::bench::SECOND;
use crate::runs::mixed_packs::{self, MIXED, MIXED_MV, TWO};

const LENGTH_US: u64 = 20 * SECOND;

#[test]
fn two_packs_keep_10_hz() {
    mixed_packs::run(&TWO, &MIXED_MV[..2], LENGTH_US);
}

#[test]
fn nine_packs_of_mixed_kinds_keep_10_hz() {
    mixed_packs::run(&MIXED, &MIXED_MV, LENGTH_US);
}
