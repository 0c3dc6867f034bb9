//! Reports a crash after the restart.

use core::ops::Range;

use embassy_time::{Duration, Timer};

use super::Shared;
use crate::autopilot::CrashLine;
use crate::crash::{CrashRecord, call_sites_text, headline};

/// Longer than a crash report takes to leave at 9600 baud, behind everything else that may wait.
const UNTIL_SENT: Duration = Duration::from_secs(2);

/// Reports a crash to ground stations as soon as one is heard. Without one, or with a reset before that, the record
/// stays for the next start. `code` is the address range of the program; `forget` is called once the report was sent.
pub async fn report_crash(crash: &CrashRecord, code: Range<u32>, forget: impl FnOnce(), shared: &Shared) {
    shared.ground_station_heard.wait().await;
    shared.announce(&CrashLine(&headline(crash)));
    if let Some(calls) = call_sites_text(crash, code) {
        shared.announce(&CrashLine(&calls));
    }
    Timer::after(UNTIL_SENT).await;
    forget();
}
