//! Restarts the vehicle when a ground station asks for it.

use embassy_time::{Duration, Timer};

use super::{Shared, now};
use crate::log::info;
use crate::vehicle::Restart;

/// Time-out of the answers to be sent and the values to be saved before a restart.
const SAVE_TIMEOUT: Duration = Duration::from_secs(3);

const LOOK_INTERVAL: Duration = Duration::from_millis(20);

/// After the last message was given to the wire: what its buffers may still hold at 9600 baud.
const WIRE_DELAY: Duration = Duration::from_millis(250);

/// Waits until a restart is asked for, and then until what was answered and set before has been sent and saved. Returns
/// what to restart into. `all_sent` returns whether the links are idle.
pub async fn reboot_requested(shared: &Shared, all_sent: impl Fn() -> bool) -> Restart {
    shared.to_reboot.wait().await;
    shared.with(|autopilot| autopilot.prepare_restart(now()));
    let deadline = now().after_us(SAVE_TIMEOUT.as_micros());
    while (shared.with(|autopilot| autopilot.has_unsaved()) || !all_sent()) && now() < deadline {
        Timer::after(LOOK_INTERVAL).await;
    }
    Timer::after(WIRE_DELAY).await;
    let restart = shared.with(|autopilot| autopilot.vehicle().pending_restart());
    let restart = restart.unwrap_or_default();
    info!("restarting: {:?}", restart);
    restart
}
