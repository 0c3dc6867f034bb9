//! Writes the messages of one link to its wire.

use embassy_futures::yield_now;
use embedded_io_async::Write;

use super::link::LogReading;
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
        match next_frame(&mut framer, shared, link) {
            Ok(frame) => wire.write_all(frame).await?,
            Err(LogReading::Read) => yield_now().await,
            Err(LogReading::NothingToRead) => {
                wire.flush().await?;
                link.to_write.wait().await;
            }
        }
        mark(check_in);
    }
}

/// The frame of the message that leaves next. If there is none, whether a part of one was read.
// Not inlined: there is a writer for each kind of wire.
#[inline(never)]
fn next_frame<'a>(framer: &'a mut Framer, shared: &Shared, link: &Link<'_>) -> Result<&'a [u8], LogReading> {
    let reading = link.read_log(shared);
    let frame = link.serve(shared, |autopilot, endpoint| {
        autopilot.next_frame(endpoint, framer, now())
    });
    frame.ok_or(reading)
}
