//! Analog pins, the ADC, and what is wired to the pins, with its scales.

use crate::battery::{CurrentRange, ReadError};
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, Parameters};

/// Full-scale code of the RP2040's 12-bit ADC.
pub const ADC_FULL_SCALE: u16 = 4095;

/// ADC reference, in volts: ADC_VREF on the board is the 3.3 V rail.
pub const ADC_REFERENCE_V: f32 = 3.3;

/// Conversions averaged into one reading. A burst takes well under a millisecond and reduces ripple and noise by a
/// factor of four.
pub const BURST_CONVERSIONS: u16 = 16;

/// A raw code of the 12-bit ADC, 0 to [`ADC_FULL_SCALE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct AdcCount(pub u16);

impl AdcCount {
    /// The same, if the voltage may be what it shows.
    ///
    /// # Errors
    /// It is at full scale: the voltage is that or any above it.
    pub(super) fn within_range(self) -> Result<Self, ReadError> {
        match self.current_range() {
            CurrentRange::Within => Ok(self),
            CurrentRange::Over => Err(ReadError::OverRange),
        }
    }

    /// Whether a current sensor at the pin is within range.
    pub(super) fn current_range(self) -> CurrentRange {
        if self.0 < ADC_FULL_SCALE {
            CurrentRange::Within
        } else {
            CurrentRange::Over
        }
    }

    /// The voltage at the pin, in volts.
    pub fn pin_voltage_v(self) -> f32 {
        f32::from(self.0) * (ADC_REFERENCE_V / f32::from(ADC_FULL_SCALE))
    }
}

/// An analog pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum AnalogPin {
    /// GP26, ADC0
    Gp26,
    /// GP27, ADC1
    Gp27,
    /// GP28, ADC2
    Gp28,
    /// GP29, ADC3
    Gp29,
}

impl AnalogPin {
    /// All analog pins, in the order of their discriminants.
    pub const ALL: [Self; 4] = [Self::Gp26, Self::Gp27, Self::Gp28, Self::Gp29];

    /// The pin with this GPIO number (`BATT_VOLT_PIN`, `BATT_CURR_PIN`).
    pub fn from_gpio(number: i32) -> Option<Self> {
        match number {
            26 => Some(Self::Gp26),
            27 => Some(Self::Gp27),
            28 => Some(Self::Gp28),
            29 => Some(Self::Gp29),
            _ => None,
        }
    }
}

/// Pin of an analog level sensor (`BATT_FL_PIN`).
pub(super) fn level_pin(parameters: &Parameters, pack: Pack) -> Option<AnalogPin> {
    AnalogPin::from_gpio(parameters.get_whole(BatteryParameter::FlPin.of(pack)))
}

/// ADC readings of one tick, by pin.
#[derive(Clone, Copy, Debug)]
pub struct AnalogReadings {
    counts: [Result<AdcCount, ReadError>; AnalogPin::ALL.len()],
}

impl AnalogReadings {
    /// No pin was read.
    pub const NONE: Self = Self {
        counts: [Err(ReadError::NoPin); AnalogPin::ALL.len()],
    };

    /// Sets the reading of a pin.
    pub fn set(&mut self, pin: AnalogPin, count: Result<AdcCount, ReadError>) {
        if let Some(place) = self.counts.get_mut(pin as usize) {
            *place = count;
        }
    }

    /// Reading of a pin.
    ///
    /// # Errors
    /// The pin is not set, or the read failed.
    pub(super) fn count(&self, pin: Option<AnalogPin>) -> Result<AdcCount, ReadError> {
        let pin = pin.ok_or(ReadError::NoPin)?;
        self.counts
            .get(pin as usize)
            .copied()
            .unwrap_or(Err(ReadError::NoPin))
    }
}

/// Whether an analog pin is pulled up while it is in use: then a broken lead is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum PinPull {
    /// A pull would bend a divider's ratio.
    None,
    /// By the pad's resistor of some 60 kΩ.
    Up,
}

/// Analog pins with their ADC.
pub trait AnalogIn {
    /// One conversion of `pin`. It may never complete: the caller applies a time-out.
    ///
    /// # Errors
    /// The ADC reported a failed conversion.
    // The futures stay on one executor, so they need not be `Send`.
    #[allow(async_fn_in_trait)]
    async fn convert(&mut self, pin: AnalogPin) -> Result<AdcCount, ReadError>;

    /// Pulls `pin` like this from now on, if it can be pulled.
    fn pull(&mut self, _pin: AnalogPin, _pull: PinPull) {}
}

/// Rounded mean of a burst of [`BURST_CONVERSIONS`] conversions.
///
/// # Errors
/// A conversion failed. A mean of the others would be noisier without an indication.
pub async fn read_mean(input: &mut impl AnalogIn, pin: AnalogPin) -> Result<AdcCount, ReadError> {
    let mut sum = 0u32;
    for _ in 0..BURST_CONVERSIONS {
        sum += u32::from(input.convert(pin).await?.0);
    }
    let conversions = u32::from(BURST_CONVERSIONS);
    // The mean of u16 values is a u16.
    Ok(AdcCount(((sum + conversions / 2) / conversions) as u16))
}

