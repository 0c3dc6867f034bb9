//! Packs on the CAN bus, behind an MCP2515 at SPI1: chip select GP13, interrupt GP17.

mod faults;
mod load;
mod peers;

use support::monitor_types::DRONECAN;
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, TestedVehicle};
use workbench::can::{BITS_PER_SECOND, CRYSTAL_HZ, CanRig, Peer, Transfer};

/// How often a battery reports.
pub const INTERVAL_US: u64 = 100 * MILLISECOND;

/// A board with a CAN controller, set up with these parameters.
pub fn with_can(parameters: &[(&str, f32)]) -> (Bench, CanRig) {
    with_can_at(BITS_PER_SECOND, parameters)
}

/// A board with a CAN controller on a bus of this bit rate, set up with these parameters.
pub fn with_can_at(bits_per_second: u64, parameters: &[(&str, f32)]) -> (Bench, CanRig) {
    let mut bench = Bench::running(DIVIDER_CODE);
    let rig = CanRig::new(&mut bench, CRYSTAL_HZ, bits_per_second);
    bench.set("CAN_P1_DRIVER", 1.0);
    bench.set("CAN_P1_BITRATE", bits_per_second as f32);
    bench.set("SR0_EXTRA1", 10.0);
    bench.set_all(parameters);
    bench.reboot();
    bench.forget_sent();
    (bench, rig)
}

/// A board with a CAN controller, and a second pack that is measured by a node with battery id 1.
pub fn with_battery() -> (Bench, CanRig) {
    with_battery_at(BITS_PER_SECOND)
}

/// [`with_battery`] on a bus of this bit rate.
pub fn with_battery_at(bits_per_second: u64) -> (Bench, CanRig) {
    let parameters = [("BATT2_MONITOR", DRONECAN), ("BATT2_SERIAL_NUM", 1.0)];
    with_can_at(bits_per_second, &parameters)
}

/// Lets the board run while a peer sends these transfers ten times a second.
pub fn run_with(bench: &mut Bench, rig: &CanRig, duration_us: u64, peer: &mut Peer, transfers: &[Transfer]) {
    rig.run_with(bench, duration_us, INTERVAL_US, &mut [(peer, transfers)]);
}
