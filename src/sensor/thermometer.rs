//! Thermometers for packs whose own sensors have none.

use super::{AdcCount, AnalogPin, AnalogReadings, PinUse};
use crate::battery::{Measurement, Thermometer};
use crate::pack::{Pack, PackSet};
use crate::parameter::{Parameters, THERMOMETER_COUNT, TemperatureSensor, ThermometerParameter};
use crate::time::Instant;

/// `TEMP1_TYPE`, as in ArduPilot.
const ANALOG: i32 = 5;
const DRONE_CAN: i32 = 6;

/// `TEMP1_SRC`: a pack by its number.
const BATTERY_INDEX: i32 = 3;

/// A temperature from the CAN bus is unknown after this time, in microseconds.
const SILENCE_US: u64 = 5_000_000;

/// A thermometer in use.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Input {
    /// `TEMP1_PIN`, `TEMP1_A0` to `TEMP1_A5`
    Analog(Option<AnalogPin>, [f32; 6]),
    /// `TEMP1_MSG_ID`
    DroneCan(u16),
}

impl Input {
    // Inlined, the code would be repeated for each of its five uses.
    #[inline(never)]
    fn from_parameters(parameters: &Parameters, sensor: TemperatureSensor) -> Option<Self> {
        match parameters.get_whole(ThermometerParameter::Type.of(sensor)) {
            ANALOG => Some(Self::Analog(
                AnalogPin::from_gpio(parameters.get_whole(ThermometerParameter::Pin.of(sensor))),
                ThermometerParameter::COEFFICIENTS.map(|coefficient| parameters.get(coefficient.of(sensor))),
            )),
            DRONE_CAN => Some(Self::DroneCan(
                parameters.get_whole(ThermometerParameter::MessageId.of(sensor)) as u16,
            )),
            _ => None,
        }
    }
}

/// The pack whose temperature a thermometer measures (`TEMP1_SRC`, `TEMP1_SRC_ID`).
fn pack_of(parameters: &Parameters, sensor: TemperatureSensor) -> Option<Pack> {
    let number = parameters.get_whole(ThermometerParameter::SourceId.of(sensor)) as u8;
    let is_of_pack = parameters.get_whole(ThermometerParameter::Source.of(sensor)) == BATTERY_INDEX;
    Pack::from_instance(number.checked_sub(1)?).filter(|_| is_of_pack)
}

/// The packs that have a thermometer, whether or not it measures.
pub fn packs_with_thermometer(parameters: &Parameters) -> PackSet {
    let in_use = TemperatureSensor::ALL
        .into_iter()
        .filter(|sensor| Input::from_parameters(parameters, *sensor).is_some());
    in_use.filter_map(|sensor| pack_of(parameters, sensor)).collect()
}

/// The analog thermometers in use that have a pin.
pub fn thermometer_pins(
    parameters: &Parameters,
) -> impl Iterator<Item = (TemperatureSensor, AnalogPin)> + Clone {
    let sensors = TemperatureSensor::ALL.into_iter();
    sensors.filter_map(|sensor| match Input::from_parameters(parameters, sensor)? {
        Input::Analog(pin, _) => Some((sensor, pin?)),
        Input::DroneCan(_) => None,
    })
}

/// A thermometer whose pin another thermometer or a pack reads, too.
pub fn thermometer_on_shared_pin(parameters: &Parameters, of_packs: &PinUse) -> Option<TemperatureSensor> {
    let mut pins = thermometer_pins(parameters);
    let shared = pins.find(|(own, pin)| {
        let mut others = thermometer_pins(parameters).filter(|(other, _)| other != own);
        others.any(|(_, other)| other == *pin) || of_packs.contains(*pin)
    });
    shared.map(|(own, _)| own)
}

/// Whether any thermometer is on the CAN bus.
pub(super) fn has_can_thermometer(parameters: &Parameters) -> bool {
    let mut sensors = TemperatureSensor::ALL.into_iter();
    sensors.any(|sensor| parameters.get_whole(ThermometerParameter::Type.of(sensor)) == DRONE_CAN)
}

