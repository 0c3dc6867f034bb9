//! Serves the device on the second serial port.

use embassy_futures::yield_now;

use super::clock::with_deadline;
use super::{ByteSource, CheckIn, LONGEST_SLEEP, ReceiveError, Shared, idle, mark, now};
use crate::log::warn;
use crate::sensor::SerialDevice;

/// Bytes handled in one go: a few frames.
const CHUNK_BYTES: usize = 32;

/// A serial line with a device on it: bytes come from it, and requests are sent to it.
pub trait SerialLine: ByteSource {
    /// Sends `bytes`, at most [`REQUEST_BYTES`](crate::sensor::REQUEST_BYTES), and returns when the last of them has left.
    #[allow(async_fn_in_trait)]
    async fn send(&mut self, bytes: &[u8]);
}

/// Hands what comes from `line` to the battery task, and sends the requests that are due. Without a line, or a pack that is
/// measured by it, there is nothing to do.
pub async fn serve_serial(line: Option<impl SerialLine>, shared: &Shared, check_in: &CheckIn) -> ! {
    let device = shared.with(|autopilot| SerialDevice::from_parameters(autopilot.parameters()));
    let (Some(mut line), Some(mut device)) = (line, device) else {
        idle(check_in).await
    };
    let mut chunk = [0; CHUNK_BYTES];
    loop {
        mark(check_in);
        if let Some(request) = device.next_request(now()) {
            line.send(&request).await;
        }
        let longest = now().after_us(LONGEST_SLEEP.as_micros());
        let wake = device.next_due().map_or(longest, |due| due.min(longest));
        match with_deadline(wake, line.receive(&mut chunk)).await {
            Ok(Ok(received)) => {
                let bytes = chunk.get(..received).unwrap_or(&chunk);
                let now = now();
                device.receive(bytes, now, |reading| {
                    shared.with(|autopilot| autopilot.add_serial_reading(reading, now));
                });
            }
            Ok(Err(ReceiveError::Closed)) => idle(check_in).await,
            Ok(Err(ReceiveError::BytesLost(bytes))) => {
                warn!("second serial port: {} received bytes were lost", bytes);
            }
            // Silence or noise: without a frame the pack will be unhealthy.
            Ok(Err(ReceiveError::LineError)) | Err(_) => {}
        }
        // A sender that never pauses must leave the others their turn.
        yield_now().await;
    }
}
