//! What is known of a crash when the board has started again, and of starts that follow each other too quickly.
//!
//! A [`CrashRecord`] is written by the fault handler, or at the next start from what the watchdog has left; it goes
//! through RAM as plain words.

mod quick_resets;
mod record;
mod task_name;
mod text;

pub use quick_resets::{ParameterSource, QuickResets, Start};
pub use record::{CrashCause, CrashRecord, CrashWords, FaultSite, STACK_WORDS};
pub use task_name::{TaskName, TaskNameWords};
pub use text::{call_sites_text, headline};
