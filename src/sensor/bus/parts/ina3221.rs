//! Texas Instruments' INA3221 (SBOS576): three packs on one chip, each with a shunt of its own.

use super::{TEXAS_INSTRUMENTS, positive_voltage};
use crate::battery::{CurrentRange, Measurement, ReadError};
use crate::log::info;
use crate::sensor::bus::part::{FAST_MODE_HZ, Part, Sharing};
use crate::sensor::bus::registers::Registers;
use crate::sensor::bus::{Address, SensorBus, Wiring};

const CONFIGURATION: u8 = 0x00;
const MANUFACTURER_ID: u8 = 0xfe;
const DIE_ID: u8 = 0xff;
const INA3221: u16 = 0x3220;

/// All three channels, again and again, 16 times 588 µs for each of their voltages: 56 ms in all.
const CONTINUOUS: u16 = 0x74df;

/// The registers of channel n: the voltage over the shunt, then the one of the pack.
const SHUNT_VOLTAGE: [u8; 3] = [0x01, 0x03, 0x05];
const BUS_VOLTAGE: [u8; 3] = [0x02, 0x04, 0x06];

const SHUNT_STEP_V: f32 = 40e-6;
const BUS_STEP_V: f32 = 8e-3;

/// Both are 13 bits from bit 3 on; the others are always 0.
const UNUSED_BITS: u32 = 3;

/// Codes at either end are beyond the range, too; the data sheet ends the shunt's at 163.8 mV.
const END: i32 = 4095;

const ADDRESSES: [Address; 4] = [
    Address::I2c(0x40),
    Address::I2c(0x41),
    Address::I2c(0x42),
    Address::I2c(0x43),
];

/// An INA3221 that answered.
#[derive(Debug)]
pub(in crate::sensor::bus) struct Ina3221 {
    address: Address,
}

impl Part for Ina3221 {
    type Model = ();
    const INTERVAL_US: u64 = 100_000;
    const HIGHEST_CLOCK_HZ: u32 = FAST_MODE_HZ;
    /// Its conversions, a tenth longer at the most.
    const FIRST_RESULT_US: u64 = 65_000;
    const SHARING: Sharing = Sharing::ByChannel;

    fn addresses((): &()) -> &'static [Address] {
        &ADDRESSES
    }

    async fn set_up(
        bus: &mut impl SensorBus,
        address: Address,
        _: &Wiring,
        (): &(),
    ) -> Result<Self, ReadError> {
        let mut registers = Registers::new(bus, address);
        registers.expect_u16(MANUFACTURER_ID, TEXAS_INSTRUMENTS).await?;
        registers.expect_u16(DIE_ID, INA3221).await?;
        registers.write_u16(CONFIGURATION, CONTINUOUS).await?;
        info!("INA3221 {:?}", address);
        Ok(Self { address })
    }

    fn range(&self, wiring: &Wiring) -> Option<(&'static str, f32)> {
        Some(("INA3221", END as f32 * SHUNT_STEP_V / wiring.shunt_ohm))
    }

    async fn read(&mut self, bus: &mut impl SensorBus, wiring: &Wiring) -> Result<Measurement, ReadError> {
        let channel = usize::from(wiring.channel).wrapping_sub(1);
        let (Some(shunt), Some(voltage)) = (SHUNT_VOLTAGE.get(channel), BUS_VOLTAGE.get(channel)) else {
            return Err(ReadError::NoPin);
        };
        let mut registers = Registers::new(bus, self.address);
        let value = |code: u16, step_v: f32| {
            let steps = code as i16 >> UNUSED_BITS;
            let range = CurrentRange::of_code(steps.into(), -END..=END);
            (f32::from(steps) * step_v, range)
        };
        let (voltage_v, range) = value(registers.read_u16(*voltage).await?, BUS_STEP_V);
        let (shunt_v, current_range) = value(registers.read_u16(*shunt).await?, SHUNT_STEP_V);
        registers.expect_u16(CONFIGURATION, CONTINUOUS).await?;
        Ok(Measurement {
            voltage_v: Some(positive_voltage(voltage_v, range)?),
            current_a: Some(shunt_v / wiring.shunt_ohm),
            current_range,
            ..Measurement::default()
        })
    }
}
