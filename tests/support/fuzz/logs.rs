//! The readers of recordings: each reads all bytes to their end, gives nothing that they do not have, and where it sets times
//! itself these never run back.

use rover_battmon_tools::recordings::csv::Csv;
use rover_battmon_tools::recordings::dataflash;
use rover_battmon_tools::recordings::entry::{Content, Entries, Entry};
use rover_battmon_tools::recordings::tlog::{self, Senders};
use rover_battmon_tools::recordings::ulog;

/// The end of a file's name for each reader, at the place of the byte that chooses it.
pub const READERS: [&str; 5] = ["BIN", "log", "tlog", "ulg", "csv"];

/// A decoded character may take three bytes for one, and a parameter of PX4 is of nine packs.
const GROWTH: usize = 3 * 9;

/// The first byte chooses the reader.
pub fn run(bytes: &[u8]) {
    let Some((reader, log)) = bytes.split_first() else {
        return;
    };
    let reader = READERS[usize::from(*reader) % READERS.len()];
    let mut entries: Box<dyn Entries + '_> = match reader {
        "BIN" => Box::new(dataflash::binary(log)),
        "log" => Box::new(dataflash::text(log)),
        "tlog" => Box::new(tlog::read(log, Senders::of(log, None).expect("it is readable"))),
        "ulg" => Box::new(ulog::read(log)),
        _ => Box::new(Csv::of(log)),
    };
    let all: Result<Vec<Entry>, _> = entries.by_ref().collect();
    let bytes = entries.bytes();
    assert_eq!(bytes.read, log.len() as u64);
    assert!(bytes.skipped + bytes.cut <= bytes.read);
    // A table is read as a whole or not at all.
    let all = match all {
        Err(_) if reader == "csv" => return,
        all => all.expect("it is readable"),
    };
    let texts = all.iter().map(|entry| match &entry.content {
        Content::Text(text) | Content::Board(text) | Content::Parameter(text, _) => text.len(),
        _ => 0,
    });
    assert!(texts.sum::<usize>() <= GROWTH * log.len());
    let times_s: Vec<f64> = all.iter().filter_map(|entry| entry.time_s).collect();
    assert!(times_s.iter().all(|time_s| time_s.is_finite()), "{times_s:?}");
    if ["tlog", "csv"].contains(&reader) {
        assert!(times_s.is_sorted(), "{times_s:?}");
    }
}
