//! A radio that does not work: announced once, restarted, and nothing else suffers.

use super::ground::Ground;
use emulator::{ChipPart, RadioFault};
use support::frames::{BATTERY_STATUS, assert_no_sequence_gap, of_message, texts_of};
use workbench::bench::{Bench, DIVIDER_CODE, SECOND, TestedVehicle};
use workbench::runs::radio_restarts;

const NO_ANSWER: &str = "Wi-Fi radio does not answer";
const NOT_TAKEN: &str = "Wi-Fi radio does not take its firmware";

fn with_fault(fault: RadioFault) -> Bench {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.attach_wifi();
    bench.wifi().set_fault(Some(fault));
    bench
}

/// Panics unless the telemetry port has worked all the time.
fn assert_telemetry_undisturbed(bench: &mut Bench, seconds: usize) {
    let (resets, log) = (bench.resets(), bench.log_lines());
    assert!(resets.is_empty(), "{resets:?}: {log:?}");
    let frames = bench.frames();
    assert_no_sequence_gap(&frames);
    let packs = of_message(&frames, BATTERY_STATUS).len();
    assert!(packs >= 2 * seconds - 1, "{packs} in {seconds} s");
    assert!(bench.read_parameter("BATT_LOW_VOLT").is_some());
}

fn times_announced(bench: &mut Bench, text: &str) -> usize {
    let texts = texts_of(&bench.frames());
    texts.iter().filter(|said| *said == text).count()
}

#[test]
// Requirement: R-7
fn a_radio_that_is_missing_is_announced_once() {
    for fault in [RadioFault::Missing, RadioFault::Noise] {
        let mut bench = with_fault(fault);
        bench.run_for(20 * SECOND);
        assert_telemetry_undisturbed(&mut bench, 20);
        let times = times_announced(&mut bench, NO_ANSWER);
        assert_eq!(times, 1, "{fault:?}: {:?}", bench.log_lines());
    }
}

#[test]
// Requirement: R-7
fn a_radio_that_falls_silent_on_its_way_up_harms_nothing_and_comes_back() {
    // Of some 4,000 commands until the network is up most are for the download.
    for words in [0, 1, 2, 3, 5, 9, 25, 60, 400, 3_640, 3_700, 3_750] {
        let mut bench = with_fault(RadioFault::SilentAfter(words));
        bench.run_for(5 * SECOND);
        assert_telemetry_undisturbed(&mut bench, 5);
        let is_up = bench.wifi().access_point().is_some();
        let is_announced = times_announced(&mut bench, NO_ANSWER) == 1;
        assert!(is_up || is_announced, "after {words}: {:?}", bench.log_lines());
    }
    let mut bench = with_fault(RadioFault::SilentAfter(400));
    bench.run_for(4 * SECOND);
    bench.wifi().set_fault(None);
    let mut ground = Ground::around(bench);
    ground.wait_for_network(15 * SECOND);
    ground.found_station();
}

#[test]
// Requirement: R-7
fn a_radio_that_falls_silent_while_a_station_is_served_comes_back() {
    let mut ground = Ground::up();
    let mut station = ground.found_station();
    ground.bench.wifi().set_fault(Some(RadioFault::SilentAfter(3)));
    ground.run_for(10 * SECOND);
    assert_telemetry_undisturbed(&mut ground.bench, 10);
    assert_eq!(times_announced(&mut ground.bench, NO_ANSWER), 1);
    ground.bench.wifi().set_fault(None);
    ground.wait_for_network(20 * SECOND);
    // It asks for an address again, and hears the board on the same port.
    ground.run_for(2 * SECOND);
    assert!(!ground.hear_for(&mut station, 4 * SECOND).is_empty());
    ground.assert_not_reset();
}

#[test]
// Requirement: R-7
fn a_chip_that_answers_and_never_gets_ready_does_not_restart_the_board() {
    for part in [ChipPart::LowPowerClock, ChipPart::WlanCore, ChipPart::Packets] {
        let mut bench = with_fault(RadioFault::NotReady(part));
        bench.run_for(5 * SECOND);
        assert_telemetry_undisturbed(&mut bench, 5);
        let times = times_announced(&mut bench, NOT_TAKEN);
        assert_eq!(times, 1, "{part:?}: {:?}", bench.log_lines());
        bench.wifi().set_fault(None);
        Ground::around(bench).wait_for_network(12 * SECOND);
    }
}

#[test]
// Requirement: R-7
fn a_radio_that_is_restarted_in_the_middle_of_transfers_comes_up_each_time() {
    radio_restarts::run(6, 1);
}
