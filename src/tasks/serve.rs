//! A link that comes and goes with the program at its other end.

use embassy_futures::select::{select, select3};
use embassy_futures::yield_now;
use embedded_io_async::Write;

use super::{ByteSource, CheckIn, Link, Shared, read_frames, schedule_telemetry, write_frames};
use crate::announce::Severity;

/// Schedules, writes and reads `link` until the wire is closed or fails in either direction.
pub async fn serve_link(
    transmitter: impl Write,
    receiver: impl ByteSource,
    shared: &Shared,
    link: &Link<'_>,
    check_in: &CheckIn,
) {
    select3(
        schedule_telemetry(shared, link, check_in),
        write_frames(transmitter, shared, link, check_in),
        read_frames(receiver, shared, link, check_in),
    )
    .await;
}

/// Says on a link that has just been opened why it is not served, and nothing else. Nothing is read from it.
pub async fn refuse_link(
    transmitter: impl Write,
    shared: &Shared,
    link: &Link<'_>,
    reason: &str,
    check_in: &CheckIn,
) {
    link.with(|endpoint| endpoint.say(Severity::Error, reason));
    let taken = async {
        while !link.is_idle() {
            yield_now().await;
        }
    };
    // Frames that were taken have been written: a new link has room for so little.
    select(write_frames(transmitter, shared, link, check_in), taken).await;
}
