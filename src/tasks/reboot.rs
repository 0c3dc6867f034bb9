//! Restarts the vehicle when a ground station asks for it.

use embassy_time::{Duration, Instant, Timer};

use super::Shared;
use crate::log::info;
use crate::mavlink::SigningTrouble;
use crate::mavlink::dialect::MavSeverity;
use crate::parameter::Parameters;

/// What was answered and set before a restart gets this long to be sent and saved.
const PATIENCE: Duration = Duration::from_secs(3);

const LOOK_INTERVAL: Duration = Duration::from_millis(20);

/// After the last message was given to the wire: what its buffers may still hold at 9600 baud.
const WIRE_DELAY: Duration = Duration::from_millis(250);

/// Waits until a restart is asked for, and then until what was answered and set before has been sent and saved.
/// `all_sent` returns whether the links are idle.
pub async fn reboot_requested(shared: &Shared, all_sent: impl Fn() -> bool) {
    shared.to_reboot.wait().await;
    // What could not be saved has a last chance.
    shared.with_parameters(Parameters::retry_failed);
    shared.to_save.signal(());
    // The last moment at which it matters.
    if shared.with_signing(|signing| signing.trouble()) == Some(SigningTrouble::NotSaved) {
        shared.announce(
            MavSeverity::MAV_SEVERITY_CRITICAL,
            SigningTrouble::NotSaved.text(),
        );
    }
    let deadline = Instant::now() + PATIENCE;
    while (shared.has_unsaved() || !all_sent()) && Instant::now() < deadline {
        Timer::after(LOOK_INTERVAL).await;
    }
    Timer::after(WIRE_DELAY).await;
    info!("restarting");
}