/// Analog wiring of a pack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalogWiring {
    /// Pin of the voltage divider (`BATT_VOLT_PIN`).
    pub voltage_pin: Option<AnalogPin>,
    /// Scale of the voltage.
    pub divider: VoltageDivider,
    /// Pin of the current sensor (`BATT_CURR_PIN`).
    pub current_pin: Option<AnalogPin>,
    /// Scale of the current.
    pub current_sensor: CurrentSensor,
    /// Pin of a fuel level sensor (`BATT_FL_PIN`).
    pub level_pin: Option<AnalogPin>,
    /// Voltage at which full throttle draws `BATT_AMP_PERVLT` amperes, in volts (`BATT_MAX_VOLT`).
    pub full_throttle_voltage_v: f32,
}

/// Scale of a voltage divider.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltageDivider {
    /// Pack voltage divided by pin voltage, without a unit (`BATT_VOLT_MULT`).
    pub multiplier: f32,
    /// Pin voltage at zero pack voltage, in volts (`BATT_VLT_OFFSET`).
    pub offset_v: f32,
}

/// Scale of an analog current sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentSensor {
    /// Amperes per volt at the pin (`BATT_AMP_PERVLT`).
    pub amperes_per_volt: f32,
    /// Pin voltage at zero current, in volts (`BATT_AMP_OFFSET`).
    pub offset_v: f32,
}

impl VoltageDivider {
    /// The pack's voltage, in volts: `(pin voltage − offset) × multiplier`.
    pub fn pack_voltage_v(&self, pin_voltage_v: f32) -> f32 {
        (pin_voltage_v - self.offset_v) * self.multiplier
    }
}

impl CurrentSensor {
    /// The pack's current, in amperes: `(pin voltage − offset) × amperes per volt`; negative while charging.
    pub fn current_a(&self, pin_voltage_v: f32) -> f32 {
        (pin_voltage_v - self.offset_v) * self.amperes_per_volt
    }
}

impl AnalogWiring {
    /// The highest voltage that can be measured of a pack at the divider on the board, in volts; `None` if its pin is another.
    pub fn board_divider_range_v(&self) -> Option<f32> {
        let is_boards = self.voltage_pin == Some(AnalogPin::Gp26);
        is_boards.then(|| {
            self.divider
                .pack_voltage_v(AdcCount(ADC_FULL_SCALE).pin_voltage_v())
        })
    }

    /// From the live parameters of a pack.
    pub fn from_parameters(parameters: &Parameters, pack: Pack) -> Self {
        let value = |parameter: BatteryParameter| parameters.get(parameter.of(pack));
        let pin =
            |parameter: BatteryParameter| AnalogPin::from_gpio(parameters.get_whole(parameter.of(pack)));
        Self {
            voltage_pin: pin(BatteryParameter::VoltPin),
            divider: VoltageDivider {
                multiplier: value(BatteryParameter::VoltMult),
                offset_v: value(BatteryParameter::VltOffset),
            },
            current_pin: pin(BatteryParameter::CurrPin),
            current_sensor: CurrentSensor {
                amperes_per_volt: value(BatteryParameter::AmpPervlt),
                offset_v: value(BatteryParameter::AmpOffset),
            },
            level_pin: level_pin(parameters, pack),
            full_throttle_voltage_v: value(BatteryParameter::MaxVolt),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::IntoIter;

    use embassy_futures::block_on;

    use super::*;

    struct Recorded(IntoIter<Result<AdcCount, ReadError>>);

    impl AnalogIn for Recorded {
        async fn convert(&mut self, _: AnalogPin) -> Result<AdcCount, ReadError> {
            self.0.next().expect("more conversions than recorded")
        }
    }

    fn mean_of(results: [Result<AdcCount, ReadError>; 16]) -> Result<AdcCount, ReadError> {
        let mut input = Recorded(Vec::from(results).into_iter());
        block_on(read_mean(&mut input, AnalogPin::Gp26))
    }

    #[test]
    // Requirement: FR-11
    fn mean_of_a_burst_is_rounded() {
        let mut burst = [Ok(AdcCount(1000)); 16];
        burst[..7].fill(Ok(AdcCount(1001)));
        assert_eq!(mean_of(burst), Ok(AdcCount(1000)));
        burst[..8].fill(Ok(AdcCount(1001)));
        assert_eq!(mean_of(burst), Ok(AdcCount(1001)));
    }

    #[test]
    fn mean_of_full_scale_does_not_overflow() {
        let full_scale = Ok(AdcCount(ADC_FULL_SCALE));
        assert_eq!(mean_of([full_scale; 16]), full_scale);
    }

    #[test]
    fn one_failed_conversion_fails_the_burst() {
        let mut burst = [Ok(AdcCount(2000)); 16];
        burst[9] = Err(ReadError::Conversion);
        assert_eq!(mean_of(burst), Err(ReadError::Conversion));
    }
}