/// Temperatures of packs by thermometers, in degrees Celsius.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Temperatures([Option<(Pack, f32)>; THERMOMETER_COUNT]);

impl Temperatures {
    /// Completes a measurement whose sensor does not measure the pack's temperature.
    pub fn complete(&self, pack: Pack, measurement: &mut Measurement) {
        let has_own =
            measurement.possible_temperature_c().is_some() && measurement.thermometer == Thermometer::Pack;
        let mut measured = self.0.iter().flatten().filter(|(of_pack, _)| *of_pack == pack);
        if let Some((_, temperature_c)) = measured.next().filter(|_| !has_own) {
            measurement.temperature_c = Some(*temperature_c);
            measurement.thermometer = Thermometer::Pack;
        }
    }
}

/// All thermometers, with what was received from those on the CAN bus.
#[derive(Clone, Debug, Default)]
pub struct Thermometers {
    received: [Option<(f32, Instant)>; THERMOMETER_COUNT],
}

impl Thermometers {
    /// Takes a temperature in degrees Celsius from the CAN bus, with its device id.
    pub fn receive(&mut self, device_id: u16, temperature_c: f32, now: Instant, parameters: &Parameters) {
        for (received, sensor) in self.received.iter_mut().zip(TemperatureSensor::ALL) {
            if Input::from_parameters(parameters, sensor) == Some(Input::DroneCan(device_id)) {
                *received = Some((temperature_c, now));
            }
        }
    }

    /// The temperatures now.
    pub fn measure(&self, readings: &AnalogReadings, now: Instant, parameters: &Parameters) -> Temperatures {
        let mut temperatures = Temperatures::default();
        let sensors = self.received.iter().zip(TemperatureSensor::ALL);
        for (place, (received, sensor)) in temperatures.0.iter_mut().zip(sensors) {
            let Some(input) = Input::from_parameters(parameters, sensor) else {
                continue;
            };
            let temperature_c = match input {
                Input::Analog(pin, coefficients) => {
                    let conversions = pin.and_then(|pin| readings.pin(pin).ok());
                    conversions.and_then(|conversions| analog_c(conversions.mean(), &coefficients))
                }
                Input::DroneCan(_) => received
                    .filter(|(_, at)| now.us_since(*at) <= SILENCE_US)
                    .map(|(temperature_c, _)| temperature_c),
            };
            *place = pack_of(parameters, sensor).zip(Thermometer::Pack.possible_c(temperature_c));
        }
        temperatures
    }
}

