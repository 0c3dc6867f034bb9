//! What nodes on the bus report arrives on the wire, and what the board sends is what they expect.

use super::{run_with, with_battery};
use support::frames::{last_of, texts_of};
use workbench::bench::{Bench, DIVIDER_CODE, SECOND, TestedVehicle};
use workbench::can::CanRig;
use workbench::can::transfers::{A, A_LATER, GET_NODE_INFO, STATUS_A};

/// NodeStatus (341) of the board, which is node 10 by default, without its priority.
const OWN_STATUS: u32 = 341 << 8 | 10;
/// GetNodeInfo (1), the board's response to node 127.
const OWN_INFO: u32 = 1 << 16 | 127 << 8 | 0x80 | 10;
const WITHOUT_PRIORITY: u32 = 0x00ff_ffff;

#[test]
fn the_board_is_a_node_on_the_bus() {
    let mut bench = Bench::running(DIVIDER_CODE);
    let rig = CanRig::new(&mut bench, 8_000_000, 125_000);
    bench.set_all(&[
        ("CAN_P1_DRIVER", 1.0),
        ("CAN_P1_CRYSTAL", 8.0),
        ("CAN_P1_BITRATE", 125_000.0),
    ]);
    bench.reboot();
    let mut monitor = rig.peer();
    bench.run_for(2 * SECOND);
    monitor.take_received();
    let request_us = bench.time_us() + SECOND / 2;
    monitor.send(request_us, GET_NODE_INFO);
    bench.run_for(5 * SECOND);
    let heard = monitor.take_received();
    let of_message = |own: u32| {
        heard
            .iter()
            .filter(move |(_, id, _)| id & WITHOUT_PRIORITY == own)
    };
    assert_eq!(of_message(OWN_STATUS).count(), 5, "one a second");
    let (answered_us, ..) = of_message(OWN_INFO).next().expect("an answer");
    assert!(answered_us - request_us < SECOND / 10);
    assert_eq!(rig.chip.borrow().ignored_writes(), 0);
}

#[test]
fn readings_come_through_while_others_take_nine_tenths_of_the_bus() {
    /// Not let through by the filters: esc.RawCommand (1030) of node 1, of highest priority.
    const COMMANDS: u32 = 1030 << 8 | 1;
    let (mut bench, rig) = with_battery();
    let mut battery = rig.peer();
    run_with(&mut bench, &rig, 3 * SECOND, &mut battery, &[A]);
    let traffic = rig.traffic(&bench, COMMANDS, 0.9);
    let awake = bench.awake_cycles();
    run_with(&mut bench, &rig, 7 * SECOND, &mut battery, &[STATUS_A, A_LATER]);
    let awake = (bench.awake_cycles() - awake) as f64 / (7 * SECOND * 125) as f64;
    let frames = bench.frames();
    let status = last_of(&frames, 1);
    assert_eq!((status.voltage_mv(0), status.current_ca()), (12_250, 850));
    let texts = texts_of(&frames);
    assert!(!texts.iter().any(|text| text.contains("healthy")), "{texts:?}");
    assert_eq!(rig.chip.borrow().lost_frames(), 0);
    assert!(traffic.borrow().sent_frames() > 40_000);
    assert!(awake < 0.5, "awake {awake:.3}");
    println!("awake {awake:.3} at 90 % of 1 Mbit/s");
}
