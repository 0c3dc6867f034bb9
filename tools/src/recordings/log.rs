//! The entries of a log through a sliding window: a file of any length takes the same memory.

use std::collections::VecDeque;
use std::io::{self, Read};

use super::entry::{Bytes, Entries, Entry};

/// Bytes that are read of a file at once, more than any entry of a log has.
const BUFFER_BYTES: usize = 1 << 18;

/// A format in which messages follow each other.
pub trait Messages {
    /// The longest message, and what shows that another one follows.
    const MOST_NEEDED_BYTES: usize;

    /// Takes the message that `bytes` begin with, at `offset` in the file, and returns its length; `None` if there is none.
    fn take(&mut self, bytes: &[u8], offset: u64, found: &mut VecDeque<Entry>) -> Option<usize>;

    /// Whether a message begins here that is longer than all of `bytes`.
    fn is_cut(&self, bytes: &[u8]) -> bool;

    /// Gives what waited for more, at the end of the file.
    fn finish(&mut self, _: &mut VecDeque<Entry>) {}
}

/// The entries of a log whose messages follow each other.
pub struct Log<R, M> {
    source: R,
    buffer: Vec<u8>,
    /// The part of the buffer that is not used yet.
    start: usize,
    end: usize,
    is_at_end: bool,
    bytes: Bytes,
    found: VecDeque<Entry>,
    messages: M,
}

impl<R: Read, M: Messages> Log<R, M> {
    /// Of what `source` delivers.
    pub fn of(source: R, messages: M) -> Self {
        Self {
            source,
            buffer: vec![0; BUFFER_BYTES],
            start: 0,
            end: 0,
            is_at_end: false,
            bytes: Bytes::default(),
            found: VecDeque::new(),
            messages,
        }
    }

    /// The messages by now.
    pub fn into_messages(self) -> M {
        self.messages
    }

    fn read_next(&mut self) -> io::Result<Option<Entry>> {
        while self.found.is_empty() {
            if self.end - self.start < M::MOST_NEEDED_BYTES && !self.is_at_end {
                self.fill()?;
            }
            let rest = &self.buffer[self.start..self.end];
            if rest.is_empty() {
                self.messages.finish(&mut self.found);
                break;
            }
            match self.messages.take(rest, self.bytes.read, &mut self.found) {
                Some(length) => {
                    // The end of the file did not cut what was skipped before.
                    self.bytes.skipped += std::mem::take(&mut self.bytes.cut);
                    self.advance(length);
                }
                None => {
                    // Unless a record follows in what the length of this one covers, all of it is cut.
                    match self.bytes.cut > 0 || self.messages.is_cut(rest) {
                        true => self.bytes.cut += 1,
                        false => self.bytes.skipped += 1,
                    }
                    self.advance(1);
                }
            }
        }
        Ok(self.found.pop_front())
    }

    /// Reads on until a message has room, as far as the file goes. After an error there is no more.
    fn fill(&mut self) -> io::Result<()> {
        self.buffer.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        while self.end < M::MOST_NEEDED_BYTES && !self.is_at_end {
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

    fn advance(&mut self, bytes: usize) {
        let bytes = bytes.min(self.end - self.start);
        self.start += bytes;
        self.bytes.read += bytes as u64;
    }
}

impl<R: Read, M: Messages> Entries for Log<R, M> {
    fn bytes(&self) -> Bytes {
        self.bytes
    }
}

impl<R: Read, M: Messages> Iterator for Log<R, M> {
    type Item = io::Result<Entry>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read_next().transpose()
    }
}
