//! The log of an hour, and power cuts while the ring rotates.

use emulator::FlashCut;
use workbench::bench::SECOND;
use workbench::downloads::{download, list};
use workbench::log_records::{named, records};
use workbench::runs::budget::Budget;
use workbench::runs::log_cuts;
use workbench::runs::logged_drive::LoggedDrive;

/// A drive on four packs. An hour takes nearly the four fifths of the ring that a file may have.
pub fn drive(duration_us: u64) {
    let mut drive = LoggedDrive::on_packs(4);
    drive.arm();
    drive.drive_for(duration_us);
    drive.end();
    let files = list(&mut drive.bench);
    assert_eq!(files.len(), 1, "{files:?}");
    let content = download(&mut drive.bench, files[0]);
    let records = records(&content);
    drive.assert_complete(&records);
    let seconds = named(&records, "PM").count();
    let driven = (duration_us / SECOND) as usize;
    assert!(seconds >= driven, "{seconds} s");
    let compared = drive.compare_voltages(&records);
    println!(
        "{driven} s on four packs: {} bytes, {compared} voltages as on the wire",
        content.len()
    );
    assert!(compared > 2 * driven, "{compared}");
    let erases = drive.bench.flash_erase_counts().values().max();
    assert!(erases.is_none_or(|most| *most <= 2), "{erases:?}");
}

/// Every this many operations of a rotation.
pub fn power_cuts(step: usize, budget: Budget) {
    for (cut, first) in FlashCut::ALL.into_iter().zip(1..) {
        let operations = (1 + first % step as u64..).step_by(step);
        log_cuts::run(cut, budget.limit(operations, "log power cuts"));
    }
}
