//! `replay --table` and `--history` on the logs of many rovers, and the files that `replay` writes, run as their user runs them.

mod bad;
mod copies;
mod generator;
mod outputs;
mod parquet_file;
mod program;

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Write};
use std::path::Path;

use generator::{DRIVES, Owned, write_fleet};
use parquet_file::{Row, rows};
use program::{Run, folder, replay, table};

/// A megabyte, as the limit of memory has it.
const MB: u64 = 1_000_000;

/// The last drive of a pack.
const LAST: usize = DRIVES - 1;

/// The most memory that a processor's log may take.
const MOST_BYTES: u64 = 64 * MB;

/// Shows a figure also of a test that passes.
fn show(figure: &str) {
    let _ = writeln!(io::stderr(), "{figure}");
}

fn table_on(cores: u32, logs: &str, name: &str) -> (Run, Vec<Row>) {
    let (run, path) = table(&[logs], name, cores);
    show(&run.figures(cores));
    assert!(
        run.peak_bytes < MOST_BYTES * u64::from(cores),
        "{}",
        run.figures(cores)
    );
    (run, rows(&path))
}

/// Whether the table has each pack as it is.
fn assert_true(rows: &[Row], packs: &[Owned]) {
    assert_eq!(rows.len(), packs.len() * DRIVES);
    for (rows, pack) in rows.chunks(DRIVES).zip(packs) {
        for (row, day) in rows.iter().zip(1..) {
            assert!(row.text("path").ends_with(&format!("{day:08}.BIN")), "{row:?}");
            assert_eq!(row.text("board_id"), pack.board_id());
            assert_eq!(row.whole("system_id"), i32::from(pack.system_id()));
            assert_eq!(row.text("pack_id"), pack.serial_number().to_string());
            assert_eq!((row.whole("pack"), row.flag("complete")), (1, true));
            assert!((row.number("duration_s") - 600.0).abs() < 0.01, "{row:?}");
        }
        // In the last drive the board knew what it had learnt in the one before; a simulated cell is not the one that the board
        // expects.
        let last = rows.last().expect("a drive");
        let drawn = last.number("drawn_mah") / f64::from(pack.drawn_mah(LAST));
        assert!((drawn - 1.0).abs() < 0.03, "{drawn}");
        let error = last.number("capacity_mah") / f64::from(pack.capacity_mah(LAST)) - 1.0;
        assert!(error.abs() < 0.15, "{error}, {last:?}");
        let error = last.number("resistance_mohm") / f64::from(pack.resistance_ohm(LAST) * 1e3) - 1.0;
        assert!(error.abs() < 0.15, "{error}, {last:?}");
    }
}

/// Once, with the figures: five packs of twenty drives each.
#[test]
// Requirement: OWN-8
fn a_hundred_logs_make_a_table_that_is_the_same_on_one_core_and_on_two() {
    let logs = folder("fleet");
    let packs = write_fleet(&logs, 5);
    let logs = logs.to_str().expect("a path");
    let (one, rows) = table_on(1, logs, "one");
    let (two, same) = table_on(2, logs, "two");
    show(&format!("one core to two: {:.2}", one.seconds / two.seconds));
    assert_eq!(rows, same);
    assert_true(&rows, &packs);
}

