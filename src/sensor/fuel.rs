//! Fuel: flow meters, level sensors of a tank, and what an engine takes by its injectors.

use core::f32::consts::TAU;
use core::ops::RangeInclusive;

use super::analog::{level_pin, uses_pulses};
use super::{AdcCount, AnalogReadings};
use crate::battery::{Contents, Counted, Gauge, GaugeReading, Measurement, ReadError};
use crate::parameter::{BatteryParameter, FuelKind, PackParameters, Parameters, VehicleParameter};
use crate::time::Instant;

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
    /// The pin, the capacity or the scale is not set, the read failed or timed out, or the reading is implausible.
    pub fn measure(
        &mut self,
        kind: FuelKind,
        pack: PackParameters<'_>,
        readings: &FuelReadings<'_>,
    ) -> Result<Measurement, ReadError> {
        let now = readings.now;
        let capacity_ml = capacity_ml(pack);
        match kind {
            FuelKind::Flow => {
                let pulses = pulses(pack, readings)?;
                let ml_per_pulse = pack.get(BatteryParameter::AmpPervlt);
                // Pulses without a scale must not count once it is set.
                let measurement = self.flow.measure(pulses, ml_per_pulse, now);
                if ml_per_pulse > 0.0 {
                    Ok(measurement)
                } else {
                    Err(ReadError::NoScale)
                }
            }
            FuelKind::LevelPwm => level_by_pulses(pulses(pack, readings)?, capacity_ml, now),
            FuelKind::LevelAnalog => {
                let conversions = readings.pins.pin(level_pin(pack).ok_or(ReadError::NoPin)?)?;
                let scale = LevelScale::from_parameters(pack);
                self.level.measure(&scale, conversions.mean(), capacity_ml, now)
            }
        }
    }
}

/// Capacity of a tank (`BATT_CAPACITY`), in millilitres; `None` if it is not set.
pub fn capacity_ml(pack: PackParameters<'_>) -> Option<f32> {
    pack.above_zero(BatteryParameter::Capacity)
}

/// The pulses, if the pack uses the pulse input (`BATT_CURR_PIN`).
fn pulses<'a>(pack: PackParameters<'_>, readings: &FuelReadings<'a>) -> Result<&'a Pulses, ReadError> {
    uses_pulses(pack)
        .then_some(readings.pulses)
        .ok_or(ReadError::NoPin)
}

/// Count and timing of pulses since boot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pulses {
    /// Rising edges, modulo 2^32.
    count: u32,
    /// Time of the last rising edge.
    last_rise: Option<Instant>,
    /// Time of the last falling edge.
    last_fall: Option<Instant>,
    /// Widths of the last three, in µs.
    widths_us: [u32; 3],
}

impl Pulses {
    /// No pulses.
    pub const NONE: Self = Self {
        count: 0,
        last_rise: None,
        last_fall: None,
        widths_us: [0; 3],
    };

    /// Rising edge.
    pub fn rise(&mut self, now: Instant) {
        self.count = self.count.wrapping_add(1);
        self.last_rise = Some(now);
    }

    /// Falling edge.
    pub fn fall(&mut self, now: Instant) {
        let Some(rise) = self.last_rise else { return };
        let width_us = now.us_since(rise);
        let [latest, before, _] = self.widths_us;
        self.widths_us = [u32::try_from(width_us).unwrap_or(u32::MAX), latest, before];
        self.last_fall = Some(now);
    }

    /// Pulse width, in µs: the median of three, which rejects one measured late by a busy processor.
    fn width_us(&self) -> u32 {
        let [a, b, c] = self.widths_us;
        a.min(b).max(a.max(b).min(c))
    }
}

/// Time without a pulse after which the flow is zero, in microseconds.
const MAX_PERIOD_US: u64 = 10_000_000;

/// Litres per hour in one millilitre per second.
const L_H_PER_ML_S: f32 = 3.6;

/// Flow meter: volume and flow rate from pulses.
#[derive(Clone, Copy, Debug, Default)]
struct FlowMeter {
    /// The pulses at the previous call.
    previous: Pulses,
    pulses_per_s: f32,
}

