//! The monitor of one pack: from its measurements to its state, events and failsafe level.

mod counting;
mod evaluation;
mod learning;
mod reports;
mod source_counter;

use core::mem;

use counting::{ChargeCounter, GaugeState};
use evaluation::Evaluation;
use learning::Learnt;
use reports::Reports;

use crate::basis::Basis;
use crate::charge::{PackIdentity, Quantity};
use crate::chemistry::SAME_VOLTAGE_V;
use crate::consumption::{MAX_INTERVAL_US, mean_current_a, microseconds, was_off};
use crate::diagnosis;
use crate::estimator::{Estimator, EstimatorMemory, Findings, Reading, ReportedCharge};
use crate::event::push;
use crate::failsafe::ReachedLevels;
use crate::reporters::{GapReporter, HealthReporter, LessonReporter};
use crate::settings::PackSettings;
use crate::swap::{AtRest, Doubt, Replacement, SwapDetector};
use crate::time::Instant;
use crate::{
    Amount, BatteryState, ChargeSource, Consumed, Contents, Counted, CurrentRange, LearntPack,
    LessonObstacle, LoadState, Measurement, Measuring, PackEvent, PackEvents, PackMemory, PackSource,
    PackStatus, ReadError, Readings, Tick,
};

/// Below this voltage no pack is connected, in volts: what leaks into the divider while the board is powered by USB.
/// PX4's `BATTERY_CONNECTED` test has the same limit.
pub const MIN_CONNECTED_VOLTAGE_V: f32 = 2.1;

/// Consecutive failed reads after which a pack is unhealthy: half a second at 10 Hz.
pub const FAILED_READS_UNTIL_UNHEALTHY: u32 = 5;

/// The longest period of a source whose current is compared with its counter, in microseconds.
const SLOWEST_PERIOD_US: u64 = 6_000_000;

/// Outcome of an update, besides the new state.
#[derive(Clone, Debug, Default, PartialEq)]
#[must_use = "a failsafe level that was reached has to act"]
pub struct PackUpdate {
    /// To be announced.
    pub events: PackEvents,
    /// Why the read failed.
    pub error: Option<ReadError>,
    /// The failsafe levels that were reached in this tick. Their most severe action has to be taken.
    pub failsafe: ReachedLevels,
}

/// Monitors one pack, whose state is its owner's: who has several keeps their states side by side, as telemetry reads them.
#[derive(Clone, Debug)]
pub struct BatteryMonitor {
    failed_reads: u32,
    last_tick: Option<Instant>,
    /// Time, and what was drawn, of the latest valid reading that was that of a pack.
    last_reading: Option<(Instant, Option<f32>)>,
    last_healthy: Option<Instant>,
    /// When the charge was counted last of a pack whose current was known, since the source of this current was set.
    counted_at: Option<Instant>,
    /// The latest voltage while connected, in volts.
    last_voltage_v: Option<f32>,
    reports: Reports,
    health: HealthReporter,
    gaps: GapReporter,
    lesson: LessonReporter,
    counting: ChargeCounter,
    estimator: Estimator,
    swap_detector: SwapDetector,
    evaluation: Evaluation,
    learnt: Option<Learnt>,
    /// Exchanges of the pack, and charges elsewhere; of a sum, those of its packs (wraps).
    exchanges: u8,
    /// Scale and pin of the voltage on which the estimate is based.
    measuring: Option<Measuring>,
    current_source: Option<u16>,
    /// The worst range of the current that was announced since the start.
    announced_range: CurrentRange,
    /// Whether the current sensor has shown that it has power since the voltage is missing, under load.
    sensor_has_power: bool,
    /// Since the start, or another scale of the current.
    current_is_reversed: bool,
}

/// One update of a pack.
struct Turn<'a> {
    tick: Tick,
    /// Since the tick before, in microseconds and in seconds.
    tick_us: u64,
    tick_s: f32,
    /// Since the latest valid reading of a pack, in microseconds.
    reading_us: u64,
    /// The owner's, overridden by what the pack reports of itself.
    settings: &'a PackSettings,
    state: &'a mut BatteryState,
    events: &'a mut PackEvents,
}

impl BatteryMonitor {
    /// A monitor without any reading yet.
    // Inlined, the code would be repeated for each pack of a bank.
    #[inline(never)]
    pub fn new() -> Self {
        Self {
            failed_reads: 0,
            last_tick: None,
            last_reading: None,
            last_healthy: None,
            counted_at: None,
            last_voltage_v: None,
            reports: Reports::new(),
            health: HealthReporter::default(),
            gaps: GapReporter::default(),
            lesson: LessonReporter::default(),
            counting: ChargeCounter::default(),
            estimator: Estimator::new(),
            swap_detector: SwapDetector::new(),
            evaluation: Evaluation::default(),
            learnt: None,
            exchanges: 0,
            measuring: None,
            current_source: None,
            announced_range: CurrentRange::Within,
            sensor_has_power: false,
            current_is_reversed: false,
        }
    }

