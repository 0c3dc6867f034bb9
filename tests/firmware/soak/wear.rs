//! How often the flash is written and erased.

use workbench::bench::{Bench, SECOND, TestedVehicle};

#[test]
// Requirement: W-1
fn starts_and_requests_write_nothing() {
    let mut bench = Bench::running(2482);
    bench.set("SR0_EXTRA1", 4.0);
    bench.run_for(SECOND);
    bench.take_flash_operations();
    for _ in 0..3 {
        bench.power_cycle();
        bench.run_for(SECOND / 2);
        bench.set("SR0_EXTRA1", 4.0);
    }
    let operations = bench.flash_operations();
    assert!(operations.is_empty(), "{operations:?}");
}
