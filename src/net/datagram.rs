//! Frames that are sent together.

use heapless::{CapacityError, Vec};

/// The largest datagram that is sent: some frames. The largest frame has 293 bytes.
pub(super) const DATAGRAM_BYTES: usize = 512;

/// Whole frames that are sent in one datagram.
#[derive(Debug)]
pub(super) struct Datagram {
    bytes: Vec<u8, DATAGRAM_BYTES>,
    frames: u32,
}

impl Datagram {
    /// One without frames.
    pub const fn new() -> Self {
        Self {
            bytes: Vec::new(),
            frames: 0,
        }
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// There is no room for it.
    pub fn add(&mut self, frame: &[u8]) -> Result<(), CapacityError> {
        self.bytes.extend_from_slice(frame)?;
        self.frames += 1;
        Ok(())
    }

    /// The frames, one behind the other.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Number of its frames.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// It was sent or lost.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.frames = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn datagrams_have_whole_frames_in_their_order(lengths in prop::collection::vec(12_usize..=293, 1..60)) {
            let mut datagram = Datagram::new();
            let (mut sent, mut expected) = (Vec::<u8, 20_000>::new(), Vec::<u8, 20_000>::new());
            for (number, length) in lengths.into_iter().enumerate() {
                let frame = vec![number as u8; length];
                expected.extend_from_slice(&frame).expect("there is room");
                if datagram.add(&frame).is_err() {
                    // The smallest frames that do not fit together with the largest one.
                    prop_assert!(datagram.bytes().len() + length > DATAGRAM_BYTES);
                    sent.extend_from_slice(datagram.bytes()).expect("there is room");
                    datagram.clear();
                    prop_assert!(datagram.add(&frame).is_ok());
                }
                prop_assert!(datagram.bytes().ends_with(&frame));
            }
            sent.extend_from_slice(datagram.bytes()).expect("there is room");
            prop_assert_eq!(sent, expected);
        }
    }

    #[test]
    fn frames_are_counted_until_they_are_sent() {
        let mut datagram = Datagram::new();
        assert!(datagram.is_empty());
        assert!(datagram.add(&[0; 293]).is_ok());
        assert!(datagram.add(&[0; 293]).is_err());
        assert!(datagram.add(&[0; 219]).is_ok());
        assert_eq!((datagram.frames(), datagram.bytes().len()), (2, DATAGRAM_BYTES));
        datagram.clear();
        assert!(datagram.is_empty());
        assert_eq!(datagram.frames(), 0);
    }
}
