//! Writes the messages of one link to its wire.

use embassy_time::Instant;
use embedded_io_async::Write;

use super::{Link, Shared, mark};
use crate::liveness::CheckIn;
use crate::mavlink::Framer;
use crate::parameter::VehicleParameter;

/// Takes messages out of the link's outbox as fast as `wire` takes their frames. Only this task ever waits for the wire.
///
/// # Errors
/// The wire failed and takes no more frames.
pub async fn write_frames<W: Write>(
    mut wire: W,
    shared: &Shared,
    link: &Link,
    check_in: &CheckIn,
) -> Result<(), W::Error> {
    let mut framer = Framer::new();
    loop {
        let Some(frame) = next_frame(&mut framer, shared, link) else {
            link.to_write.wait().await;
            continue;
        };
        wire.write_all(frame).await?;
        mark(check_in);
    }
}

/// The frame of the message that leaves next.
fn next_frame<'a>(framer: &'a mut Framer, shared: &Shared, link: &Link) -> Option<&'a [u8]> {
    let message = link.take(shared);
    // By reference: a message is large, and each move copies it.
    let message = message.as_ref()?;
    // The table's range is 1 to 255.
    let system_id = shared.whole_parameter(VehicleParameter::SysidThismav) as u8;
    let now_us = Instant::now().as_micros();
    Some(shared.with_signing(|signing| framer.signed_frame(message, system_id, signing, link.kind(), now_us)))
}
