//! The directories: what a path leads to, and what is listed.

use core::num::NonZeroU32;

use heapless::{String, Vec};

use crate::mavlink::messages::MAX_FILE_BYTES;
use crate::numbers::text;
use crate::parameter::DescriptionFile;
use crate::recorder::LogFile;

/// The packed parameters, where ArduPilot has them.
const PARAMETERS: &str = "@PARAM/param.pck";

/// ArduPilot's directory on a memory card; ground stations ask for the logs in there.
const CARD_DIRECTORY: &str = "APM";

const LOG_DIRECTORY: &str = "LOGS";

/// The digits of a log file's name.
const DIGITS: usize = 8;

const EXTENSION: &str = "BIN";

/// The longest entry: a log's name, the largest size and time.
const ENTRY_BYTES: usize = 40;

/// A time that is unknown, as in PX4.
const TIME_UNKNOWN: u32 = 0;

/// The target of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Path {
    Directory(Directory),
    /// The log file with this number, if there is one.
    Log(u16),
    Parameters(Selection),
    Description(DescriptionFile),
}

/// A directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Directory {
    Root,
    Logs,
}

/// Content of a directory's entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Listed {
    /// ListDirectory.
    Sizes,
    /// ListDirectoryWithTime: also when a log began, in seconds since 1970 (UTC).
    SizesAndTimes,
}

/// The wanted part of the packed parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Selection {
    /// The index of the first one.
    pub start: u16,
    /// Their number; `None` for all.
    pub count: Option<u16>,
    /// Whether a parameter's default follows its value.
    pub with_defaults: bool,
}

impl Path {
    /// The target of `path`, if there is one.
    pub fn parse(path: &str) -> Option<Self> {
        if let Some(query) = path.strip_prefix(PARAMETERS) {
            return Selection::parse(query).map(Self::Parameters);
        }
        let mut names = path.split('/').filter(|name| !name.is_empty()).peekable();
        if names.peek() == Some(&CARD_DIRECTORY) {
            names.next();
        }
        match (names.next(), names.next(), names.next()) {
            (None, ..) => Some(Self::Directory(Directory::Root)),
            (Some(LOG_DIRECTORY), None, _) => Some(Self::Directory(Directory::Logs)),
            (Some(LOG_DIRECTORY), Some(name), None) => log_number(name).map(Self::Log),
            (Some(name), None, _) => description(name).map(Self::Description),
            _ => None,
        }
    }
}

/// The file of descriptions with this name.
fn description(name: &str) -> Option<DescriptionFile> {
    DescriptionFile::ALL.into_iter().find(|file| file.name() == name)
}

/// The number of the log file with this name.
fn log_number(name: &str) -> Option<u16> {
    let (digits, extension) = name.split_once('.')?;
    let is_number = digits.len() == DIGITS && digits.bytes().all(|digit| digit.is_ascii_digit());
    if !is_number || !extension.eq_ignore_ascii_case(EXTENSION) {
        return None;
    }
    digits.parse().ok()
}

impl Selection {
    /// From what follows the path: nothing, or `?` and arguments with `&` between. Others than these are ignored, as in
    /// ArduPilot.
    fn parse(query: &str) -> Option<Self> {
        let mut selection = Self::default();
        if query.is_empty() {
            return Some(selection);
        }
        for argument in query.strip_prefix('?')?.split('&') {
            match argument.split_once('=') {
                Some(("start", value)) => selection.start = value.parse().ok()?,
                Some(("count", value)) => {
                    let count: u16 = value.parse().ok()?;
                    selection.count = (count > 0).then_some(count);
                }
                Some(("withdefaults", "1")) => selection.with_defaults = true,
                _ => {}
            }
        }
        Some(selection)
    }
}

/// The entries from number `skip` on, as many as fit a message: `F`, name, tab and size of a file, `D` and name of a
/// directory, a zero behind each. With times, a tab and the time are at the end of each.
pub(super) fn list(
    directory: Directory,
    listed: Listed,
    skip: u32,
    logs: &[LogFile],
) -> Vec<u8, MAX_FILE_BYTES> {
    let mut list = Vec::new();
    for place in skip as usize..usize::MAX {
        let Some((mut entry, time_utc_s)) = entry(directory, place, logs) else {
            break;
        };
        if listed == Listed::SizesAndTimes {
            // It fits.
            entry = text(format_args!("{entry}\t{time_utc_s}"));
        }
        let is_full = list.len() + entry.len() + 1 > list.capacity();
        if is_full || list.extend_from_slice(entry.as_bytes()).is_err() || list.push(0).is_err() {
            break;
        }
    }
    list
}

