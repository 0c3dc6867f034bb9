//! The last byte of a frame: its place in a transfer.

const START: u8 = 1 << 7;
const END: u8 = 1 << 6;
const TOGGLE: u8 = 1 << 5;
const TRANSFER_ID: u8 = 0x1f;

/// The last byte of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tail(pub u8);

impl Tail {
    /// Of the frame with this index in a transfer; counts of transfers wrap.
    pub fn of_frame(index: usize, frames: usize, transfer_id: u8) -> Self {
        let start = if index == 0 { START } else { 0 };
        let end = if index + 1 == frames { END } else { 0 };
        let toggle = if index % 2 == 1 { TOGGLE } else { 0 };
        Self(start | end | toggle | transfer_id & TRANSFER_ID)
    }

    /// Whether a transfer starts with it.
    pub fn is_start(self) -> bool {
        self.0 & START != 0
    }

    /// Whether a transfer ends with it.
    pub fn is_end(self) -> bool {
        self.0 & END != 0
    }

    /// Whether it is all of a transfer.
    pub fn is_whole(self) -> bool {
        self.is_start() && self.is_end()
    }

    /// Alternates from frame to frame, from `false` on.
    pub fn toggle(self) -> bool {
        self.0 & TOGGLE != 0
    }

    /// Distinguishes a transfer from the ones before, 0 to 31.
    pub fn transfer_id(self) -> u8 {
        self.0 & TRANSFER_ID
    }
}
