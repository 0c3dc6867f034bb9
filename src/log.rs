//! Logging macros: defmt on the board, standard error on the host, unless a program prints them itself.
//!
//! defmt's macros need its linker script, which a host build lacks. Arguments must be printable by both: `Debug` on the
//! host, `defmt::Format` on the target.

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

    /// Urgency of a line of the log.
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
