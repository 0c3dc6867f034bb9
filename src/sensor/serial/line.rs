//! The serial line: its rate and its wires.

/// What a protocol needs of the line. Every one has eight data bits, no parity and one stop bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Line {
    /// Its rate.
    pub baud: Baud,
    /// Its wires.
    pub wires: Wires,
}

/// The rate of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Baud {
    /// The protocol has this one and no other, in bits per second.
    Fixed(u32),
    /// Devices differ: it is set (`SERIAL1_BAUD`).
    Set,
}

/// What is connected to the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Wires {
    /// Only its input: the output's pin stays untouched.
    ReceiveOnly,
    /// Its input, and its output by a wire of its own.
    BothWays,
    /// Both by the same wire or pair of wires, such as RS-485: one sends at a time, and may receive what it sends.
    OneWire,
}
