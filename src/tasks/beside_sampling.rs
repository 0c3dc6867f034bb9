//! Defers other work while the packs are sampled.

use core::future::{Future, poll_fn};
use core::pin::Pin;
use core::task::{Context, Poll};

use embassy_time::Timer;

use super::{Shared, now, timer_at};
use crate::time::Instant;

/// Does `work`, but for the moments just before the packs are sampled: what it does without a pause takes longer than a sample
/// may be late.
// By reference: a future that is handed over by value takes its memory twice.
pub async fn beside_sampling<F: Future>(mut work: Pin<&mut F>, shared: &Shared) -> F::Output {
    poll_fn(|context| match shared.sampling_pause(now()) {
        Some(end) => {
            wake_at(end, context);
            Poll::Pending
        }
        None => work.as_mut().poll(context),
    })
    .await
}

fn wake_at(time: Instant, context: &mut Context<'_>) {
    let mut timer: Timer = timer_at(time);
    if Pin::new(&mut timer).poll(context).is_ready() {
        context.waker().wake_by_ref();
    }
}
