//! Ground stations by UDP and TCP: found, served each on a link of its own, and let go.

use super::ground::Ground;
use crate::stack;
use support::frames::{BATTERY_STATUS, assert_no_sequence_gap, of_message};
use support::requests::{param_read_by_name, param_set};
use workbench::bench::{SECOND, TestedVehicle, value_of};

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
fn four_packs_come_fifty_times_a_second_over_every_wire() {
    let mut ground = Ground::up();
    let packs = ["BATT2_MONITOR", "BATT3_MONITOR", "BATT4_MONITOR"];
    ground.bench.set_all(&packs.map(|name| (name, 3.0)));
    ground.bench.reboot();
    ground.wait_for_network(2 * SECOND);
    let mut by_udp = ground.found_station();
    let mut by_tcp = ground.connected_station();
    let mut in_browser = ground.web_station();
    ground.bench.forget_stack_use();
    for station in [&mut by_udp, &mut by_tcp, &mut in_browser] {
        let answers = ground.ask(station, &param_set("SR0_EXTRA1", 50.0));
        assert_eq!(value_of(&answers, "SR0_EXTRA1"), Some(50.0));
    }
    for station in [&mut by_udp, &mut by_tcp, &mut in_browser] {
        let frames = ground.hear_for(station, SECOND);
        assert_no_sequence_gap(&frames);
        let packs = of_message(&frames, BATTERY_STATUS).len();
        println!("{packs} BATTERY_STATUS in a second");
        assert!((196..=204).contains(&packs), "{packs}");
    }
    stack::assert_free(&mut ground.bench, "a browser and two stations");
    assert_eq!(ground.bench.resets().len(), 1, "the one that was asked for");
}
