//! Analog battery monitor: voltage divider and current sensor on ADC pins, and what packs read at which pins.

use super::analog::uses_pulses;
use super::{AdcCount, AnalogPin, AnalogReadings, AnalogWiring};
use crate::battery::{Extremes, MIN_CONNECTED_VOLTAGE_V, Measurement, ReadError};
use crate::pack::Pack;
use crate::parameter::{FuelKind, MonitorKind, Parameters};

impl AnalogWiring {
    /// The pins that a monitor of this kind reads.
    pub fn pins(&self, kind: MonitorKind) -> impl Iterator<Item = AnalogPin> {
        self.pins_by_use(kind).into_iter().flatten()
    }

    /// The pins of voltage, current and level that a monitor of this kind reads.
    pub(super) fn pins_by_use(&self, kind: MonitorKind) -> [Option<AnalogPin>; 3] {
        let is_level = kind == MonitorKind::Fuel(FuelKind::LevelAnalog);
        [
            self.voltage_pin.filter(|_| kind.reads_voltage_pin()),
            self.current_pin.filter(|_| kind.reads_current_pin()),
            self.level_pin.filter(|_| is_level),
        ]
    }

    /// The two pins of a monitor of this kind at which voltage and current are measured together.
    pub fn power_pins(&self, kind: MonitorKind) -> Option<(AnalogPin, AnalogPin)> {
        let [voltage_pin, current_pin, _] = self.pins_by_use(kind);
        voltage_pin.zip(current_pin)
    }

    /// The measurement of a monitor of this kind; `throttle` from −1 to 1.
    ///
    /// # Errors
    /// A pin is not set, its read failed, or the voltage is over range.
    pub fn measure(
        &self,
        kind: MonitorKind,
        readings: &AnalogReadings,
        throttle: f32,
    ) -> Result<Measurement, ReadError> {
        let mut measurement = Measurement::default();
        if kind.reads_voltage_pin() {
            let conversions = readings
                .pin(self.voltage_pin.ok_or(ReadError::NoPin)?)?
                .within_range()?;
            let voltage_v = |count: AdcCount| self.divider.pack_voltage_v(count.pin_voltage_v());
            measurement.voltage_v = Some(voltage_v(conversions.voltage()));
        }
        if kind.reads_current_pin() {
            let conversions = readings.pin(self.current_pin.ok_or(ReadError::NoPin)?)?;
            let current_a = |count: AdcCount| self.current_sensor.current_a(count.pin_voltage_v());
            measurement.current_a = Some(current_a(conversions.mean()));
            measurement.current_range = conversions.range();
        }
        measurement.power_w = self.power_w(kind, &measurement, readings);
        if kind == MonitorKind::SyntheticCurrent {
            // Without the voltage it is not known either.
            measurement.current_a = measurement
                .voltage_v
                .filter(|voltage_v| *voltage_v >= MIN_CONNECTED_VOLTAGE_V)
                .map(|voltage_v| self.synthetic_current_a(voltage_v, throttle));
        }
        Ok(measurement)
    }

    /// Extremes of the single conversions that a monitor of this kind reads. Those of a failed read mean nothing.
    pub fn extremes(&self, kind: MonitorKind, readings: &AnalogReadings) -> Extremes {
        let conversions = |pin: Option<AnalogPin>| readings.pin(pin?).ok();
        let voltage = conversions(self.voltage_pin.filter(|_| kind.reads_voltage_pin()));
        let current = conversions(self.current_pin.filter(|_| kind.reads_current_pin()));
        let current_a = |count: AdcCount| self.current_sensor.current_a(count.pin_voltage_v());
        Extremes {
            lowest_voltage_v: voltage
                .map(|voltage| self.divider.pack_voltage_v(voltage.lowest().pin_voltage_v())),
            // Its scale may be negative, unlike that of a voltage.
            highest_current_a: current
                .map(|current| current_a(current.lowest()).max(current_a(current.highest()))),
        }
    }

    /// Mean of the product of voltage and current, in watts: the product of their means, and their covariance.
    fn power_w(&self, kind: MonitorKind, means: &Measurement, readings: &AnalogReadings) -> Option<f32> {
        let (voltage_pin, current_pin) = self.power_pins(kind)?;
        let covariance_v2 = readings.covariance_v2(voltage_pin, current_pin)?;
        let scale = self.divider.multiplier * self.current_sensor.amperes_per_volt;
        Some(means.voltage_v? * means.current_a? + scale * covariance_v2)
    }

    /// ArduPilot's model: proportional to the voltage and to the square of the throttle, plus `BATT_AMP_OFFSET` in
    /// amperes.
    fn synthetic_current_a(&self, voltage_v: f32, throttle: f32) -> f32 {
        let share = voltage_v / self.full_throttle_voltage_v;
        share * throttle * throttle * self.current_sensor.amperes_per_volt + self.current_sensor.offset_v
    }
}

