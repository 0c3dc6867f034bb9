//! Reports a crash after the restart.

use core::ops::Range;

use embassy_time::{Duration, Timer};

use super::Shared;
use crate::crash::{CrashRecord, call_sites_text, headline};
use crate::mavlink::dialect::MavSeverity;

/// Longer than what is said about a crash takes to leave at 9600 baud, behind everything else that may wait.
const UNTIL_SENT: Duration = Duration::from_secs(2);

/// Where a crash is written down.
pub trait CrashMemory {
    /// The crash was reported to a ground station.
    fn forget(&mut self);
}

/// Reports a crash to ground stations as soon as one is heard. Without one, or with a reset before that, the record
/// stays for the next start. `code` is where the program lies.
pub async fn report_crash(
    crash: &CrashRecord,
    code: Range<u32>,
    memory: &mut impl CrashMemory,
    shared: &Shared,
) {
    shared.ground_station_heard.wait().await;
    shared.announce(MavSeverity::MAV_SEVERITY_CRITICAL, &headline(crash));
    if let Some(calls) = call_sites_text(crash, code) {
        shared.announce(MavSeverity::MAV_SEVERITY_CRITICAL, &calls);
    }
    Timer::after(UNTIL_SENT).await;
    memory.forget();
}
