//! The records of a log file, by a reader that is not of this project.

use std::io::Cursor;

use ardupilot_binlog::{Entry, Reader};

/// Of the header of a record.
const HEADER_BYTES: usize = 3;

/// The records of a whole file. Panics unless they are all there is in it.
pub fn records(content: &[u8]) -> Vec<Entry> {
    let (records, bytes) = read(content);
    assert_eq!(bytes, content.len(), "bytes of no record");
    records
}

/// The whole records of a file that may be torn at its end.
pub fn records_of_torn(content: &[u8]) -> Vec<Entry> {
    let (records, bytes) = read(content);
    assert!(bytes <= content.len());
    records
}

/// The records, and how many bytes they take.
fn read(content: &[u8]) -> (Vec<Entry>, usize) {
    let mut reader = Reader::new(Cursor::new(content));
    let records: Vec<_> = reader
        .by_ref()
        .map(|record| record.expect("it reads from memory"))
        .collect();
    let length = |record: &Entry| {
        let format = &reader.formats()[&record.msg_type];
        HEADER_BYTES + format.payload_size()
    };
    let bytes = records.iter().map(length).sum();
    (records, bytes)
}

/// Those with this name.
pub fn named<'a>(records: &'a [Entry], name: &'a str) -> impl Iterator<Item = &'a Entry> {
    records.iter().filter(move |record| record.name == name)
}
