//! The readers of logs, which `replay` has as modules of its own: each reads all bytes to their end, and loses none of them.
#![no_main]
#![allow(dead_code)]

#[path = "../../../../tools/src/bin/replay/assignments.rs"]
mod assignments;
#[path = "../../../../tools/src/bin/replay/binlog.rs"]
mod binlog;
#[path = "../../../../tools/src/bin/replay/dataflash.rs"]
mod dataflash;
#[path = "../../../../tools/src/bin/replay/entry.rs"]
mod entry;
#[path = "../../../../tools/src/bin/replay/px4.rs"]
mod px4;
#[path = "../../../../tools/src/bin/replay/tlog.rs"]
mod tlog;
#[path = "../../../../tools/src/bin/replay/trace.rs"]
mod trace;
#[path = "../../../../tools/src/bin/replay/ulog.rs"]
mod ulog;
#[path = "../../../../tools/src/bin/replay/window.rs"]
mod window;

use binlog::{BinaryRecords, TextRecords};
use dataflash::DataFlash;
use entry::Entries;
use tlog::Tlog;
use ulog::ULog;

/// The first byte chooses the reader.
fn run(bytes: &[u8]) {
    let Some((format, log)) = bytes.split_first() else {
        return;
    };
    let mut entries: Box<dyn Entries + '_> = match format % 4 {
        0 => Box::new(DataFlash::of(BinaryRecords::of(log))),
        1 => Box::new(DataFlash::of(TextRecords::of(log))),
        2 => Box::new(Tlog::of(log)),
        _ => Box::new(ULog::of(log)),
    };
    assert!(entries.by_ref().all(|entry| entry.is_ok()));
    assert_eq!(entries.read_bytes(), log.len() as u64);
    assert!(entries.skipped_bytes() <= entries.read_bytes());
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| run(bytes));
