//! Crash records and marks of a drive retained over a restart, and detection of reset loops.
//!
//! A [`CrashRecord`] is written by the fault handler, or at the next start from the watchdog's scratch registers; it is
//! retained in RAM as words.

mod crashes_in_a_row;
mod interruption;
mod record;
mod text;

pub use crashes_in_a_row::{CrashesInARow, ParameterSource, StartKind};
pub use interruption::{DriveMark, Interruption, RunEnd, StartCause};
pub use record::{CrashCause, CrashRecord, CrashWords, FaultSite, STACK_WORDS, TaskName, TaskNameWords};
pub use text::{call_sites_text, headline};
