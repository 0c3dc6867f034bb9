//! The trait of a protocol on the serial line, its needs of the line, and the separators of frames there: pauses, and a
//! fixed length.

use super::conditions::SerialNotice;
use crate::battery::{Measurement, ReadError};
use crate::parameter::{MonitorKind, TICK_TIMEOUT_US};
use crate::sensor::{ControllerReading, EngineReading};
use crate::time::Instant;

/// A protocol's requirements of the line. Every one has eight data bits, no parity and one stop bit.
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

/// The wires at the port.
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

/// Most bytes of a request: the port sends it as a whole.
pub const REQUEST_BYTES: usize = 32;

/// Bytes sent at once: a request, or an answer.
pub type Request = heapless::Vec<u8, REQUEST_BYTES>;

/// A received reading or notice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SerialReading {
    /// A motor controller's reading.
    Controller(ControllerReading),
    /// A generator's electrical output.
    GeneratorElectrical(Measurement),
    /// A generator's fuel: [`Contents::Fuel`](crate::battery::Contents::Fuel) with its share of a full tank as `state_of_charge`.
    GeneratorFuel(Measurement),
    /// The battery of a Torqeedo motor.
    Torqeedo(Measurement),
    /// The reading of an engine control unit.
    Efi(EngineReading),
    /// A frame for packs of this kind is refused: it has a value that the device can't have, or that is over range.
    Refused(MonitorKind, ReadError),
    /// The state of the device itself has changed.
    Notice(SerialNotice),
}

/// A protocol on the serial line: what comes in, and what has to be sent.
pub(super) trait Protocol: Sized {
    /// The differences between devices that speak it; `()` if there is one.
    type Model: 'static;

    /// Its requirements of the line.
    const LINE: Line;

    /// Kinds of packs that it measures.
    const KINDS: &'static [MonitorKind];

    /// For how long its packs may be without a reading, in microseconds.
    const TIMEOUT_US: u64 = TICK_TIMEOUT_US;

    /// Nothing was received yet.
    fn new(model: &'static Self::Model) -> Self;

    /// Bytes were received at `now`, after a gap or not: a partial frame before a gap is dropped, if gaps end frames.
    fn begin(&mut self, _now: Instant) {}

    /// Processes a byte, which was received by `now`.
    fn push(&mut self, byte: u8, now: Instant, deliver: &mut impl FnMut(SerialReading));

    /// The request to send at `now`, if there is one; never to a device that sends by itself.
    fn next_request(&mut self, _now: Instant) -> Option<Request> {
        None
    }

    /// When [`Self::next_request`] has to be called again; `None` if not before something was received.
    fn next_due(&self) -> Option<Instant> {
        None
    }
}

/// Voltage of a word, in volts, which has steps of 10 mV.
///
/// # Errors
/// The end of the word is over range.
pub(super) fn centivolts(word: u16) -> Result<f32, ReadError> {
    match word {
        u16::MAX => Err(ReadError::OverRange),
        word => Ok(f32::from(word) * 0.01),
    }
}

/// Notices pauses of more than `MAX_US` microseconds, which end a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gaps<const MAX_US: u64> {
    last_received: Instant,
}

impl<const MAX_US: u64> Gaps<MAX_US> {
    /// Nothing was received yet.
    pub fn new() -> Self {
        Self {
            last_received: Instant::EPOCH,
        }
    }

    /// Whether the bytes that were received at `now` come after such a pause.
    pub fn precede(&mut self, now: Instant) -> bool {
        let is_gap = now.us_since(self.last_received) > MAX_US;
        self.last_received = now;
        is_gap
    }
}

/// The latest bytes, `N` at most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window<const N: usize> {
    bytes: [u8; N],
    length: usize,
}

impl<const N: usize> Window<N> {
    /// Empty.
    pub fn new() -> Self {
        Self {
            bytes: [0; N],
            length: 0,
        }
    }

    /// Adds a byte, and returns all if that is what `decode` finds a frame in, which ends there: they are removed then.
    ///
    /// Else no frame starts at the oldest byte, but one may at any other.
    pub fn push<T>(&mut self, byte: u8, decode: impl FnOnce(&[u8; N]) -> Option<T>) -> Option<T> {
        if self.length == N {
            self.bytes.rotate_left(1);
            self.length -= 1;
        }
        *self.bytes.get_mut(self.length)? = byte;
        self.length += 1;
        if self.length < N {
            return None;
        }
        let decoded = decode(&self.bytes)?;
        self.length = 0;
        Some(decoded)
    }

    /// Drops what is there of a frame.
    pub fn clear(&mut self) {
        self.length = 0;
    }
}
