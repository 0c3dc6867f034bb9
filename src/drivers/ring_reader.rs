//! Reads a ring that is written without end by a writer that never waits.

/// Written bytes are counted modulo this. The reader has to look before that much more is written: at 921,600 baud
/// that takes 2.8 s. A reader that is late by more miscounts what it has lost, and is about to be missed by the watchdog.
pub const COUNT_PERIOD: u32 = 1 << 18;

/// The writer was so far ahead that unread bytes have been overwritten. All that was unread is dropped: this many bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overtaken {
    /// Bytes, at least one more than the ring holds.
    pub bytes_lost: u32,
}

/// Reading position in a ring of bytes.
#[derive(Debug)]
pub struct RingReader {
    ring_bytes: u32,
    /// Bytes read, modulo [`COUNT_PERIOD`].
    read: u32,
}

impl RingReader {
    /// For a ring of `ring_bytes`, a power of two below [`COUNT_PERIOD`], into which nothing was written yet.
    pub const fn new(ring_bytes: u32) -> Self {
        Self { ring_bytes, read: 0 }
    }

    /// Moves bytes that were not read yet into `buffer`, as many as there are and fit, and returns how many.
    ///
    /// `written` returns how many bytes have been written so far, modulo [`COUNT_PERIOD`], and `byte` the one at a place in
    /// the ring. The writer may go on meanwhile.
    ///
    /// # Errors
    /// The writer has overtaken the reader, before or while bytes were moved. What comes next is what is written next.
    pub fn read(
        &mut self,
        written: impl Fn() -> u32,
        byte: impl Fn(usize) -> u8,
        buffer: &mut [u8],
    ) -> Result<usize, Overtaken> {
        let unread = self.unread(written())?;
        let mut moved = 0;
        for (slot, ahead) in buffer.iter_mut().zip(0..unread) {
            let place = self.read.wrapping_add(ahead) & self.ring_bytes.wrapping_sub(1);
            *slot = byte(place as usize);
            moved = ahead + 1;
        }
        self.unread(written())?;
        self.read = self.read.wrapping_add(moved) & (COUNT_PERIOD - 1);
        Ok(moved as usize)
    }

    /// Counts as read what was written, but for the latest `later`, in whole rounds of `round` words, a power of two. Returns
    /// where that ends, modulo [`COUNT_PERIOD`], and how many words it is, of which the ring holds the last.
    pub fn skip_rounds(&mut self, written: u32, later: u32, round: u32) -> (u32, u32) {
        let behind = self.behind(written).saturating_sub(later);
        let unread = behind & !(round - 1);
        self.read = self.read.wrapping_add(unread) & (COUNT_PERIOD - 1);
        (self.read, unread)
    }

    /// Whether anything is unread once `written` bytes were written, modulo [`COUNT_PERIOD`].
    pub fn has_unread(&self, written: u32) -> bool {
        self.behind(written) > 0
    }

    fn behind(&self, written: u32) -> u32 {
        written.wrapping_sub(self.read) & (COUNT_PERIOD - 1)
    }

    fn unread(&mut self, written: u32) -> Result<u32, Overtaken> {
        let unread = self.behind(written);
        if unread <= self.ring_bytes {
            return Ok(unread);
        }
        self.read = written & (COUNT_PERIOD - 1);
        Err(Overtaken { bytes_lost: unread })
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use proptest::prelude::*;

    use super::*;

    const RING_BYTES: u32 = 64;

    /// The byte that is written as the `number`th.
    fn byte_of(number: u64) -> u8 {
        (number % 251) as u8
    }

    /// A writer that goes on while it is read, and the count of what it has written.
    struct Writer {
        written: Cell<u64>,
        ring: [Cell<u8>; RING_BYTES as usize],
    }

    impl Writer {
        fn new() -> Self {
            Self {
                written: Cell::new(0),
                ring: [const { Cell::new(0) }; RING_BYTES as usize],
            }
        }

        fn write(&self, bytes: u32) {
            for _ in 0..bytes {
                let number = self.written.get();
                self.ring[number as usize % self.ring.len()].set(byte_of(number));
                self.written.set(number + 1);
            }
        }

        fn count(&self) -> u32 {
            (self.written.get() % u64::from(COUNT_PERIOD)) as u32
        }

        /// Reads while `meanwhile` bytes are written after each byte that is moved.
        fn read(&self, reader: &mut RingReader, room: usize, meanwhile: u32) -> Result<Vec<u8>, Overtaken> {
            let mut buffer = [0; 2 * RING_BYTES as usize];
            let byte = |place: usize| {
                let byte = self.ring[place].get();
                self.write(meanwhile);
                byte
            };
            let moved = reader.read(|| self.count(), byte, &mut buffer[..room])?;
            Ok(buffer[..moved].to_vec())
        }
    }

    #[test]
    fn an_empty_ring_gives_nothing_and_a_full_one_everything() {
        let (writer, mut reader) = (Writer::new(), RingReader::new(RING_BYTES));
        assert_eq!(writer.read(&mut reader, 100, 0), Ok(vec![]));
        writer.write(RING_BYTES);
        let all: Vec<u8> = (0..64).map(byte_of).collect();
        assert_eq!(writer.read(&mut reader, 100, 0), Ok(all));
        assert_eq!(writer.read(&mut reader, 100, 0), Ok(vec![]));
    }

    #[test]
    fn one_byte_more_than_the_ring_holds_loses_all_that_was_unread() {
        let (writer, mut reader) = (Writer::new(), RingReader::new(RING_BYTES));
        writer.write(RING_BYTES + 1);
        let bytes_lost = RING_BYTES + 1;
        assert_eq!(writer.read(&mut reader, 100, 0), Err(Overtaken { bytes_lost }));
        assert_eq!(writer.read(&mut reader, 100, 0), Ok(vec![]));
        writer.write(2);
        assert_eq!(
            writer.read(&mut reader, 100, 0),
            Ok(vec![byte_of(65), byte_of(66)])
        );
    }

    #[test]
    fn bytes_that_are_overwritten_while_they_are_moved_are_lost() {
        let (writer, mut reader) = (Writer::new(), RingReader::new(RING_BYTES));
        writer.write(RING_BYTES);
        assert_eq!(
            writer.read(&mut reader, 3, 1),
            Err(Overtaken {
                bytes_lost: RING_BYTES + 3
            })
        );
    }

    proptest! {
        /// Whatever is written and read in which steps, over the end of the ring and of the count: each byte is either read,
        /// in order and as it was written, or counted as lost.
        #[test]
        fn every_byte_is_read_in_order_or_counted_as_lost(
            start in prop_oneof![Just(0), Just(COUNT_PERIOD - 100), 0..COUNT_PERIOD],
            steps in prop::collection::vec((0u32..200, 0usize..100, 0u32..3), 1..100),
        ) {
            let (writer, mut reader) = (Writer::new(), RingReader::new(RING_BYTES));
            writer.write(start);
            reader.read = start;
            let mut accounted = u64::from(start);
            for (bytes, room, meanwhile) in steps {
                writer.write(bytes);
                match writer.read(&mut reader, room, meanwhile) {
                    Ok(read) => for byte in read {
                        prop_assert_eq!(byte, byte_of(accounted));
                        accounted += 1;
                    },
                    Err(Overtaken { bytes_lost }) => {
                        prop_assert!(bytes_lost > RING_BYTES);
                        accounted += u64::from(bytes_lost);
                        prop_assert_eq!(accounted, writer.written.get());
                    }
                }
                prop_assert!(writer.written.get() - accounted <= u64::from(RING_BYTES));
            }
        }
    }
}
