//! From a series of measurements to the state of a pack.

use heapless::Vec;

use super::charge_state::{ChargeStateMachine, Signs};
use super::consumption::Consumption;
use super::diagnosis::Diagnosis;
use super::estimator::{Estimator, Reading};
use super::failsafe::{ArmState, Failsafe, Observation};
use super::health::HealthReporter;
use super::settings::PackSettings;
use super::swap::{Replacement, SerialNumber, SwapDetector};
use super::{
    BatteryState, ChargeSource, Consumed, Contents, Counted, Faults, Gauge, Measurement, PackEvent,
    PackMemory, PackStatus, ReadError, Supply,
};

/// Below this voltage no pack is connected, in volts: the divider then sees what leaks in while the board runs from USB.
/// The same limit as PX4's `BATTERY_CONNECTED` test.
pub const MIN_CONNECTED_VOLTAGE_V: f32 = 2.1;

/// After this many failed reads in a row the state says unhealthy: half a second at 10 Hz.
pub const FAILED_READS_UNTIL_UNHEALTHY: u32 = 5;

/// More than this no pack of a rover has, whatever its sensor says: in volts, amperes and degrees Celsius.
const HIGHEST_VOLTAGE_V: f32 = 1_000.0;
const HIGHEST_CURRENT_A: f32 = 10_000.0;
const HIGHEST_TEMPERATURE_C: f32 = 1_000.0;

/// No pack of a rover holds more, or less: in milliampere-hours and watt-hours.
const HIGHEST_CHARGE_MAH: f32 = 10_000_000.0;
const HIGHEST_ENERGY_WH: f32 = 1_000_000.0;
const LOWEST_CAPACITY_MAH: f32 = 1.0;

/// What can happen to a pack in one tick: cells detected, swapped, a gap, its sensor failed or back, its contact lost or
/// back, switched off, a failsafe.
pub const MAX_EVENTS: usize = 7;

/// What happened to a pack in one tick.
pub type PackEvents = Vec<PackEvent, MAX_EVENTS>;

/// One tick of the clock, as far as a battery is concerned.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// Microseconds since some start; it may stand still or leap.
    pub now_us: u64,
    /// Whether the rover may move.
    pub arm_state: ArmState,
}

/// Follows one pack.
#[derive(Clone, Debug)]
pub struct BatteryMonitor {
    state: BatteryState,
    failed_reads: u32,
    last_tick_us: Option<u64>,
    last: Option<Last>,
    last_healthy_us: Option<u64>,
    /// The last voltage of a connected pack, in volts.
    last_voltage_v: Option<f32>,
    /// What the pack's own gauge told last.
    gauge: Option<Gauge>,
    health: HealthReporter,
    supply: Supply,
    consumption: Consumption,
    estimator: Estimator,
    swap: SwapDetector,
    serial_number: SerialNumber,
    diagnosis: Diagnosis,
    charge_state: ChargeStateMachine,
    failsafe: Failsafe,
}

/// Whether this tick's reading was a good one of a connected pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Freshness {
    /// It was, and the state shows it.
    OfThisTick,
    /// It was not: the state keeps what was known before, or nothing.
    Kept,
}

/// The last good reading.
#[derive(Clone, Copy, Debug)]
struct Last {
    time_us: u64,
    current_a: Option<f32>,
}

impl BatteryMonitor {
    /// A monitor that has seen nothing yet.
    // Inlined, it would be written out once for each pack of a bank.
    #[inline(never)]
    pub fn new() -> Self {
        Self {
            state: BatteryState::default(),
            failed_reads: 0,
            last_tick_us: None,
            last: None,
            last_healthy_us: None,
            last_voltage_v: None,
            gauge: None,
            health: HealthReporter::default(),
            supply: Supply::Stays,
            consumption: Consumption::default(),
            estimator: Estimator::new(),
            swap: SwapDetector::new(),
            serial_number: SerialNumber::default(),
            diagnosis: Diagnosis::default(),
            charge_state: ChargeStateMachine::default(),
            failsafe: Failsafe::default(),
        }
    }

    /// What is known now.
    pub fn state(&self) -> &BatteryState {
        &self.state
    }

    /// How many reads have failed since the last good one (saturating).
    pub fn failed_reads(&self) -> u32 {
        self.failed_reads
    }

