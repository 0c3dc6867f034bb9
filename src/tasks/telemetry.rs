//! Posts the messages of one link when they are due.

use core::future::pending;

use embassy_futures::select::select3;

use super::shared::AnnouncementReceiver;
use super::{CheckIn, Link, Shared, mark, now, timer_at};

/// A link while it is open: closed when this is dropped, however its tasks end.
struct OpenLink<'a> {
    shared: &'a Shared,
    link: &'a Link<'a>,
}

impl<'a> OpenLink<'a> {
    fn new(shared: &'a Shared, link: &'a Link<'a>) -> Self {
        link.serve(shared, |autopilot, endpoint| autopilot.open(endpoint));
        Self { shared, link }
    }
}

impl Drop for OpenLink<'_> {
    fn drop(&mut self) {
        self.link
            .serve(self.shared, |autopilot, endpoint| autopilot.close(endpoint));
    }
}

/// Opens `link`, posts each of its streams at its due time, and what is announced; sleeps in between.
pub async fn schedule_telemetry(shared: &Shared, link: &Link<'_>, check_in: &CheckIn) -> ! {
    let mut announcements = shared.announcements();
    let _open = OpenLink::new(shared, link);
    loop {
        link.serve(shared, |autopilot, endpoint| autopilot.post_due(endpoint, now()));
        link.to_write.signal(());
        mark(check_in);
        let next_due = link.with(|endpoint| endpoint.next_due());
        select3(
            timer_at(next_due),
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
