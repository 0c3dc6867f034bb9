//! Fuel level sensors with analog or pulse-width output.

use core::f32::consts::TAU;

use super::Pulses;
use crate::battery::{Contents, Gauge, GaugeReading, Measurement, ReadError};
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, Parameters};
use crate::time::Instant;

/// Servo pulse widths of an empty and a full tank, and their tolerance; ArduPilot's numbers.
const EMPTY_US: u32 = 1100;
const FULL_US: u32 = 1900;
const TOLERANCE_US: u32 = 20;

/// Time-out of the pulses, in microseconds.
const TIMEOUT_US: u64 = 250_000;

/// Scale of an analog level sensor; ArduPilot's formula.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LevelScale {
    /// Coefficients of the linearisation, a polynomial of the pin's voltage: constant term (`BATT_FL_OFF`).
    offset_v: f32,
    /// `BATT_FL_FF`.
    first_order: f32,
    /// `BATT_FL_FS`.
    second_order: f32,
    /// `BATT_FL_FT`.
    third_order: f32,
    /// Linearised voltage of the empty tank, in volts (`BATT_FL_VLT_MIN`).
    empty_v: f32,
    /// Fill level per volt, from 0 to 1 (`BATT_FL_V_MULT`).
    share_per_volt: f32,
    /// Cutoff frequency of the filter against sloshing, in Hz (`BATT_FL_FLTR`); `None` is disabled.
    cutoff_hz: Option<f32>,
}

impl LevelScale {
    /// From the live parameters of a pack.
    pub fn from_parameters(parameters: &Parameters, pack: Pack) -> Self {
        let value = |parameter: BatteryParameter| parameters.get(parameter.of(pack));
        Self {
            offset_v: value(BatteryParameter::FlOff),
            first_order: value(BatteryParameter::FlFf),
            second_order: value(BatteryParameter::FlFs),
            third_order: value(BatteryParameter::FlFt),
            empty_v: value(BatteryParameter::FlVltMin),
            share_per_volt: value(BatteryParameter::FlVMult),
            cutoff_hz: Some(value(BatteryParameter::FlFltr)).filter(|cutoff_hz| *cutoff_hz > 0.0),
        }
    }

    fn linearised_v(&self, pin_v: f32) -> f32 {
        self.offset_v + pin_v * (self.first_order + pin_v * (self.second_order + pin_v * self.third_order))
    }
}

/// Analog level meter with a low-pass filter against sloshing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LevelMeter {
    /// Time and output of the filter at the previous reading.
    last: Option<(Instant, f32)>,
}

impl LevelMeter {
    /// Measurement of a tank with this capacity.
    pub fn measure(
        &mut self,
        scale: &LevelScale,
        pin_v: f32,
        capacity_ml: Option<f32>,
        now: Instant,
    ) -> Result<Measurement, ReadError> {
        let level_v = self.filter(scale.linearised_v(pin_v), scale.cutoff_hz, now);
        tank((level_v - scale.empty_v) * scale.share_per_volt, capacity_ml)
    }

    fn filter(&mut self, voltage_v: f32, cutoff_hz: Option<f32>, now: Instant) -> f32 {
        let filtered_v = match (self.last, cutoff_hz) {
            (Some((last, last_v)), Some(cutoff_hz)) => {
                let steps = TAU * cutoff_hz * now.us_since(last) as f32 * 1e-6;
                last_v + (voltage_v - last_v) * steps / (1.0 + steps)
            }
            _ => voltage_v,
        };
        self.last = Some((now, filtered_v));
        filtered_v
    }
}

/// Pulse-width measurement of a tank with this capacity.
pub(super) fn level_by_pulses(
    pulses: &Pulses,
    capacity_ml: Option<f32>,
    now: Instant,
) -> Result<Measurement, ReadError> {
    let last = pulses.last_fall.ok_or(ReadError::Timeout)?;
    if now.us_since(last) > TIMEOUT_US {
        return Err(ReadError::Timeout);
    }
    let width_us = pulses.width_us();
    if width_us <= EMPTY_US - TOLERANCE_US || width_us >= FULL_US + TOLERANCE_US {
        return Err(ReadError::Implausible);
    }
    let above_empty_us = width_us.saturating_sub(EMPTY_US) as f32;
    tank(above_empty_us / (FULL_US - EMPTY_US) as f32, capacity_ml)
}

