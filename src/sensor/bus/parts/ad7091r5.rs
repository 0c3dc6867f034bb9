//! Analog Devices' AD7091R-5: four more analog pins, 50 to 53 by ArduPilot's count, for dividers and current sensors.
//!
//! It has no identification: its configuration, read back, has to do.
//!
//! It converts one pin after the other while their results are read, round after round (the data sheet of its sibling AD7291
//! shows such a read), so that a long read spreads the conversions of each pin over the pulses of the motors. Wires and gaps
//! between bytes stretch a read by some percent: the share of a pulse is right within some conversions.

use crate::battery::{Measurement, ReadError};
use crate::log::info;
use crate::sensor::Conversions;
use crate::sensor::bus::part::{FAST_MODE_HZ, Part, Sharing};
use crate::sensor::bus::registers::Registers;
use crate::sensor::bus::{Address, SensorBus, Wiring};

const RESULT: u8 = 0x00;
const CHANNELS_REGISTER: u8 = 0x01;
const CONFIGURATION: u8 = 0x02;

/// Configuration: conversions by command, no internal reference, so that the 3.3 V at REF count.
const BY_COMMAND: u16 = 1 << 10;
const RESET: u16 = 1 << 9;
const ALL_CHANNELS: u8 = 0x0f;

/// 3.3 V over 12 bits.
const STEP_V: f32 = 3.3 / 4096.0;

const PINS: usize = 4;

/// The motors' PWM.
const PWM_HZ: u32 = 500;

/// Results of all pins once: two bytes each, with an acknowledge bit behind each byte.
const ROUND_BITS: usize = PINS * 2 * 9;

/// As many take 18 ms at 100 kHz.
const MOST_ROUNDS: usize = 25;

/// Rounds in a reading: the fewest that last, within a hundredth of a period, a whole number of periods of the motors' PWM.
fn rounds(i2c_clock_hz: u32) -> usize {
    let lasts_whole_periods = |rounds: &usize| {
        // In bits times the PWM's frequency, of which a period has as many as the clock has hertz.
        let rest = ((rounds * ROUND_BITS) as u32 * PWM_HZ).checked_rem(i2c_clock_hz);
        rest.is_some_and(|rest| rest.min(i2c_clock_hz - rest) <= i2c_clock_hz / 100)
    };
    (1..=MOST_ROUNDS).find(lasts_whole_periods).unwrap_or(MOST_ROUNDS)
}

/// ArduPilot's number of the first.
const FIRST_PIN: i32 = 50;

/// Both address pins at ground.
const ADDRESSES: [Address; 1] = [Address::I2c(0x2f)];

/// A converter that was set up, and the conversions of its pins in the last reading.
#[derive(Debug)]
pub(in crate::sensor::bus) struct Ad7091r5 {
    address: Address,
    rounds: usize,
    conversions: [Option<Conversions>; PINS],
}

impl Part for Ad7091r5 {
    type Model = ();

    const INTERVAL_US: u64 = 100_000;
    const HIGHEST_CLOCK_HZ: u32 = FAST_MODE_HZ;
    const FIRST_RESULT_US: u64 = Self::INTERVAL_US;
    const SHARING: Sharing = Sharing::ByPin;

    fn addresses((): &()) -> &'static [Address] {
        &ADDRESSES
    }

    async fn set_up(
        bus: &mut impl SensorBus,
        address: Address,
        wiring: &Wiring,
        (): &(),
    ) -> Result<Self, ReadError> {
        let mut registers = Registers::new(bus, address);
        registers.write_u16(CONFIGURATION, BY_COMMAND | RESET).await?;
        registers.write_u16(CONFIGURATION, BY_COMMAND).await?;
        registers.write_u8(CHANNELS_REGISTER, ALL_CHANNELS).await?;
        registers.expect_u16(CONFIGURATION, BY_COMMAND).await?;
        info!("AD7091R-5 {:?}", address);
        Ok(Self {
            address,
            rounds: rounds(wiring.i2c_clock_hz),
            conversions: [None; PINS],
        })
    }

    /// Reads all pins for the packs that share them, and then makes sure that it is set up.
    async fn begin_turn(&mut self, bus: &mut impl SensorBus) -> Result<(), ReadError> {
        let mut buffer = [[0; 2]; 1 + PINS * MOST_ROUNDS];
        let results = buffer.get_mut(..=PINS * self.rounds).unwrap_or_default();
        bus.write_read(self.address, &[RESULT], results.as_flattened_mut())
            .await?;
        Registers::new(bus, self.address)
            .expect_u16(CONFIGURATION, BY_COMMAND)
            .await?;
        // The first was converted at the end of the read before, or before the set-up.
        let results = results.get(1..).unwrap_or_default();
        for (pin, place) in self.conversions.iter_mut().enumerate() {
            // Each has its channel with it, so its place does not matter.
            let words = results.iter().map(|bytes| u16::from_be_bytes(*bytes));
            let of_pin = words.filter(|word| usize::from(word >> 13 & 3) == pin);
            *place = Conversions::from_codes(of_pin.map(|word| word & 0xfff));
        }
        Ok(())
    }

    async fn read(&mut self, _: &mut impl SensorBus, wiring: &Wiring) -> Result<Measurement, ReadError> {
        let analog = &wiring.analog;
        let pin_v = |conversions: Conversions| conversions.mean().0 * STEP_V;
        let voltage = self.pin(wiring.voltage_pin)?;
        let voltage = voltage.map(Conversions::within_range).transpose()?;
        let voltage_v = voltage.map(|conversions| analog.divider.pack_voltage_v(pin_v(conversions)));
        let current = self.pin(wiring.current_pin)?;
        let current_a = current.map(|conversions| analog.current_sensor.current_a(pin_v(conversions)));
        if voltage_v.is_none() && current_a.is_none() {
            return Err(ReadError::NoPin);
        }
        Ok(Measurement {
            voltage_v,
            current_a,
            current_range: current.map(|current| current.range()).unwrap_or_default(),
            ..Measurement::default()
        })
    }
}

impl Ad7091r5 {
    /// Reading of a pin; `None` if it is not one of these.
    fn pin(&self, pin: i32) -> Result<Option<Conversions>, ReadError> {
        let pin = usize::try_from(pin.wrapping_sub(FIRST_PIN)).ok();
        match pin.and_then(|pin| self.conversions.get(pin)) {
            Some(Some(conversions)) => Ok(Some(*conversions)),
            Some(None) => Err(ReadError::Implausible),
            None => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_lasts_a_whole_number_of_periods_of_the_pwm() {
        // 1.98 ms, and 18 ms.
        assert_eq!([400_000, 100_000].map(rounds), [11, 25]);
    }
}