/// The packs that age are those that need attention, and come first.
#[test]
// Requirement: OWN-8
fn the_history_finds_the_packs_that_age_and_no_other() {
    let logs = folder("history");
    let packs = write_fleet(&logs, 10);
    let page = logs.join("packs.html");
    let [logs, page_name] = [&logs, &page].map(|path| path.to_str().expect("a path"));
    let run = replay(&["--history", page_name, logs], 2);
    assert!(run.output.status.success(), "{}", run.errors());
    let text = fs::read_to_string(page).expect("it is written");
    assert!(text.contains("<h1>2 of 10 packs need attention</h1>"), "{text}");
    let named = |section: &&str| {
        let (_, name) = section.split_once("<h2>Pack ").expect("a name");
        name.split('<')
            .next()
            .and_then(|number| number.parse().ok())
            .expect("a number")
    };
    let sections: Vec<&str> = text.split("<section").skip(1).collect();
    assert_eq!(sections.len(), packs.len());
    let needing = sections.iter().filter(|section| {
        section
            .lines()
            .next()
            .is_some_and(|tag| tag.ends_with(" class=\"attention\">"))
    });
    let found: BTreeSet<i32> = needing.map(named).collect();
    let aged = packs.iter().filter(|pack| pack.ages()).map(Owned::serial_number);
    assert_eq!(found, aged.collect());
    assert!(
        sections[..2]
            .iter()
            .all(|section| found.contains(&named(section)))
    );
    for section in sections {
        let (_, sentence) = section.split_once("<p>").expect("a sentence");
        println!(
            "{}: {}",
            named(&section),
            sentence.split('<').next().expect("a text")
        );
        assert_eq!(
            section.contains("less capacity than at first"),
            found.contains(&named(&section))
        );
    }
}

/// Logs of any format and vehicle make one table, in which each row has its pack.
#[test]
fn logs_of_other_autopilots_are_in_the_table() {
    let logs = folder("mixed");
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/logs");
    for name in ["armed_before.BIN", "boat.tlog", "curr.BIN", "old_bat.BIN"] {
        fs::copy(data.join(name), logs.join(name)).expect("a file");
    }
    let mut pack = Owned::new(0);
    fs::write(logs.join("rover.BIN"), pack.drive()).expect("a file");
    let name = logs.to_str().expect("a path");
    let (_, path) = table(&[name], "mixed", 2);
    let rows = rows(&path);
    let of_folder = format!("folder {name}/1");
    let of_pack = format!("serial {}", pack.serial_number());
    let inferred = "the log has the disarming only";
    let expected = [
        ["", "", &of_folder, inferred],
        ["ArduPilot", "boat", &of_folder, ""],
        ["", "", &of_folder, ""],
        ["", "", &of_folder, ""],
        ["", "", &of_pack, ""],
    ];
    assert_eq!(rows.len(), expected.len());
    for (row, expected) in rows.iter().zip(expected) {
        let columns = ["firmware", "vehicle", "pack_key", "armed_before"].map(|column| row.text(column));
        assert_eq!(columns, expected, "{row:?}");
    }
    for row in [&rows[0], &rows[2], &rows[3]] {
        assert!((row.number("drawn_mah") - 83.0).abs() < 1.0, "{row:?}");
        assert!((row.number("low_s") - 33.0).abs() < 1.0, "{row:?}");
    }
    assert_eq!(rows[1].number("log_remaining_pct"), 50.0);
}

/// One log alone begins with what the board knew, too.
#[test]
fn a_replay_begins_with_what_the_board_had_learnt() {
    let folder = folder("learnt");
    let mut pack = Owned::new(0);
    let logs = [pack.drive(), pack.drive()];
    let learnt = logs.map(|log| {
        let path = folder.join("drive.BIN");
        fs::write(&path, log).expect("a file");
        let errors = replay(&[path.to_str().expect("a path")], 1).errors();
        let line = errors.lines().find(|line| line.starts_with("Learnt: "));
        line.expect("a summary").to_owned()
    });
    assert_eq!(learnt[0], "Learnt: nothing: no rest of 30s at the end");
    assert!(
        learnt[1].starts_with("Learnt: nothing new: capacity 2."),
        "{learnt:?}"
    );
}

/// For the figures of the note, and for other programs: FLEET_FOLDER, seen from the repository's root, gets the logs of
/// FLEET_PACKS packs.
#[test]
#[ignore = "it takes minutes"]
fn writes_a_fleet() {
    let variable = |name: &str| std::env::var(name).unwrap_or_else(|_| panic!("{name} has to be set"));
    let packs = variable("FLEET_PACKS").parse().expect("a number");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let packs = write_fleet(&root.join(variable("FLEET_FOLDER")), packs);
    println!("{} logs", packs.len() * DRIVES);
}
