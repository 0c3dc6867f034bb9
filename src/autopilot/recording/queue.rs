//! Records that wait for the flash.

use heapless::Deque;

/// A second of records at the log's share, the announcements of all packs in one tick, and an erase of 400 ms.
const QUEUE_BYTES: usize = 2048;

/// Encoded records that wait for the flash, whole ones only.
#[derive(Debug, Default)]
pub(super) struct Queue {
    bytes: Deque<u8, QUEUE_BYTES>,
    dropped: u32,
}

impl Queue {
    /// Adds a record. One for which there is no room is dropped and counted.
    pub fn add(&mut self, record: &[u8]) {
        if self.bytes.capacity() - self.bytes.len() < record.len() {
            self.dropped = self.dropped.saturating_add(1);
            return;
        }
        for byte in record {
            // There is room for all of it.
            let _ = self.bytes.push_back(*byte);
        }
    }

    /// The byte that leaves next.
    pub fn take(&mut self) -> Option<u8> {
        self.bytes.pop_front()
    }

    /// Bytes that wait.
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Records dropped so far.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Forgets what waits.
    pub fn clear(&mut self) {
        self.bytes.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_without_room_is_dropped_whole_and_counted() {
        let mut queue = Queue::default();
        for _ in 0..QUEUE_BYTES / 100 {
            queue.add(&[1; 100]);
        }
        queue.add(&[2; 100]);
        assert_eq!((queue.len(), queue.dropped()), (QUEUE_BYTES / 100 * 100, 1));
        queue.add(&[3; 10]);
        let taken: Vec<u8> = std::iter::from_fn(|| queue.take()).collect();
        assert_eq!(taken[taken.len() - 10..], [3; 10]);
        assert!(!taken.contains(&2));
    }
}