    /// Delays what is done once in a second, and the first estimate with it, before the first reading.
    pub fn delay(&mut self, delay_s: f32) {
        self.estimator.delay(delay_s);
    }

    /// Failed reads since the last valid one (saturating).
    pub fn failed_reads(&self) -> u32 {
        self.failed_reads
    }

    /// Whether the sensor was found to take a load for charging, since the start or another scale of the current.
    pub fn is_current_reversed(&self) -> bool {
        self.current_is_reversed
    }

    /// Processes one reading, valid or failed. The result is in `state`, which was by default before the first one.
    pub fn update(
        &mut self,
        state: &mut BatteryState,
        tick: Tick,
        reading: Result<Measurement, ReadError>,
        settings: &PackSettings,
    ) -> PackUpdate {
        let mut update = PackUpdate::default();
        let events = &mut update.events;
        let since = |time: Option<Instant>| time.map_or(0, |time| tick.now.us_since(time));
        let reading_us = since(self.last_reading.map(|(time, _)| time));
        let tick_us = since(self.last_tick.replace(tick.now));
        let reading = reading
            .as_ref()
            .map_err(|error| *error)
            .and_then(Measurement::check_plausible);
        if let Ok(measurement) = reading {
            self.follow_reports(tick, measurement, state, events);
        }
        let reported = self.reports.settings(state, settings);
        let settings = reported.as_ref().unwrap_or(settings);
        let turn = &mut Turn {
            tick,
            tick_us,
            tick_s: microseconds(tick_us) * 1e-6,
            reading_us,
            settings,
            state,
            events,
        };
        let mut is_fresh = false;
        let error = match reading {
            Ok(measurement) => {
                self.failed_reads = 0;
                is_fresh = self.accept(turn, measurement);
                // A pack whose charge is unknown is read all the same: that is no failed read.
                self.judge_health(turn)
            }
            Err(error) => {
                self.reject(turn.state);
                update.error = Some(error);
                Some(error)
            }
        };
        turn.state.read_error = error;
        self.report_health(turn, error);
        // A sum without healthy members has not lost a contact: it can't be swapped itself.
        if !is_fresh && error != Some(ReadError::NoHealthyMember) {
            self.swap_detector.lose_contact(turn.tick_s, tick.load_state);
        }
        self.show_settings(turn);
        let basis = self.basis(turn, is_fresh);
        update.failsafe = self.evaluation.update(&basis, turn.state, settings, turn.events);
        update
    }

    /// Announces what has changed of the sensor, the current and the contact.
    fn report_health(&mut self, turn: &mut Turn<'_>, error: Option<ReadError>) {
        let Turn { tick, tick_s, .. } = *turn;
        let status = turn.state.status;
        let has_lost_current = self.lost_count(tick.now, turn.state) == Some(ReadError::CurrentLost);
        if let Some(event) = self.health.sensor(tick_s, status, error) {
            push(turn.events, event);
        }
        if let Some(event) = self.health.current(tick_s, status, has_lost_current) {
            push(turn.events, event);
        }
        if let Some(event) = self.health.contact(tick_s, status, error, tick.load_state) {
            push(turn.events, event);
        }
    }

    /// Estimates and knowledge follow the scale of the measurements, at least once a second: before a voltage has rested.
    pub fn follow(&mut self, now: &Measuring, cell_count: Option<u8>) {
        if let Some(learnt) = &mut self.learnt {
            learnt.follow_scale(&now.scale);
        }
        let before = self.measuring.get_or_insert(*now);
        before.scale.amperes_per_volt = now.scale.amperes_per_volt;
        let Some(voltage_v) = self.last_voltage_v.filter(|_| before != now) else {
            return;
        };
        let cells = f32::from(cell_count.unwrap_or(1));
        let change_v = now.scale.voltage_change_v(&before.scale, voltage_v) / cells;
        if before.voltage_pin != now.voltage_pin || change_v.abs() > SAME_VOLTAGE_V {
            self.measuring = Some(*now);
            self.swap_detector.rescale();
        }
    }

    /// The current is made of another source than before if this number is another, as a hash of its scale and pin: charge that was
    /// counted before is not that of a lesson, and none is filled in. In every tick, before the reading.
    pub fn follow_current(&mut self, current_source: u16) {
        if let Some(learnt) = &mut self.learnt {
            learnt.follow_current(current_source);
        }
        let before = self.current_source.replace(current_source);
        if before.is_none_or(|before| before == current_source) {
            return;
        }
        self.counted_at = None;
        self.estimator.change_current();
        self.counting.end_interval();
        if let Some((_, rate)) = &mut self.last_reading {
            *rate = None;
        }
        if mem::take(&mut self.current_is_reversed) {
            self.estimator.clear_current();
            self.counting.discard_negative();
        }
    }

    /// Another component measures the pack from now on: its total is not what was drawn from it.
    pub fn change_counter(&mut self) {
        self.counting.change_source();
    }

