//! Analog battery monitor: voltage divider and current sensor on ADC pins.

use super::fuel::level_pin;
use super::{AdcCount, AnalogPin, FuelKind, MonitorKind};
use crate::battery::{Measurement, ReadError};
use crate::parameter::{BatteryParameter, Pack, Parameters};

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

    /// The voltage at a pin, in volts.
    ///
    /// # Errors
    /// The pin is not set, or the read failed.
    pub(super) fn pin_voltage_v(&self, pin: Option<AnalogPin>) -> Result<f32, ReadError> {
        let pin = pin.ok_or(ReadError::NoPin)?;
        let count = self
            .counts
            .get(pin as usize)
            .copied()
            .unwrap_or(Err(ReadError::NoPin))?;
        Ok(count.pin_voltage_v())
    }
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

    /// The pins that a monitor of this kind reads.
    pub fn pins(&self, kind: MonitorKind) -> impl Iterator<Item = AnalogPin> {
        let voltage_pin = self.voltage_pin.filter(|_| kind.reads_voltage_pin());
        let current_pin = self.current_pin.filter(|_| kind.reads_current_pin());
        let is_level = kind == MonitorKind::Fuel(FuelKind::LevelAnalog);
        let level_pin = self.level_pin.filter(|_| is_level);
        voltage_pin.into_iter().chain(current_pin).chain(level_pin)
    }

    /// The measurement of a monitor of this kind; `throttle` from −1 to 1.
    ///
    /// # Errors
    /// A pin is not set, or its read failed.
    pub fn measure(
        &self,
        kind: MonitorKind,
        readings: &AnalogReadings,
        throttle: f32,
    ) -> Result<Measurement, ReadError> {
        let mut measurement = Measurement::default();
        if kind.reads_voltage_pin() {
            let pin_v = readings.pin_voltage_v(self.voltage_pin)?;
            measurement.voltage_v = Some(self.divider.pack_voltage_v(pin_v));
        }
        if kind.reads_current_pin() {
            let pin_v = readings.pin_voltage_v(self.current_pin)?;
            measurement.current_a = Some(self.current_sensor.current_a(pin_v));
        }
        if kind == MonitorKind::SyntheticCurrent {
            measurement.current_a = measurement
                .voltage_v
                .map(|voltage_v| self.synthetic_current_a(voltage_v, throttle));
        }
        Ok(measurement)
    }

    /// ArduPilot's model: proportional to the voltage and to the square of the throttle, plus `BATT_AMP_OFFSET` in
    /// amperes.
    fn synthetic_current_a(&self, voltage_v: f32, throttle: f32) -> f32 {
        let share = voltage_v / self.full_throttle_voltage_v;
        share * throttle * throttle * self.current_sensor.amperes_per_volt + self.current_sensor.offset_v
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        AnalogWiring::from_parameters(&parameters, Pack::First)
    }

    fn readings(gp26: u16, gp27: u16) -> AnalogReadings {
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp26, Ok(AdcCount(gp26)));
        readings.set(AnalogPin::Gp27, Ok(AdcCount(gp27)));
        readings
    }

    #[track_caller]
    fn assert_close(value: Option<f32>, expected: f32) {
        let value = value.expect("measured");
        assert!((value - expected).abs() < 0.005, "{value} instead of {expected}");
    }

    #[test]
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
    }

    #[test]
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