/// Measurement of a tank at this fill level, clamped to 0 to 1.
///
/// # Errors
/// The capacity is not set.
pub fn tank(fill_level: f32, capacity_ml: Option<f32>) -> Result<Measurement, ReadError> {
    let full_ml = capacity_ml.ok_or(ReadError::NoCapacity)?;
    Ok(Measurement {
        contents: Contents::Fuel,
        gauge: GaugeReading::Read(Gauge {
            remaining_mah: fill_level.clamp(0.0, 1.0) * full_ml,
            full_mah: full_ml,
        }),
        ..Measurement::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    const TICK_US: u64 = 100_000;

    fn scale(changes: &[(BatteryParameter, f32)]) -> LevelScale {
        let mut parameters = Parameters::defaults();
        for (parameter, value) in changes {
            parameters.set(parameter.of(Pack::Second), *value).unwrap();
        }
        LevelScale::from_parameters(&parameters, Pack::Second)
    }

    #[track_caller]
    fn assert_remaining(measurement: Result<Measurement, ReadError>, expected_ml: f32) {
        let measurement = measurement.expect("measured");
        let gauge = measurement.gauge.read().expect("a gauge");
        assert!(
            (gauge.remaining_mah - expected_ml).abs() < 0.1,
            "{} ml instead of {expected_ml}",
            gauge.remaining_mah
        );
        assert_eq!(gauge.full_mah, 2000.0);
        assert_eq!(measurement.contents, Contents::Fuel);
        assert_eq!((measurement.voltage_v, measurement.current_a), (None, None));
    }

    fn read(scale: &LevelScale, pin_v: f32) -> Result<Measurement, ReadError> {
        LevelMeter::default().measure(scale, pin_v, Some(2000.0), Instant::EPOCH)
    }

    #[test]
    fn default_scale_is_empty_at_500_mv_and_full_at_2500_mv() {
        let scale = scale(&[]);
        for (pin_v, remaining_ml) in [(0.5, 0.0), (1.0, 500.0), (2.5, 2000.0), (0.2, 0.0), (3.3, 2000.0)] {
            assert_remaining(read(&scale, pin_v), remaining_ml);
        }
    }

    #[test]
    fn nonlinear_sensor_is_linearised() {
        let scale = scale(&[
            (BatteryParameter::FlFf, 0.5),
            (BatteryParameter::FlFs, -0.25),
            (BatteryParameter::FlFt, 0.125),
            (BatteryParameter::FlOff, 0.75),
            (BatteryParameter::FlVltMin, 0.25),
            (BatteryParameter::FlVMult, 0.4),
        ]);
        // 0.75 + 0.5 · 2 − 0.25 · 4 + 0.125 · 8 = 1.75 V.
        assert_remaining(read(&scale, 2.0), 2000.0 * 0.4 * 1.5);
    }

    #[test]
    fn sloshing_is_low_pass_filtered() {
        let scale = scale(&[]);
        let mut meter = LevelMeter::default();
        assert_remaining(meter.measure(&scale, 2.5, Some(2000.0), Instant::EPOCH), 2000.0);
        // The time constant is 1 / (2 π 0.3 Hz) = 0.53 s: 1/e of a step remains, less the effect of the tick.
        let mut remaining_ml = 0.0;
        for tick in 1..=5 {
            let measurement = meter
                .measure(&scale, 0.5, Some(2000.0), at_us(tick * TICK_US))
                .unwrap();
            remaining_ml = measurement.gauge.read().unwrap().remaining_mah;
        }
        assert!((800.0..900.0).contains(&remaining_ml), "{remaining_ml} ml");
        for tick in 6..=60 {
            meter
                .measure(&scale, 0.5, Some(2000.0), at_us(tick * TICK_US))
                .unwrap();
        }
        assert_remaining(meter.measure(&scale, 0.5, Some(2000.0), at_us(61 * TICK_US)), 0.0);
    }

    #[test]
    fn disabled_filter_follows_at_once() {
        let scale = scale(&[(BatteryParameter::FlFltr, -1.0)]);
        let mut meter = LevelMeter::default();
        assert_remaining(meter.measure(&scale, 2.5, Some(2000.0), Instant::EPOCH), 2000.0);
        assert_remaining(meter.measure(&scale, 1.5, Some(2000.0), at_us(TICK_US)), 1000.0);
    }

    #[test]
    fn level_needs_a_capacity() {
        let measured = LevelMeter::default().measure(&scale(&[]), 1.0, None, Instant::EPOCH);
        assert_eq!(measured, Err(ReadError::NoCapacity));
    }

    fn pulses(width_us: u64) -> Pulses {
        let mut pulses = Pulses::NONE;
        for start_us in [0, 20_000, 40_000] {
            pulses.rise(at_us(start_us));
            pulses.fall(at_us(start_us + width_us));
        }
        pulses
    }

    #[test]
    fn pulse_width_is_scaled_from_empty_to_full() {
        for (width_us, remaining_ml) in [
            (1081, 0.0),
            (1100, 0.0),
            (1300, 500.0),
            (1500, 1000.0),
            (1900, 2000.0),
            (1919, 2000.0),
        ] {
            assert_remaining(
                level_by_pulses(&pulses(width_us), Some(2000.0), at_us(100_000)),
                remaining_ml,
            );
        }
        for width_us in [1, 1080, 1920, 20_000] {
            let measured = level_by_pulses(&pulses(width_us), Some(2000.0), at_us(100_000));
            assert_eq!(measured, Err(ReadError::Implausible), "{width_us}");
        }
    }

    #[test]
    fn pulses_time_out_after_250_ms() {
        let read = |us| level_by_pulses(&pulses(1500), Some(2000.0), at_us(us));
        assert_remaining(read(41_500 + 250_000), 1000.0);
        assert_eq!(read(41_500 + 250_001), Err(ReadError::Timeout));
        let never = level_by_pulses(&Pulses::NONE, Some(2000.0), at_us(100_000));
        assert_eq!(never, Err(ReadError::Timeout));
    }
}