    /// Takes over what the pack reports of itself, and notices another serial number.
    fn follow_reports(
        &mut self,
        tick: Tick,
        measurement: &Measurement,
        state: &mut BatteryState,
        events: &mut PackEvents,
    ) {
        if let Some(replacement) = self.reports.replacement(tick, measurement) {
            self.swap_detector.reset();
            self.evaluation.restart_charge_reports();
            if let Some(learnt) = &mut self.learnt {
                learnt.replace_pack();
            }
            self.replace_pack(replacement, state, events);
        }
        self.reports.update(tick, measurement, state, events);
        if state.members != 0 && self.exchanges != measurement.exchanges {
            self.exchanges = measurement.exchanges;
            self.replace_member(events);
        }
    }

    /// A member of the sum was exchanged: what was estimated is that of other packs. Its failsafe level stays latched.
    fn replace_member(&mut self, events: &mut PackEvents) {
        self.estimator = Estimator::new();
        self.evaluation.diagnosis = diagnosis::Diagnosis::default();
        push(events, PackEvent::EstimateRestarted);
    }

    fn remember(&mut self, now: Instant, measurement: &Measurement) {
        self.last_reading = Some((now, measurement.rate()));
        self.counting.remember(now, measurement.rate());
    }

    /// Follows whether the charge of a pack whose current was known is counted. A time without readings is no loss.
    fn follow_count(&mut self, now: Instant, reading_us: u64, measurement: &Measurement) {
        let is_counted_at_source = match measurement.counted {
            Some(Counted::Members { drawn_mah, .. }) => drawn_mah.is_some(),
            Some(_) => self.counting.source_counts(),
            None => false,
        };
        let goes_on = is_counted_at_source || reading_us > counting::TIMEOUT_US;
        if measurement.rate().is_some() || goes_on && self.counted_at.is_some() {
            self.counted_at = Some(now);
        }
    }

    /// Processes a valid reading. Returns whether it is that of a pack: at a voltage near zero none is connected, unless a
    /// current shows that only the wire which measures the voltage is loose.
    fn accept(&mut self, turn: &mut Turn<'_>, measurement: &Measurement) -> bool {
        turn.state.temperature_c = measurement.possible_temperature_c();
        turn.state.thermometer = measurement.thermometer;
        // A sensor that measures no voltage, as one of fuel, has not lost it.
        let is_missing = |voltage_v| voltage_v < MIN_CONNECTED_VOLTAGE_V;
        if !measurement.voltage_v.is_some_and(is_missing) {
            self.sensor_has_power = false;
            turn.state.status = PackStatus::Healthy;
            self.estimate(turn, measurement);
            return true;
        }
        // While driving the wire that measures the voltage may be loose.
        let may_be_loaded = turn.tick.load_state == LoadState::On;
        let by_current = measurement
            .without_voltage(self.sensor_has_power)
            .filter(|_| may_be_loaded);
        // The first reading of a loss is a mean that includes the time before it.
        let was_missing = turn.state.status == PackStatus::NotConnected;
        self.sensor_has_power =
            may_be_loaded && was_missing && measurement.shows_powered_sensor(self.sensor_has_power);
        if let Some(by_current) = &by_current {
            self.estimate(turn, by_current);
        } else {
            // The voltage at the pin means nothing: the values become unknown, the pack is not empty. Until one is read
            // again it is a gap.
            turn.state.readings = Readings {
                faults: self.evaluation.diagnosis.disconnect(turn.state),
                ..Readings::NONE
            };
        }
        turn.state.status = PackStatus::NotConnected;
        by_current.is_some()
    }

    /// Processes a reading of a pack: counts its charge, estimates what is left, and shows both in the state.
    fn estimate(&mut self, turn: &mut Turn<'_>, measurement: &Measurement) {
        self.report_range(turn, measurement.current_range);
        self.last_voltage_v = measurement.voltage_v.or(self.last_voltage_v);
        let mut reading = self.reading(turn, measurement);
        let mut identity = self.identify(turn, measurement, &reading);
        reading.doubt = self.swap_detector.doubt();
        self.count(turn, measurement, &mut reading);
        reading.known_cells = reading.known_cells.or(self.kept_cells());
        let settings = turn.settings;
        let (estimator, learnt) = self.estimator_of(turn);
        let Findings { event, second } = estimator.update(&reading, settings, learnt);
        if let Some(second) = &second
            && second.identity != PackIdentity::Same
        {
            self.swap_detector.reset();
            identity = second.identity;
        }
        self.follow_identity(identity, turn.events);
        self.limit_by_count(turn, second.is_some());
        self.update_state(turn, measurement);
        if let Some(event) = event {
            turn.state.revision = turn.state.revision.wrapping_add(1);
            push(turn.events, event);
        }
        if let Some(second) = second {
            self.end_second(turn, measurement, second.kept);
        }
        self.remember(turn.tick.now, measurement);
    }

