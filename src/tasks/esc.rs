//! Reads the telemetry of a motor controller.

use embassy_futures::yield_now;
use embassy_time::with_timeout;

use super::{ByteSource, LONGEST_SLEEP, ReceiveError, Shared, idle, mark, now};
use crate::battery::{BusError, ReadError};
use crate::liveness::CheckIn;
use crate::log::warn;
use crate::sensor::EscTelemetry;

/// Bytes handled in one go: a few frames.
const CHUNK_BYTES: usize = 32;

/// Hands each frame of `source` to the battery task, for every pack that is measured so. Without a source nothing is ever
/// heard of them.
pub async fn read_esc(source: Option<impl ByteSource>, shared: &Shared, check_in: &CheckIn) -> ! {
    shared.with(|autopilot| autopilot.add_esc_reading(Err(ReadError::Bus(BusError::NoAnswer))));
    let Some(mut source) = source else {
        idle(check_in).await
    };
    let mut telemetry = EscTelemetry::default();
    let mut chunk = [0; CHUNK_BYTES];
    loop {
        match with_timeout(LONGEST_SLEEP, source.receive(&mut chunk)).await {
            Ok(Ok(received)) => {
                telemetry.begin(now());
                for byte in chunk.get(..received).unwrap_or(&chunk) {
                    if let Some(measurement) = telemetry.push(*byte) {
                        shared.with(|autopilot| autopilot.add_esc_reading(Ok(measurement)));
                    }
                }
            }
            Ok(Err(ReceiveError::Closed)) => idle(check_in).await,
            Ok(Err(ReceiveError::BytesLost(bytes))) => {
                warn!("motor controller: {} received bytes were lost", bytes);
            }
            // Silence or noise: without a frame the pack will be unhealthy.
            Ok(Err(ReceiveError::LineError)) | Err(_) => {}
        }
        mark(check_in);
        // A sender that never pauses must leave the others their turn.
        yield_now().await;
    }
}
