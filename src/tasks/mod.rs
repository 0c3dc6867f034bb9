//! Thin loops around the core: wait, call it, publish.
//!
//! They are plain generic `async fn`s, the same ones on the board and in the simulator. Each binary wraps them in
//! `#[embassy_executor::task]`s of one line, since tasks can't be generic.

mod announcements;
mod battery;
mod bus;
mod drive;
mod link;
mod reader;
mod reboot;
mod serve;
mod shared;
mod status;
mod storage;
mod supervisor;
mod telemetry;
mod writer;

use embassy_time::Instant;

pub use announcements::ANNOUNCEMENT_BYTES;
pub use battery::sample_batteries;
pub use bus::read_bus;
pub use drive::drive;
pub use link::Link;
pub use reader::{ByteSource, ReceiveError, read_frames};
pub use reboot::reboot_requested;
pub use serve::serve_link;
pub use shared::Shared;
pub use status::{IdleTime, report_status};
pub use storage::{keep_parameters, load_parameters, report_load};
pub use supervisor::{Watchdog, supervise};
pub use telemetry::schedule_telemetry;
pub use writer::write_frames;

use crate::liveness::CheckIn;

/// The task behind `check_in` is alive now.
fn mark(check_in: &CheckIn) {
    // Liveness counts modulo 2^32 on purpose.
    check_in.mark(Instant::now().as_millis() as u32);
}