    /// Takes one reading, good or failed, and returns what happened. What is known afterwards is [`state`](Self::state).
    pub fn update(
        &mut self,
        tick: Tick,
        reading: Result<Measurement, ReadError>,
        settings: &PackSettings,
    ) -> (PackEvents, Option<ReadError>) {
        let mut events = PackEvents::new();
        let since = |time_us: Option<u64>| time_us.map_or(0, |time_us| tick.now_us.saturating_sub(time_us));
        let dt_us = since(self.last.map(|last| last.time_us));
        let tick_us = since(self.last_tick_us.replace(tick.now_us));
        let dt_s = tick_us as f32 * 1e-6;
        let reading = reading.and_then(plausible);
        if let Ok(measurement) = &reading {
            self.ingest_details(tick.arm_state, measurement, &mut events);
        }
        let settings = self.informed(settings);
        let error = match reading {
            Ok(measurement) => {
                self.accept(tick, dt_us, &measurement, &settings, &mut events);
                self.last = Some(Last {
                    time_us: tick.now_us,
                    current_a: measurement.current_a,
                });
                None
            }
            Err(error) => {
                self.reject();
                Some(error)
            }
        };
        let status = self.state.status;
        if let Some(event) = self.health.sensor(dt_s, status, error) {
            push(&mut events, event);
        }
        if let Some(event) = self.health.contact(dt_s, status, error, tick.arm_state) {
            push(&mut events, event);
        }
        let freshness = match (error, status) {
            (None, PackStatus::Healthy) => Freshness::OfThisTick,
            _ => Freshness::Kept,
        };
        // The packs of a sum come and go; it is none that can be changed itself.
        if freshness == Freshness::Kept && error != Some(ReadError::NoMember) {
            self.swap.lose_contact(dt_s, tick.arm_state);
        }
        self.judge(tick, tick_us, freshness, &settings, &mut events);
        (events, error)
    }

    /// Takes what a smart battery reports of itself. Details under another serial number wait until that is confirmed.
    fn ingest_details(&mut self, arm_state: ArmState, measurement: &Measurement, events: &mut PackEvents) {
        let serial_number = measurement.details.serial_number;
        if let Some(replacement) = self.serial_number.update(serial_number, arm_state) {
            self.swap.forget();
            self.replace_pack(replacement, events);
        }
        if self.serial_number.fits(serial_number) {
            self.state.details = measurement.details;
        }
        if self.supply != measurement.supply && measurement.supply == Supply::SwitchingOff {
            push(events, PackEvent::SwitchingOff);
        }
        self.supply = measurement.supply;
        self.state.contents = measurement.contents;
        self.state.members = measurement.members;
        self.state.cells = measurement.cells;
        self.gauge = measurement.gauge;
    }

    /// What the owner has set, with what a smart battery knows better.
    fn informed(&self, settings: &PackSettings) -> PackSettings {
        let details = &self.state.details;
        let cells = self.state.cells.millivolts().len() as u8;
        PackSettings {
            chemistry: details.chemistry.unwrap_or(settings.chemistry),
            cell_count: settings.cell_count.or((cells > 0).then_some(cells)),
            capacity_mah: self.gauge.map(|gauge| gauge.full_mah).or(settings.capacity_mah),
            serial_number: details.serial_number.or(settings.serial_number),
            ..*settings
        }
    }

    fn accept(
        &mut self,
        tick: Tick,
        dt_us: u64,
        measurement: &Measurement,
        settings: &PackSettings,
        events: &mut PackEvents,
    ) {
        self.failed_reads = 0;
        self.state.temperature_c = measurement.temperature_c;
        let reading = Reading {
            dt_s: dt_us as f32 * 1e-6,
            voltage_v: measurement.voltage_v,
            current_a: measurement.current_a,
            arm_state: tick.arm_state,
        };
        if measurement
            .voltage_v
            .is_some_and(|voltage_v| voltage_v < MIN_CONNECTED_VOLTAGE_V)
        {
            self.disconnected();
            return;
        }
        self.state.status = PackStatus::Healthy;
        self.last_healthy_us = Some(tick.now_us);
        self.last_voltage_v = measurement.voltage_v.or(self.last_voltage_v);
        if let Some(replacement) = self.watch_for_swap(&reading) {
            self.replace_pack(replacement, events);
        }
        if let Some(gap) = self.count(dt_us, measurement) {
            push(events, PackEvent::Gap(gap));
        }
        if let Some(event) = self.estimator.update(&reading, settings) {
            push(events, event);
        }
        self.describe(measurement, settings);
    }