    /// Announces a current beyond its sensor's range, once for each way.
    fn report_range(&mut self, turn: &mut Turn<'_>, range: CurrentRange) {
        turn.state.current_range = range;
        if range > self.announced_range {
            self.announced_range = range;
            push(turn.events, PackEvent::CurrentOverRange(range));
        }
    }

    /// A measurement as the estimators read it, before the charge is counted.
    fn reading(&self, turn: &Turn<'_>, measurement: &Measurement) -> Reading {
        let Turn {
            tick,
            tick_us,
            reading_us,
            ..
        } = *turn;
        let mut mean_a = None;
        if let Some(current_a) = measurement.rate()
            && !self.current_is_reversed
        {
            let before_a = self.last_reading.and_then(|(_, rate)| rate);
            let parked_a = (tick.load_state == LoadState::Off).then_some(current_a);
            mean_a = if was_off(measurement.contents, reading_us) {
                Some(0.0)
            } else {
                mean_current_a(reading_us, before_a, current_a).or(parked_a)
            };
        }
        Reading {
            dt_s: microseconds(reading_us) * 1e-6,
            voltage_v: measurement.voltage_v,
            current_a: measurement.rate(),
            current_range: measurement.current_range,
            mean_current_a: mean_a,
            unmeasured_mah: 0.0,
            // A source that reports seldom has missed none.
            missed_s: match reading_us {
                0..=MAX_INTERVAL_US => 0.0,
                _ => microseconds(reading_us.saturating_sub(tick_us)) * 1e-6,
            },
            soc_at_most: 1.0,
            known_cells: measurement.doubtful_cells,
            load_state: tick.load_state,
            doubt: Doubt::None,
        }
    }

    /// Acts on a swap, by which a count of this pack begins, or resolves a doubt once the pack rests. Returns whether it is the pack
    /// that is counted.
    fn identify(
        &mut self,
        turn: &mut Turn<'_>,
        measurement: &Measurement,
        reading: &Reading,
    ) -> PackIdentity {
        match self.detect_swap(reading) {
            Some(AtRest::Replaced(replacement)) => {
                if let Some(learnt) = &mut self.learnt {
                    learnt.swap(turn.settings.serial_number);
                }
                self.replace_pack(replacement, turn.state, turn.events);
                self.reports.gauge.update(turn.tick.now, measurement.gauge);
                PackIdentity::Same
            }
            Some(at_rest) => {
                // A pack that rests near the voltage of the one before may still have another charge.
                let settings = turn.settings;
                let (estimator, learnt) = self.estimator_of(turn);
                estimator.resolve(&at_rest, reading, settings, learnt)
            }
            None => PackIdentity::Same,
        }
    }

    /// Once a second, behind the estimate: keeps what was learnt, and updates what takes long to compute.
    fn end_second(&mut self, turn: &mut Turn<'_>, measurement: &Measurement, kept: Option<LearntPack>) {
        self.notice_reversed_current(turn);
        self.lesson.follow(turn.tick.load_state);
        if kept.is_some()
            && let Some(obstacle) = self.lesson_obstacle(turn.state, turn.settings)
            && let Some(event) = self.lesson.report(obstacle)
        {
            push(turn.events, event);
        }
        self.persist(turn, kept);
        if measurement.time_remaining_s.is_none() {
            self.update_time_remaining(turn.state);
        }
    }

    /// Counts the charge of a reading, and corrects the reading by what the source has counted.
    fn count(&mut self, turn: &mut Turn<'_>, measurement: &Measurement, reading: &mut Reading) {
        let now = turn.tick.now;
        let reading_us = turn.reading_us;
        let capacity_mah = largest_capacity_mah(turn.state, turn.settings);
        let gauge = &self.reports.gauge;
        let count = self
            .counting
            .update(now, reading.dt_s, measurement, gauge, capacity_mah);
        if let Some(gap) = self.gaps.update(reading.dt_s, count.gap) {
            push(turn.events, PackEvent::Gap(gap));
        }
        match count.at_source_mah {
            Some(counted_mah) => {
                let is_measured = measurement.rate().is_some() && reading_us <= SLOWEST_PERIOD_US;
                self.counting.correct(reading, counted_mah, is_measured);
            }
            None => self.counting.complete(now, reading_us, reading),
        }
        if let Some(charged_mah) = reading.charged_mah() {
            self.counting.add_charged(charged_mah, capacity_mah);
        }
        turn.state.left_at_most = self.counting.soc_at_most(capacity_mah);
        reading.soc_at_most = turn.state.left_at_most.unwrap_or(1.0);
        self.follow_count(now, reading_us, measurement);
        if self.lost_count(now, turn.state) == Some(ReadError::CurrentLost) {
            let (estimator, learnt) = self.estimator_of(turn);
            estimator.lose_current(turn.settings, learnt);
        }
    }