/// Pins that packs read, and as what, a bit for each analog pin. Several may read the same at a pin: a voltage that is measured
/// once may be that of two packs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PinUse {
    voltages: u8,
    currents: u8,
    levels: u8,
    /// A flow, and the width of pulses, at the pulse input.
    flow: bool,
    width: bool,
}

impl PinUse {
    /// By the live parameters of these packs, which are of these kinds since boot.
    pub fn of_packs(packs: &[(Pack, MonitorKind)], parameters: &Parameters) -> Self {
        let mut pins = Self::default();
        for (pack, kind) in packs {
            let wiring = AnalogWiring::from_parameters(parameters.pack(*pack));
            let [voltage, current, level] = wiring.pins_by_use(*kind).map(bit);
            pins.voltages |= voltage;
            pins.currents |= current;
            pins.levels |= level;
            pins.flow |= *kind == FLOW && uses_pulses(parameters.pack(*pack));
            pins.width |= *kind == WIDTH && uses_pulses(parameters.pack(*pack));
        }
        pins
    }

    /// Whether anything is read at an analog pin.
    pub fn contains(&self, pin: AnalogPin) -> bool {
        (self.voltages | self.currents | self.levels) & bit(Some(pin)) != 0
    }

    /// Whether something else is read where a pack of this kind has its current, level or flow. A voltage is whatever else is
    /// read there.
    pub fn is_taken(&self, kind: MonitorKind, parameters: &Parameters, pack: Pack) -> bool {
        match kind {
            FLOW | WIDTH => self.flow && self.width && uses_pulses(parameters.pack(pack)),
            _ => self.has_other_use(&AnalogWiring::from_parameters(parameters.pack(pack)), kind),
        }
    }

    /// Whether a pin of the current or level that are read at analog pins has another use.
    pub fn has_other_use(&self, wiring: &AnalogWiring, kind: MonitorKind) -> bool {
        let [_, current, level] = wiring.pins_by_use(kind).map(bit);
        current & self.voltages != 0 || level & (self.voltages | self.currents) != 0
    }
}

const FLOW: MonitorKind = MonitorKind::Fuel(FuelKind::Flow);
const WIDTH: MonitorKind = MonitorKind::Fuel(FuelKind::LevelPwm);

