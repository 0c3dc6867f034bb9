//! One set of logging macros: defmt on the board, standard error on a desk.
//!
//! A host build can't use defmt's own macros (they need its linker script), so the same call sites go to `eprintln!`
//! there. Arguments must therefore be printable by both; enums derive `Debug`, and `defmt::Format` on the target.

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

// `warn` is also the name of a built-in attribute, so the macro needs another name where it is defined.
#[cfg(not(target_os = "none"))]
pub(crate) use {info, warning as warn};
