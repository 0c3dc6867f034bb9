//! The log of drives: recorded in flash, downloaded, and no burden on driving and measuring.

mod downloads;
mod ring;
mod timing;

use rover_battmon::memory::flash_map;
use support::commands::REQUEST_MESSAGE;
use support::frames::{AUTOPILOT_VERSION, of_message};
use support::requests::command_long;
use workbench::bench::{Bench, DIVIDER_CODE, MINUTE, SECOND, TestedVehicle};
use workbench::downloads::{download, list};
use workbench::log_records::{named, records};
use workbench::runs::logged_drive::LoggedDrive;

#[test]
fn the_log_of_a_minute_on_two_packs_has_what_was_on_the_wire() {
    let mut drive = LoggedDrive::on_packs(2);
    drive.arm();
    drive.drive_for(MINUTE);
    drive.end();
    let files = list(&mut drive.bench);
    assert_eq!(files.len(), 1, "{files:?}");
    let content = download(&mut drive.bench, files[0]);
    let compared = assert_drive(&mut drive, &content);
    println!(
        "{} bytes of a minute on two packs, {compared} voltages compared",
        content.len()
    );
    assert!(compared > 250, "{compared}");
}

/// Panics unless the log has what belongs into it. Returns how many voltages were compared with the wire's.
fn assert_drive(drive: &mut LoggedDrive, content: &[u8]) -> usize {
    let records = records(content);
    drive.assert_complete(&records);
    let numbers = |name, field| -> Vec<_> {
        named(&records, name)
            .filter_map(|record| record.get_i64(field))
            .collect()
    };
    let boards: Vec<_> = named(&records, "BRD")
        .map(|record| record.get_str("Id"))
        .collect();
    assert_eq!(boards, [Some(board_id(&mut drive.bench).as_str())]);
    assert_eq!(numbers("PACK", "Inst"), [0, 1]);
    assert_eq!(numbers("ARM", "ArmState"), [1, 0]);
    assert_eq!(numbers("EV", "Id"), [10, 11]);
    // HOLD at the start, then MANUAL.
    assert_eq!(numbers("MODE", "Mode").last(), Some(&0));
    let seconds = named(&records, "PM").count();
    assert!((75..=77).contains(&seconds), "{seconds} s");
    drive.compare_voltages(&records)
}

/// What the board says its id is: `uid` of AUTOPILOT_VERSION.
pub fn board_id(bench: &mut Bench) -> String {
    let answers = bench.ask(&command_long(REQUEST_MESSAGE, AUTOPILOT_VERSION as f32));
    let version = of_message(&answers, AUTOPILOT_VERSION)[0];
    format!("{:08X}{:08X}", version.u32(12), version.u32(8))
}

/// A board that runs with this log in its flash.
fn running_with(log: &[u8]) -> Bench {
    let mut bench = Bench::power_up_with_flash(DIVIDER_CODE, flash_map::LOG.start, log);
    bench.run_for(SECOND);
    bench
}
