//! Sampling: a tick every 100 ms, pack after pack.

use core::mem;

use super::Autopilot;
use super::recording::Detail;
use crate::announce::Announce;
use crate::battery::{
    BatteryState, FAILED_READS_UNTIL_UNHEALTHY, LoadState, Measurement, PackEvent, PackStatus, PackUpdate,
    ReadError, RetainedMemory, SupplyEvent, Tick, recall, retain,
};
use crate::log::{info, warn};
use crate::pack::Pack;
use crate::parameter::MonitorKind;
use crate::recorder::dataflash::Record;
use crate::sensor::{
    Admission, AnalogPin, AnalogReadings, AnalogWiring, CanEvent, CanReport, CanStatus, ControllerReading,
    ExternalReport, PinPull, Pulses, SerialReading, Temperatures, WantedReadings,
};
use crate::system::{MeasuredAt, above_drivers, arming_readiness};
use crate::time::Instant;
use crate::vehicle::PowerLimit;
use crate::wifi::Radio;

/// Interval of sampling ticks: 10 Hz, ArduPilot's rate of `AP_BattMonitor::read`.
pub const SAMPLING_INTERVAL_US: u64 = 100_000;

/// Ticks are due, and readings count as taken, at a whole millisecond: so intervals are nearly always equal, and the
/// filters need not divide again.
pub const SAMPLING_RESOLUTION_US: u64 = 1_000;

/// Index of the motor controller on the serial line, among those on the CAN bus.
const SERIAL_CONTROLLER: u8 = 0;

/// One in this many of an unhealthy pack's failed reads is logged.
const LOGGED_FAILURE: u32 = 10;

/// Once a second what has to survive a reset is recorded, and the arming checks run. Not in the same tick: together they
/// would hold up other tasks for longer.
const TICKS_PER_SECOND: u32 = (1_000_000 / SAMPLING_INTERVAL_US) as u32;
const RECORDING_TICK: u32 = 0;
const CHECKING_TICK: u32 = 5;

/// A sampling tick in progress.
#[derive(Debug)]
pub struct SamplingTick {
    tick: Tick,
    readings: AnalogReadings,
    temperatures: Temperatures,
    /// Since the tick before, in seconds.
    dt_s: f32,
    /// Position in the order of sampling.
    next: usize,
}

/// Progress of a sampling tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum SamplingProgress {
    /// Another pack may be left.
    Sampled,
    /// All packs are done.
    Complete,
}

impl Autopilot {
    /// Continues with what was retained of the packs over a reset, before the first tick.
    pub fn restore_packs(&mut self, memory: &RetainedMemory) {
        if let Some(packs) = recall(memory) {
            self.packs.bank.restore(&packs, &self.packs.read_from);
            info!("battery: consumption kept over the reset");
        }
    }

    /// The readings of the converter that the next tick needs.
    pub fn wanted_readings(&mut self) -> WantedReadings {
        self.packs.follow_wiring(&self.parameters);
        self.packs.wanted_readings()
    }

    /// The pin that a radio takes from the packs: on a Pico W its clock is at GP29.
    fn pin_of_radio(&self) -> Option<AnalogPin> {
        match self.wifi.credentials.radio() {
            Radio::Absent => None,
            Radio::Present => Some(AnalogPin::Gp29),
        }
    }

    /// Begins a sampling tick with what the pins read until `now`; due every [`SAMPLING_INTERVAL_US`].
    pub fn begin_sampling(&mut self, now: Instant, mut readings: AnalogReadings) -> SamplingTick {
        self.packs.follow_wiring(&self.parameters);
        self.change_pulls(&mut readings);
        if let Some(pin) = self.pin_of_radio() {
            readings.set(pin, Err(ReadError::PinOfRadio));
        }
        let thermometers = &self.packs.thermometers;
        let tick = Tick {
            now: now.before_us(now.as_micros() % SAMPLING_RESOLUTION_US),
            load_state: self.vehicle.arm_state().into(),
        };
        let before = mem::replace(&mut self.packs.ticked_at, tick.now);
        SamplingTick {
            tick,
            dt_s: tick.now.us_since(before) as f32 * 1e-6,
            temperatures: thermometers.measure(&readings, now, &self.parameters),
            readings,
            next: 0,
        }
    }

    /// Follows the parameters. Readings of a pin whose pull changes are of neither wiring.
    fn change_pulls(&mut self, readings: &mut AnalogReadings) {
        let wanted = self.packs.wanted_pulls(&self.parameters);
        let pulls = self.packs.pulls.iter().zip(&wanted);
        for (pin, (before, now)) in AnalogPin::ALL.into_iter().zip(pulls) {
            if before != now {
                readings.set(pin, Err(ReadError::Timeout));
            }
        }
        self.packs.pulls = wanted;
    }

