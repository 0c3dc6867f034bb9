//! What nodes on the bus report arrives on the wire, and what the board sends is what they expect.

use super::{DRONECAN, INTERVAL_US, run_with, with_battery, with_can};
use support::frames::{BatteryStatus, last_of, texts_of};
use workbench::bench::{Bench, SECOND};
use workbench::can::transfers::{A, A_CELLS, A_LATER, B, GET_NODE_INFO, STATUS_A, STATUS_B};

/// NodeStatus (341) of the board, which is node 10 by default, without its priority.
const OWN_STATUS: u32 = 341 << 8 | 10;
/// GetNodeInfo (1), the board's response to node 127.
const OWN_INFO: u32 = 1 << 16 | 127 << 8 | 0x80 | 10;
const WITHOUT_PRIORITY: u32 = 0x00ff_ffff;

/// A half-precision number between 256 and 512 K has steps of 0.25 K.
const TEMPERATURE_STEP_CDEGC: i16 = 25;

#[track_caller]
fn assert_reports(status: &BatteryStatus<'_>, mv: u16, ca: i16, cdegc: i16, percent: i8) {
    assert_eq!(
        (status.voltage_mv(0), status.current_ca(), status.remaining_pct()),
        (mv, ca, percent)
    );
    let off = (status.temperature_cdegc() - cdegc).abs();
    assert!(off <= TEMPERATURE_STEP_CDEGC, "{}", status.temperature_cdegc());
}

fn healthy_texts(bench: &mut Bench) -> Vec<String> {
    let texts = texts_of(&bench.frames());
    texts
        .into_iter()
        .filter(|text| text.contains("healthy"))
        .collect()
}

#[test]
// Requirement: AP-8
fn a_battery_measures_its_pack() {
    let (mut bench, rig) = with_battery();
    let mut battery = rig.peer();
    run_with(&mut bench, &rig, 3 * SECOND, &mut battery, &[STATUS_A, A]);
    assert_reports(&last_of(&bench.frames(), 1), 12_500, 325, 2_510, 76);
    run_with(&mut bench, &rig, SECOND, &mut battery, &[STATUS_A, A_LATER]);
    assert_reports(&last_of(&bench.frames(), 1), 12_250, 850, 3_010, 75);
    assert_eq!(rig.chip.borrow().lost_frames(), 0);
    assert_eq!(rig.chip.borrow().ignored_writes(), 0);
}

#[test]
fn a_battery_reports_its_cells() {
    let (mut bench, rig) = with_battery();
    let mut battery = rig.peer();
    run_with(&mut bench, &rig, 3 * SECOND, &mut battery, &[A_CELLS, A]);
    let frames = bench.frames();
    let status = last_of(&frames, 1);
    let cells = [0, 1, 2].map(|cell| status.voltage_mv(cell));
    for (reported, sent) in cells.into_iter().zip([4_125, 4_188, 4_156]) {
        assert!(reported.abs_diff(sent) <= 1, "{cells:?}");
    }
}

#[test]
// Requirement: S-7
fn a_battery_that_falls_silent_is_lost_and_found_again() {
    let (mut bench, rig) = with_battery();
    let mut battery = rig.peer();
    run_with(&mut bench, &rig, 3 * SECOND, &mut battery, &[A]);
    healthy_texts(&mut bench);
    bench.run_for(4 * SECOND);
    assert!(
        !healthy_texts(&mut bench)
            .iter()
            .any(|text| text.contains("unhealthy"))
    );
    bench.run_for(3 * SECOND);
    run_with(&mut bench, &rig, 7 * SECOND, &mut battery, &[A_LATER]);
    let texts = healthy_texts(&mut bench);
    assert!(
        texts.iter().any(|text| text.starts_with("Battery 2 unhealthy")),
        "{texts:?}"
    );
    assert!(
        texts.iter().any(|text| text == "Battery 2 healthy again"),
        "{texts:?}"
    );
    assert_reports(&last_of(&bench.frames(), 1), 12_250, 850, 3_010, 75);
}

#[test]
fn two_batteries_measure_two_packs_by_their_ids() {
    let parameters = [
        ("BATT2_MONITOR", DRONECAN),
        ("BATT3_MONITOR", DRONECAN),
        ("BATT2_SERIAL_NUM", 2.0),
        ("BATT3_SERIAL_NUM", 1.0),
    ];
    let (mut bench, rig) = with_can(&parameters);
    let (mut first, mut second) = (rig.peer(), rig.peer());
    // Both at the same moment: their frames take turns on the bus.
    let sent = &mut [
        (&mut first, &[STATUS_A, A][..]),
        (&mut second, &[STATUS_B, B][..]),
    ];
    rig.run_with(&mut bench, 3 * SECOND, INTERVAL_US, sent);
    let frames = bench.frames();
    assert_reports(&last_of(&frames, 1), 25_000, 1_600, 1_010, 40);
    assert_reports(&last_of(&frames, 2), 12_500, 325, 2_510, 76);
}

#[test]
fn the_board_is_a_node_on_the_bus() {
    let (mut bench, rig) = with_battery();
    let mut monitor = rig.peer();
    bench.run_for(2 * SECOND);
    monitor.take_received();
    let request_us = bench.time_us() + SECOND / 2;
    monitor.send(request_us, GET_NODE_INFO);
    bench.run_for(5 * SECOND);
    let heard = monitor.take_received();
    let status = heard
        .iter()
        .filter(|(_, id, _)| id & WITHOUT_PRIORITY == OWN_STATUS);
    let uptimes: Vec<_> = status
        .map(|(_, _, data)| u32::from_le_bytes(data[..4].try_into().unwrap()))
        .collect();
    assert_eq!(uptimes.len(), 5, "one a second: {uptimes:?}");
    assert!(
        uptimes.windows(2).all(|pair| pair[1] == pair[0] + 1),
        "{uptimes:?}"
    );
    let info: Vec<_> = heard
        .iter()
        .filter(|(_, id, _)| id & WITHOUT_PRIORITY == OWN_INFO)
        .collect();
    let tails: Vec<_> = info.iter().map(|(_, _, data)| data[data.len() - 1]).collect();
    assert_eq!(
        (tails[0] & 0xe0, tails[tails.len() - 1] & 0x40),
        (0x80, 0x40),
        "start, end"
    );
    assert!(
        info[0].0 - request_us < SECOND / 10,
        "{} us",
        info[0].0 - request_us
    );
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
    assert_reports(&last_of(&bench.frames(), 1), 12_250, 850, 3_010, 75);
    assert_eq!(healthy_texts(&mut bench), ["Battery 2 healthy"; 0]);
    assert_eq!(rig.chip.borrow().lost_frames(), 0);
    assert!(traffic.borrow().sent_frames() > 40_000);
    assert!(awake < 0.5, "awake {awake:.3}");
    println!("awake {awake:.3} at 90 % of 1 Mbit/s");
}
