//! What may be wrong with the chip.

/// A part of the chip that the driver waits for while it starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChipPart {
    /// The low-power clock of the backplane.
    LowPowerClock,
    /// The core that runs the program: it stays in reset.
    WlanCore,
    /// Function 2, by which the program takes packets.
    Packets,
}

/// A fault of the radio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadioFault {
    /// It never answers: the data line is low.
    Missing,
    /// It stops answering after this many commands, counted from the moment at which the fault is set.
    SilentAfter(u64),
    /// It answers with random words.
    Noise,
    /// One in this many writes of the download has a flipped bit. At least 1.
    FlippedBits { one_in: u32 },
    /// The bus works, and a part of the chip never gets ready.
    NotReady(ChipPart),
    /// A station that was refused its passphrase stays associated. It reports an aborted key exchange only, and takes no
    /// other passphrase meanwhile (embassy-rs/embassy, issue 4526).
    StaysAssociated,
}
