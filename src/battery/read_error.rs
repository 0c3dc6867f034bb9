//! Why a read of a sensor failed.

use core::fmt;

/// Why a read of a sensor failed. It is one byte as long as only one variant holds another enum; a second one would take
/// 1.2 KB of flash, in the `async` drivers that pass it on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ReadError {
    /// There was no reading in time.
    Timeout,
    /// The ADC reported a failed conversion.
    Conversion,
    /// The pack's own fuel gauge has not reported in time what is left.
    GaugeTimeout,
    /// The value is not finite or beyond its plausible range.
    Implausible,
    /// The part at the address is not the one that is set, or is not set up any more.
    OtherPart,
    /// No member of the sum is healthy.
    NoHealthyMember,
    /// The wires to the sensor failed.
    Bus(BusError),
    /// Configuration: no pin is set, or no such channel.
    NoPin,
    /// Configuration: no capacity is set, which the fill level is computed from.
    NoCapacity,
    /// Configuration: another pack's sensor uses the address.
    AddressTaken,
    /// Configuration: the pin is the clock of this board's Wi-Fi radio.
    PinOfRadio,
    /// Configuration: another sensor that is set up uses the pin.
    PinTaken,
    /// Configuration: what connects the sensor is not set up: the CAN bus, or the protocol of the serial port.
    NotSetUp,
}

/// What failed on the wires to a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum BusError {
    /// Nothing answers, or a byte was not acknowledged.
    NoAnswer,
    /// The transfer did not end in time.
    Timeout,
    /// A line is held low.
    Stuck,
    /// The packet error code does not match.
    Checksum,
    /// The transfer failed in another way.
    Transfer,
}

const _: () = assert!(size_of::<ReadError>() == 1);

impl From<BusError> for ReadError {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

impl ReadError {
    /// Whether a setting is missing or wrong: until it is changed, the sensor can't be read.
    pub fn is_configuration(self) -> bool {
        matches!(
            self,
            Self::NoPin
                | Self::NoCapacity
                | Self::AddressTaken
                | Self::PinOfRadio
                | Self::PinTaken
                | Self::NotSetUp
        )
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Timeout | Self::Bus(BusError::Timeout) => "no reading in time",
            Self::Conversion => "conversion failed",
            Self::GaugeTimeout => "its gauge reports no charge",
            Self::Implausible => "impossible value",
            Self::OtherPart => "unknown part",
            Self::NoHealthyMember => "no healthy pack to sum",
            Self::Bus(BusError::NoAnswer) => "no answer",
            Self::Bus(BusError::Stuck) => "bus held low",
            Self::Bus(BusError::Checksum) => "wrong checksum",
            Self::Bus(BusError::Transfer) => "bus error",
            Self::NoPin => "no pin set",
            Self::NoCapacity => "no capacity set",
            Self::AddressTaken => "address already in use",
            Self::PinOfRadio => "GP29 is the Wi-Fi radio's",
            Self::PinTaken => "pin already in use",
            Self::NotSetUp => "port not set up",
        })
    }
}
