//! Logs that are there more than once.

use std::fs;
use std::path::Path;

use crate::generator::Owned;
use crate::parquet_file::rows;
use crate::program::{folder, replay, table};

/// What a replay of a folder says last, and the logs that its table has, in the order of their rows.
fn logs_of_table(folder: &Path, name: &str) -> (String, Vec<String>) {
    let folder = folder.to_str().expect("a path");
    let (run, path) = table(&[folder], name, 2);
    let rows = rows(&path);
    let logs = rows
        .iter()
        .map(|row| row.text("path").replace(&format!("{folder}/"), ""));
    let said = run.errors().replace(path.to_str().expect("a path"), "TABLE");
    (said, logs.collect())
}

fn write(folder: &Path, name: &str, log: &[u8]) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
    fs::write(path, log).expect("a file");
}

#[test]
fn three_drives_in_two_folders_are_three_drives() {
    let folder = folder("twice");
    let mut pack = Owned::new(0);
    for name in ["1.BIN", "2.BIN", "3.BIN"] {
        let log = pack.drive();
        write(&folder, &format!("rover/{name}"), &log);
        write(&folder, &format!("backup/{name}"), &log);
    }
    let (said, logs) = logs_of_table(&folder, "twice");
    assert_eq!(said, "left out 3 copies of logs\nwrote TABLE with 3 rows\n");
    assert_eq!(logs, ["backup/1.BIN", "backup/2.BIN", "backup/3.BIN"]);
    let page = folder.join("packs.html");
    let [folder, page_name] = [&folder, &page].map(|path| path.to_str().expect("a path"));
    let run = replay(&["--history", page_name, folder], 2);
    assert!(
        run.errors().starts_with("left out 3 copies of logs\n"),
        "{}",
        run.errors()
    );
    let text = fs::read_to_string(page).expect("it is written");
    assert!(text.contains("<p>3 drives, "), "{text}");
}

/// Wherever it was cut, also within what all logs begin with.
#[test]
fn a_cut_download_beside_the_whole_one_does_not_count() {
    let folder = folder("cut_beside");
    let mut pack = Owned::new(0);
    let [log, next] = [pack.drive(), pack.drive()];
    let (half, most) = (log.len() / 2, log.len() - 1);
    for length in [1, 100, 4_096, 65_535, 65_536, 65_537, half, most] {
        write(&folder, &format!("{length:08}.BIN"), &log[..length]);
    }
    write(&folder, "next.BIN", &next);
    write(&folder, "whole.BIN", &log);
    let (said, logs) = logs_of_table(&folder, "cut_beside");
    assert_eq!(said, "left out 8 copies of logs\nwrote TABLE with 2 rows\n");
    assert_eq!(logs, ["next.BIN", "whole.BIN"]);
}

#[test]
fn the_longest_of_several_cut_downloads_counts() {
    let folder = folder("longest");
    let log = Owned::new(0).drive();
    write(&folder, "a.BIN", &log[..30_000]);
    write(&folder, "b.BIN", &log[..90_000]);
    write(&folder, "c.BIN", &log[..60_000]);
    let (said, logs) = logs_of_table(&folder, "longest");
    assert_eq!(said, "left out 2 copies of logs\nwrote TABLE with 1 rows\n");
    assert_eq!(logs, ["b.BIN"]);
}

/// A byte decides, at the end, too; and what can't be read is a copy of nothing, and nothing is one of it.
#[test]
fn logs_that_differ_are_no_copies() {
    let folder = folder("alike");
    let log = Owned::new(0).drive();
    let mut other = log.clone();
    *other.last_mut().expect("a byte") ^= 1;
    write(&folder, "a.BIN", &log);
    write(&folder, "b.BIN", &other);
    write(&folder, "empty.BIN", &[]);
    let long = folder.join("too-long.BIN");
    write(&folder, "too-long.BIN", &[log.as_slice(), b"and so on"].concat());
    let file = fs::File::options().write(true).open(long).expect("a file");
    file.set_len(300_000_000).expect("room for nothing");
    let (said, logs) = logs_of_table(&folder, "alike");
    assert_eq!(logs, ["a.BIN", "b.BIN"]);
    let folder = folder.to_str().expect("a path");
    assert_eq!(
        said,
        format!(
            "{folder}/empty.BIN: empty\n{folder}/too-long.BIN: larger than 256 MiB\nwrote TABLE with 2 rows\n"
        )
    );
}

/// As those of one day, which have the same parameters and a long rest in front: to compare each with each took minutes.
#[test]
fn many_logs_that_begin_alike_take_seconds() {
    const LOGS: usize = 3_000;
    const ALIKE_BYTES: usize = 66_000;
    let folder = folder("many_alike");
    let mut log = Owned::new(0).drive();
    log.resize(ALIKE_BYTES, 0);
    for number in 0..LOGS {
        log.truncate(ALIKE_BYTES);
        // Each twice, and none as long as another one.
        log.extend((number as u64 / 2).to_le_bytes());
        log.extend(vec![0; number / 2]);
        write(&folder, &format!("{number:04}.BIN"), &log);
    }
    let (run, path) = table(&[folder.to_str().expect("a path")], "many_alike", 2);
    let said = format!("left out {} copies of logs\n", LOGS / 2);
    assert!(run.errors().starts_with(&said), "{}", run.errors());
    assert_eq!(rows(&path).len(), LOGS / 2);
    assert!(run.seconds < 60.0, "{} s", run.seconds);
    fs::remove_dir_all(folder).expect("it is there");
}
