//! What a sensor delivers.

use core::fmt;

use super::{CellVoltages, PackDetails};

/// What a pack holds. As in ArduPilot a tank is a pack, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Contents {
    /// Electric charge.
    #[default]
    Charge,
    /// Liquid fuel. Milliampere-hours are millilitres then, and amperes are litres per hour; there is neither a voltage nor
    /// an energy.
    Fuel,
}

/// One reading of a pack by its sensor. `None` is what the sensor does not measure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// What the pack holds.
    pub contents: Contents,
    /// Voltage between the pack's terminals, in volts.
    pub voltage_v: Option<f32>,
    /// Current drawn from the pack, in amperes; negative while charging.
    pub current_a: Option<f32>,
    /// Charge and energy, where the sensor counts them itself.
    pub counted: Option<Counted>,
    /// What the pack's own gauge tells.
    pub gauge: Option<Gauge>,
    /// Temperature of the pack, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Voltage of each cell.
    pub cells: CellVoltages,
    /// What the pack tells of itself.
    pub details: PackDetails,
    /// Whether the pack is about to be switched off.
    pub supply: Supply,
    /// The packs it is the sum of, one bit for each instance, bit 0 for the first; 0 for a sensor.
    pub members: u16,
}

/// Whether a pack is about to be switched off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Supply {
    /// It is not, as far as is known.
    #[default]
    Stays,
    /// Somebody holds the button on it.
    SwitchingOff,
}

/// Charge and energy as a sensor counts them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Counted {
    /// What was drawn since the reading before, by a counter that does not stop between readings.
    SinceLast(Consumed),
    /// All that was drawn.
    InAll(Consumed),
}

/// What has been drawn from a pack; negative after net charging.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Consumed {
    /// Charge, in milliampere-hours.
    pub charge_mah: f32,
    /// Energy, in watt-hours.
    pub energy_wh: f32,
}

const COULOMBS_PER_MAH: f32 = 3.6;
const JOULES_PER_WH: f32 = 3600.0;

impl Consumed {
    /// The same in the units that parts count in.
    pub fn from_si(charge_c: f32, energy_j: f32) -> Self {
        Self {
            charge_mah: charge_c / COULOMBS_PER_MAH,
            energy_wh: energy_j / JOULES_PER_WH,
        }
    }
}

/// What the gauge in a smart battery tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gauge {
    /// Charge that is left, in milliampere-hours.
    pub remaining_mah: f32,
    /// Charge of the full pack at its present age, in milliampere-hours.
    pub full_mah: f32,
}

impl Gauge {
    /// How full the pack is, from 0 to 1.
    pub fn share(&self) -> f32 {
        (self.remaining_mah / self.full_mah).clamp(0.0, 1.0)
    }

    /// What is missing from the full pack, in milliampere-hours; 0 when it holds more than it should.
    pub fn consumed_mah(&self) -> f32 {
        (self.full_mah - self.remaining_mah).max(0.0)
    }
}

/// Why a reading of a sensor failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ReadError {
    /// The sensor did not answer in time.
    Timeout,
    /// The converter reported a failed conversion.
    Conversion,
    /// The parameters name no pin.
    NoPin,
    /// The parameters tell no capacity, and without it what is measured means nothing.
    NoCapacity,
    /// None of the packs it is the sum of is healthy.
    NoMember,
    /// The reading is not a number a pack can have.
    Implausible,
    /// Nobody acknowledges the address.
    NoAnswer,
    /// Somebody holds a line of the bus.
    BusStuck,
    /// The transfer failed in another way.
    Bus,
    /// What came does not agree with its check byte.
    Checksum,
    /// What answers at the address is another part than the one that was set.
    OtherPart,
    /// Another pack's sensor is at the address.
    AddressTaken,
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Timeout => "no reading in time",
            Self::Conversion => "conversion failed",
            Self::NoPin => "no pin set",
            Self::NoCapacity => "no capacity set",
            Self::NoMember => "no healthy pack to sum",
            Self::Implausible => "impossible value",
            Self::NoAnswer => "no answer",
            Self::BusStuck => "bus held low",
            Self::Bus => "bus error",
            Self::Checksum => "wrong checksum",
            Self::OtherPart => "unknown part",
            Self::AddressTaken => "address already in use",
        })
    }
}
