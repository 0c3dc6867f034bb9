//! Analog Devices' LTC2946: 12-bit power monitor that adds up charge and energy itself.
//!
//! Its registers are as in the data sheet and in the maker's own examples; the counting of its accumulators was not seen on
//! silicon. It measures no current that flows into the pack.

use core::ops::RangeInclusive;

use super::positive_voltage;
use crate::battery::{Consumed, Counted, CurrentRange, Measurement, ReadError};
use crate::log::info;
use crate::sensor::bus::part::{FAST_MODE_HZ, Part};
use crate::sensor::bus::registers::Registers;
use crate::sensor::bus::{Address, SensorBus, Wiring};

const CONTROL_A: u8 = 0x00;
const CONTROL_B: u8 = 0x01;
const SENSE: u8 = 0x14;
const VOLTAGE: u8 = 0x1e;
const CHARGE: u8 = 0x38;
const ENERGY: u8 = 0x3c;
const SPECIAL_ID: u8 = 0xe7;

/// The first byte of the identification.
const LTC2946: u8 = 0x60;

/// The voltage at SENSE+ and the current by turns. ADIN, which is not measured, is referred to INTVCC: that shows a part which
/// has lost its supply, since it is set up for the rest by a reset, too.
const MEASURE_SENSE_PLUS: u8 = 0x98;

/// The accumulators run, and nothing resets them.
const ACCUMULATE: u8 = 0x00;

/// Steps of the 12 bits: 102.4 V and 102.4 mV over all but one of them.
const VOLTAGE_STEP_V: f32 = 102.4 / 4095.0;
const SENSE_STEP_V: f32 = 0.1024 / 4095.0;
const UNUSED_BITS: u32 = 4;

/// The highest code is over range; at the lowest nothing flows.
const CODES: RangeInclusive<i32> = -1..=0xfff;

/// It adds up with every tick of its own oscillator, in seconds.
const TICK_S: f32 = 4101.0 / 250_000.0;

/// Steps of a current in a step of the charge, and of a power in a step of the energy.
const CHARGE_STEPS: f32 = 16.0;
const ENERGY_STEPS: f32 = 65_536.0;

/// Its two address pins have nine settings.
const ADDRESSES: [Address; 9] = [
    Address::I2c(0x6f),
    Address::I2c(0x6e),
    Address::I2c(0x6d),
    Address::I2c(0x6c),
    Address::I2c(0x6b),
    Address::I2c(0x6a),
    Address::I2c(0x69),
    Address::I2c(0x68),
    Address::I2c(0x67),
];

/// An LTC2946 that answered.
#[derive(Debug)]
pub(in crate::sensor::bus) struct Ltc2946 {
    address: Address,
    /// Last reading of the accumulators: charge and energy.
    last: Option<(u32, u32)>,
}

impl Part for Ltc2946 {
    type Model = ();

    const INTERVAL_US: u64 = 25_000;
    const HIGHEST_CLOCK_HZ: u32 = FAST_MODE_HZ;
    /// A conversion that runs, then its offset, the voltage and the current, 16.4 ms each.
    const FIRST_RESULT_US: u64 = 75_000;

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
        registers.expect([(SPECIAL_ID, LTC2946)]).await?;
        registers.write_u8(CONTROL_A, MEASURE_SENSE_PLUS).await?;
        registers.write_u8(CONTROL_B, ACCUMULATE).await?;
        info!("LTC2946 {:?}", address);
        Ok(Self { address, last: None })
    }

    fn range(&self, wiring: &Wiring) -> Option<(&'static str, f32)> {
        Some(("LTC2946", *CODES.end() as f32 * SENSE_STEP_V / wiring.shunt_ohm))
    }

    async fn read(&mut self, bus: &mut impl SensorBus, wiring: &Wiring) -> Result<Measurement, ReadError> {
        let mut registers = Registers::new(bus, self.address);
        let value = |code: u16, step_v: f32| {
            let steps = code >> UNUSED_BITS;
            (
                f32::from(steps) * step_v,
                CurrentRange::of_code(steps.into(), CODES),
            )
        };
        let (voltage_v, range) = value(registers.read_u16(VOLTAGE).await?, VOLTAGE_STEP_V);
        let (sense_v, current_range) = value(registers.read_u16(SENSE).await?, SENSE_STEP_V);
        let charge = u32::from_be_bytes(registers.read(CHARGE).await?);
        let energy = u32::from_be_bytes(registers.read(ENERGY).await?);
        registers
            .expect([(SPECIAL_ID, LTC2946), (CONTROL_A, MEASURE_SENSE_PLUS)])
            .await?;
        let voltage_v = positive_voltage(voltage_v, range)?;
        let last = self.last.replace((charge, energy));
        Ok(Measurement {
            voltage_v: Some(voltage_v),
            current_a: Some(sense_v / wiring.shunt_ohm),
            current_range,
            counted: last.and_then(|(last_charge, last_energy)| {
                let charge_steps = steps_between(charge, last_charge)?;
                let energy_steps = steps_between(energy, last_energy)?;
                Some(counted(charge_steps, energy_steps, wiring))
            }),
            ..Measurement::default()
        })
    }
}

/// They only count up, and start over when they are full. `None` if they have been reset.
fn steps_between(now: u32, before: u32) -> Option<f32> {
    let steps = now.wrapping_sub(before);
    (steps <= u32::MAX / 2).then_some(steps as f32)
}

fn counted(charge_steps: f32, energy_steps: f32, wiring: &Wiring) -> Counted {
    let current_step_a = SENSE_STEP_V / wiring.shunt_ohm;
    let charge_c = charge_steps * CHARGE_STEPS * current_step_a * TICK_S;
    let energy_j = energy_steps * ENERGY_STEPS * current_step_a * VOLTAGE_STEP_V * TICK_S;
    Counted::Increment(Consumed::from_si(charge_c, energy_j))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    // Requirement: S-10
    fn a_counter_goes_on_over_its_end_and_one_that_was_reset_counts_nothing() {
        assert_eq!(steps_between(1_000, 400), Some(600.0));
        assert_eq!(steps_between(3, u32::MAX - 1), Some(5.0));
        assert_eq!(steps_between(400, 1_000), None);
    }
}
