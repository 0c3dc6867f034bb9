//! What may be wrong with the chip.

/// A fault of the radio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadioFault {
    /// It never answers: the data line is low.
    Missing,
    /// It stops answering after so many commands, counted from the moment at which the fault is set.
    SilentAfter(u64),
    /// It answers with random words.
    Noise,
    /// It loses every frame to and from the air, and sees no network.
    Deaf,
    /// One in so many writes of the download has a flipped bit. At least 1.
    FlippedBits { one_in: u32 },
}