impl FlowMeter {
    /// Volume since the previous call, and the present flow rate.
    pub fn measure(&mut self, pulses: &Pulses, ml_per_pulse: f32, now: Instant) -> Measurement {
        let before = core::mem::replace(&mut self.previous, *pulses);
        let new = pulses.count.wrapping_sub(before.count) as f32;
        self.pulses_per_s = match (before.last_rise, pulses.last_rise) {
            (Some(from), Some(to)) if to > from => new / seconds(to.us_since(from)),
            (_, Some(last)) => self.decayed_rate(now.us_since(last)),
            (_, None) => 0.0,
        };
        Measurement {
            contents: Contents::Fuel,
            fuel_l_h: Some(self.pulses_per_s * ml_per_pulse * L_H_PER_ML_S),
            counted: Some(Counted::Volume(new * ml_per_pulse)),
            ..Measurement::default()
        }
    }

    /// The rate decays while no pulse arrives: at most that of a pulse right now.
    fn decayed_rate(&self, pause_us: u64) -> f32 {
        if pause_us >= MAX_PERIOD_US {
            return 0.0;
        }
        // A division by 0 gives infinity, which the minimum ignores.
        self.pulses_per_s.min(1.0 / seconds(pause_us))
    }
}

fn seconds(us: u64) -> f32 {
    us as f32 * 1e-6
}

/// Servo pulse widths of an empty and a full tank, and their tolerance; ArduPilot's numbers.
const EMPTY_US: u32 = 1100;
const FULL_US: u32 = 1900;
const TOLERANCE_US: u32 = 20;

/// Time-out of the pulses, in microseconds.
const PULSE_TIMEOUT_US: u64 = 250_000;

/// Scale of an analog level sensor; ArduPilot's formula.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LevelScale {
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
    pub fn from_parameters(pack: PackParameters<'_>) -> Self {
        Self {
            offset_v: pack.get(BatteryParameter::FlOff),
            first_order: pack.get(BatteryParameter::FlFf),
            second_order: pack.get(BatteryParameter::FlFs),
            third_order: pack.get(BatteryParameter::FlFt),
            empty_v: pack.get(BatteryParameter::FlVltMin),
            share_per_volt: pack.get(BatteryParameter::FlVMult),
            cutoff_hz: pack.above_zero(BatteryParameter::FlFltr),
        }
    }

    fn linearised_v(&self, pin_v: f32) -> f32 {
        self.offset_v + pin_v * (self.first_order + pin_v * (self.second_order + pin_v * self.third_order))
    }

    /// Fill level, from 0 to 1, unless it is beyond empty or full.
    fn fill_level(&self, level_v: f32) -> f32 {
        (level_v - self.empty_v) * self.share_per_volt
    }
}

/// Fill levels of a broken or a shorted lead are beyond these, and near a rail. Many tanks are empty at 0 V.
const CONNECTED_LEVELS: RangeInclusive<f32> = -0.1..=1.1;

/// Analog level meter with a low-pass filter against sloshing.
#[derive(Clone, Copy, Debug, Default)]
struct LevelMeter {
    /// Time and output of the filter at the previous reading.
    last: Option<(Instant, f32)>,
}

