//! Output of the simulator: lines, or on a terminal one status line that is updated in place below all others.

use std::fmt;
use std::io::{self, IsTerminal, Stdout, Write};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use embassy_time::Instant;
use rover_battmon::log;
use rover_battmon::mavlink::dialect::MavSeverity;

/// The terminal, once [`use_terminal`] has found one.
static SCREEN: Mutex<Option<Screen<Stdout>>> = Mutex::new(None);

/// Whether standard output could not be written to.
static IS_CLOSED: AtomicBool = AtomicBool::new(false);

/// Urgency of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// In the terminal's own colour.
    Info,
    /// Yellow.
    Warning,
    /// Red.
    Critical,
}

impl From<MavSeverity> for Level {
    fn from(severity: MavSeverity) -> Self {
        match severity {
            MavSeverity::MAV_SEVERITY_EMERGENCY
            | MavSeverity::MAV_SEVERITY_ALERT
            | MavSeverity::MAV_SEVERITY_CRITICAL
            | MavSeverity::MAV_SEVERITY_ERROR => Self::Critical,
            MavSeverity::MAV_SEVERITY_WARNING => Self::Warning,
            MavSeverity::MAV_SEVERITY_NOTICE
            | MavSeverity::MAV_SEVERITY_INFO
            | MavSeverity::MAV_SEVERITY_DEBUG => Self::Info,
        }
    }
}

/// Output for lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// To a terminal, with a status line that is updated in place.
    Terminal,
    /// To a file or another program, line by line.
    Lines,
}

/// Updates the status line in place from now on, if standard output is a terminal.
///
/// The log's warnings are then printed above it, and the rest of the log is not, unless standard error goes elsewhere.
pub fn use_terminal() -> Output {
    let is_dumb = std::env::var_os("TERM").is_some_and(|name| name == "dumb");
    if is_dumb || !io::stdout().is_terminal() {
        log::set_printer(print_whole_log);
        return Output::Lines;
    }
    // By no-color.org: present and not empty.
    let has_colours = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    with_screen(|screen| *screen = Some(Screen::new(io::stdout(), has_colours)));
    if io::stderr().is_terminal() {
        print_only_warnings();
    } else {
        log::set_printer(print_whole_log);
    }
    Output::Terminal
}

/// Prints the log's warnings only, if it is called before [`use_terminal`].
pub fn print_only_warnings() {
    log::set_printer(print_warnings);
}

/// Whether the reader of standard output has gone, as `head` does.
pub fn is_closed() -> bool {
    IS_CLOSED.load(Ordering::Relaxed)
}

/// Prints a line that may come at any time. On a terminal the simulated time stands before it.
pub fn print_line(line: &str) {
    print_above(Level::Info, line, || print_plain(format_args!("{line}")));
}

/// Prints something that has happened, with the simulated time before it.
pub fn print_event(level: Level, text: &str) {
    print_above(level, text, || {
        print_plain(format_args!("{}  {text}", simulated_time()))
    });
}

/// Prints the present status.
pub fn print_status(level: Level, status: &str) {
    with_screen(|screen| match screen {
        Some(screen) => screen.update(level, status),
        None => print_plain(format_args!("{status}")),
    });
}

/// Leaves the status line where it is: what follows is printed below it.
pub fn end() {
    with_screen(|screen| {
        if let Some(mut screen) = screen.take() {
            screen.end();
        }
    });
}

/// Prints a line on standard output. Unlike `println!` it does not panic when the output is closed.
pub fn print_plain(line: fmt::Arguments<'_>) {
    if writeln!(io::stdout(), "{line}").is_err() {
        IS_CLOSED.store(true, Ordering::Relaxed);
    }
}

/// Prints a line on standard error, if it is open.
pub fn print_error(line: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{line}");
}

fn print_whole_log(level: log::Level, line: fmt::Arguments<'_>) {
    print_error(format_args!("{level} {line}"));
}

fn print_warnings(level: log::Level, line: fmt::Arguments<'_>) {
    if level == log::Level::Warning {
        print_above(Level::Warning, &line.to_string(), || print_whole_log(level, line));
    }
}

fn print_above(level: Level, text: &str, print_plain: impl FnOnce()) {
    with_screen(|screen| match screen {
        Some(screen) => screen.print_above(level, &format!("{}  {text}", simulated_time())),
        None => print_plain(),
    });
}

fn with_screen<R>(use_it: impl FnOnce(&mut Option<Screen<Stdout>>) -> R) -> R {
    // A panic while printing leaves nothing half done that matters.
    use_it(&mut SCREEN.lock().unwrap_or_else(|poisoned| poisoned.into_inner()))
}

/// Simulated time since the start, in minutes and seconds.
pub fn simulated_time() -> String {
    minutes_and_seconds(Instant::now().as_secs())
}

fn minutes_and_seconds(seconds: u64) -> String {
    format!("{}:{:02}", seconds / 60, seconds % 60)
}

/// A terminal with the status in its last line.
struct Screen<W> {
    terminal: W,
    /// Whether levels have colours.
    has_colours: bool,
    status: Option<(Level, String)>,
}

/// To the start of the line, and erase it.
const ERASE_LINE: &str = "\r\x1b[K";

