//! Checks a board over MAVLink, as any ground station could, and writes a report (host only).
//!
//! [`run()`] goes through the procedures: they listen, ask, set, restart and drive, and leave evidence. Each row of
//! [`CHECKS`] judges that evidence, without I/O and without a clock, and [`Report`] has the result. Bytes, time and
//! the owner's answers come through [`Port`] and [`Owner`], so that tests need no wall time.

mod checks;
mod elf;
mod evidence;
mod plan;
mod port;
mod procedures;
mod record;
mod report;
mod run;
mod session;

pub use checks::{CHECKS, Check, Outcome};
pub use elf::hash_of_elf;
pub use plan::{Calibrate, Multimeter, Part, Plan};
pub use port::{Answer, Owner, Port, PortClosed};
pub use report::{Report, Verdict};
pub use run::run;
