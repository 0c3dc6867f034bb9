//! Feeds the watchdog while every task is alive.

use embassy_futures::select::select;
use embassy_time::{Duration, Ticker};

use super::clock::now_us;
use super::{CheckIn, Shared, first_overdue};
use crate::log::warn;
use crate::vehicle::ArmState;

/// Several looks within any watchdog's time-out.
const LOOK_INTERVAL: Duration = Duration::from_millis(100);

/// Something that resets the board unless it is fed in time.
pub trait Watchdog {
    /// Puts the reset off by the time-out of a vehicle in this state.
    fn feed(&mut self, arm_state: ArmState);

    /// The reset will come because this task is overdue, unless it is seen again and the feeding goes on.
    fn starve(&mut self, overdue: &str);
}

/// Feeds `watchdog` while none of `tasks` is overdue, and at once when the vehicle is armed or disarmed. A task that is overdue gets
/// named, and the feeding stops.
pub async fn supervise(shared: &Shared, tasks: &[&CheckIn], watchdog: &mut impl Watchdog) -> ! {
    let mut looks = Ticker::every(LOOK_INTERVAL);
    // The start may have taken longer than a task has.
    tasks.iter().for_each(|task| task.mark(now_us()));
    loop {
        let arm_state = shared.with(|autopilot| autopilot.vehicle().arm_state());
        match first_overdue(tasks, arm_state, now_us()) {
            None => {
                watchdog.feed(arm_state);
                shared.with(|autopilot| autopilot.watched(arm_state));
            }
            Some(task) => {
                warn!("task {} is overdue, not feeding the watchdog", task.name());
                watchdog.starve(task.name());
            }
        }
        select(looks.next(), shared.to_feed_watchdog.wait()).await;
    }
}
