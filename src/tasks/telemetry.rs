//! Posts the messages of one link when they are due.

use core::future::pending;

use embassy_futures::select::select3;
use embassy_time::{Instant, Timer};

use super::shared::AnnouncementReceiver;
use super::{Link, Shared, mark};
use crate::liveness::CheckIn;

/// Posts each stream of `link` at its due time, and what is announced; sleeps in between.
pub async fn schedule_telemetry(shared: &Shared, link: &Link, check_in: &CheckIn) -> ! {
    let mut announcements = shared.announcements();
    link.serve(shared, |autopilot, channel| autopilot.open(channel));
    loop {
        let now_us = Instant::now().as_micros();
        link.serve(shared, |autopilot, channel| autopilot.post_due(channel, now_us));
        link.to_write.signal(());
        mark(check_in);
        let next_due_us = link.with(|channel| channel.next_due_us());
        select3(
            Timer::at(Instant::from_micros(next_due_us)),
            link.to_schedule.wait(),
            announced(&mut announcements),
        )
        .await;
    }
}

async fn announced(announcements: &mut Option<AnnouncementReceiver<'_>>) {
    match announcements {
        Some(announcements) => announcements.changed().await,
        None => pending().await,
    }
}
