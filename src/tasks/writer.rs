//! Writes the messages of one link to its wire.

use embassy_futures::yield_now;
use embedded_io_async::Write;

use super::{CheckIn, Link, Shared, mark, now};
use crate::mavlink::Framer;

/// Takes messages out of the link's outbox as fast as `wire` takes their frames. Only this task ever waits for the wire,
/// which may collect frames until there is no other one.
///
/// # Errors
/// The wire failed and takes no more frames.
pub async fn write_frames<W: Write>(
    mut wire: W,
    shared: &Shared,
    link: &Link<'_>,
    check_in: &CheckIn,
) -> Result<(), W::Error> {
    let mut framer = Framer::starting_at(link.first_sequence);
    loop {
        let has_read = link.read_log(shared);
        if let Some(frame) = next_frame(&mut framer, shared, link) {
            wire.write_all(frame).await?;
        } else if has_read {
            yield_now().await;
        } else {
            wire.flush().await?;
            link.to_write.wait().await;
        }
        mark(check_in);
    }
}

/// The frame of the message that leaves next.
// Not inlined: there is a writer for each kind of wire.
#[inline(never)]
fn next_frame<'a>(framer: &'a mut Framer, shared: &Shared, link: &Link<'_>) -> Option<&'a [u8]> {
    link.serve(shared, |autopilot, endpoint| {
        autopilot.next_frame(endpoint, framer, now())
    })
}