    /// Pulls of the analog pins from now on.
    pub fn pin_pulls(&self) -> impl Iterator<Item = (AnalogPin, PinPull)> {
        let pins = AnalogPin::ALL.into_iter().zip(self.packs.pulls);
        pins.filter(|(pin, _)| Some(*pin) != self.pin_of_radio())
    }

    /// Samples the next pack. A failsafe that it reaches has acted on the vehicle when this returns.
    ///
    /// Nine packs take a few milliseconds: other tasks may run after each.
    pub fn sample_next(&mut self, sampling: &mut SamplingTick) -> SamplingProgress {
        let Some((pack, kind)) = self.packs.order.get(sampling.next).copied() else {
            return SamplingProgress::Complete;
        };
        sampling.next += 1;
        if self.packs.ticks == 0 {
            // Staggers per-second work across packs.
            let delay_s = f32::from(pack.instance()) * SAMPLING_INTERVAL_US as f32 * 1e-6;
            self.packs.bank.get_mut(pack).0.delay(delay_s);
        }
        let reading = self.packs.measure(
            pack,
            kind,
            sampling.tick,
            &sampling.readings,
            &self.parameters,
            self.vehicle.effort(),
        );
        let is_read = reading.is_some();
        if let Some(mut reading) = reading {
            if let Ok(measurement) = &mut reading {
                sampling.temperatures.complete(pack, measurement);
            }
            self.update_pack(pack, kind, sampling.tick, reading);
            self.record_extremes(pack, kind, &sampling.readings);
        }
        let power_w = self.packs.bank.power_w(pack).filter(|_| is_read);
        self.limit_power(pack, sampling, power_w);
        SamplingProgress::Sampled
    }

    /// Records the extremes of a pack's single conversions, unless its read failed.
    fn record_extremes(&mut self, pack: Pack, kind: MonitorKind, readings: &AnalogReadings) {
        let bank = &self.packs.bank;
        if self.recording.takes_records() && bank.monitor(pack).failed_reads() == 0 {
            let wiring = AnalogWiring::from_parameters(self.parameters.pack(pack));
            let measured = wiring.extremes(kind, readings);
            let known = bank.state(pack).readings.known_extremes(measured);
            self.recording.add_extremes(pack, known);
        }
    }

    /// Ends a sampling tick. Once a second, and after a battery reset, `memory` is updated; once a second the arming checks run.
    pub fn end_sampling(&mut self, sampling: SamplingTick, memory: &mut RetainedMemory) {
        self.update_vehicle();
        let tick = self.packs.ticks % TICKS_PER_SECOND;
        if tick == RECORDING_TICK || mem::take(&mut self.was_reset) {
            retain(memory, &self.packs.bank.memory(&self.packs.read_from));
        }
        if tick == CHECKING_TICK {
            self.packs.follow_scales(&self.parameters);
            self.packs.follow_thermometers(&self.parameters);
            self.record_health();
            let state = self.system_state(sampling.tick.now);
            self.own_state.readiness = arming_readiness(&state, &self.parameters, &self.vehicle);
            self.announce_above_drivers(sampling.tick.now);
        }
        self.packs.ticks = self.packs.ticks.wrapping_add(1);
        self.record_packs(sampling.tick.now);
    }

    /// Hands the levels and alerts of all packs to the vehicle.
    pub(super) fn update_vehicle(&mut self) {
        let bank = &self.packs.bank;
        self.vehicle
            .update_batteries(bank.at_a_level(), bank.most_urgent_alert());
    }

    /// Announces packs that the motor drivers don't stand, once; one that is known to supply them does not arm instead. A sum
    /// is none of them: its members are.
    fn announce_above_drivers(&mut self, now: Instant) {
        let state = self.system_state(now);
        let is_news = |pack: &Pack| {
            !self.packs.announced_too_high.contains(*pack)
                && above_drivers(&state, &self.parameters, *pack) == Some(MeasuredAt::Elsewhere)
                && !self.packs.is_of_kind(*pack, MonitorKind::Sum)
        };
        // The remaining packs follow, one a second.
        if let Some(pack) = Pack::ALL.into_iter().find(is_news) {
            self.packs.announced_too_high.insert(pack);
            self.announce_supply(pack, &SupplyEvent::AboveDrivers, now);
        }
    }

