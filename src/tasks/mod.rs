//! Thin loops around the core: wait, call it, publish.
//!
//! They are plain generic `async fn`s, the same ones on the board and in the simulator. Each binary wraps them in
//! `#[embassy_executor::task]`s of one line, since tasks can't be generic.

mod battery;
mod bus;
mod can;
mod clock;
mod drive;
mod flash;
mod link;
mod liveness;
mod program;
mod pulses;
mod reader;
mod reboot;
mod serial;
mod serve;
mod shared;
mod status;
mod supervisor;
mod telemetry;
mod wired_endpoint;
mod writer;

use embassy_time::{Duration, Timer};

pub use battery::sample_batteries;
pub use bus::read_bus;
pub use can::serve_can;
pub use clock::{now, timer_at};
pub use drive::drive;
pub use flash::{Storages, keep_flash};
pub use link::{Link, read_file};
pub use liveness::{CheckIn, first_overdue};
pub use program::hash_program;
pub use pulses::{SeenPulses, hand_over_pulses, watch_pulses};
pub use reader::{ByteSource, ReceiveError, read_frames};
pub use reboot::reboot_requested;
pub use serial::{SerialLine, serve_serial};
pub use serve::{refuse_link, serve_link};
pub use shared::Shared;
pub use status::report_status;
pub use supervisor::{Watchdog, supervise};
pub use telemetry::schedule_telemetry;
pub use wired_endpoint::WiredEndpoint;
pub use writer::write_frames;

use clock::now_us;

/// A task for which nothing comes shows twice a second that it is alive.
const LONGEST_SLEEP: Duration = Duration::from_millis(500);

/// There is nothing to do, and nothing is wrong with that.
async fn idle(check_in: &CheckIn) -> ! {
    loop {
        mark(check_in);
        Timer::after(LONGEST_SLEEP).await;
    }
}

/// The task behind `check_in` is alive now.
pub(crate) fn mark(check_in: &CheckIn) {
    check_in.mark(now_us());
}
