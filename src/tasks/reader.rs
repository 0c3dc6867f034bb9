//! Reads one link and handles what ground stations ask for.

use core::future::poll_fn;
use core::pin::pin;
use core::task::Poll;

use embassy_futures::yield_now;
use embassy_time::{Duration, with_timeout};

use super::{CheckIn, Link, Shared, mark, now};
use crate::log::warn;
use crate::time::Instant;

/// Bytes handled in one go.
const CHUNK_BYTES: usize = 64;

/// A sender that has been silent for this long will not complete the frame it began. Radios that send in slots split frames by
/// less.
const PAUSE: Duration = Duration::from_millis(250);

/// By how much a wait for [`PAUSE`] is exceeded at most while the task gets its turns: the others' longest step.
const LONGEST_STEP: Duration = Duration::from_millis(50);

/// Why nothing was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ReceiveError {
    /// The line was noisy, or bytes came faster than the port took them: some are wrong or missing. More can be received.
    LineError,
    /// This many bytes were not taken in time, and are lost. More can be received.
    BytesLost(u32),
    /// The other end is gone.
    Closed,
}

/// Something bytes come from.
pub trait ByteSource {
    /// Waits for bytes and puts them into `buffer`; says how many. 0 if all that came concerns the wire only.
    ///
    /// # Errors
    /// Bytes were lost, or there will be no more.
    // The futures stay on one executor, so `Send` need not be promised.
    #[allow(async_fn_in_trait)]
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError>;
}

/// Handles what `source` delivers until it is closed.
pub async fn read_frames(mut source: impl ByteSource, shared: &Shared, link: &Link<'_>, check_in: &CheckIn) {
    let mut earliest = Instant::EPOCH;
    let mut chunk = [0; CHUNK_BYTES];
    loop {
        match receive(&mut source, &mut chunk, &mut earliest).await {
            Some(Ok(received)) => {
                let bytes = chunk.get(..received).unwrap_or(&chunk);
                handle(bytes, earliest, shared, link).await;
            }
            Some(Err(ReceiveError::Closed)) => return,
            Some(Err(error)) => note(error, link),
            None => {
                link.with(|endpoint| endpoint.give_up_waiting());
                handle(&[], earliest, shared, link).await;
            }
        }
        mark(check_in);
        // A sender that never pauses must leave the others their turn.
        yield_now().await;
    }
}

/// Counts and logs lost bytes.
// Not inlined, like `handle_next`: there is a reader for each kind of wire.
#[inline(never)]
fn note(error: ReceiveError, link: &Link<'_>) {
    link.with(|endpoint| endpoint.count_overrun());
    match error {
        ReceiveError::LineError => warn!("{}: line error", link.name()),
        ReceiveError::BytesLost(bytes) => warn!("{}: {} received bytes were lost", link.name(), bytes),
        ReceiveError::Closed => {}
    }
}

/// Waits for bytes, for [`PAUSE`] at most.
///
/// `earliest` becomes the lower bound of their arrival time, but for the few milliseconds between two looks at a ring. A source
/// that always has bytes ready may have held them back, and so may one that was not asked for a while. What it holds at first
/// may be as old as the board's start.
async fn receive(
    source: &mut impl ByteSource,
    chunk: &mut [u8],
    earliest: &mut Instant,
) -> Option<Result<usize, ReceiveError>> {
    let mut receive = pin!(source.receive(chunk));
    // With the task's own waker: a source may wait for a timer, which takes no other.
    let first_poll = poll_fn(|context| Poll::Ready(receive.as_mut().poll(context))).await;
    if let Poll::Ready(received) = first_poll {
        return Some(received);
    }
    // It is empty, so what comes next has not come yet.
    let empty_at = now();
    let received = with_timeout(PAUSE, receive).await.ok();
    *earliest = earliest_after_wait(empty_at, now());
    received
}

/// Lower bound of the arrival time of bytes that ended a wait for them. Such a wait is no longer than [`PAUSE`]; what lies
/// beyond was a delay of this task, in which they may have come at any moment.
fn earliest_after_wait(began: Instant, ended: Instant) -> Instant {
    if ended.us_since(began) > (PAUSE + LONGEST_STEP).as_micros() {
        began
    } else {
        ended
    }
}

/// Handles all frames that end in `bytes`, which can't have come before `earliest`. After each the others have their turn:
/// what a fast line brings in a millisecond takes longer than a sample may be late.
async fn handle(mut bytes: &[u8], earliest: Instant, shared: &Shared, link: &Link<'_>) {
    loop {
        let taken = link.with(|endpoint| endpoint.push(bytes));
        bytes = bytes.get(taken..).unwrap_or(&[]);
        while handle_next(earliest, shared, link).is_some() {
            yield_now().await;
        }
        if bytes.is_empty() {
            return;
        }
    }
}

/// Handles the next frame, if there is one.
#[inline(never)]
fn handle_next(earliest: Instant, shared: &Shared, link: &Link<'_>) -> Option<()> {
    let event = link.serve(shared, |autopilot, endpoint| {
        autopilot.handle_next(endpoint, now(), earliest)
    })?;
    if event.concerns_link() {
        link.to_write.signal(());
        link.to_schedule.signal(());
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    #[test]
    // Requirement: L-1
    fn bytes_that_end_a_wait_came_now_unless_the_task_was_delayed() {
        let at = |ms: u64| at_us(ms * 1_000);
        for (ended_ms, earliest_ms) in [(1_000, 1_000), (1_300, 1_300), (1_301, 1_000), (9_000, 1_000)] {
            assert_eq!(earliest_after_wait(at(1_000), at(ended_ms)), at(earliest_ms));
        }
    }
}