    /// Without a pack the pin's voltage is not a pack voltage: unknown, not a flat battery.
    fn disconnected(&mut self) {
        self.state.status = PackStatus::NotConnected;
        self.state.voltage_v = None;
        self.state.resting_voltage_v = None;
        self.state.current_a = None;
        self.state.average_current_a = None;
        self.state.remaining_pct = None;
        self.state.time_remaining_s = None;
        self.state.faults = Faults::empty();
        self.diagnosis = Diagnosis::default();
    }

    fn watch_for_swap(&mut self, reading: &Reading) -> Option<Replacement> {
        let Some(voltage_v) = reading.voltage_v else {
            self.swap.lose_contact(reading.dt_s, reading.arm_state);
            return None;
        };
        self.swap
            .update(reading.dt_s, voltage_v, reading.current_a, reading.arm_state)
    }

    /// Another pack is in: what was estimated and counted starts over. Its failsafe level stays until it is disproved.
    fn replace_pack(&mut self, replacement: Replacement, events: &mut PackEvents) {
        self.consumption = Consumption::default();
        self.estimator = Estimator::new();
        self.failsafe.replace_pack(replacement);
        self.charge_state = ChargeStateMachine::default();
        self.last = None;
        push(events, PackEvent::Swapped);
    }

    fn count(&mut self, dt_us: u64, measurement: &Measurement) -> Option<super::Gap> {
        match measurement.counted {
            Some(Counted::InAll(consumed)) => {
                self.consumption.restart(consumed);
                return None;
            }
            Some(Counted::SinceLast(counted)) => {
                self.consumption.add_counted(counted);
                return None;
            }
            None => {}
        }
        let gap = self.integrate(dt_us, measurement);
        match measurement.gauge {
            Some(gauge) => {
                // The energy is integrated; the charge the pack knows itself, whatever was missed.
                self.consumption.set_charge_mah(gauge.consumed_mah());
                None
            }
            None => gap,
        }
    }

    fn integrate(&mut self, dt_us: u64, measurement: &Measurement) -> Option<super::Gap> {
        let current_a = measurement.current_a?;
        let previous_a = self.last?.current_a?;
        self.consumption
            .add(dt_us, previous_a, current_a, measurement.voltage_v)
    }

    fn describe(&mut self, measurement: &Measurement, settings: &PackSettings) {
        let Measurement {
            voltage_v, current_a, ..
        } = *measurement;
        let is_counted = current_a.is_some() || measurement.counted.is_some() || measurement.gauge.is_some();
        let share = match (measurement.gauge, measurement.contents) {
            (Some(gauge), _) => Some(gauge.share()),
            (None, Contents::Charge) => self.estimator.state_of_charge(),
            (None, Contents::Fuel) => self.fuel_share(settings),
        };
        let state = &mut self.state;
        state.voltage_v = voltage_v;
        state.current_a = current_a;
        state.resting_voltage_v = voltage_v
            .zip(current_a)
            .and_then(|(voltage_v, current_a)| self.estimator.resting_voltage_v(voltage_v, current_a));
        state.average_current_a = current_a.and(self.estimator.average_current_a());
        state.resistance_ohm = self.estimator.resistance_ohm();
        state.consumed_mah = is_counted.then(|| self.consumption.charge_mah());
        state.consumed_wh = (is_counted && voltage_v.is_some() && measurement.contents == Contents::Charge)
            .then(|| self.consumption.energy_wh());
        state.remaining_pct = share.map(|share| share * 100.0);
        state.time_remaining_s = current_a
            .and(share)
            .and_then(|share| self.estimator.time_remaining_s(share, settings));
        state.charge_source = match measurement.gauge {
            Some(_) => ChargeSource::Gauge,
            None => ChargeSource::Estimated,
        };
        state.cell_count = self.estimator.cell_count(settings);
    }

    /// How full a tank is whose flow is counted: it was full at the start, or what the last battery reset has told.
    fn fuel_share(&self, settings: &PackSettings) -> Option<f32> {
        let capacity_ml = settings.capacity_mah?;
        Some((1.0 - self.consumption.charge_mah() / capacity_ml).clamp(0.0, 1.0))
    }

    fn reject(&mut self) {
        self.serial_number.miss();
        self.failed_reads = self.failed_reads.saturating_add(1);
        if self.failed_reads >= FAILED_READS_UNTIL_UNHEALTHY {
            self.state.status = PackStatus::Unhealthy;
        }
    }

