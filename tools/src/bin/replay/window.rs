//! A sliding window over a file: a file of any length takes the same memory.

use std::io::{self, Read};

/// Bytes that are read of a file at once, more than any entry of a log has.
const BUFFER_BYTES: usize = 1 << 18;

/// The bytes of a file that are not used yet, some at a time.
pub struct Window<R> {
    source: R,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    is_at_end: bool,
    read_bytes: u64,
    skipped_bytes: u64,
}

impl<R: Read> Window<R> {
    /// At the beginning of what `source` delivers.
    pub fn of(source: R) -> Self {
        Self {
            source,
            buffer: vec![0; BUFFER_BYTES],
            start: 0,
            end: 0,
            is_at_end: false,
            read_bytes: 0,
            skipped_bytes: 0,
        }
    }

    /// The next bytes: at least `needed` of them, as far as the file goes. After an error there are no more.
    pub fn look(&mut self, needed: usize) -> io::Result<&[u8]> {
        if self.end - self.start < needed && !self.is_at_end {
            self.fill(needed)?;
        }
        Ok(&self.buffer[self.start..self.end])
    }

    fn fill(&mut self, needed: usize) -> io::Result<()> {
        self.buffer.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        while self.end < needed.min(BUFFER_BYTES) && !self.is_at_end {
            match self.source.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.is_at_end = true,
                Ok(bytes) => self.end += bytes,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => {
                    (self.start, self.end, self.is_at_end) = (0, 0, true);
                    return Err(error);
                }
            }
        }
        Ok(())
    }

    /// Goes past bytes of an entry, as far as there are any.
    pub fn advance(&mut self, bytes: usize) {
        let bytes = bytes.min(self.end - self.start);
        self.start += bytes;
        self.read_bytes += bytes as u64;
    }

    /// Goes past bytes that belong to no entry.
    pub fn skip(&mut self, bytes: usize) {
        self.advance(bytes);
        self.skipped_bytes += bytes as u64;
    }

    /// Bytes so far, of entries and others.
    pub fn read_bytes(&self) -> u64 {
        self.read_bytes
    }

    /// Bytes so far that belong to no entry.
    pub fn skipped_bytes(&self) -> u64 {
        self.skipped_bytes
    }
}
