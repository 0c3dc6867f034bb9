//! Logging macros: defmt on the board, standard error on the host, unless a program prints them itself.
//!
//! defmt's macros need its linker script, which a host build lacks. Arguments must be printable by both: `Debug` on the
//! host, `defmt::Format` on the target.

use core::cell::Cell;

use crate::time::Instant;

#[cfg(target_os = "none")]
pub(crate) use defmt::{info, warn};

#[cfg(not(target_os = "none"))]
pub(crate) use host::print;
#[cfg(not(target_os = "none"))]
pub use host::{Level, Printer, set_printer};

#[cfg(not(target_os = "none"))]
mod host {
    use std::fmt;
    use std::sync::OnceLock;

    /// How urgent a line of the log is.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Level {
        /// For the record.
        Info,
        /// Something is wrong.
        Warning,
    }

    impl fmt::Display for Level {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str(match self {
                Self::Info => "INFO ",
                Self::Warning => "WARN ",
            })
        }
    }

    /// Prints a line of the log.
    pub type Printer = fn(Level, fmt::Arguments<'_>);

    static PRINTER: OnceLock<Printer> = OnceLock::new();

    /// Has all further lines printed by `printer`, unless there is one already.
    pub fn set_printer(printer: Printer) {
        let _ = PRINTER.set(printer);
    }

    /// Prints a line, on standard error unless there is a printer.
    pub(crate) fn print(level: Level, line: fmt::Arguments<'_>) {
        match PRINTER.get() {
            Some(printer) => printer(level, line),
            None => eprintln!("{level} {line}"),
        }
    }
}

#[cfg(not(target_os = "none"))]
macro_rules! info {
    ($($argument:tt)*) => { $crate::log::print($crate::log::Level::Info, ::std::format_args!($($argument)*)) };
}

#[cfg(not(target_os = "none"))]
macro_rules! warning {
    ($($argument:tt)*) => { $crate::log::print($crate::log::Level::Warning, ::std::format_args!($($argument)*)) };
}

// `warn` is also a built-in attribute, so the macro is defined under another name.
#[cfg(not(target_os = "none"))]
pub(crate) use {info, warning as warn};

/// Allows one log line per `INTERVAL_US` about something that may happen many times a second.
#[derive(Debug)]
pub(crate) struct LogLimit<const INTERVAL_US: u64> {
    last: Cell<Option<Instant>>,
}

impl<const INTERVAL_US: u64> LogLimit<INTERVAL_US> {
    /// Nothing was logged yet.
    pub const fn new() -> Self {
        Self {
            last: Cell::new(None),
        }
    }

    /// Whether a line may be logged at `now`; then it counts as logged.
    pub fn allows(&self, now: Instant) -> bool {
        let is_due = self
            .last
            .get()
            .is_none_or(|last| now.us_since(last) >= INTERVAL_US);
        if is_due {
            self.last.set(Some(now));
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    #[test]
    fn one_line_is_logged_per_interval() {
        let limit = LogLimit::<1_000_000>::new();
        assert!(limit.allows(Instant::EPOCH));
        assert!(!limit.allows(at_us(999_999)));
        assert!(limit.allows(at_us(1_000_000)));
        assert!(!limit.allows(at_us(1_000_000)));
    }
}