    /// What follows from the state, after a good reading or a failed one.
    fn judge(
        &mut self,
        tick: Tick,
        dt_us: u64,
        freshness: Freshness,
        settings: &PackSettings,
        events: &mut PackEvents,
    ) {
        let dt_s = dt_us as f32 * 1e-6;
        let state = &mut self.state;
        state.chemistry = settings.chemistry;
        state.capacity_mah = settings.capacity_mah;
        state.critical_voltage_v = settings.failsafe.critical.voltage_v;
        state.serial_number = settings.serial_number;
        state.reported_voltage = settings.reported_voltage;
        state.visibility = settings.visibility;
        if state.status == PackStatus::Healthy {
            state.faults = self.diagnosis.update(dt_s, state, settings);
        }
        let observation = Observation {
            tick,
            dt_us: u32::try_from(dt_us).unwrap_or(u32::MAX),
            last_healthy_us: self.last_healthy_us,
            state: match freshness {
                Freshness::OfThisTick => Some(state),
                Freshness::Kept => None,
            },
            resting_v: self.swap.resting_v(),
        };
        let raised = self.failsafe.update(&observation, &settings.failsafe);
        if let Some(level) = raised {
            push(
                events,
                PackEvent::Failsafe {
                    level,
                    contents: state.contents,
                    voltage_v: self.last_voltage_v.unwrap_or(0.0),
                    consumed_mah: state.consumed_mah.unwrap_or(0.0),
                },
            );
        }
        state.failsafe = self.failsafe.level();
        let signs = Signs {
            status: state.status,
            faults: state.faults,
            failsafe: state.failsafe,
            remaining_pct: state.remaining_pct,
            arm_state: tick.arm_state,
            current_a: state.current_a,
            capacity_mah: state.capacity_mah,
        };
        state.charge_state = self.charge_state.update(dt_s, &signs);
    }

    /// What has to survive a reset of the processor.
    pub fn memory(&self) -> PackMemory {
        let (charge, detected_cells) = self.estimator.memory();
        PackMemory {
            consumption: self.consumption,
            charge,
            detected_cells,
        }
    }

    /// Takes up what was known before a reset of the processor.
    pub fn restore(&mut self, memory: &PackMemory) {
        self.consumption = memory.consumption;
        self.estimator.restore(memory.charge, memory.detected_cells);
    }

    /// The battery was reset: so much is left, in percent (0 to 100). What is no number changes nothing, and a pack with a
    /// gauge of its own knows better.
    pub fn reset(&mut self, remaining_pct: f32, settings: &PackSettings) {
        if !remaining_pct.is_finite() || self.gauge.is_some() {
            return;
        }
        let share = (remaining_pct / 100.0).clamp(0.0, 1.0);
        let charge_mah = (1.0 - share) * settings.capacity_mah.unwrap_or(0.0);
        self.consumption.restart(Consumed {
            charge_mah,
            energy_wh: charge_mah / 1000.0 * self.state.voltage_v.unwrap_or(0.0),
        });
        self.estimator.set_state_of_charge(share);
        self.failsafe.clear();
    }
}

impl Default for BatteryMonitor {
    fn default() -> Self {
        Self::new()
    }
}

/// There is one place for every kind of event.
fn push(events: &mut PackEvents, event: PackEvent) {
    let _ = events.push(event);
}

fn plausible(measurement: Measurement) -> Result<Measurement, ReadError> {
    let Measurement {
        voltage_v,
        current_a,
        temperature_c,
        ..
    } = measurement;
    // NaN is not within any limit.
    let is_within = |value: Option<f32>, limit: f32| value.is_none_or(|value| value.abs() <= limit);
    let is_gauge = |gauge: &Gauge| {
        (0.0..=HIGHEST_CHARGE_MAH).contains(&gauge.remaining_mah)
            && gauge.full_mah >= LOWEST_CAPACITY_MAH
            && gauge.full_mah <= HIGHEST_CHARGE_MAH
    };
    let is_count = |counted: Counted| {
        let (Counted::InAll(consumed) | Counted::SinceLast(consumed)) = counted;
        is_within(Some(consumed.charge_mah), HIGHEST_CHARGE_MAH)
            && is_within(Some(consumed.energy_wh), HIGHEST_ENERGY_WH)
    };
    if is_within(voltage_v, HIGHEST_VOLTAGE_V)
        && is_within(current_a, HIGHEST_CURRENT_A)
        && is_within(temperature_c, HIGHEST_TEMPERATURE_C)
        && measurement.gauge.as_ref().is_none_or(is_gauge)
        && measurement.counted.is_none_or(is_count)
    {
        Ok(measurement)
    } else {
        Err(ReadError::Implausible)
    }
}

#[cfg(test)]
mod tests;
