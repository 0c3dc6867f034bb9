//! Ground stations by UDP and TCP: found, served each on a link of its own, and let go.

use super::ground::{Ground, Station};
use support::frames::{
    BATTERY_STATUS, Frame, HEARTBEAT, PARAM_VALUE, SYS_STATUS, assert_no_sequence_gap, of_message,
};
use support::requests::{
    GCS, VEHICLE, heartbeat, param_read_by_name, param_request_list, param_set, request_data_stream,
};
use workbench::bench::{SECOND, value_of};

/// Where PARAM_VALUE has the number of parameters.
const COUNT: usize = 4;

fn can_ask(ground: &mut Ground, station: &mut Station) -> bool {
    let answers = ground.ask(station, &param_read_by_name("BATT_LOW_VOLT"));
    value_of(&answers, "BATT_LOW_VOLT").is_some()
}

/// Panics unless every parameter comes.
fn assert_lists_all(ground: &mut Ground, station: &mut Station) {
    ground.send(station, &param_request_list(VEHICLE));
    let frames = ground.hear_for(station, 6 * SECOND);
    let values = of_message(&frames, PARAM_VALUE);
    let count = usize::from(values[0].u16(COUNT));
    assert!(values.len() >= count, "{} of {count}", values.len());
    assert_no_sequence_gap(&frames);
}

fn count(frames: &[Frame], message: u32) -> usize {
    of_message(frames, message).len()
}

/// A late reader of the radio's bus loses a bit of a packet, and reads the one behind it: of a broadcast it is the one by which it is
/// for all.
#[test]
// Requirement: R-7
fn every_broadcast_is_heard_however_late_the_radios_task_is() {
    let mut ground = Ground::up();
    let mut station = ground.found_station();
    for number in 0..30 {
        let asked_us = ground.bench.time_us();
        ground.broadcast(&station, &param_read_by_name("BATT_LOW_VOLT"));
        hold_up_while_it_comes(&mut ground);
        ground.run_for(SECOND / 5);
        let answers = ground.heard_since(&mut station, asked_us);
        assert!(value_of(&answers, "BATT_LOW_VOLT").is_some(), "request {number}");
    }
}

/// Stops the processor again and again, each time for longer than the bus's FIFO lasts.
fn hold_up_while_it_comes(ground: &mut Ground) {
    const CORE_0: u32 = 1;
    for _ in 0..500 {
        for (halted, for_us) in [(0, 6), (CORE_0, 12)] {
            ground.bench.halt_cores(halted);
            ground.run_for(for_us);
        }
    }
    ground.bench.halt_cores(0);
}

#[test]
// Requirement: OWN-7
fn stations_are_found_and_served_by_udp() {
    let mut ground = Ground::up();
    let mut first = ground.found_station();
    let frames = ground.hear_for(&mut first, 2 * SECOND);
    assert_no_sequence_gap(&frames);
    assert_eq!(count(&frames, HEARTBEAT), 2);
    assert_eq!(count(&frames, BATTERY_STATUS), 4);
    assert_lists_all(&mut ground, &mut first);

    ground.send(&mut first, &heartbeat(GCS));
    // A second one is found while the first is served; what it asks for is its own.
    let mut second = ground.found_station();
    ground.ask(&mut second, &request_data_stream(12, 10, 1));
    let of_second = ground.hear_for(&mut second, SECOND);
    assert!(
        count(&of_second, BATTERY_STATUS) >= 9,
        "{}",
        count(&of_second, BATTERY_STATUS)
    );
    let of_first = ground.hear_for(&mut first, 2 * SECOND);
    assert_eq!(count(&of_first, BATTERY_STATUS), 4);
    assert_no_sequence_gap(&of_first);

    ground.send(&mut first, &heartbeat(GCS));
    // The third one is not served, and the others do not notice it.
    let laptop = ground.laptop();
    let mut third = ground.listen(laptop);
    assert!(ground.hear_for(&mut third, 2 * SECOND).is_empty());
    ground.send(&mut first, &heartbeat(GCS));
    ground.send(&mut second, &heartbeat(GCS));
    assert!(can_ask(&mut ground, &mut first) && can_ask(&mut ground, &mut second));

    // A place is free once a station was silent for ten seconds.
    for _ in 0..12 {
        ground.send(&mut first, &heartbeat(GCS));
        ground.run_for(SECOND);
    }
    let heard = ground.hear_for(&mut third, 2 * SECOND);
    assert_eq!(count(&heard, HEARTBEAT), 2, "{heard:?}");
    ground.send(&mut third, &heartbeat(GCS));
    ground.run_for(SECOND / 2);
    assert!(can_ask(&mut ground, &mut third));
    ground.assert_not_reset();
}

#[test]
fn stations_are_served_by_tcp() {
    let mut ground = Ground::up();
    let mut first = ground.connected_station();
    assert_lists_all(&mut ground, &mut first);
    let mut second = ground.connected_station();
    assert!(can_ask(&mut ground, &mut first) && can_ask(&mut ground, &mut second));
    let third = ground.connected_station();
    assert!(!ground.is_connected(&third), "there is room for two");
    let frames = ground.hear_for(&mut second, 2 * SECOND);
    assert_no_sequence_gap(&frames);
    assert_eq!(count(&frames, SYS_STATUS), 4);
    ground.assert_not_reset();
}

#[test]
fn four_packs_come_fifty_times_a_second_over_every_wire() {
    let mut ground = Ground::up();
    for pack in ["BATT2_MONITOR", "BATT3_MONITOR", "BATT4_MONITOR"] {
        ground.bench.set(pack, 3.0);
    }
    ground.bench.reboot();
    ground.wait_for_network(2 * SECOND);
    let mut by_udp = ground.found_station();
    let mut by_tcp = ground.connected_station();
    for station in [&mut by_udp, &mut by_tcp] {
        let answers = ground.ask(station, &param_set("SR0_EXTRA1", 50.0));
        assert_eq!(value_of(&answers, "SR0_EXTRA1"), Some(50.0));
    }
    for station in [&mut by_udp, &mut by_tcp] {
        let frames = ground.hear_for(station, SECOND);
        assert_no_sequence_gap(&frames);
        let packs = count(&frames, BATTERY_STATUS);
        println!(
            "{packs} BATTERY_STATUS, {} SYS_STATUS in a second",
            count(&frames, SYS_STATUS)
        );
        assert!((196..=204).contains(&packs), "{packs}");
    }
    assert_eq!(ground.bench.resets().len(), 1, "the one that was asked for");
}