fn bit(pin: Option<AnalogPin>) -> u8 {
    pin.map_or(0, |pin| 1 << pin as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::CurrentRange;
    use crate::parameter::BatteryParameter;
    use crate::sensor::Conversions;

    fn wiring() -> AnalogWiring {
        let mut parameters = Parameters::defaults();
        for (parameter, value) in [
            (BatteryParameter::CurrPin, 27.0),
            (BatteryParameter::AmpPervlt, 10.0),
            (BatteryParameter::AmpOffset, 0.33),
            (BatteryParameter::FlPin, 28.0),
        ] {
            parameters.set(parameter.of(Pack::First), value).unwrap();
        }
        AnalogWiring::from_parameters(parameters.pack(Pack::First))
    }

    fn readings(gp26: u16, gp27: u16) -> AnalogReadings {
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp26, Ok(Conversions::of(gp26)));
        readings.set(AnalogPin::Gp27, Ok(Conversions::of(gp27)));
        readings
    }

    #[track_caller]
    fn assert_close(value: Option<f32>, expected: f32) {
        let value = value.expect("measured");
        assert!((value - expected).abs() < 0.005, "{value} instead of {expected}");
    }

    #[test]
    // Requirement: FR-13
    fn default_scale_gives_the_required_voltage() {
        // FR-00069: 3000 counts are 9.55 V with the default multiplier.
        let measure = |count| {
            wiring()
                .measure(MonitorKind::AnalogVoltage, &readings(count, 0), 0.0)
                .unwrap()
        };
        assert_close(measure(3000).voltage_v, 9.55);
        assert_close(measure(2482).voltage_v, 7.9006);
        assert_eq!(measure(0).voltage_v, Some(0.0));
        assert_eq!(measure(3000).current_a, None);
    }

    #[test]
    fn current_sensor_is_bidirectional() {
        let measure = |count| {
            wiring()
                .measure(MonitorKind::AnalogVoltageAndCurrent, &readings(2482, count), 0.0)
                .unwrap()
        };
        // 1241 counts are 1.0 V.
        assert_close(measure(1241).current_a, 6.7);
        assert_close(measure(0).current_a, -3.3);
        assert_close(measure(1241).voltage_v, 7.9006);
    }

    #[test]
    fn extremes_are_of_single_conversions_also_with_a_reversed_current_sensor() {
        let mut readings = AnalogReadings::NONE;
        for pin in [AnalogPin::Gp26, AnalogPin::Gp27] {
            let codes = [2482, 1241, 2482, 3723];
            readings.set(pin, Ok(Conversions::from_codes(codes.into_iter()).unwrap()));
        }
        let extremes = |amperes_per_volt, kind| {
            let mut wiring = wiring();
            wiring.current_sensor.amperes_per_volt = amperes_per_volt;
            wiring.extremes(kind, &readings)
        };
        // 1, 2 and 3 V at the pins.
        for (amperes_per_volt, highest_a) in [(10.0, 26.7), (-10.0, -6.7)] {
            let both = extremes(amperes_per_volt, MonitorKind::AnalogVoltageAndCurrent);
            assert_close(both.lowest_voltage_v, 3.9503);
            assert_close(both.highest_current_a, highest_a);
        }
        for (kind, measured) in [
            (MonitorKind::AnalogVoltage, (true, false)),
            (MonitorKind::AnalogCurrent, (false, true)),
            // Its current is computed.
            (MonitorKind::SyntheticCurrent, (true, false)),
        ] {
            let Extremes {
                lowest_voltage_v,
                highest_current_a,
            } = extremes(10.0, kind);
            let has = (lowest_voltage_v.is_some(), highest_current_a.is_some());
            assert_eq!(has, measured, "{kind:?}");
        }
    }

    #[test]
    fn current_only_monitor_has_no_voltage() {
        let measurement = wiring()
            .measure(MonitorKind::AnalogCurrent, &readings(2482, 1241), 0.0)
            .unwrap();
        assert_close(measurement.current_a, 6.7);
        assert_eq!(measurement.voltage_v, None);
    }

    #[test]
    fn synthetic_current_is_quadratic_in_the_throttle() {
        let current_a = |throttle| {
            let wiring = AnalogWiring {
                full_throttle_voltage_v: 7.9006,
                ..wiring()
            };
            wiring
                .measure(MonitorKind::SyntheticCurrent, &readings(2482, 0), throttle)
                .unwrap()
                .current_a
        };
        assert_close(current_a(0.0), 0.33);
        assert_close(current_a(0.5), 2.83);
        assert_close(current_a(-1.0), 10.33);
        // A loose wire.
        let measured = wiring().measure(MonitorKind::SyntheticCurrent, &readings(20, 0), 1.0);
        assert_eq!(measured.unwrap().current_a, None);
    }

    #[test]
    // Requirement: S-5
    fn unset_or_failed_pin_is_an_error() {
        let mut readings = readings(2482, 1241);
        readings.set(AnalogPin::Gp27, Err(ReadError::Timeout));
        let measure =
            |wiring: &AnalogWiring| wiring.measure(MonitorKind::AnalogVoltageAndCurrent, &readings, 0.0);
        assert_eq!(measure(&wiring()), Err(ReadError::Timeout));
        let unset = AnalogWiring {
            current_pin: None,
            ..wiring()
        };
        assert_eq!(measure(&unset), Err(ReadError::NoPin));
    }

    #[test]
    // Requirement: S-3
    fn full_scale_is_no_voltage_and_at_least_that_current() {
        let measure = |kind, gp26, gp27| wiring().measure(kind, &readings(gp26, gp27), 0.0);
        for kind in [
            MonitorKind::AnalogVoltage,
            MonitorKind::AnalogVoltageAndCurrent,
            MonitorKind::SyntheticCurrent,
        ] {
            assert!(measure(kind, 4094, 0).is_ok(), "{kind:?}");
            assert_eq!(measure(kind, 4095, 0), Err(ReadError::OverRange), "{kind:?}");
        }
        for (kind, gp26) in [
            (MonitorKind::AnalogVoltageAndCurrent, 2482),
            (MonitorKind::AnalogCurrent, 4095),
        ] {
            for (count, range) in [(4094, CurrentRange::Within), (4095, CurrentRange::Over)] {
                let measurement = measure(kind, gp26, count).unwrap();
                assert_eq!(measurement.current_range, range, "{kind:?}");
                assert!(measurement.current_a.is_some_and(|current_a| current_a > 29.6));
            }
        }
    }

    #[test]
    // Requirement: AP-4
    fn each_kind_reads_only_its_pins() {
        let pins = |kind| wiring().pins(kind).collect::<Vec<_>>();
        assert_eq!(pins(MonitorKind::AnalogVoltage), [AnalogPin::Gp26]);
        assert_eq!(
            pins(MonitorKind::AnalogVoltageAndCurrent),
            [AnalogPin::Gp26, AnalogPin::Gp27]
        );
        assert_eq!(pins(MonitorKind::AnalogCurrent), [AnalogPin::Gp27]);
        assert_eq!(pins(MonitorKind::SyntheticCurrent), [AnalogPin::Gp26]);
        assert_eq!(pins(MonitorKind::Sum), []);
        assert_eq!(pins(MonitorKind::Fuel(FuelKind::LevelAnalog)), [AnalogPin::Gp28]);
        assert_eq!(pins(MonitorKind::Fuel(FuelKind::Flow)), []);
    }
}
