//! Fuel sensors.

mod flow;
mod level;
mod pulses;

use flow::FlowMeter;
pub use level::tank;
use level::{LevelMeter, LevelScale, level_by_pulses};
use pulses::PULSE_GPIO;
pub use pulses::Pulses;

use super::{AnalogPin, AnalogReadings};
use crate::battery::{Measurement, ReadError};
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, Parameters};
use crate::time::Instant;

/// Kind of fuel sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum FuelKind {
    /// Flow sensor with a fixed volume per pulse.
    Flow,
    /// Level sensor with a pulse-width output.
    LevelPwm,
    /// Level sensor with an analog output.
    LevelAnalog,
}

/// Inputs of a fuel measurement.
#[derive(Clone, Copy, Debug)]
pub struct FuelReadings<'a> {
    /// Readings of the analog pins.
    pub pins: &'a AnalogReadings,
    /// Pulses on the pulse input.
    pub pulses: &'a Pulses,
    /// When they were taken.
    pub now: Instant,
}

/// State of a fuel sensor between readings.
#[derive(Clone, Copy, Debug, Default)]
pub struct FuelMeter {
    level: LevelMeter,
    flow: FlowMeter,
}

impl FuelMeter {
    /// Measurement of a sensor of this kind, with the wiring of its pack's parameters.
    ///
    /// # Errors
    /// The pin or the capacity is not set, the read failed or timed out, or the reading is implausible.
    pub fn measure(
        &mut self,
        kind: FuelKind,
        parameters: &Parameters,
        pack: Pack,
        readings: &FuelReadings<'_>,
    ) -> Result<Measurement, ReadError> {
        let now = readings.now;
        let value = |parameter: BatteryParameter| parameters.get(parameter.of(pack));
        let capacity_ml = capacity_ml(parameters, pack);
        match kind {
            FuelKind::Flow => {
                let pulses = pulses(parameters, pack, readings)?;
                let ml_per_pulse = value(BatteryParameter::AmpPervlt);
                Ok(self.flow.measure(pulses, ml_per_pulse, now))
            }
            FuelKind::LevelPwm => level_by_pulses(pulses(parameters, pack, readings)?, capacity_ml, now),
            FuelKind::LevelAnalog => {
                let pin_v = readings.pins.pin_voltage_v(level_pin(parameters, pack))?;
                let scale = LevelScale::from_parameters(parameters, pack);
                self.level.measure(&scale, pin_v, capacity_ml, now)
            }
        }
    }
}

/// Capacity of a tank (`BATT_CAPACITY`), in millilitres; `None` if it is not set.
pub fn capacity_ml(parameters: &Parameters, pack: Pack) -> Option<f32> {
    let capacity_ml = parameters.get(BatteryParameter::Capacity.of(pack));
    (capacity_ml > 0.0).then_some(capacity_ml)
}

/// Pin of an analog level sensor (`BATT_FL_PIN`).
pub(super) fn level_pin(parameters: &Parameters, pack: Pack) -> Option<AnalogPin> {
    AnalogPin::from_gpio(parameters.get_whole(BatteryParameter::FlPin.of(pack)))
}

/// The pulses, if the pack uses the pulse input (`BATT_CURR_PIN`).
fn pulses<'a>(
    parameters: &Parameters,
    pack: Pack,
    readings: &FuelReadings<'a>,
) -> Result<&'a Pulses, ReadError> {
    match parameters.get_whole(BatteryParameter::CurrPin.of(pack)) {
        PULSE_GPIO => Ok(readings.pulses),
        _ => Err(ReadError::NoPin),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::{Consumed, Counted};
    use crate::sensor::AdcCount;
    use crate::time::at_us;

    fn measure(kind: FuelKind, changes: &[(BatteryParameter, f32)]) -> Result<Measurement, ReadError> {
        let mut parameters = Parameters::defaults();
        for (parameter, value) in changes {
            parameters.set(parameter.of(Pack::First), *value).unwrap();
        }
        let mut pins = AnalogReadings::NONE;
        // 1.5 V.
        pins.set(AnalogPin::Gp28, Ok(AdcCount(1861)));
        let mut pulses = Pulses::NONE;
        for start_us in [0, 20_000, 40_000] {
            pulses.rise(at_us(start_us));
            pulses.fall(at_us(start_us + 1700));
        }
        let readings = FuelReadings {
            pins: &pins,
            pulses: &pulses,
            now: at_us(100_000),
        };
        FuelMeter::default().measure(kind, &parameters, Pack::First, &readings)
    }

    fn remaining_ml(measurement: Result<Measurement, ReadError>) -> f32 {
        measurement.unwrap().gauge.read().unwrap().remaining_mah.round()
    }

    #[test]
    fn level_is_read_from_its_own_pin() {
        let read = |pin| measure(FuelKind::LevelAnalog, &[(BatteryParameter::FlPin, pin)]);
        assert_eq!(remaining_ml(read(28.0)), 1650.0, "half of 3300 ml");
        assert_eq!(read(27.0), Err(ReadError::NoPin), "not read");
        assert_eq!(measure(FuelKind::LevelAnalog, &[]), Err(ReadError::NoPin));
    }

    #[test]
    fn pulses_are_read_from_the_pulse_input_only() {
        let wired = (BatteryParameter::CurrPin, 17.0);
        assert_eq!(remaining_ml(measure(FuelKind::LevelPwm, &[wired])), 2475.0);
        let flow = measure(FuelKind::Flow, &[wired, (BatteryParameter::AmpPervlt, 0.5)]).unwrap();
        let counted = Consumed {
            charge_mah: 1.5,
            energy_wh: 0.0,
        };
        assert_eq!(flow.counted, Some(Counted::Increment(counted)));
        for kind in [FuelKind::Flow, FuelKind::LevelPwm] {
            for pin in [-1.0, 26.0] {
                let elsewhere = measure(kind, &[(BatteryParameter::CurrPin, pin)]);
                assert_eq!(elsewhere, Err(ReadError::NoPin));
            }
        }
    }

    #[test]
    fn zero_capacity_is_not_set() {
        let wired = [
            (BatteryParameter::CurrPin, 17.0),
            (BatteryParameter::Capacity, 0.0),
        ];
        assert_eq!(measure(FuelKind::LevelPwm, &wired), Err(ReadError::NoCapacity));
        assert!(
            measure(FuelKind::Flow, &wired).is_ok(),
            "the flow needs no capacity"
        );
    }
}
