//! A link that comes and goes with whoever is at its other end.

use embassy_futures::select::select3;
use embedded_io_async::Write;

use super::{ByteSource, Link, Shared, read_frames, schedule_telemetry, write_frames};
use crate::liveness::CheckIn;

/// Schedules, writes and reads `link` until the wire is closed or fails in either direction.
pub async fn serve_link(
    transmitter: impl Write,
    receiver: impl ByteSource,
    shared: &Shared,
    link: &Link,
    check_in: &CheckIn,
) {
    select3(
        schedule_telemetry(shared, link, check_in),
        write_frames(transmitter, shared, link, check_in),
        read_frames(receiver, shared, link, check_in),
    )
    .await;
}
