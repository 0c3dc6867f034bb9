//! Frames on the CAN bus.

/// Most bytes of data in a frame.
pub const FRAME_BYTES: usize = 8;

/// A data frame with an extended identifier, the only kind that DroneCAN uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanFrame {
    id: u32,
    length: u8,
    data: [u8; FRAME_BYTES],
}

impl CanFrame {
    /// A frame; `None` if the identifier has more than 29 bits or there are more than [`FRAME_BYTES`] bytes.
    pub fn new(id: u32, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; FRAME_BYTES];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        (id < 1 << 29).then_some(Self {
            id,
            length: data.len() as u8,
            data: bytes,
        })
    }

    /// Identifier, of 29 bits.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// Data, at most [`FRAME_BYTES`].
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.length)).unwrap_or(&self.data)
    }
}
