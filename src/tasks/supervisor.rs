//! Feeds the watchdog while every task is alive.

use embassy_time::{Duration, Ticker};

use super::clock::now_us;
use super::{CheckIn, first_overdue};
use crate::log::warn;

/// Several looks within any watchdog's time-out.
const LOOK_INTERVAL: Duration = Duration::from_millis(100);

/// Something that resets the board unless it is fed in time.
pub trait Watchdog {
    /// Puts the reset off by one time-out.
    fn feed(&mut self);

    /// The reset will come because this task is overdue, unless it is seen again and the feeding goes on.
    fn starve(&mut self, overdue: &str);
}

/// Feeds `watchdog` while none of `tasks` is overdue. One that is gets named, and the feeding stops.
pub async fn supervise(tasks: &[&CheckIn], watchdog: &mut impl Watchdog) -> ! {
    let mut looks = Ticker::every(LOOK_INTERVAL);
    loop {
        match first_overdue(tasks, now_us()) {
            None => watchdog.feed(),
            Some(task) => {
                warn!("task {} is overdue, not feeding the watchdog", task.name());
                watchdog.starve(task.name());
            }
        }
        looks.next().await;
    }
}
