//! Reads the telemetry of a motor controller.

use embassy_futures::yield_now;
use embassy_time::{Instant, with_timeout};
use heapless::Vec;

use super::{ByteSource, LONGEST_SLEEP, ReceiveError, Shared, idle, mark};
use crate::battery::{BusError, MAX_PACKS, Measurement, ReadError};
use crate::liveness::CheckIn;
use crate::parameter::Pack;
use crate::sensor::{EscTelemetry, MonitorKind};

/// Bytes handled in one go: a few frames.
const CHUNK_BYTES: usize = 32;

/// Hands each frame of `source` to the battery task, for every pack that is measured so. Without a source nothing is ever
/// heard of them.
pub async fn read_esc(source: Option<impl ByteSource>, shared: &Shared, check_in: &CheckIn) -> ! {
    let packs = packs(shared);
    deliver(&packs, Err(ReadError::Bus(BusError::NoAnswer)), shared);
    let Some(mut source) = source else {
        idle(check_in).await
    };
    let mut telemetry = EscTelemetry::default();
    let mut chunk = [0; CHUNK_BYTES];
    loop {
        match with_timeout(LONGEST_SLEEP, source.receive(&mut chunk)).await {
            Ok(Ok(received)) => {
                telemetry.begin(Instant::now().as_micros());
                for byte in chunk.get(..received).unwrap_or(&chunk) {
                    if let Some(measurement) = telemetry.push(*byte) {
                        deliver(&packs, Ok(measurement), shared);
                    }
                }
            }
            Ok(Err(ReceiveError::Closed)) => idle(check_in).await,
            // Silence, or bytes that were lost: without a frame the pack will be unhealthy.
            Ok(Err(ReceiveError::BytesLost)) | Err(_) => {}
        }
        mark(check_in);
        // A sender that never pauses must leave the others their turn.
        yield_now().await;
    }
}

/// The packs that were set up so at the start.
fn packs(shared: &Shared) -> Vec<Pack, MAX_PACKS> {
    shared.with_parameters(|parameters| {
        let is_measured_so = |pack: &Pack| MonitorKind::of(parameters, *pack) == Some(MonitorKind::Esc);
        let mut packs = Vec::new();
        for pack in Pack::ALL.into_iter().filter(is_measured_so) {
            // There is room for every pack.
            let _ = packs.push(pack);
        }
        packs
    })
}

fn deliver(packs: &[Pack], reading: Result<Measurement, ReadError>, shared: &Shared) {
    for pack in packs {
        shared.add_sample(*pack, reading);
    }
}