    /// The limit by a count at the source follows the estimate with the load off.
    fn limit_by_count(&mut self, turn: &mut Turn<'_>, is_new: bool) {
        let is_followed = is_new || self.counting.awaits_rest();
        if turn.state.left_at_most.is_none() || !is_followed {
            return;
        }
        let capacity_mah = largest_capacity_mah(turn.state, turn.settings);
        let estimate = self.estimator.charge();
        self.counting
            .follow_estimate(estimate, turn.tick.load_state, capacity_mah);
        turn.state.left_at_most = self.counting.soc_at_most(capacity_mah);
    }

    fn detect_swap(&mut self, reading: &Reading) -> Option<AtRest> {
        let Some(voltage_v) = reading.voltage_v else {
            self.swap_detector.lose_contact(reading.dt_s, reading.load_state);
            return None;
        };
        self.swap_detector
            .update(reading.dt_s, voltage_v, reading.current_a, reading.load_state)
    }

    /// The pack was swapped: estimates and counts restart. The failsafe level stays latched until the new pack
    /// disproves it.
    fn replace_pack(&mut self, replacement: Replacement, state: &mut BatteryState, events: &mut PackEvents) {
        self.exchanges = self.exchanges.wrapping_add(1);
        self.counting.replace_pack();
        self.reports.gauge = GaugeState::Absent;
        self.estimator = Estimator::new();
        self.evaluation.replace_pack(replacement);
        self.last_reading = None;
        state.revision = state.revision.wrapping_add(1);
        push(events, PackEvent::Swapped);
    }

    /// A count that runs backwards is worse than none. With the load off a charger may be switched on and off.
    fn notice_reversed_current(&mut self, turn: &mut Turn<'_>) {
        if self.current_is_reversed
            || turn.tick.load_state == LoadState::Off
            || !self.estimator.is_current_reversed()
        {
            return;
        }
        self.current_is_reversed = true;
        self.estimator.restart_charge();
        push(turn.events, PackEvent::CurrentReversed);
    }

    /// Knowledge of another pack starts over. While the board runs a count goes on unless a pack was swapped for certain.
    fn follow_identity(&mut self, identity: PackIdentity, events: &mut PackEvents) {
        if identity == PackIdentity::Same {
            return;
        }
        if identity == PackIdentity::Another {
            self.counting.replace_pack();
        }
        self.exchanges = self.exchanges.wrapping_add(1);
        if let Some(learnt) = &mut self.learnt {
            learnt.clear_charge();
        }
        push(events, PackEvent::EstimateRestarted);
    }

    /// The estimator, and what is known of the pack that it estimates.
    fn estimator_of(&mut self, turn: &Turn<'_>) -> (&mut Estimator, &LearntPack) {
        let cell_count = self.estimator.cell_count(turn.settings);
        let can_learn = self.can_learn(turn.state);
        let learnt = self.learnt.as_ref().filter(|_| can_learn);
        let learnt = Learnt::of(learnt, turn.settings, cell_count);
        (&mut self.estimator, learnt)
    }

    /// Keeps what was learnt of a pack, or of its rest.
    fn persist(&mut self, turn: &mut Turn<'_>, kept: Option<LearntPack>) {
        let settings = turn.settings;
        let can_learn = self.can_learn(turn.state);
        let cell_count = self.estimator.cell_count(settings);
        let Some(learnt) = self.learnt.as_mut().filter(|_| can_learn) else {
            return;
        };
        if let Some(cell_ohm) = self.estimator.cell_resistance_ohm(settings) {
            learnt.compare(cell_ohm);
        }
        if let Some(mut kept) = kept {
            if let (Some(open), Some(current_source)) = (&mut kept.open, self.current_source) {
                open.current_source = current_source;
            }
            learnt.update(&kept, settings, cell_count, turn.events);
        }
    }

    /// Whether the pack is learnt here: not one that knows itself, nor a sum of others, nor a tank.
    fn can_learn(&self, state: &BatteryState) -> bool {
        self.reports.gauge.full_mah().is_none() && state.members == 0 && state.contents == Contents::Charge
    }

    /// Why the drive so far has taught nothing of the pack; `None` if it has, or if no such pack is learnt.
    pub fn lesson_obstacle(&self, state: &BatteryState, settings: &PackSettings) -> Option<LessonObstacle> {
        let learnt = self.learnt.as_ref().filter(|_| self.can_learn(state))?;
        let learnt = Learnt::of(Some(learnt), settings, self.estimator.cell_count(settings));
        self.estimator.lesson_obstacle(settings, learnt)
    }