/// An entry without its time, and the time.
fn entry(directory: Directory, place: usize, logs: &[LogFile]) -> Option<(String<ENTRY_BYTES>, u32)> {
    // All fit.
    match directory {
        Directory::Root => match place.checked_sub(1) {
            None => Some((text(format_args!("D{LOG_DIRECTORY}")), TIME_UNKNOWN)),
            Some(place) => {
                let file = DescriptionFile::ALL.get(place)?;
                let entry = text(format_args!("F{}\t{}", file.name(), file.content().len()));
                Some((entry, TIME_UNKNOWN))
            }
        },
        Directory::Logs => {
            let file = logs.get(place)?;
            let entry = text(format_args!("F{:08}.BIN\t{}", file.number, file.bytes));
            Some((entry, file.began_utc_s.map_or(TIME_UNKNOWN, NonZeroU32::get)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn directories_and_log_files_are_found_with_and_without_ardupilots_directory() {
        let root = Some(Path::Directory(Directory::Root));
        let logs = Some(Path::Directory(Directory::Logs));
        for (path, expected) in [
            ("", root),
            ("/", root),
            ("/APM", root),
            ("APM/", root),
            ("/LOGS", logs),
            ("LOGS", logs),
            ("/APM/LOGS/", logs),
            ("/LOGS/00000001.BIN", Some(Path::Log(1))),
            ("/APM/LOGS/00065535.bin", Some(Path::Log(65535))),
            ("/LOGS/00065536.BIN", None),
            ("/LOGS/1.BIN", None),
            ("/LOGS/0000000x.BIN", None),
            ("/LOGS/00000001.TXT", None),
            ("/LOGS/00000001.BIN/x", None),
            ("/LOGS/..", None),
            ("../LOGS", None),
            ("/etc/passwd", None),
            ("@SYS", None),
            ("/general.json", Some(Path::Description(DescriptionFile::General))),
            (
                "parameters.json.xz",
                Some(Path::Description(DescriptionFile::Parameters)),
            ),
            ("/parameters.json", None),
            ("/general.json/x", None),
            ("/LOGS/general.json", None),
            ("/APM/APM/LOGS", None),
        ] {
            assert_eq!(Path::parse(path), expected, "{path}");
        }
    }

    #[test]
    fn parameters_are_selected_by_arguments() {
        let all = Selection::default();
        let with_defaults = Selection {
            with_defaults: true,
            ..all
        };
        let some = Selection {
            start: 10,
            count: Some(5),
            with_defaults: true,
        };
        for (path, expected) in [
            ("@PARAM/param.pck", Some(all)),
            ("@PARAM/param.pck?", Some(all)),
            ("@PARAM/param.pck?withdefaults=0", Some(all)),
            ("@PARAM/param.pck?withdefaults=1", Some(with_defaults)),
            ("@PARAM/param.pck?start=10&count=5&withdefaults=1", Some(some)),
            ("@PARAM/param.pck?count=0&colour=red", Some(all)),
            ("@PARAM/param.pck?start=65536", None),
            ("@PARAM/param.pck?count=-1", None),
            ("@PARAM/param.pckx", None),
        ] {
            assert_eq!(Path::parse(path), expected.map(Path::Parameters), "{path}");
        }
    }

    #[test]
    fn the_root_has_the_logs_and_the_descriptions() {
        let [general, parameters] = DescriptionFile::ALL.map(|file| file.content().len());
        let expected = format!("DLOGS\0Fgeneral.json\t{general}\0Fparameters.json.xz\t{parameters}\0");
        assert_eq!(
            list(Directory::Root, Listed::Sizes, 0, &[]).as_slice(),
            expected.as_bytes()
        );
        assert_eq!(
            list(Directory::Root, Listed::Sizes, 1, &[]).as_slice(),
            &expected.as_bytes()[6..]
        );
        assert!(list(Directory::Root, Listed::Sizes, 3, &[]).is_empty());
    }

    fn undated(number: u16, bytes: u32) -> LogFile {
        LogFile {
            number,
            bytes,
            began_utc_s: None,
        }
    }

    proptest! {
        #[test]
        fn any_path_is_parsed(path in "\\PC*", query in "[?&=a-z0-9]{0,40}") {
            Path::parse(&path);
            Path::parse(&format!("@PARAM/param.pck{query}"));
        }

        /// As ground stations read it: the entries so far are skipped by the next request.
        #[test]
        fn all_files_are_listed_in_as_many_messages_as_needed(files in prop::collection::vec(any::<(u16, u32)>(), 0..60)) {
            let logs: Vec<LogFile, 60> = files.iter().map(|(number, bytes)| undated(*number, *bytes)).collect();
            let mut listed = std::vec::Vec::new();
            loop {
                let part = list(Directory::Logs, Listed::Sizes, listed.len() as u32, &logs);
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
