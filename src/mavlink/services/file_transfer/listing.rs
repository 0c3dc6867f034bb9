//! What a directory has.

use core::fmt::Write;

use heapless::{String, Vec};

use super::path::{Directory, LOG_DIRECTORY};
use crate::mavlink::messages::MAX_FILE_BYTES;
use crate::recorder::LogFile;

/// The longest entry: a file's name and the largest size.
const ENTRY_BYTES: usize = 32;

/// The entries from number `skip` on, as many as fit a message: `F`, name, tab and size of a file, `D` and name of a
/// directory, a zero behind each.
pub(super) fn list(directory: Directory, skip: u32, logs: &[LogFile]) -> Vec<u8, MAX_FILE_BYTES> {
    let mut list = Vec::new();
    for place in skip as usize..usize::MAX {
        let Some(entry) = entry(directory, place, logs) else {
            break;
        };
        let is_full = list.len() + entry.len() + 1 > list.capacity();
        if is_full || list.extend_from_slice(entry.as_bytes()).is_err() || list.push(0).is_err() {
            break;
        }
    }
    list
}

fn entry(directory: Directory, place: usize, logs: &[LogFile]) -> Option<String<ENTRY_BYTES>> {
    let mut entry = String::new();
    // Both fit.
    match directory {
        Directory::Root if place == 0 => {
            let _ = write!(entry, "D{LOG_DIRECTORY}");
        }
        Directory::Root => return None,
        Directory::Logs => {
            let file = logs.get(place)?;
            let _ = write!(entry, "F{:08}.BIN\t{}", file.number, file.bytes);
        }
    }
    Some(entry)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_root_has_the_logs() {
        assert_eq!(list(Directory::Root, 0, &[]).as_slice(), b"DLOGS\0");
        assert!(list(Directory::Root, 1, &[]).is_empty());
    }

    #[test]
    fn log_files_have_name_and_size() {
        let logs = [(7, 1234), (65535, u32::MAX)].map(|(number, bytes)| LogFile { number, bytes });
        let expected = b"F00000007.BIN\t1234\0F00065535.BIN\t4294967295\0";
        assert_eq!(list(Directory::Logs, 0, &logs).as_slice(), expected);
        assert_eq!(list(Directory::Logs, 1, &logs).as_slice(), &expected[19..]);
        assert!(list(Directory::Logs, 2, &logs).is_empty());
        assert!(list(Directory::Logs, u32::MAX, &logs).is_empty());
    }

    proptest! {
        /// As ground stations read it: the entries so far are skipped by the next request.
        #[test]
        fn all_files_are_listed_in_as_many_messages_as_needed(files in prop::collection::vec(any::<(u16, u32)>(), 0..60)) {
            let logs: Vec<LogFile, 60> = files.iter().map(|(number, bytes)| LogFile { number: *number, bytes: *bytes }).collect();
            let mut listed = std::vec::Vec::new();
            loop {
                let part = list(Directory::Logs, listed.len() as u32, &logs);
                if part.is_empty() {
                    break;
                }
                let text = core::str::from_utf8(&part).unwrap();
                let entries = text.strip_suffix('\0').expect("a zero at the end").split('\0');
                listed.extend(entries.map(std::string::String::from));
            }
            let expected: std::vec::Vec<_> = files.iter().map(|(number, bytes)| format!("F{number:08}.BIN\t{bytes}")).collect();
            prop_assert_eq!(listed, expected);
        }
    }
}
