//! Duties of a driver, and the wiring of a pack to its part.

use super::{Address, SensorBus};
use crate::battery::{Measurement, ReadError};
use crate::parameter::{BatteryParameter, PackParameters};
use crate::sensor::AnalogWiring;

/// A driver of a part on the bus.
pub(super) trait Part: Sized {
    /// The differences between kinds of such a part.
    type Model: 'static;

    /// The time between two readings, in µs. What comes in between two ticks of the battery task is averaged.
    const INTERVAL_US: u64;

    /// The fastest clock it stands, in Hz. The slowest part sets the pace of the bus.
    const HIGHEST_CLOCK_HZ: u32;

    /// Time from the set-up until its results are wholly of it, in µs; 0 if it is read as it is. Nothing is read before, nor
    /// in the turn that sets it up.
    const FIRST_RESULT_US: u64 = 0;

    /// Which packs may share it.
    const SHARING: Sharing = Sharing::None;

    /// Whether it is announced when it is met: which one it is can't be seen otherwise.
    const IS_ANNOUNCED: bool = false;

    /// Addresses to search when none is set.
    fn addresses(model: &'static Self::Model) -> &'static [Address];

    /// Makes sure that what answers is such a part, and prepares it.
    ///
    /// # Errors
    /// No part answers, or it is another one.
    async fn set_up(
        bus: &mut impl SensorBus,
        address: Address,
        wiring: &Wiring,
        model: &'static Self::Model,
    ) -> Result<Self, ReadError>;

    /// Precedes the readings of a turn: reads what the packs of the part share, or makes sure that a battery is still the same.
    ///
    /// # Errors
    /// [`ReadError::OtherPart`] if it has to be set up again.
    async fn begin_turn(&mut self, _: &mut impl SensorBus) -> Result<(), ReadError> {
        Ok(())
    }

    /// Its name, and the largest current it measures, in amperes, over the shunt of the pack that is wired like this; `None` if
    /// no setting decides that.
    fn range(&self, _: &Wiring) -> Option<(&'static str, f32)> {
        None
    }

    /// One reading of the pack that is wired like this. Its last transfer makes sure that the part is still set up as it was:
    /// one that has just lost its supply gives zeros, and another one may be plugged in.
    ///
    /// # Errors
    /// The transfer failed, the part answered nonsense, [`ReadError::OtherPart`] if it has to be set up again, or,
    /// [`ReadError::Timeout`], it has no reading yet.
    async fn read(&mut self, bus: &mut impl SensorBus, wiring: &Wiring) -> Result<Measurement, ReadError>;
}

/// Which packs may share a part, if their address is set alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sharing {
    /// It measures one.
    None,
    /// One on each channel (`BATT_CHANNEL`).
    ByChannel,
    /// Any, each by its pins. Those and their scale follow the parameters.
    ByPin,
}

/// An I2C part of ordinary speed ("fast mode").
pub(super) const FAST_MODE_HZ: u32 = 400_000;

/// The wiring of a pack to a part on the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wiring {
    /// Clock of the I2C bus, in hertz.
    pub i2c_clock_hz: u32,
    /// Address of the part (`BATT_I2C_ADDR`); `None`: it is searched for.
    pub address: Option<Address>,
    /// Which of a part's channels measures the pack, from 1 (`BATT_CHANNEL`).
    pub channel: u8,
    /// The resistor the current flows through, in ohms (`BATT_SHUNT`).
    pub shunt_ohm: f32,
    /// The highest current that has to be counted, in amperes (`BATT_MAX_AMPS`).
    pub max_current_a: f32,
    /// The pin of a converter that measures the voltage, by ArduPilot's number (`BATT_VOLT_PIN`).
    pub voltage_pin: i32,
    /// The pin of a converter that measures the current, by ArduPilot's number (`BATT_CURR_PIN`).
    pub current_pin: i32,
    /// The wiring of a converter's pins.
    pub analog: AnalogWiring,
}

impl Wiring {
    /// The wiring the parameters of a pack describe, to a bus with this clock.
    pub fn from_parameters(pack: PackParameters<'_>, i2c_clock_hz: u32) -> Self {
        Self {
            i2c_clock_hz,
            address: Address::from_parameter(pack.get_whole(BatteryParameter::I2cAddr)),
            channel: u8::try_from(pack.get_whole(BatteryParameter::Channel)).unwrap_or(1),
            shunt_ohm: pack.get(BatteryParameter::Shunt),
            max_current_a: pack.get(BatteryParameter::MaxAmps),
            voltage_pin: pack.get_whole(BatteryParameter::VoltPin),
            current_pin: pack.get_whole(BatteryParameter::CurrPin),
            analog: AnalogWiring::from_parameters(pack),
        }
    }
}
