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
        let message = link.next_message(shared).await;
        // The table's range is 1 to 255.
        let system_id = shared.whole_parameter(VehicleParameter::SysidThismav) as u8;
        let now_us = Instant::now().as_micros();
        let frame = shared
            .with_signing(|signing| framer.signed_frame(&message, system_id, signing, link.kind(), now_us));
        wire.write_all(frame).await?;
        mark(check_in);
    }
}