    /// Records the packs whose turn it is, as this tick has read them.
    fn record_packs(&mut self, now: Instant) {
        self.recording.tick();
        while let Some((turn, detail)) = self.recording.next_pack(self.packs.order.len(), &self.parameters) {
            let Some((pack, _)) = self.packs.order.get(turn) else {
                return;
            };
            let extremes = self.recording.extremes(*pack);
            let records = Record::of_pack(*pack, self.packs.bank.state(*pack), extremes);
            let count = match detail {
                Detail::Readings => 1,
                Detail::Everything => usize::MAX,
            };
            for record in records.take(count) {
                let bytes = self.recording.add_at(&record, now);
                self.recording.spend(bytes);
            }
            let reported = &self.packs.bank.state(*pack).readings.reported;
            if reported.has_details() && self.recording.takes_report(*pack) {
                let bytes = self.recording.add_at(&Record::Report(*pack, reported), now);
                self.recording.spend(bytes);
            }
        }
    }

    fn record_health(&mut self) {
        if self.recording.records_health(&self.parameters) {
            self.recording.add(&Record::Health {
                load_permille: self.load_permille(),
                dropped_records: self.recording.dropped(),
            });
        }
    }

    fn update_pack(
        &mut self,
        pack: Pack,
        kind: MonitorKind,
        tick: Tick,
        reading: Result<Measurement, ReadError>,
    ) {
        let mut settings = self.parameters.pack(pack).settings_of_kind(Some(kind));
        if !self.vehicle.has_exhausted_power_limit(pack) {
            settings.overload_w = None;
        }
        self.packs.follow_current(pack);
        let bank = &mut self.packs.bank;
        if tick.load_state == LoadState::Off && !self.vehicle.is_terminated_by(pack) {
            bank.get_mut(pack).0.release_unhealthy();
        }
        let shown = |state: &BatteryState| (state.serial_number, state.revision);
        let (status, before) = (bank.state(pack).status, shown(bank.state(pack)));
        let PackUpdate {
            events,
            error,
            failsafe,
        } = bank.update(pack, tick, reading, &settings);
        let is_below_critical = settings.failsafe.is_below_critical(bank.state(pack));
        self.vehicle.update_below_critical(pack, is_below_critical);
        match error {
            Some(error) => log_failure(pack, error, bank.monitor(pack).failed_reads()),
            None => self.packs.silences[pack as usize].confirm(),
        }
        let state = self.packs.bank.state(pack);
        log_change(pack, status, state.status);
        if before != shown(state) {
            self.recording.describe(pack);
        }
        self.recording.add_timers(pack, state, tick.now);
        self.keep_learnt(pack);
        for event in &events {
            self.announce_pack(pack, event, tick.now);
            if *event == PackEvent::Swapped {
                self.show_learnt(pack);
            }
            if let PackEvent::CellsDetected { .. } = event
                && let Some(suggestion) = self.suggestion(pack)
            {
                self.announce(&suggestion, tick.now);
            }
        }
        if !failsafe.is_empty() {
            self.act_on_failsafe(pack, &failsafe);
        }
    }

    /// Limits the motors by the power that a pack supplies, in watts, if this tick has read it: a limit that was set or
    /// removed acts without a reading, too.
    fn limit_power(&mut self, pack: Pack, sampling: &SamplingTick, power_w: Option<f32>) {
        let limit = PowerLimit::from_parameters(self.parameters.pack(pack));
        if self.vehicle.limit_power(pack, sampling.dt_s, limit, power_w) {
            let event = SupplyEvent::PowerLimited(self.vehicle.power_limit_w(pack));
            self.announce_supply(pack, &event, sampling.tick.now);
        }
    }

    /// Takes a reading of a pack's part on the bus, or the reason why there is none.
    pub fn add_bus_reading(&mut self, pack: Pack, reading: Result<Measurement, ReadError>, now: Instant) {
        match reading {
            // It answers, and is still asked for what its readings need.
            Err(ReadError::Timeout) => self.packs.silences[pack as usize].restart(now),
            reading => self.packs.add_reading(pack, reading, now),
        }
    }

    /// Takes the reading of a motor controller with this index, from 0, for every pack that it supplies (kind 9 and
    /// `BATT_ESC_MASK`).
    pub fn add_controller_reading(&mut self, index: u8, reading: ControllerReading, now: Instant) {
        self.packs
            .add_controller_reading(index, reading, now, &self.parameters);
    }

