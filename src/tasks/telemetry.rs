//! Posts the messages of one link when they are due.

use embassy_time::{Instant, Timer};

use super::{Link, Shared, mark};
use crate::liveness::CheckIn;
use crate::mavlink::StreamScheduler;
use crate::parameter::ParameterId;

/// Builds each stream of `link` from the state at its due time and posts it; sleeps in between.
pub async fn schedule_telemetry(shared: &Shared, link: &Link, check_in: &CheckIn) -> ! {
    let mut scheduler = StreamScheduler::new(Instant::now().as_micros());
    loop {
        let now_us = Instant::now().as_micros();
        scheduler.set_extra1_rate(shared.parameter(ParameterId::Sr0Extra1), now_us);
        while let Some(stream) = scheduler.poll(now_us) {
            link.post(stream.build(&shared.system_state(link)));
        }
        mark(check_in);
        Timer::at(Instant::from_micros(scheduler.next_due_us())).await;
    }
}