impl LevelMeter {
    /// Measurement of a tank with this capacity.
    pub fn measure(
        &mut self,
        scale: &LevelScale,
        pin: AdcCount,
        capacity_ml: Option<f32>,
        now: Instant,
    ) -> Result<Measurement, ReadError> {
        let level_v = scale.linearised_v(pin.pin_voltage_v());
        if pin.is_near_rail() && !CONNECTED_LEVELS.contains(&scale.fill_level(level_v)) {
            return Err(ReadError::Implausible);
        }
        let filtered_v = self.filter(level_v, scale.cutoff_hz, now);
        tank(scale.fill_level(filtered_v), capacity_ml)
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
fn level_by_pulses(
    pulses: &Pulses,
    capacity_ml: Option<f32>,
    now: Instant,
) -> Result<Measurement, ReadError> {
    let last = pulses.last_fall.ok_or(ReadError::Timeout)?;
    if now.us_since(last) > PULSE_TIMEOUT_US {
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
// Inlined, it would be repeated for each kind of tank.
#[inline(never)]
pub fn tank(fill_level: f32, capacity_ml: Option<f32>) -> Result<Measurement, ReadError> {
    let full_ml = capacity_ml.ok_or(ReadError::NoCapacity)?;
    Ok(Measurement {
        contents: Contents::Fuel,
        gauge: GaugeReading::Read(Gauge::of_tank(fill_level.clamp(0.0, 1.0) * full_ml, full_ml)),
        ..Measurement::default()
    })
}

/// Up to this speed the engine does not run, in revolutions per minute: ArduPilot's limit.
const STANDSTILL_RPM: u16 = 100;

/// Duty cycle in percent, of an injection of one millisecond in each revolution, at one revolution per minute.
const DUTY_PCT: f32 = 1.0 / 600.0;

/// Litres per hour in one cubic centimetre per minute.
const L_H_PER_CM3_MIN: f32 = 0.06;

/// An engine control unit's reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EngineReading {
    /// Duration of an injection, in milliseconds.
    pub injection_ms: f32,
    /// Speed, in revolutions per minute.
    pub speed_rpm: u16,
}

impl EngineReading {
    /// The flow of fuel: the injectors' duty cycle, calibrated by `EFI_COEF1` and `EFI_COEF2` as in ArduPilot. Its volume has
    /// to be integrated.
    ///
    /// # Errors
    /// The calibration is not set.
    pub fn measure(&self, parameters: &Parameters) -> Result<Measurement, ReadError> {
        let slope = parameters.get(VehicleParameter::EfiCoef1);
        if slope <= 0.0 {
            return Err(ReadError::NotSetUp);
        }
        let duty_pct = self.injection_ms * f32::from(self.speed_rpm) * DUTY_PCT;
        let calibrated = duty_pct * slope - parameters.get(VehicleParameter::EfiCoef2);
        let cm3_per_minute = match self.speed_rpm {
            ..=STANDSTILL_RPM => 0.0,
            _ => calibrated.max(0.0),
        };
        Ok(Measurement {
            contents: Contents::Fuel,
            fuel_l_h: Some(cm3_per_minute * L_H_PER_CM3_MIN),
            ..Measurement::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::Pack;
    use crate::sensor::{AnalogPin, Conversions};
    use crate::time::at_us;

    fn changed(changes: &[(BatteryParameter, f32)], pack: Pack) -> Parameters {
        let mut parameters = Parameters::defaults();
        for (parameter, value) in changes {
            parameters.set(parameter.of(pack), *value).unwrap();
        }
        parameters
    }

    fn measure(kind: FuelKind, changes: &[(BatteryParameter, f32)]) -> Result<Measurement, ReadError> {
        // 1.5 V.
        measure_level(kind, changes, 1861)
    }

    fn measure_level(
        kind: FuelKind,
        changes: &[(BatteryParameter, f32)],
        level: u16,
    ) -> Result<Measurement, ReadError> {
        let parameters = changed(changes, Pack::First);
        let mut pins = AnalogReadings::NONE;
        pins.set(AnalogPin::Gp28, Ok(Conversions::of(level)));
        let readings = FuelReadings {
            pins: &pins,
            pulses: &of_widths(&[1700; 3]),
            now: at_us(100_000),
        };
        FuelMeter::default().measure(kind, parameters.pack(Pack::First), &readings)
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
    fn a_level_at_full_scale_is_a_full_tank() {
        use BatteryParameter::{FlPin, FlVMult, FlVltMin};
        let read = |empty_v, full_v, code| {
            let changes = [
                (FlPin, 28.0),
                (FlVltMin, empty_v),
                (FlVMult, 1.0 / (full_v - empty_v)),
            ];
            measure_level(FuelKind::LevelAnalog, &changes, code)
        };
        // The span ends at the rail, or less than a tenth before it.
        assert_eq!(remaining_ml(read(0.01, 3.3, 4095)), 3300.0);
        assert_eq!(remaining_ml(read(0.01, 3.01, 4095)), 3300.0);
        assert_eq!(remaining_ml(read(0.01, 3.3, 0)), 0.0);
        assert_eq!(remaining_ml(read(0.29, 3.3, 0)), 0.0);
    }

    #[test]
    fn a_level_far_beyond_its_span_at_a_rail_is_impossible() {
        let wired = [(BatteryParameter::FlPin, 28.0)];
        let read = |code| measure_level(FuelKind::LevelAnalog, &wired, code);
        // The default span is 0.5 to 2.5 V: a tenth beyond is 0.3 V and 2.7 V.
        for (code, expected_ml) in [
            (0, None),
            (122, None),
            (123, Some(0.0)),
            (3972, Some(3300.0)),
            (3973, None),
            (4095, None),
        ] {
            let expected = expected_ml.ok_or(ReadError::Implausible);
            assert_eq!(
                read(code).map(|level| remaining_ml(Ok(level))),
                expected,
                "{code}"
            );
        }
    }

    #[test]
    fn a_level_that_is_impossible_does_not_enter_the_filter() {
        let scale = scale(&[]);
        let mut meter = LevelMeter::default();
        let mut at = |pin_v, tick| meter.measure(&scale, count(pin_v), Some(2000.0), at_us(tick * TICK_US));
        assert_remaining(at(1.5, 0), 1000.0);
        assert_eq!(at(0.0, 1), Err(ReadError::Implausible));
        assert_remaining(at(1.5, 2), 1000.0);
    }

    #[test]
    fn a_flow_needs_millilitres_a_pulse_and_counts_none_from_before() {
        let mut meter = FuelMeter::default();
        let mut pulses = Pulses::NONE;
        let mut measure = |ml_per_pulse| {
            pulses.rise(at_us(1));
            let changes = [
                (BatteryParameter::CurrPin, 17.0),
                (BatteryParameter::AmpPervlt, ml_per_pulse),
            ];
            let readings = FuelReadings {
                pins: &AnalogReadings::NONE,
                pulses: &pulses,
                now: at_us(2),
            };
            let parameters = changed(&changes, Pack::First);
            let measured = meter.measure(FuelKind::Flow, parameters.pack(Pack::First), &readings)?;
            Ok(measured.counted)
        };
        for ml_per_pulse in [0.0, -0.5] {
            assert_eq!(measure(ml_per_pulse), Err(ReadError::NoScale));
        }
        assert_eq!(measure(0.5), Ok(Some(Counted::Volume(0.5))));
    }

    #[test]
    fn pulses_are_read_from_the_pulse_input_only() {
        let wired = (BatteryParameter::CurrPin, 17.0);
        assert_eq!(remaining_ml(measure(FuelKind::LevelPwm, &[wired])), 2475.0);
        let flow = measure(FuelKind::Flow, &[wired, (BatteryParameter::AmpPervlt, 0.5)]).unwrap();
        assert_eq!(flow.counted, Some(Counted::Volume(1.5)));
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

    /// Pulses of these widths, one every 20 ms.
    fn of_widths(widths_us: &[u64]) -> Pulses {
        let mut pulses = Pulses::NONE;
        for (start_us, width_us) in (0..).step_by(20_000).zip(widths_us) {
            pulses.rise(at_us(start_us));
            pulses.fall(at_us(start_us + width_us));
        }
        pulses
    }

    #[test]
    fn pulses_are_counted_and_timed() {
        let pulses = of_widths(&[1500, 1501, 1502]);
        assert_eq!(pulses.count, 3);
        assert_eq!(pulses.last_rise, Some(at_us(40_000)));
        assert_eq!(pulses.last_fall, Some(at_us(41_502)));
        assert_eq!(pulses.width_us(), 1501);
    }

    #[test]
    fn median_rejects_one_wrong_width() {
        for wrong_us in [0, 700, 2900, 1 << 40] {
            for place in 0..3 {
                let mut widths_us = [1500; 3];
                widths_us[place] = wrong_us;
                assert_eq!(of_widths(&widths_us).width_us(), 1500, "{wrong_us} at {place}");
            }
        }
    }

    #[test]
    fn falling_edge_without_a_rising_one_is_ignored() {
        let mut pulses = Pulses::NONE;
        pulses.fall(at_us(10));
        assert_eq!(pulses, Pulses::NONE);
    }

    const TICK_US: u64 = 100_000;

    /// A sensor of 0.5 ml per pulse with its meter.
    struct TankBench {
        meter: FlowMeter,
        pulses: Pulses,
        now: Instant,
        volume_ml: f32,
        flow_l_h: f32,
    }

    impl TankBench {
        fn new() -> Self {
            Self {
                meter: FlowMeter::default(),
                pulses: Pulses::NONE,
                now: Instant::EPOCH,
                volume_ml: 0.0,
                flow_l_h: 0.0,
            }
        }

        /// Runs for seconds with a pulse every `period_us`, the first at once.
        fn run(&mut self, seconds: u64, period_us: Option<u64>) {
            let start = self.now;
            let mut next = period_us.map(|_| start);
            for _ in 0..seconds * 10 {
                self.now = self.now.after_us(TICK_US);
                while let Some(due) = next.filter(|due| *due < self.now) {
                    self.pulses.rise(due);
                    next = period_us.map(|period_us| due.after_us(period_us));
                }
                self.tick();
            }
        }

        fn tick(&mut self) {
            let measurement = self.meter.measure(&self.pulses, 0.5, self.now);
            assert_eq!(measurement.contents, Contents::Fuel);
            assert_eq!(measurement.voltage_v, None);
            let Some(Counted::Volume(volume_ml)) = measurement.counted else {
                panic!("{measurement:?}");
            };
            self.volume_ml += volume_ml;
            self.flow_l_h = measurement.fuel_l_h.unwrap();
        }
    }

    #[test]
    fn steady_flow_is_exact_at_any_pulse_rate() {
        // 8.3 pulses per tick, one in most ticks, and one in every 25th.
        for period_us in [12_000, 150_000, 2_500_000] {
            let mut bench = TankBench::new();
            bench.run(60, Some(period_us));
            let (flow_l_h, volume_ml) = (bench.flow_l_h, bench.volume_ml);
            let expected = [0.5 * 3.6e6, 0.5 * 60e6].map(|ratio| ratio / period_us as f32);
            let what = format!("{flow_l_h} and {volume_ml} instead of {expected:?}");
            assert!((flow_l_h - expected[0]).abs() < 0.001 * expected[0], "{what}");
            assert!((volume_ml - expected[1]).abs() <= 0.5, "{what}");
        }
    }

    #[test]
    fn stopped_flow_decays_to_zero_in_ten_seconds() {
        let mut bench = TankBench::new();
        bench.run(10, Some(100_000));
        assert!((bench.flow_l_h - 18.0).abs() < 0.1);
        bench.run(4, None);
        assert!((0.4..0.5).contains(&bench.flow_l_h), "{}", bench.flow_l_h);
        bench.run(6, None);
        assert_eq!(bench.flow_l_h, 0.0);
        assert_eq!(bench.volume_ml, 50.0);
    }

    #[test]
    fn flow_rate_needs_two_pulses() {
        let mut bench = TankBench::new();
        bench.run(5, None);
        assert_eq!((bench.flow_l_h, bench.volume_ml), (0.0, 0.0));
        bench.pulses.rise(bench.now);
        bench.tick();
        assert_eq!((bench.flow_l_h, bench.volume_ml), (0.0, 0.5));
    }

    #[test]
    fn pulse_counter_may_wrap() {
        let mut bench = TankBench::new();
        bench.pulses.count = u32::MAX;
        bench.meter.previous = bench.pulses;
        bench.run(1, Some(100_000));
        assert_eq!(bench.volume_ml, 5.0);
    }

    fn scale(changes: &[(BatteryParameter, f32)]) -> LevelScale {
        LevelScale::from_parameters(changed(changes, Pack::Second).pack(Pack::Second))
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
        assert_eq!((measurement.voltage_v, measurement.fuel_l_h), (None, None));
    }

    fn count(pin_v: f32) -> AdcCount {
        AdcCount(pin_v / AdcCount(1.0).pin_voltage_v())
    }

    fn read(scale: &LevelScale, pin_v: f32) -> Result<Measurement, ReadError> {
        LevelMeter::default().measure(scale, count(pin_v), Some(2000.0), Instant::EPOCH)
    }

    #[test]
    fn default_scale_is_empty_at_500_mv_and_full_at_2500_mv() {
        let scale = scale(&[]);
        for (pin_v, remaining_ml) in [(0.5, 0.0), (1.0, 500.0), (2.5, 2000.0), (0.2, 0.0), (3.1, 2000.0)] {
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
        assert_remaining(
            meter.measure(&scale, count(2.5), Some(2000.0), Instant::EPOCH),
            2000.0,
        );
        // The time constant is 1 / (2 π 0.3 Hz) = 0.53 s: 1/e of a step remains, less the effect of the tick.
        let at = |tick: u64| at_us(tick * TICK_US);
        let measured: Vec<_> = (1..=61)
            .map(|tick| meter.measure(&scale, count(0.5), Some(2000.0), at(tick)).unwrap())
            .collect();
        let remaining_ml = measured[4].gauge.read().unwrap().remaining_mah;
        assert!((800.0..900.0).contains(&remaining_ml), "{remaining_ml} ml");
        assert_remaining(Ok(measured[60]), 0.0);
    }

    #[test]
    fn disabled_filter_follows_at_once() {
        let scale = scale(&[(BatteryParameter::FlFltr, -1.0)]);
        let mut meter = LevelMeter::default();
        assert_remaining(
            meter.measure(&scale, count(2.5), Some(2000.0), Instant::EPOCH),
            2000.0,
        );
        assert_remaining(
            meter.measure(&scale, count(1.5), Some(2000.0), at_us(TICK_US)),
            1000.0,
        );
    }

    /// The level of a tank of 2000 ml at a moment in microseconds, by three pulses from the start.
    fn level_of_width(width_us: u64, us: u64) -> Result<Measurement, ReadError> {
        level_by_pulses(&of_widths(&[width_us; 3]), Some(2000.0), at_us(us))
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
            assert_remaining(level_of_width(width_us, 100_000), remaining_ml);
        }
        for width_us in [1, 1080, 1920, 20_000] {
            let measured = level_of_width(width_us, 100_000);
            assert_eq!(measured, Err(ReadError::Implausible), "{width_us}");
        }
    }

    #[test]
    fn pulses_time_out_after_250_ms() {
        assert_remaining(level_of_width(1500, 41_500 + 250_000), 1000.0);
        assert_eq!(level_of_width(1500, 41_500 + 250_001), Err(ReadError::Timeout));
        let never = level_by_pulses(&Pulses::NONE, Some(2000.0), at_us(100_000));
        assert_eq!(never, Err(ReadError::Timeout));
    }

    fn flow_l_h(injection_ms: f32, speed_rpm: u16, coefficients: [f32; 2]) -> Result<f32, ReadError> {
        let mut parameters = Parameters::defaults();
        let [slope, offset] = coefficients;
        parameters.set(VehicleParameter::EfiCoef1, slope).unwrap();
        parameters.set(VehicleParameter::EfiCoef2, offset).unwrap();
        let reading = EngineReading {
            injection_ms,
            speed_rpm,
        };
        let measurement = reading.measure(&parameters)?;
        assert_eq!(measurement.contents, Contents::Fuel);
        assert_eq!(measurement.voltage_v, None);
        Ok(measurement.fuel_l_h.expect("a flow"))
    }

    #[test]
    fn flow_is_the_calibrated_duty_cycle() {
        // 3 ms in each 20 ms are 15 %; 15 × 0.8 − 2 = 10 cm³ a minute.
        let flow = flow_l_h(3.0, 3000, [0.8, 2.0]).unwrap();
        assert!((flow - 0.6).abs() < 1e-5, "{flow}");
    }

    #[test]
    fn flow_is_never_negative_and_zero_at_standstill() {
        assert_eq!(flow_l_h(0.1, 3000, [0.1, 2.0]), Ok(0.0));
        assert_eq!(flow_l_h(50.0, 100, [1.0, 0.0]), Ok(0.0));
        assert!(flow_l_h(50.0, 101, [1.0, 0.0]).unwrap() > 0.0);
    }

    #[test]
    fn without_calibration_there_is_no_flow() {
        assert_eq!(flow_l_h(3.0, 3000, [0.0, 0.0]), Err(ReadError::NotSetUp));
    }
}
