//! What a sensor delivers.

use super::CellVoltages;

/// One reading of a pack by its sensor. `None` is what the sensor does not measure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Voltage between the pack's terminals, in volts.
    pub voltage_v: Option<f32>,
    /// Current drawn from the pack, in amperes; negative while charging.
    pub current_a: Option<f32>,
    /// Charge and energy, where the sensor counts them itself.
    pub consumed: Option<Consumed>,
    /// Temperature of the pack, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Voltage of each cell.
    pub cells: CellVoltages,
}

/// What has been drawn from a pack; negative after net charging.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Consumed {
    /// Charge, in milliampere-hours.
    pub charge_mah: f32,
    /// Energy, in watt-hours.
    pub energy_wh: f32,
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
    /// None of the packs it is the sum of is healthy.
    NoMember,
    /// The reading is not a number a pack can have.
    Implausible,
}
