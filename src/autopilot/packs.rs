//! The packs: sampled one after the other in each tick, sums last.

use heapless::Vec;

use super::Autopilot;
use super::announcement::Announcement;
use super::start::in_place;
use crate::battery::{
    BatteryBank, BatteryState, FAILED_READS_UNTIL_UNHEALTHY, MAX_PACKS, Measurement, PackSettings,
    PackStatus, PackUpdate, ReadError, RetainedMemory, SumVoltage, Tick, recall, retain,
};
use crate::log::{info, warn};
use crate::parameter::{BatteryParameter, Pack, Parameters};
use crate::sensor::{
    AnalogPin, AnalogReadings, AnalogWiring, FuelMeter, FuelReadings, MonitorKind, Pulses, Samples,
};
use crate::vehicle::Vehicle;

/// Readings count as taken at a whole millisecond: so intervals are nearly always equal, and the filters need not divide
/// anew.
const RESOLUTION_US: u64 = 1_000;

/// One in so many of an unhealthy pack's failed reads is logged.
const LOGGED_FAILURE: u32 = 10;

const PIN_COUNT: usize = AnalogPin::ALL.len();

/// Ticks between records of what has to survive a reset: a second.
const TICKS_PER_RECORD: u32 = 10;

/// All packs and their latest readings.
#[derive(Debug)]
pub(super) struct Packs {
    bank: BatteryBank,
    /// The monitored packs in the order in which they are sampled. Their kinds take effect at boot.
    order: Vec<(Pack, MonitorKind), MAX_PACKS>,
    samples: [Samples; MAX_PACKS],
    pulses: Pulses,
    meters: [FuelMeter; MAX_PACKS],
    states: [BatteryState; MAX_PACKS],
    ticks: u32,
}

/// A sampling tick in progress.
#[derive(Debug)]
pub struct SamplingTick {
    tick: Tick,
    readings: AnalogReadings,
    /// Position in the order of sampling.
    next: usize,
}

/// Progress of a sampling tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum SamplingProgress {
    /// Another pack may be left.
    Sampled(Pack),
    /// All packs are done.
    Complete,
}

impl Packs {
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(parameters: &Parameters) -> Self {
        Self {
            bank: in_place(BatteryBank::new),
            order: in_place(|| sampling_order(parameters)),
            samples: in_place(|| [Samples::new(); MAX_PACKS]),
            pulses: Pulses::NONE,
            meters: in_place(|| [FuelMeter::default(); MAX_PACKS]),
            states: in_place(|| states_at_boot(parameters)),
            ticks: 0,
        }
    }

    pub fn states(&self) -> &[BatteryState] {
        &self.states
    }

    pub fn state(&self, pack: Pack) -> &BatteryState {
        self.states
            .get(usize::from(pack.instance()))
            .unwrap_or(&BatteryState::UNKNOWN)
    }

    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Battery reset of the packs in `mask` (one bit per instance).
    pub fn reset(&mut self, mask: u16, percent: f32, parameters: &Parameters) {
        for (pack, _) in &self.order {
            if mask & 1 << pack.instance() != 0
                && let Some(monitor) = self.bank.monitor(pack.instance())
            {
                monitor.reset(percent, &PackSettings::from_parameters(parameters, *pack));
            }
        }
    }

    /// The pins that the packs need. Packs may share a pin.
    fn needed_pins(&self, parameters: &Parameters) -> Vec<AnalogPin, PIN_COUNT> {
        let mut needed = [false; PIN_COUNT];
        for (pack, kind) in &self.order {
            for pin in AnalogWiring::from_parameters(parameters, *pack).pins(*kind) {
                if let Some(is_needed) = needed.get_mut(pin as usize) {
                    *is_needed = true;
                }
            }
        }
        let mut pins = Vec::new();
        for (pin, is_needed) in AnalogPin::ALL.into_iter().zip(needed) {
            if is_needed {
                // There is room for every pin.
                let _ = pins.push(pin);
            }
        }
        pins
    }

