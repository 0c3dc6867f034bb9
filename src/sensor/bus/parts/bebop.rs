//! The motor board of Parrot's Bebop, which measures the voltage of the pack that it drives the motors from.
//!
//! Parrot has published nothing of it: its commands are as Paparazzi's and ArduPilot's drivers and Paparazzi's wiki
//! (Bebop/BLDC) have them. It is only read: its motors are not driven.

use crate::battery::{BusError, Measurement, ReadError};
use crate::log::info;
use crate::sensor::bus::part::{FAST_MODE_HZ, Part};
use crate::sensor::bus::registers::Registers;
use crate::sensor::bus::{Address, SensorBus, Wiring};

/// Speeds of four motors in two bytes each, the pack's voltage in millivolts, four more bytes, and the checksum.
const OBSERVED: u8 = 0x20;
const OBSERVED_BYTES: usize = 15;

/// Version, type and number of motors, before what it has counted.
const INFO: u8 = 0xa0;
const MOTORS: u8 = 4;

const ADDRESSES: [Address; 1] = [Address::I2c(0x08)];

/// A motor board that answered.
#[derive(Debug)]
pub(in crate::sensor::bus) struct Bebop {
    address: Address,
}

impl Part for Bebop {
    type Model = ();

    const INTERVAL_US: u64 = 100_000;
    const HIGHEST_CLOCK_HZ: u32 = FAST_MODE_HZ;

    fn addresses((): &()) -> &'static [Address] {
        &ADDRESSES
    }

    async fn set_up(
        bus: &mut impl SensorBus,
        address: Address,
        _: &Wiring,
        (): &(),
    ) -> Result<Self, ReadError> {
        let [_, _, _, motors] = Registers::new(bus, address).read(INFO).await?;
        if motors != MOTORS {
            return Err(ReadError::OtherPart);
        }
        info!("Bebop {:?}", address);
        Ok(Self { address })
    }

    /// Nothing is set up that could be lost, and each reading has a checksum.
    async fn read(&mut self, bus: &mut impl SensorBus, _: &Wiring) -> Result<Measurement, ReadError> {
        let observed: [u8; OBSERVED_BYTES] = Registers::new(bus, self.address).read(OBSERVED).await?;
        // The checksum makes it zero.
        if observed.iter().fold(0, |sum, byte| sum ^ byte) != 0 {
            return Err(BusError::Checksum.into());
        }
        let [_, _, _, _, _, _, _, _, high, low, ..] = observed;
        match u16::from_be_bytes([high, low]) {
            // A data line that is low.
            0 => Err(ReadError::Implausible),
            u16::MAX => Err(ReadError::OverRange),
            millivolts => Ok(Measurement {
                voltage_v: Some(f32::from(millivolts) * 1e-3),
                ..Measurement::default()
            }),
        }
    }
}
