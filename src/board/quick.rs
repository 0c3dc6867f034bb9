//! Tasks that run from RAM.

use core::future::{Future, poll_fn};
use core::pin::{Pin, pin};
use core::task::{Context, Poll};

/// Does `work` from RAM, where memory.x places it: read line by line from flash it would take several times as long.
pub async fn run_from_ram<F: Future>(work: F) -> F::Output {
    let mut work = pin!(work);
    poll_fn(|context| poll_quickly(work.as_mut(), context)).await
}

#[inline(never)]
fn poll_quickly<F: Future>(future: Pin<&mut F>, context: &mut Context<'_>) -> Poll<F::Output> {
    future.poll(context)
}
