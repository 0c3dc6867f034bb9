//! Logging macros: defmt on the board, standard error on the host.
//!
//! defmt's macros need its linker script, which a host build lacks. Arguments must be printable by both: `Debug` on the
//! host, `defmt::Format` on the target.

#[cfg(target_os = "none")]
pub(crate) use defmt::{info, warn};

#[cfg(not(target_os = "none"))]
macro_rules! info {
    ($($argument:tt)*) => { ::std::eprintln!("INFO  {}", ::std::format_args!($($argument)*)) };
}

#[cfg(not(target_os = "none"))]
macro_rules! warning {
    ($($argument:tt)*) => { ::std::eprintln!("WARN  {}", ::std::format_args!($($argument)*)) };
}

// `warn` is also a built-in attribute, so the macro is defined under another name.
#[cfg(not(target_os = "none"))]
pub(crate) use {info, warning as warn};
