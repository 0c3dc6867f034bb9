//! Posts the messages of one link when they are due.

use embassy_futures::select::select;
use embassy_time::{Instant, Timer};

use super::{Link, Shared, mark};
use crate::liveness::CheckIn;

/// Builds each stream of `link` from the state at its due time and posts it; sleeps in between.
pub async fn schedule_telemetry(shared: &Shared, link: &Link, check_in: &CheckIn) -> ! {
    let mut notices_said = 0;
    loop {
        for (severity, text) in shared.notices().into_iter().skip(notices_said) {
            link.with(|endpoint| endpoint.say(severity, text));
            notices_said += 1;
        }
        let now_us = Instant::now().as_micros();
        let state = shared.system_state();
        let dropped = link.with(|endpoint| {
            shared.with_parameters(|parameters| endpoint.post_due(now_us, &state, parameters))
        });
        if let Some(stream) = dropped {
            link.report_drop(stream);
        }
        link.to_write.signal(());
        mark(check_in);
        let next_due_us = link.with(|endpoint| endpoint.next_due_us());
        select(
            Timer::at(Instant::from_micros(next_due_us)),
            link.to_schedule.wait(),
        )
        .await;
    }
}