/// A line that is too long for the terminal is cut off: if it continued in the next one, it could not be erased.
const NO_WRAP: &str = "\x1b[?7l";
const WRAP: &str = "\x1b[?7h";

impl<W: Write> Screen<W> {
    fn new(terminal: W, has_colours: bool) -> Self {
        Self {
            terminal,
            has_colours,
            status: None,
        }
    }

    fn update(&mut self, level: Level, status: &str) {
        self.status = Some((level, status.to_owned()));
        self.draw("");
    }

    fn print_above(&mut self, level: Level, line: &str) {
        let line = format!("{}\r\n", self.coloured(level, line));
        self.draw(&line);
    }

    fn end(&mut self) {
        if self.status.take().is_some() {
            // A terminal that has gone can't be written to, and need not be.
            let _ = self.terminal.write_all(b"\r\n");
            let _ = self.terminal.flush();
        }
    }

    /// Draws `above` in the place of the status, and the status below it.
    fn draw(&mut self, above: &str) {
        let status = self
            .status
            .as_ref()
            .map(|(level, status)| self.coloured(*level, status))
            .unwrap_or_default();
        // At once: another program's output must not come in between.
        let drawn = format!("{ERASE_LINE}{above}{NO_WRAP}{status}{WRAP}");
        let _ = self.terminal.write_all(drawn.as_bytes());
        let _ = self.terminal.flush();
    }

    fn coloured(&self, level: Level, text: &str) -> String {
        match level {
            Level::Warning if self.has_colours => format!("\x1b[33m{text}\x1b[0m"),
            Level::Critical if self.has_colours => format!("\x1b[31m{text}\x1b[0m"),
            _ => text.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Content of a terminal after `bytes`: understands what [`Screen`] uses, and nothing else.
    fn shown(bytes: &[u8]) -> Vec<String> {
        let text = std::str::from_utf8(bytes).unwrap();
        let mut lines = vec![String::new()];
        let mut rest = text;
        while let Some(character) = rest.chars().next() {
            if let Some(after) = rest.strip_prefix(ERASE_LINE) {
                lines.last_mut().unwrap().clear();
                rest = after;
            } else if let Some(after) = rest.strip_prefix("\r\n") {
                lines.push(String::new());
                rest = after;
            } else if let Some(sequence) = rest.strip_prefix("\x1b[") {
                let end = sequence.find(['m', 'l', 'h']).unwrap();
                rest = &sequence[end + 1..];
            } else {
                lines.last_mut().unwrap().push(character);
                rest = &rest[character.len_utf8()..];
            }
        }
        lines
    }

    fn drawn(has_colours: bool, draw: impl FnOnce(&mut Screen<Vec<u8>>)) -> Vec<u8> {
        let mut screen = Screen::new(Vec::new(), has_colours);
        draw(&mut screen);
        screen.terminal
    }

    #[test]
    fn the_status_stays_below_what_is_printed() {
        let bytes = drawn(true, |screen| {
            screen.print_above(Level::Info, "0:00  before");
            screen.update(Level::Info, "pack 12.60 V");
            screen.print_above(Level::Warning, "0:01  Battery 1 low");
            screen.update(Level::Critical, "pack 9.9 V");
            screen.end();
        });
        assert_eq!(
            shown(&bytes),
            ["0:00  before", "0:01  Battery 1 low", "pack 9.9 V", ""]
        );
    }

    #[test]
    fn only_warnings_and_worse_are_coloured_and_none_without_colours() {
        let lines = |has_colours| {
            drawn(has_colours, |screen| {
                screen.print_above(Level::Info, "plain");
                screen.print_above(Level::Warning, "yellow");
                screen.update(Level::Critical, "red");
            })
        };
        let coloured = String::from_utf8(lines(true)).unwrap();
        assert!(coloured.contains("\x1b[33myellow\x1b[0m\r\n"), "{coloured:?}");
        assert!(coloured.contains("\x1b[31mred\x1b[0m"), "{coloured:?}");
        assert!(!coloured.contains("mplain"), "{coloured:?}");
        let plain = String::from_utf8(lines(false)).unwrap();
        assert!(!plain.contains('m'), "{plain:?}");
        assert_eq!(shown(plain.as_bytes()), shown(coloured.as_bytes()));
    }

    #[test]
    fn time_is_in_minutes_and_seconds() {
        let shown = [0, 59, 60, 605, 6000].map(minutes_and_seconds);
        assert_eq!(shown, ["0:00", "0:59", "1:00", "10:05", "100:00"]);
    }

    proptest! {
        #[test]
        fn no_line_is_torn(lines in prop::collection::vec(("[a-z ±%]{0,100}", any::<bool>()), 0..40)) {
            let bytes = drawn(true, |screen| {
                for (line, is_status) in &lines {
                    match is_status {
                        true => screen.update(Level::Warning, line),
                        false => screen.print_above(Level::Critical, line),
                    }
                }
            });
            let (statuses, above): (Vec<_>, Vec<_>) = lines.into_iter().partition(|(_, is_status)| *is_status);
            let status = statuses.last().map(|(line, _)| line.clone()).unwrap_or_default();
            let expected: Vec<_> = above.into_iter().map(|(line, _)| line).chain([status]).collect();
            prop_assert_eq!(shown(&bytes), expected);
        }
    }
}
