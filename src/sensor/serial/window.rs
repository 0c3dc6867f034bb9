//! The latest bytes, in which a frame of a fixed length is looked for.

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
