//! An update from a build whose log began at 768 KiB, where the program has its constants now.
//!
//! The flash is that of a Pico W with commit 05eba53a, without the program. Code of that commit stored log files in all of the
//! ring, and that a capacity was learnt; then its release firmware, emulated, recorded a drive of five seconds, had parameters
//! set, and got by USB the password of its own network, a network to join, and a signing key.

use std::io::Read;

use flate2::read::GzDecoder;
use rover_battmon::memory::flash_map;

use crate::rover::{GOOD_3S, VEHICLE_ID};
use crate::signing::station;
use support::commands::ACCEPTED;
use support::requests::{arm, disarm, manual_control, manual_mode, param_set};
use workbench::bench::{Bench, MILLISECOND, SECOND, TestedVehicle, value_of};
use workbench::downloads::{download, list};
use workbench::log_flash::files_in;
use workbench::log_records::{named, records};

const OLD_CHIP: &[u8] = include_bytes!("../data/flash/log_from_768_kib.bin.gz");

/// A board that was updated, and has not run yet.
pub fn updated() -> Bench {
    let mut chip = Vec::new();
    let read = GzDecoder::new(OLD_CHIP).read_to_end(&mut chip);
    read.expect("it is compressed");
    Bench::power_up_updated(GOOD_3S, &chip)
}

/// From now on the board's owner is at the telemetry port.
fn let_its_owner_ask(bench: &mut Bench) {
    let owner = station(bench);
    bench.sign_with(owner);
}

#[test]
fn parameters_key_and_learnt_data_are_kept() {
    let mut bench = updated();
    bench.run_for(SECOND);
    let answers = bench.ask(&param_set("BATT_LOW_VOLT", 9.0));
    assert_eq!(value_of(&answers, "BATT_LOW_VOLT"), None, "it is not signed");
    let_its_owner_ask(&mut bench);
    for (name, value) in [
        ("BATT_CELLS", 3.0),
        ("BATT_CAPACITY", 2900.0),
        ("BATT_LOW_VOLT", 10.5),
        ("MOT_SLEWRATE", 55.0),
        ("BATT_LRN_CAP", 2950.0),
    ] {
        assert_eq!(bench.parameter(name), value, "{name}");
    }
    bench.assert_untroubled();
}

#[test]
fn old_logs_are_gone_and_the_next_drive_is_kept() {
    let mut bench = updated();
    bench.run_for(SECOND);
    let_its_owner_ask(&mut bench);
    let constants = |bench: &Bench| bench.read_flash(flash_map::CONSTANTS.start, flash_map::CONSTANTS.len());
    let served = constants(&bench);
    assert_eq!(list(&mut bench), []);
    // A sector after the other is erased, for the drive and ahead of the next.
    bench.run_for(20 * SECOND);
    assert_eq!(bench.result_of(&arm()), ACCEPTED);
    bench.ask(&manual_mode());
    bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    for _ in 0..50 {
        bench.request(&manual_control(VEHICLE_ID, 0, 500));
        bench.run_for(100 * MILLISECOND);
    }
    bench.ask(&disarm());
    bench.run_for(20 * SECOND);
    bench.assert_untroubled();

    bench.power_cycle();
    bench.run_for(2 * SECOND);
    let_its_owner_ask(&mut bench);
    let files = list(&mut bench);
    assert_eq!(files.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [1]);
    let content = download(&mut bench, files[0]);
    let records = records(&content);
    let states = named(&records, "ARM").map(|record| record.get_i64("ArmState"));
    assert_eq!(states.collect::<Vec<_>>(), [Some(1), Some(0)]);
    let ring = bench.read_flash(flash_map::LOG.start, flash_map::LOG.len());
    assert_eq!(files_in(&ring), [(1, content)]);
    assert!(constants(&bench) == served, "the log is behind the constants");
}
