//! What is no log, or not a whole one.

use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::Path;

use crate::generator::{Owned, arming};
use crate::parquet_file::rows;
use crate::program::{folder, replay, table};

/// A sparse file of this length is no burden to the disk.
const TOO_LONG_BYTES: u64 = 300_000_000;

/// The place of these bytes in a log.
fn place(log: &[u8], bytes: &[u8]) -> usize {
    let found = log.windows(bytes.len()).position(|found| found == bytes);
    found.unwrap_or_else(|| panic!("no {bytes:02x?}"))
}

/// A vehicle without a battery monitor: formats, parameters and other records.
fn without_packs(log: &[u8]) -> Vec<u8> {
    // The format of BAT gets another name.
    let format = place(log, &[0xa3, 0x95, 128, 138, 41]);
    let mut log = log.to_vec();
    log[format + 5] = b'X';
    log
}

#[test]
fn each_bad_input_ends_as_it_should() {
    let folder = folder("bad");
    let log = Owned::new(0).drive();
    let other = Owned::new(1).drive();
    let mut damaged = log.clone();
    let middle = log.len() / 2;
    damaged[middle..middle + 500].fill(0xff);
    let noise: Vec<u8> = (0..100_000u32)
        .map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8)
        .collect();
    for (name, bytes) in [
        ("cut.BIN", &other[..other.len() / 2]),
        ("damaged.bin", &damaged),
        ("empty.BIN", &[]),
        ("noise.BIN", &noise),
        ("text.BIN", b"a letter, not a log\n"),
        ("vehicle.BIN", &without_packs(&log)),
        ("whole.BIN", &log),
        ("notes.txt", b"of no interest"),
        ("system.log", b"of no interest, either"),
        ("flight.ulg", b"ULog\x01\x12\x35"),
        ("packed.tlog", b"PK\x03\x04"),
    ] {
        fs::write(folder.join(name), bytes).expect("a file");
    }
    let long = File::create(folder.join("long.BIN")).expect("a file");
    long.set_len(TOO_LONG_BYTES).expect("room for nothing");
    symlink(&folder, folder.join("circle")).expect("a link");
    symlink("whole.BIN", folder.join("zz-the-same.BIN")).expect("a link");
    let name = folder.to_str().expect("a path");
    let (run, path) = table(&[name], "bad", 2);
    let rows: Vec<(String, bool)> = rows(&path)
        .iter()
        .map(|row| (row.text("path").replace(name, ""), row.flag("complete")))
        .collect();
    assert_eq!(
        rows,
        [("/cut.BIN", false), ("/damaged.bin", false), ("/whole.BIN", true)]
            .map(|(path, complete)| (path.into(), complete))
    );
    let expected = [
        ("empty.BIN", "empty"),
        ("flight.ulg", "no reading of a pack"),
        ("long.BIN", "larger than 256 MiB"),
        (
            "noise.BIN",
            "neither a log of ArduPilot (.BIN, .log), PX4 (.ulg) or a ground station (.tlog) nor CSV",
        ),
        ("packed.tlog", "compressed: unpack it first"),
        (
            "text.BIN",
            "text, but not a log of ArduPilot (.BIN, .log), PX4 (.ulg) or a ground station (.tlog)",
        ),
        ("vehicle.BIN", "no reading of a pack"),
    ];
    let lines = expected.map(|(file, reason)| format!("{name}/{file}: {reason}\n"));
    assert!(run.errors().starts_with(&lines.concat()), "{}", run.errors());
    let failures = fs::read_to_string(path.with_extension("failures.csv")).expect("it is written");
    let lines = expected.map(|(file, reason)| format!("\"{name}/{file}\",\"{reason}\"\n"));
    assert_eq!(failures, format!("path,reason\n{}", lines.concat()));
}

