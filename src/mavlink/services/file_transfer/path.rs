//! The paths of files.

/// The packed parameters, where ArduPilot has them.
const PARAMETERS: &str = "@PARAM/param.pck";

/// ArduPilot's directory on a memory card; ground stations ask for the logs in there.
const CARD_DIRECTORY: &str = "APM";

pub(super) const LOG_DIRECTORY: &str = "LOGS";

/// The digits of a log file's name.
const DIGITS: usize = 8;

const EXTENSION: &str = "BIN";

/// What a path leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Path {
    Directory(Directory),
    /// The log file with this number, if there is one.
    Log(u16),
    Parameters(Selection),
}

/// A directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Directory {
    Root,
    Logs,
}

/// What is wanted of the packed parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Selection {
    /// The index of the first one.
    pub start: u16,
    /// How many; `None` for all.
    pub count: Option<u16>,
    pub defaults: Defaults,
}

/// Whether a parameter's default follows its value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Defaults {
    #[default]
    Without,
    With,
}

impl Path {
    /// What `path` leads to, if anything.
    pub fn parse(path: &str) -> Option<Self> {
        if let Some(query) = path.strip_prefix(PARAMETERS) {
            return Selection::parse(query).map(Self::Parameters);
        }
        let mut names = path.split('/').filter(|name| !name.is_empty()).peekable();
        if names.peek() == Some(&CARD_DIRECTORY) {
            names.next();
        }
        let Some(directory) = names.next() else {
            return Some(Self::Directory(Directory::Root));
        };
        if directory != LOG_DIRECTORY {
            return None;
        }
        match (names.next(), names.next()) {
            (None, _) => Some(Self::Directory(Directory::Logs)),
            (Some(name), None) => log_number(name).map(Self::Log),
            _ => None,
        }
    }
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
                Some(("withdefaults", "1")) => selection.defaults = Defaults::With,
                _ => {}
            }
        }
        Some(selection)
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
            ("/APM/APM/LOGS", None),
        ] {
            assert_eq!(Path::parse(path), expected, "{path}");
        }
    }

    #[test]
    fn parameters_are_selected_by_arguments() {
        let all = Selection::default();
        let with_defaults = Selection {
            defaults: Defaults::With,
            ..all
        };
        let some = Selection {
            start: 10,
            count: Some(5),
            defaults: Defaults::With,
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

    proptest! {
        #[test]
        fn any_path_is_parsed(path in "\\PC*", query in "[?&=a-z0-9]{0,40}") {
            Path::parse(&path);
            Path::parse(&format!("@PARAM/param.pck{query}"));
        }
    }
}