    /// `None` as long as there is nothing to measure by: a part on the bus or an ESC that has not been read yet, or a
    /// sum in the first tick, when parts on the bus have no reading yet.
    fn measure(
        &mut self,
        pack: Pack,
        kind: MonitorKind,
        sampling: &SamplingTick,
        parameters: &Parameters,
        vehicle: &Vehicle,
    ) -> Option<Result<Measurement, ReadError>> {
        let place = usize::from(pack.instance());
        Some(match kind {
            MonitorKind::Bus(_) | MonitorKind::Esc => return self.samples.get_mut(place)?.take(),
            MonitorKind::Sum if self.ticks == 0 => return None,
            MonitorKind::Sum => {
                let mask = parameters.get_whole(BatteryParameter::SumMask.of(pack)) as u16;
                let voltage = SumVoltage::from_parameters(parameters, pack);
                self.bank.sum(pack.instance(), mask, voltage)
            }
            MonitorKind::Fuel(kind) => {
                let readings = FuelReadings {
                    pins: &sampling.readings,
                    pulses: &self.pulses,
                    now_us: sampling.tick.now_us,
                };
                let meter = self.meters.get_mut(place)?;
                meter.measure(kind, parameters, pack, &readings)
            }
            MonitorKind::AnalogVoltage
            | MonitorKind::AnalogVoltageAndCurrent
            | MonitorKind::SyntheticCurrent
            | MonitorKind::AnalogCurrent => {
                let wiring = AnalogWiring::from_parameters(parameters, pack);
                wiring.measure(kind, &sampling.readings, vehicle.effort())
            }
        })
    }
}

impl Autopilot {
    /// Continues with what was retained of the packs over a reset, before the first tick.
    pub fn restore_packs(&mut self, memory: &RetainedMemory) {
        if let Some(packs) = recall(memory) {
            self.packs.bank.restore(&packs);
            info!("battery: consumption kept over the reset");
        }
    }

    /// The pins to read before the next sampling tick.
    pub fn pins_to_read(&self) -> Vec<AnalogPin, PIN_COUNT> {
        self.packs.needed_pins(&self.parameters)
    }

    /// Begins a sampling tick with what the pins read; due every 100 ms.
    pub fn begin_sampling(&self, now_us: u64, readings: AnalogReadings) -> SamplingTick {
        SamplingTick {
            tick: Tick {
                now_us: now_us - now_us % RESOLUTION_US,
                arm_state: self.vehicle.arm_state(),
            },
            readings,
            next: 0,
        }
    }

    /// Samples the next pack. A failsafe that it reaches has acted on the vehicle when this returns.
    ///
    /// Nine packs take a few milliseconds: other tasks may run after each.
    pub fn sample_next(&mut self, sampling: &mut SamplingTick) -> SamplingProgress {
        let Some((pack, kind)) = self.packs.order.get(sampling.next).copied() else {
            return SamplingProgress::Complete;
        };
        sampling.next += 1;
        let reading = self
            .packs
            .measure(pack, kind, sampling, &self.parameters, &self.vehicle);
        if let Some(reading) = reading {
            self.update_pack(pack, sampling.tick, reading);
        }
        SamplingProgress::Sampled(pack)
    }

    /// Ends a sampling tick. Once a second `memory` is updated.
    pub fn end_sampling(&mut self, _: SamplingTick, memory: &mut RetainedMemory) {
        self.vehicle.update_batteries(self.packs.bank.worst_failsafe());
        if self.packs.ticks.is_multiple_of(TICKS_PER_RECORD) {
            retain(memory, &self.packs.bank.memory());
        }
        self.packs.ticks = self.packs.ticks.wrapping_add(1);
    }