/// Two logs in one file, for example. The drive before is whole, and what follows is taken as it comes.
#[test]
fn times_that_run_backwards_are_said() {
    let folder = folder("backwards");
    let [first, second] = {
        let mut pack = Owned::new(0);
        [pack.drive(), pack.drive()]
    };
    fs::write(folder.join("both.BIN"), [first.as_slice(), &second].concat()).expect("a file");
    fs::write(folder.join("second.BIN"), &second).expect("a file");
    let name = folder.to_str().expect("a path");
    let (run, path) = table(&[name], "backwards", 2);
    let said = format!("{name}/both.BIN: times run backwards\n");
    assert_eq!(run.errors().matches("backwards\n").count(), 1, "{}", run.errors());
    assert!(run.errors().starts_with(&said), "{}", run.errors());
    let complete: Vec<bool> = rows(&path).iter().map(|row| row.flag("complete")).collect();
    assert_eq!(complete, [true, false, true]);
    let page = folder.join("packs.html");
    let run = replay(&["--history", page.to_str().expect("a path"), name], 2);
    assert!(run.errors().starts_with(&said), "{}", run.errors());
    let run = replay(&[format!("{name}/both.BIN")], 1);
    let said = "\nTimes run backwards: once, first from 11:14 to 1:00; readings are taken";
    assert!(run.errors().contains(said), "{}", run.errors());
}

/// Of a ground station's log: a delayed reading is skipped, and a clock that was set is no damage.
#[test]
fn clocks_of_a_station_that_were_set_are_said() {
    let folder = folder("clocks");
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/logs");
    fs::copy(data.join("clock_back.tlog"), folder.join("back.tlog")).expect("a file");
    let mut log = fs::read(data.join("boat.tlog")).expect("a file");
    // The time of a BATTERY_STATUS in the middle, in microseconds.
    let header = [1, 1, 147, 0, 0];
    let middle = log.len() / 2;
    let time = middle + place(&log[middle..], &header) - 5 - 8;
    let time_us = u64::from_be_bytes(*log[time..].first_chunk().expect("a time"));
    log[time..time + 8].copy_from_slice(&(time_us - 2_000_000).to_be_bytes());
    fs::write(folder.join("delayed.tlog"), log).expect("a file");
    let name = folder.to_str().expect("a path");
    let (run, path) = table(&[name], "clocks", 1);
    let said = format!(
        "{name}/back.tlog: clock stepped back by 2 h at 0:10 (once)\n{name}/delayed.tlog: times run backwards\n"
    );
    assert!(run.errors().starts_with(&said), "{}", run.errors());
    let rows = rows(&path);
    assert!((rows[0].number("drawn_mah") - 339.0).abs() < 1.0, "{:?}", rows[0]);
    assert_eq!(rows[1].number("duration_s"), 88.5);
}

/// A drive that ends with the power has a row; so has one that never began.
#[test]
fn a_log_ends_anywhere() {
    let folder = folder("cut");
    let mut pack = Owned::new(0);
    let (board_id, log) = (pack.board_id(), pack.drive());
    let disarming = arming(rover_battmon::vehicle::ArmState::Disarmed, 660_000_000);
    let disarmed = place(&log, &disarming) + disarming.len();
    let first_reading = place(&log, &[0xa3, 0x95, 138]);
    let board = place(&log, board_id.as_bytes());
    for end in (first_reading + 60..log.len()).step_by(log.len() / 50) {
        // Of a board of its own, or it would be a copy.
        let mut log = log[..end].to_vec();
        log[board..board + board_id.len()].copy_from_slice(format!("{end:016}").as_bytes());
        fs::write(folder.join(format!("{end:08}.BIN")), log).expect("a file");
    }
    let (run, path) = table(&[folder.to_str().expect("a path")], "cut", 2);
    assert_eq!(run.errors().lines().count(), 1, "{}", run.errors());
    let rows = rows(&path);
    assert!(rows.len() > 45);
    for row in &rows {
        let end: usize = row.text("path").rsplit('/').next().expect("a name")[..8]
            .parse()
            .expect("a number");
        assert_eq!(row.flag("complete"), end >= disarmed, "{row:?}");
    }
}