    /// Takes what the device on the serial line has reported by `now`, for every pack that is measured so.
    pub fn add_serial_reading(&mut self, reading: SerialReading, now: Instant) {
        let (kind, measured) = match reading {
            SerialReading::Controller(reading) => {
                return self.add_controller_reading(SERIAL_CONTROLLER, reading, now);
            }
            SerialReading::GeneratorElectrical(measurement) => {
                (MonitorKind::GeneratorElectrical, Ok(measurement))
            }
            SerialReading::GeneratorFuel(measurement) => {
                return self.packs.add_tank(measurement, &self.parameters, now);
            }
            SerialReading::Torqeedo(measurement) => (MonitorKind::Torqeedo, Ok(measurement)),
            SerialReading::Efi(reading) => (MonitorKind::Efi, reading.measure(&self.parameters)),
            SerialReading::Refused(kind, error) => (kind, Err(error)),
            SerialReading::Notice(notice) => return self.announce(&notice, now),
        };
        self.packs.add_to_all(kind, measured, now);
    }

    /// Takes what came from the CAN bus at `now`.
    pub fn add_can_event(&mut self, event: &CanEvent, now: Instant) {
        match event {
            CanEvent::Reading(pack, reading) => {
                self.packs.add(*pack, MonitorKind::Can, Ok(*reading), now);
            }
            CanEvent::Controller(index, reading) => self.add_controller_reading(*index, *reading, now),
            CanEvent::Temperature(device_id, temperature_c) => {
                let thermometers = &mut self.packs.thermometers;
                thermometers.receive(*device_id, *temperature_c, now, &self.parameters);
            }
            CanEvent::Announce(notice) => self.announce(notice, now),
        }
    }

    /// Takes what is known of the bus's controller, and announces what is news.
    pub fn set_can_status(&mut self, status: &CanStatus, now: Instant) {
        let limit = &self.limit;
        let is_due = |report: CanReport| limit.allows_one(report.limit(), now);
        if let Some(report) = self.can.news(status, now, is_due) {
            info!("CAN: {:?}, {} frames not sent", report, status.unsent_frames);
            self.announce(&report, now);
        }
    }

    /// Takes what another component reports of a pack, which can't have been received before `received_at`; `None` if the
    /// pack is not measured so, or it is no reading.
    pub(super) fn add_external_report(
        &mut self,
        component_id: u8,
        report: &ExternalReport,
        received_at: Instant,
        now: Instant,
    ) -> Option<Admission> {
        let pack = report.pack();
        if !self.packs.is_of_kind(pack, MonitorKind::External) {
            return None;
        }
        let source = &mut self.packs.sources[pack as usize];
        let reading = match report {
            ExternalReport::Reading(reading) | ExternalReport::ReadingV2(reading) => reading,
            ExternalReport::Health(_, health) => {
                source.set_health(component_id, *health);
                return None;
            }
        };
        let admission = source.admit(component_id, report, received_at, now);
        if admission == Admission::Successor {
            self.packs.bank.get_mut(pack).0.change_counter();
        }
        if let Admission::Known | Admission::New | Admission::Successor = admission {
            let measurement = Measurement {
                details: source.details(),
                ..reading.into()
            };
            self.packs.add_reading(pack, Ok(measurement), received_at);
        }
        if admission == Admission::Successor {
            self.announce_supply(pack, &SupplyEvent::MeasuredBy(component_id), now);
        }
        Some(admission)
    }

    /// Sets the measurement of the pulses so far.
    pub fn set_pulses(&mut self, pulses: Pulses) {
        self.packs.pulses = pulses;
    }

    /// Sets the state of a pack that is not monitored here.
    pub fn set_battery(&mut self, pack: Pack, state: BatteryState) {
        *self.packs.bank.get_mut(pack).1 = state;
    }
}

/// Further failed reads of an unhealthy pack are not reported; one in a second shows that they go on.
fn log_failure(pack: Pack, error: ReadError, failed_reads: u32) {
    if failed_reads <= FAILED_READS_UNTIL_UNHEALTHY || failed_reads.is_multiple_of(LOGGED_FAILURE) {
        warn!(
            "battery {}: read failed, {:?}, {} in a row",
            pack.number(),
            error,
            failed_reads
        );
    }
}

fn log_change(pack: Pack, before: PackStatus, now: PackStatus) {
    if before == now {
        return;
    }
    let number = pack.number();
    match now {
        PackStatus::Unhealthy => warn!("battery {}: unhealthy, keeping the last good value", number),
        PackStatus::NotConnected => warn!("battery {}: not connected", number),
        PackStatus::Disabled | PackStatus::Unknown | PackStatus::Healthy => {
            info!("battery {}: {:?}", number, now)
        }
    }
}