    fn update_pack(&mut self, pack: Pack, tick: Tick, reading: Result<Measurement, ReadError>) {
        let settings = PackSettings::from_parameters(&self.parameters, pack);
        let Some(monitor) = self.packs.bank.monitor(pack.instance()) else {
            return;
        };
        let before = monitor.state().status;
        let PackUpdate {
            events,
            error,
            failsafe,
        } = monitor.update(tick, reading, &settings);
        if let Some(error) = error {
            log_failure(pack, error, monitor.failed_reads());
        }
        log_change(pack, before, monitor.state().status);
        if let Some(state) = self.packs.states.get_mut(usize::from(pack.instance())) {
            *state = *monitor.state();
        }
        for event in &events {
            self.announce(Announcement::Pack(pack, event));
        }
        if let Some(level) = failsafe {
            self.act_on_failsafe(pack, level);
        }
    }

    /// Takes a reading of a pack's part on the bus, or the reason why there is none.
    pub fn add_bus_reading(&mut self, pack: Pack, reading: Result<Measurement, ReadError>) {
        if let Some(samples) = self.packs.samples.get_mut(usize::from(pack.instance())) {
            samples.add(reading);
        }
    }

    /// Takes a reading of ESC telemetry, for every pack that uses it, or the reason why there is none.
    pub fn add_esc_reading(&mut self, reading: Result<Measurement, ReadError>) {
        for (pack, kind) in &self.packs.order {
            if *kind == MonitorKind::Esc
                && let Some(samples) = self.packs.samples.get_mut(usize::from(pack.instance()))
            {
                samples.add(reading);
            }
        }
    }

    /// Sets the measurement of the pulses so far.
    pub fn set_pulses(&mut self, pulses: Pulses) {
        self.packs.pulses = pulses;
    }

    /// Sets the state of a pack that is not monitored here.
    pub fn set_battery(&mut self, pack: Pack, state: BatteryState) {
        if let Some(place) = self.packs.states.get_mut(usize::from(pack.instance())) {
            *place = state;
        }
    }
}

/// Sums come last: they are of the same tick's states.
fn sampling_order(parameters: &Parameters) -> Vec<(Pack, MonitorKind), MAX_PACKS> {
    let mut order = Vec::new();
    for is_turn_of_sums in [false, true] {
        for pack in Pack::ALL {
            if let Some(kind) = MonitorKind::of(parameters, pack)
                && (kind == MonitorKind::Sum) == is_turn_of_sums
            {
                // There is room for every pack.
                let _ = order.push((pack, kind));
            }
        }
    }
    order
}

/// Before the first sample nothing is known of the packs, but which are monitored.
fn states_at_boot(parameters: &Parameters) -> [BatteryState; MAX_PACKS] {
    let mut states = [BatteryState::default(); MAX_PACKS];
    for (pack, state) in Pack::ALL.into_iter().zip(&mut states) {
        if !parameters.is_monitored(pack) {
            state.status = PackStatus::Disabled;
        }
    }
    states
}

/// Further failed reads of an unhealthy pack are no news; one in a second shows that they go on.
fn log_failure(pack: Pack, error: ReadError, failed_reads: u32) {
    if failed_reads <= FAILED_READS_UNTIL_UNHEALTHY || failed_reads.is_multiple_of(LOGGED_FAILURE) {
        warn!(
            "battery {}: read failed, {:?}, {} in a row",
            pack.instance() + 1,
            error,
            failed_reads
        );
    }
}

fn log_change(pack: Pack, before: PackStatus, now: PackStatus) {
    if before == now {
        return;
    }
    let number = pack.instance() + 1;
    match now {
        PackStatus::Unhealthy => warn!("battery {}: unhealthy, keeping the last good value", number),
        PackStatus::NotConnected => warn!("battery {}: not connected", number),
        PackStatus::Disabled | PackStatus::Unknown | PackStatus::Healthy => {
            info!("battery {}: {:?}", number, now)
        }
    }
}
