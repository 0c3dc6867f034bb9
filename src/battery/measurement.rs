//! What a sensor delivers.

/// One reading of a pack by its sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Voltage between the pack's terminals, in volts.
    pub voltage_v: f32,
}

/// Why a reading of a sensor failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ReadError {
    /// The converter did not answer in time.
    Timeout,
    /// The converter reported a failed conversion.
    Conversion,
    /// The parameters name no pin.
    NoPin,
    /// The reading is not a number a pack can have.
    Implausible,
}