/// Temperature by the voltage at a pin, in degrees Celsius; `None` while no coefficient is set, or a lead is broken or
/// shorted.
fn analog_c(count: AdcCount, coefficients: &[f32; 6]) -> Option<f32> {
    let is_set = coefficients.iter().any(|coefficient| *coefficient != 0.0);
    (is_set && !count.is_near_rail()).then(|| {
        let pin_v = count.pin_voltage_v();
        let powers = coefficients.iter().rev();
        powers.fold(0.0, |sum, coefficient| sum * pin_v + coefficient)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::MonitorKind;
    use crate::parameter::ThermometerParameter::{A0, A1, A2, MessageId, Pin, Source, SourceId, Type};
    use crate::sensor::Conversions;
    use crate::time::at_us;

    const SECOND: TemperatureSensor = TemperatureSensor::Second;

    fn with(values: &[(ThermometerParameter, f32)]) -> Parameters {
        let mut parameters = Parameters::defaults();
        let pack = [(Source, 3.0), (SourceId, 3.0)];
        for (parameter, value) in pack.iter().chain(values) {
            parameters.set(parameter.of(SECOND), *value).unwrap();
        }
        parameters
    }

    fn analog() -> Parameters {
        with(&[(Type, 5.0), (Pin, 28.0), (A0, 100.0), (A1, -50.0), (A2, 2.0)])
    }

    fn measured(parameters: &Parameters, count: u16) -> Measurement {
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp28, Ok(Conversions::of(count)));
        let temperatures = Thermometers::default().measure(&readings, at_us(0), parameters);
        let mut measurement = Measurement::default();
        temperatures.complete(Pack::Third, &mut measurement);
        measurement
    }

    #[test]
    // Requirement: AP-30
    fn a_pin_is_a_temperature_by_its_polynomial() {
        // 1.5 V: 100 − 75 + 4.5.
        let temperature_c = measured(&analog(), 1861).temperature_c.unwrap();
        assert!((temperature_c - 29.5).abs() < 0.1, "{temperature_c}");
        let mut other = Measurement::default();
        Temperatures([Some((Pack::Third, 20.0)); 3]).complete(Pack::First, &mut other);
        assert_eq!(other.temperature_c, None);
    }

    #[test]
    // Requirement: AP-30
    fn a_temperature_that_may_be_none_is_unknown() {
        for count in [0, 122, 3973, 4095] {
            assert_eq!(measured(&analog(), count).temperature_c, None, "{count}");
        }
        for count in [123, 2900, 3972] {
            assert!(measured(&analog(), count).temperature_c.is_some(), "{count}");
        }
        let mut too_hot = analog();
        too_hot.set(A0.of(SECOND), 201.0).unwrap();
        assert_eq!(measured(&too_hot, 1861).temperature_c, None);
        let without_coefficients = with(&[(Type, 5.0), (Pin, 28.0)]);
        assert_eq!(measured(&without_coefficients, 1861).temperature_c, None);
        let mut of_nothing = analog();
        of_nothing.set(Source.of(SECOND), 0.0).unwrap();
        assert_eq!(measured(&of_nothing, 1861).temperature_c, None);
    }

    #[test]
    // Requirement: AP-30
    fn a_pin_that_a_pack_or_another_thermometer_reads_is_shared() {
        let packs = [(Pack::First, MonitorKind::AnalogVoltage)];
        let shared = |parameters: &Parameters| {
            thermometer_on_shared_pin(parameters, &PinUse::of_packs(&packs, parameters))
        };
        let mut parameters = analog();
        assert_eq!(shared(&parameters), None);
        parameters.set(Pin.of(SECOND), 26.0).unwrap();
        assert_eq!(shared(&parameters), Some(SECOND), "the divider's");
        parameters.set(Type.of(SECOND), 6.0).unwrap();
        assert_eq!(shared(&parameters), None, "not an analog one");
        let mut parameters = analog();
        let first = TemperatureSensor::First;
        parameters.set(Pin.of(first), 28.0).unwrap();
        parameters.set(Type.of(first), 5.0).unwrap();
        assert_eq!(shared(&parameters), Some(first));
    }

    #[test]
    // Requirement: AP-30
    fn a_sensors_own_temperature_of_the_pack_has_priority() {
        let temperatures = Temperatures([None, Some((Pack::Third, 20.0)), None]);
        for (thermometer, own_c, expected_c) in [
            (Thermometer::Pack, 35.0, 35.0),
            (Thermometer::Pack, 126.0, 20.0),
            (Thermometer::Device, 35.0, 20.0),
        ] {
            let mut measurement = Measurement {
                temperature_c: Some(own_c),
                thermometer,
                ..Measurement::default()
            };
            temperatures.complete(Pack::Third, &mut measurement);
            assert_eq!(
                (measurement.temperature_c, measurement.thermometer),
                (Some(expected_c), Thermometer::Pack)
            );
        }
    }

    #[test]
    // Requirement: AP-30
    fn a_temperature_from_the_bus_is_that_of_its_device_for_five_seconds() {
        let parameters = with(&[(Type, 6.0), (MessageId, 1234.0)]);
        let mut thermometers = Thermometers::default();
        thermometers.receive(1233, 50.0, at_us(0), &parameters);
        thermometers.receive(1234, 20.0, at_us(0), &parameters);
        let at = |us| thermometers.measure(&AnalogReadings::NONE, at_us(us), &parameters);
        assert_eq!(at(SILENCE_US).0[1], Some((Pack::Third, 20.0)));
        assert_eq!(at(SILENCE_US + 1), Temperatures::default());
    }
}
