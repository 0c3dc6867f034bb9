//! What a ground station makes of the bytes it receives, resets in between.

use support::frames::{Frame, frames};

/// Header and checksum of a frame that is not signed.
const OVERHEAD_BYTES: usize = 12;

/// Bytes, each with the time of its end in µs, that no frame was made of yet.
#[derive(Default)]
pub struct Receiver {
    pending: Vec<(u64, u8)>,
}

impl Receiver {
    /// The frames that are whole with these bytes. What a reset has cut off is left out; before it and after it there is
    /// nothing but frames.
    pub fn receive(&mut self, bytes: impl Iterator<Item = (u64, u8)>, reset_us: Option<u64>) -> Vec<Frame> {
        self.pending.extend(bytes);
        let mut received = Vec::new();
        if let Some(reset_us) = reset_us {
            let after = self.pending.partition_point(|(at_us, _)| *at_us <= reset_us);
            let after = self.pending.split_off(after);
            received = frames(&std::mem::replace(&mut self.pending, after));
        }
        let whole = frames(&self.pending);
        let length = |frame: &Frame| match &frame.signed {
            Some(bytes) => bytes.len(),
            None => OVERHEAD_BYTES + frame.payload_len(),
        };
        let lengths = whole.iter().map(length);
        self.pending.drain(..lengths.sum::<usize>());
        received.extend(whole);
        received
    }
}
