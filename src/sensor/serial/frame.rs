//! What separates frames in what is received: pauses, and a fixed length.

use crate::time::Instant;

/// Notices pauses of more than `MAX_US` microseconds, which end a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gaps<const MAX_US: u64> {
    last_received: Instant,
}

impl<const MAX_US: u64> Gaps<MAX_US> {
    /// Nothing was received yet.
    pub fn new() -> Self {
        Self {
            last_received: Instant::EPOCH,
        }
    }

    /// Whether the bytes that were received at `now` come after such a pause.
    pub fn precede(&mut self, now: Instant) -> bool {
        let is_gap = now.us_since(self.last_received) > MAX_US;
        self.last_received = now;
        is_gap
    }
}

/// The latest bytes, `N` at most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window<const N: usize> {
    bytes: [u8; N],
    length: usize,
}

impl<const N: usize> Window<N> {
    /// Empty.
    pub fn new() -> Self {
        Self {
            bytes: [0; N],
            length: 0,
        }
    }

    /// Adds a byte, and returns all if that is what `decode` finds a frame in, which ends there: they are removed then.
    ///
    /// Else no frame starts at the oldest byte, but one may at any other.
    pub fn push<T>(&mut self, byte: u8, decode: impl FnOnce(&[u8; N]) -> Option<T>) -> Option<T> {
        if self.length == N {
            self.bytes.rotate_left(1);
            self.length -= 1;
        }
        *self.bytes.get_mut(self.length)? = byte;
        self.length += 1;
        if self.length < N {
            return None;
        }
        let decoded = decode(&self.bytes)?;
        self.length = 0;
        Some(decoded)
    }

    /// Drops what is there of a frame.
    pub fn clear(&mut self) {
        self.length = 0;
    }
}
