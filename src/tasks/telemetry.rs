//! Posts the messages of one link when they are due.

use core::future::{Future, pending};

use embassy_futures::select::{Either3, select3};
use embassy_sync::pubsub::WaitResult;
use embassy_time::{Instant, Timer};

use super::announcements::{ANNOUNCEMENT_BYTES, Announcement};
use super::{Link, Shared, mark};
use crate::liveness::CheckIn;
use crate::log::warn;

/// Posts each stream of `link` at its due time, and passes on what is announced; sleeps in between.
pub async fn schedule_telemetry(shared: &Shared, link: &Link, check_in: &CheckIn) -> ! {
    let mut announcements = shared.announcements();
    link.say_notices(shared);
    loop {
        post_due(shared, link);
        link.to_write.signal(());
        mark(check_in);
        let next_due_us = link.with(|endpoint| endpoint.next_due_us());
        // Without room they wait where they are until the next due time.
        let has_room = link.with(|endpoint| endpoint.has_room_to_say(ANNOUNCEMENT_BYTES));
        let woken = select3(
            Timer::at(Instant::from_micros(next_due_us)),
            link.to_schedule.wait(),
            only_if(has_room, announcements.next()),
        );
        if let Either3::Third(announced) = woken.await {
            say(announced, link);
        }
    }
}

fn post_due(shared: &Shared, link: &Link) {
    let now_us = Instant::now().as_micros();
    let dropped = shared.with_system_state(|state| {
        link.with(|endpoint| {
            shared.with_parameters(|parameters| endpoint.post_due(now_us, state, parameters))
        })
    });
    if let Some(stream) = dropped {
        link.report_drop(stream);
    }
}

async fn only_if<T>(condition: bool, future: impl Future<Output = T>) -> T {
    if condition { future.await } else { pending().await }
}

fn say(announced: WaitResult<Announcement>, link: &Link) {
    match announced {
        WaitResult::Message(announcement) => {
            link.with(|endpoint| endpoint.say(announcement.severity, &announcement.text));
        }
        WaitResult::Lagged(lost) => warn!("{}: busy, {} announcements were not said", link.name(), lost),
    }
}
