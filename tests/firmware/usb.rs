//! The board at a USB host.

use crate::bench::{Bench, DIVIDER_CODE, SECOND, Wire};
use crate::support::frames::{BATTERY_STATUS, HEARTBEAT, PARAM_VALUE, of_message};
use crate::support::requests::param_read_by_name;

#[test]
fn a_host_enumerates_the_board_and_a_program_gets_telemetry_and_answers() {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.use_wire(Wire::Usb);
    let device = bench.usb().device().cloned().expect("it is configured");
    assert_eq!((device.vendor, device.product), (0x2e8a, 0x000a));
    assert_eq!(device.product_name, "rover-battmon MAVLink");

    bench.run_for(2 * SECOND);
    let frames = bench.frames();
    assert!(of_message(&frames, HEARTBEAT).len() >= 2);
    assert!(of_message(&frames, BATTERY_STATUS).len() >= 4);
    let answers = bench.ask(&param_read_by_name("BATT_LOW_VOLT"));
    assert_eq!(of_message(&answers, PARAM_VALUE).len(), 1);
    println!("{:?}", device);
    bench.assert_untroubled();
}