    /// Method and assumptions of the estimate, for people at a host.
    pub fn explain<'a>(
        &'a self,
        settings: &PackSettings,
    ) -> (&'static str, impl Iterator<Item = Quantity> + 'a) {
        let learnt = Learnt::of(
            self.learnt.as_ref(),
            settings,
            self.estimator.cell_count(settings),
        );
        self.estimator.explain(settings, learnt)
    }

    /// Cells of the pack that flash holds.
    fn kept_cells(&self) -> Option<u8> {
        self.learnt.as_ref()?.pack().cell_count()
    }

    /// Cells that the pack may have although its voltage is that of fewer.
    pub fn doubtful_cells(&self) -> Option<u8> {
        self.kept_cells().filter(|_| self.estimator.cells_are_doubtful())
    }

    /// Exchanges of the pack, and charges elsewhere (wraps).
    pub fn exchanges(&self) -> u8 {
        self.exchanges
    }

    /// Charge and energy drawn since the start or the last battery reset, though they may not be counted any more.
    pub fn consumed(&self) -> Consumed {
        Consumed {
            charge_mah: self.counting.charge_mah(),
            energy_wh: self.counting.energy_wh(),
        }
    }

    /// Charge drawn since the start, in milliampere-hours.
    pub fn drawn_mah(&self) -> f32 {
        self.counting.drawn_mah()
    }

    /// The voltage at rest, in volts, with the load off.
    pub fn resting_v(&self) -> Option<f32> {
        self.swap_detector.resting_v()
    }

    fn update_state(&self, turn: &mut Turn<'_>, measurement: &Measurement) {
        let Turn { tick, settings, .. } = *turn;
        let state = &mut *turn.state;
        let Measurement {
            voltage_v,
            current_a,
            power_w,
            ..
        } = *measurement;
        let is_counted = match self.reports.gauge {
            // Consumed and remaining charge are equally unknown.
            GaugeState::TimedOut { .. } => false,
            GaugeState::Valid { .. } => true,
            _ => measurement.rate().is_some() || measurement.counted.is_some(),
        };
        let (remaining_pct, charge_source) = self.remaining_pct(tick.now, measurement, settings);
        state.charge_source = charge_source;
        let charge = remaining_pct.and(self.estimated(state));
        let before = state.readings;
        state.readings = Readings {
            voltage_v,
            resting_voltage_v: voltage_v
                .zip(current_a)
                .and_then(|(voltage_v, current_a)| self.estimator.resting_voltage_v(voltage_v, current_a)),
            current_a,
            power_w,
            fuel_l_h: measurement.fuel_l_h,
            average_current_a: current_a.and(self.estimator.average_current_a()),
            remaining_pct,
            remaining_sigma_pct: charge.map(|charge| charge.sigma_pct),
            usable_pct: charge.map(|charge| charge.usable_pct).or(remaining_pct),
            usable_sigma_pct: charge.map(|charge| charge.usable_sigma_pct),
            time_remaining_s: measurement
                .time_remaining_s
                .or(remaining_pct.and(before.time_remaining_s)),
            faults: before.faults,
            reported: measurement.reported,
        };
        state.resistance_ohm = self.estimator.resistance_ohm();
        state.consumed = is_counted.then(|| Amount::of(measurement.contents, self.counting.charge_mah()));
        state.consumed_wh = (is_counted && voltage_v.is_some() && measurement.contents == Contents::Charge)
            .then(|| self.counting.energy_wh());
        state.cell_count = self.estimator.cell_count(settings);
        self.show_learnt(state, settings);
    }

    /// State of charge, in percent, and where it is from.
    fn remaining_pct(
        &self,
        now: Instant,
        measurement: &Measurement,
        settings: &PackSettings,
    ) -> (Option<f32>, ChargeSource) {
        let percent = |soc: f32| soc * 100.0;
        let reported = measurement.state_of_charge;
        if self.reports.charge_time_out(now) == Some(ReadError::LostMember) {
            return (None, ChargeSource::Estimated);
        }
        match (&self.reports.gauge, reported, measurement.contents) {
            (GaugeState::Valid { gauge, .. }, ..) => {
                (Some(percent(gauge.state_of_charge())), ChargeSource::Gauge)
            }
            (GaugeState::TimedOut { .. }, ..) => (reported.map(percent), ChargeSource::Gauge),
            (_, Some(soc), _) => (Some(percent(soc)), ChargeSource::Reported),
            (GaugeState::Awaited { .. }, ..) => (None, ChargeSource::Gauge),
            (_, _, Contents::Charge) if self.counting.awaits_rest() => (None, ChargeSource::Estimated),
            (_, _, Contents::Charge) => {
                let estimated = self.estimator.reported();
                let remaining_pct = estimated.map(|charge| charge.remaining_pct);
                (remaining_pct, ChargeSource::Estimated)
            }
            (_, _, Contents::Fuel) => (self.fill_level(settings).map(percent), ChargeSource::Estimated),
        }
    }

    fn show_learnt(&self, state: &mut BatteryState, settings: &PackSettings) {
        let cell_count = self.estimator.cell_count(settings);
        let learnt = self.learnt.as_ref().filter(|_| self.can_learn(state));
        let learnt = learnt.and_then(|learnt| learnt.known(settings, cell_count));
        state.learnt_capacity_mah = learnt.and_then(LearntPack::capacity_mah);
        state.state_of_health_pct = state
            .details
            .state_of_health_pct
            .or_else(|| learnt?.health_pct(settings.capacity_mah));
    }

    /// The charge as it is reported, where it is estimated here.
    fn estimated(&self, state: &BatteryState) -> Option<&ReportedCharge> {
        self.estimator.reported().filter(|_| state.has_estimated_charge())
    }

    /// Updates the time left: once a second, since it takes a division.
    fn update_time_remaining(&self, state: &mut BatteryState) {
        let remaining_pct = state.readings.remaining_pct;
        let charge = remaining_pct.and(self.estimator.charge());
        let charge = charge.filter(|_| state.has_estimated_charge());
        let soc = charge.map(|charge| charge.available);
        state.readings.time_remaining_s = match state.rate() {
            Some(_) => soc
                .or(remaining_pct.map(|percent| percent / 100.0))
                .zip(state.full_capacity())
                .and_then(|(soc, capacity)| self.estimator.time_to_draw_s(soc, capacity)),
            None => charge.and(self.estimator.inferred_time_remaining_s()),
        };
    }

    /// Fill level of a tank whose flow is counted: it starts full, or at the level of the last battery reset.
    fn fill_level(&self, settings: &PackSettings) -> Option<f32> {
        Some(self.counting.soc_left(settings.capacity_mah?))
    }

    /// A pack whose charge has timed out is unhealthy while a threshold needs it.
    fn judge_health(&mut self, turn: &mut Turn<'_>) -> Option<ReadError> {
        let Turn { tick, settings, .. } = *turn;
        if turn.state.status != PackStatus::Healthy {
            return None;
        }
        let time_out = self.reports.charge_time_out(tick.now);
        let is_unknown = turn.state.readings.remaining_pct.is_none();
        let cause = time_out
            .filter(|_| is_unknown)
            .or_else(|| self.lost_count(tick.now, turn.state));
        if settings.failsafe.needs_charge() && cause.is_some() {
            turn.state.status = PackStatus::Unhealthy;
            return cause;
        }
        self.last_healthy = Some(tick.now);
        None
    }

    /// Cause for which a pack whose charge was counted by its current has been measured without one for long.
    fn lost_count(&self, now: Instant, state: &BatteryState) -> Option<ReadError> {
        let is_over = |counted_at| counting::has_timed_out(counted_at, now);
        let is_lost = state.has_estimated_charge() && self.counted_at.is_some_and(is_over);
        is_lost.then(|| {
            if self.reports.is_incomplete() {
                ReadError::LostMember
            } else {
                ReadError::CurrentLost
            }
        })
    }

    fn reject(&mut self, state: &mut BatteryState) {
        self.reports.serial_number.read_failed();
        self.failed_reads = self.failed_reads.saturating_add(1);
        if self.failed_reads >= FAILED_READS_UNTIL_UNHEALTHY {
            state.status = PackStatus::Unhealthy;
        }
    }

    /// Inputs of a tick's evaluation. `is_fresh`: the state shows this tick's reading.
    fn basis(&self, turn: &Turn<'_>, is_fresh: bool) -> Basis {
        Basis {
            tick: turn.tick,
            dt_us: u32::try_from(turn.tick_us).unwrap_or(u32::MAX),
            dt_s: turn.tick_s,
            is_fresh,
            last_healthy: self.last_healthy,
            last_voltage_v: self.last_voltage_v,
            cells_are_doubtful: self.estimator.cells_are_doubtful(),
            resting_v: self.swap_detector.resting_v(),
            members_spread: self.reports.members_spread,
        }
    }

    /// The settings that are shown with the state.
    fn show_settings(&self, turn: &mut Turn<'_>) {
        let Turn { settings, state, .. } = turn;
        state.chemistry = settings.chemistry;
        // The capacity that is set is not that of a gauge which has yet to report.
        state.capacity = match self.reports.gauge {
            GaugeState::Awaited { .. } => None,
            _ => settings
                .capacity_mah
                .map(|capacity| Amount::of(state.contents, capacity)),
        };
        state.critical_voltage_v = settings.failsafe.critical.voltage_v;
        state.serial_number = settings.serial_number;
        state.reported_voltage = settings.reported_voltage;
        state.visibility = settings.visibility;
    }

    /// The part to retain over a reset of the processor, of a pack that is read from `source`.
    pub fn memory(&self, status: PackStatus, source: PackSource) -> PackMemory {
        let doubt = match self.swap_detector.doubt() {
            // After the reset another pack may be connected.
            Doubt::ShortLoss => Doubt::ContactLoss,
            Doubt::None if status == PackStatus::NotConnected => Doubt::ContactLoss,
            doubt => doubt,
        };
        let mut estimate = self.estimator.memory();
        if self.reports.gauge.full_mah().is_some() {
            estimate.reference = None;
        }
        if doubt == Doubt::ContactLoss && estimate.reference.is_none() {
            estimate = EstimatorMemory::default();
        }
        PackMemory {
            source,
            consumption: self.counting.consumption(),
            estimate,
            doubt,
            serial_number: self.reports.serial_number.known(),
            is_too_hot: self.evaluation.diagnosis.is_too_hot(),
        }
    }

    /// Continues with what was retained over a reset of the processor.
    pub fn restore(&mut self, memory: &PackMemory) {
        self.counting
            .restore(memory.consumption, memory.estimate.charge.as_ref());
        self.estimator.restore(&memory.estimate, memory.doubt);
        self.swap_detector.restore(memory.doubt);
        self.reports.serial_number.restore(memory.serial_number);
        if memory.is_too_hot {
            self.evaluation.diagnosis.restore_too_hot();
        }
    }

    /// The pack's thermometer was taken away: faults of its temperature end.
    pub fn forget_temperature(&mut self) {
        self.evaluation.diagnosis.forget_temperature();
    }

    /// Learnt properties of the pack; `None` until [`restore_learnt`](Self::restore_learnt).
    pub fn learnt(&self) -> Option<&LearntPack> {
        self.learnt.as_ref().map(Learnt::pack)
    }

    /// Learnt properties of the pack, unless it was swapped and may be another one.
    pub fn shown_learnt(&self) -> Option<&LearntPack> {
        self.learnt.as_ref()?.shown()
    }

    /// Learnt properties of the pack, unless it was swapped, or its state says that they are those of another one.
    pub fn learnt_of_this(&self, state: &BatteryState) -> Option<&LearntPack> {
        self.shown_learnt()
            .filter(|learnt| learnt.matches(state.chemistry, state.cell_count, state.capacity_mah()))
    }

    /// Continues with what flash holds of the pack, at the start and after a change of its serial number.
    pub fn restore_learnt(&mut self, pack: LearntPack) {
        if self.learnt.is_some() {
            self.estimator.change_pack();
        }
        self.learnt = Some(Learnt::saved(pack));
    }

    /// The record to write to flash.
    pub fn unsaved_learnt(&self) -> Option<&LearntPack> {
        self.learnt.as_ref()?.unsaved()
    }

    /// `saved` is in flash now.
    pub fn mark_learnt_saved(&mut self, saved: &LearntPack) {
        if let Some(learnt) = &mut self.learnt {
            learnt.mark_saved(saved);
        }
    }

    /// Erases what is learnt of the pack.
    pub fn erase_learnt(&mut self) {
        if let Some(learnt) = &mut self.learnt {
            learnt.erase();
            self.estimator.restart_drive();
        }
    }

    /// Clears the failsafe level *unhealthy*, and no other, of a pack that has been healthy for 5 s. With the load off,
    /// unless a failsafe has terminated its drive.
    pub fn release_unhealthy(&mut self) {
        self.evaluation.release_unhealthy();
    }

    /// Battery reset: clears the failsafe level and sets the remaining charge, in percent (0 to 100), unless that is
    /// reported by the pack or its sensor. `state` shows it at once: an arming may follow before the next reading. Ignored if
    /// the charge is not finite.
    pub fn reset(
        &mut self,
        state: &mut BatteryState,
        load_state: LoadState,
        remaining_pct: f32,
        settings: &PackSettings,
    ) {
        if !remaining_pct.is_finite() {
            return;
        }
        if state.charge_source == ChargeSource::Estimated {
            self.set_charge(state, remaining_pct, settings);
        }
        self.evaluation.reset(state, load_state, settings);
    }

    /// Sets the remaining charge, in percent, of a pack whose charge is estimated.
    fn set_charge(&mut self, state: &mut BatteryState, remaining_pct: f32, settings: &PackSettings) {
        let soc = (remaining_pct / 100.0).clamp(0.0, 1.0);
        let capacity_mah = state.full_capacity().or(settings.capacity_mah);
        let charge_mah = (1.0 - soc) * capacity_mah.unwrap_or(0.0);
        let consumed = Consumed {
            charge_mah,
            energy_wh: charge_mah / 1000.0 * state.readings.voltage_v.unwrap_or(0.0),
        };
        self.counting.restart(consumed, soc);
        self.estimator.set_state_of_charge(soc);
        self.swap_detector.end_doubt();
        if state.consumed.is_some() {
            state.consumed = Some(Amount::of(state.contents, charge_mah));
        }
        if state.readings.remaining_pct.is_some() {
            state.readings.remaining_pct = Some(soc * 100.0);
            state.readings.usable_pct = Some(soc * 100.0);
        }
    }
}

/// The larger of the capacities that a pack may have, in milliampere-hours.
fn largest_capacity_mah(state: &BatteryState, settings: &PackSettings) -> Option<f32> {
    let capacities_mah = [state.learnt_capacity_mah, settings.capacity_mah];
    capacities_mah.into_iter().flatten().reduce(f32::max)
}

impl Default for BatteryMonitor {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests;
