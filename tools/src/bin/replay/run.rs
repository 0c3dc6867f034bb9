//! A trace through the monitor, and the parameters it is replayed with.

use rover_battmon::battery::{
    BatteryMonitor, BatteryState, FailsafeLevel, FailsafeTimers, LearntPack, LessonObstacle, LoadState,
    Measurement, PackEvent, PackSettings, PackUpdate, ReachedLevels, ReadError, Thresholds, Tick,
};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, MonitorKind, ParameterId, Parameters, Refused};
use rover_battmon::time::Instant;
use rover_battmon_tools::recordings::entry::Sample;

use crate::assignments::Assignment;
use crate::drive::Trace;
use crate::failsafes::{Levels, Reached, Timers};
use crate::report::Row;
use crate::survey::Inputs;
use crate::words::{clock, rounded};

/// `parameters` with these assignments, in their order. `BATT_MONITOR` of `pack` is what is measured, unless it is assigned.
pub fn assign(
    mut parameters: Parameters,
    assignments: &[Assignment],
    pack: Pack,
    measured: Inputs,
) -> Result<Parameters, String> {
    let kind = if measured.current {
        MonitorKind::AnalogVoltageAndCurrent
    } else {
        MonitorKind::AnalogVoltage
    };
    let monitor = Assignment {
        id: BatteryParameter::Monitor.of(pack),
        value: kind.number() as f32,
    };
    for Assignment { id, value } in [&monitor].into_iter().chain(assignments) {
        parameters.set(*id, *value).map_err(|refused| match refused {
            Refused::OutOfRange => {
                format!("{} can't be {value}: {}", id.name(), id.row().range)
            }
            Refused::OtherChemistry => format!("{} can't be {value} with this BATT_CHEM", id.name()),
            _ => format!("{} can't be set", id.name()),
        })?;
    }
    Ok(parameters)
}

/// Values of which each parameter takes some, and that make a difference where it is read.
const TRIED: [f32; 9] = [0.0, 1.0, 2.0, 3.0, 10.0, 25.0, 64.0, 256.0, 1000.0];

/// Refuses assignments that no replay of these packs reads: of another pack, of the vehicle, or what a recording has the effect
/// of, as a scale.
pub fn check_packs(assignments: &[Assignment], packs: &[Pack]) -> Result<(), String> {
    for Assignment { id, .. } in assignments {
        let name = id.name();
        match (*id, packs) {
            (ParameterId::Battery(pack, _), packs) if packs.contains(&pack) => {
                if !is_read(*id, pack) {
                    return Err(format!("{name} is not of pack {} in a replay", pack.number()));
                }
            }
            (_, [pack]) => return Err(format!("{name} is not of pack {}", pack.number())),
            _ => return Err(format!("{name} is not of a pack")),
        }
    }
    Ok(())
}

/// Whether a value of the parameter changes the settings of a pack. One that can't be set is refused elsewhere.
fn is_read(id: ParameterId, pack: Pack) -> bool {
    let mut parameters = Parameters::defaults();
    // The percentages are read if they act.
    for (parameter, value) in [
        (
            BatteryParameter::Monitor,
            MonitorKind::AnalogVoltageAndCurrent.number() as f32,
        ),
        (BatteryParameter::LowPct, 20.0),
    ] {
        let _ = parameters.set(parameter.of(pack), value);
    }
    let own = settings(&parameters, pack);
    let mut accepted = TRIED.into_iter().filter_map(|value| {
        let mut changed = parameters.clone();
        changed.set(id, value).ok().map(|()| settings(&changed, pack))
    });
    let Some(first) = accepted.next() else {
        return true;
    };
    first != own || accepted.any(|changed| changed != own)
}

/// The parameters among the assignments that are not as they were, with both values.
pub fn changes(own: &Parameters, changed: &Parameters, assignments: &[Assignment]) -> Vec<String> {
    let mut changes = vec![];
    for Assignment { id, .. } in assignments {
        let (before, value) = (own.get(*id), changed.get(*id));
        let change = format!("{} {value} instead of {before}", id.name());
        if value != before && !changes.contains(&change) {
            changes.push(change);
        }
    }
    changes
}

impl Inputs {
    /// The trace's columns that the monitor is given, by `BATT_MONITOR` of `pack`.
    fn from_parameters(parameters: &Parameters, pack: Pack) -> Result<Self, String> {
        match parameters.monitor_kind(pack) {
            Some(MonitorKind::AnalogVoltage) => Ok(Self {
                voltage: true,
                current: false,
            }),
            Some(MonitorKind::AnalogVoltageAndCurrent) => Ok(Self {
                voltage: true,
                current: true,
            }),
            Some(MonitorKind::AnalogCurrent) => Ok(Self {
                voltage: false,
                current: true,
            }),
            other => Err(format!(
                "{} {} can't be replayed: 3, 4 and 31 can",
                BatteryParameter::Monitor.of(pack).name(),
                other.map_or(0, MonitorKind::number)
            )),
        }
    }
}

/// A fresh monitor that is given the readings of a recording.
pub struct Replay {
    pack: Pack,
    monitor: BatteryMonitor,
    /// After the latest reading.
    pub state: BatteryState,
    parameters: Parameters,
    settings: PackSettings,
    inputs: Inputs,
    known: LearntPack,
    /// Parameters that are as the user has them, whatever the recording sets.
    assigned: Vec<ParameterId>,
}

/// The settings of a pack of the kind that is set.
pub fn settings(parameters: &Parameters, pack: Pack) -> PackSettings {
    parameters
        .pack(pack)
        .settings_of_kind(parameters.monitor_kind(pack))
}

impl Replay {
    /// With the parameters of `pack`, of which this was learnt before. The user's assignments among them stay.
    pub fn new(
        pack: Pack,
        parameters: &Parameters,
        assignments: &[Assignment],
        known: LearntPack,
    ) -> Result<Self, String> {
        let mut monitor = BatteryMonitor::new();
        monitor.restore_learnt(known);
        let mut assigned: Vec<ParameterId> = assignments.iter().map(|assignment| assignment.id).collect();
        // It is what the recording has.
        assigned.push(BatteryParameter::Monitor.of(pack));
        Ok(Self {
            pack,
            monitor,
            state: BatteryState::default(),
            settings: settings(parameters, pack),
            inputs: Inputs::from_parameters(parameters, pack)?,
            parameters: parameters.clone(),
            known,
            assigned,
        })
    }

    /// Takes a parameter that was set during the recording. A value that is out of range in this version does not matter.
    pub fn set(&mut self, Assignment { id, value }: Assignment) {
        if !self.assigned.contains(&id) && self.parameters.set(id, value).is_ok() {
            self.settings = settings(&self.parameters, self.pack);
        }
    }

    /// The settings by now.
    pub fn settings(&self) -> &PackSettings {
        &self.settings
    }

    /// Takes the next reading.
    pub fn update(&mut self, sample: &Sample) -> PackUpdate {
        let reading = reading(sample, self.inputs);
        self.monitor
            .update(&mut self.state, tick(sample), reading, &self.settings)
    }

    /// The learnt data by now, as flash would have them.
    pub fn learnt(&self) -> &LearntPack {
        self.monitor.unsaved_learnt().unwrap_or(&self.known)
    }

    /// Why the drive so far has taught nothing.
    fn lesson_obstacle(&self) -> Option<LessonObstacle> {
        self.monitor.lesson_obstacle(&self.state, &self.settings)
    }
}

/// A recording through the monitor.
pub struct Outcome {
    /// The state after each reading.
    pub rows: Vec<Row>,
    /// The settings at the last armed reading; if there is none, those at the beginning.
    pub settings: PackSettings,
    /// The learnt data of the pack at the end.
    pub learnt: LearntPack,
    /// Why the last drive taught nothing.
    pub lesson_obstacle: Option<LessonObstacle>,
    /// When each level was reached.
    pub levels: Levels,
    /// Each change of the failsafe's timers.
    pub timers: Timers,
    /// The levels of which that is as the log has it.
    pub recorded: Vec<FailsafeLevel>,
}

impl Outcome {
    fn of(rows: Vec<Row>, settings: PackSettings, replay: &Replay) -> Self {
        let (mut levels, mut timers) = (Levels::default(), Timers::default());
        let mut before = FailsafeTimers::STOPPED;
        for row in &rows {
            for level in &row.reached {
                levels.reach(*level, row.time_s);
            }
            let changes = row.state.failsafe_timers.changes(before);
            changes.for_each(|change| timers.add(row.time_s, change));
            before = row.state.failsafe_timers;
        }
        Self {
            rows,
            settings,
            learnt: *replay.learnt(),
            lesson_obstacle: replay.lesson_obstacle(),
            levels,
            timers,
            recorded: vec![],
        }
    }

    /// Has the failsafe reach these levels when the log says so. Its readings, of which there are few, show that to one of them.
    pub fn follow(&mut self, levels: Vec<FailsafeLevel>, reached: &Reached, timers: &Timers) {
        for level in &levels {
            let times_s: Vec<f64> = match level {
                FailsafeLevel::Low => self.reached_low(reached),
                level => reached.times_s(*level).collect(),
            };
            self.levels.set(*level, times_s.first().copied());
            self.place(*level, &times_s);
        }
        self.timers.follow(timers, &levels);
        self.recorded = levels;
    }

    /// A low level that is skipped has no record: it is reached with the critical one.
    fn reached_low(&self, reached: &Reached) -> Vec<f64> {
        let low: Vec<f64> = reached.times_s(FailsafeLevel::Low).collect();
        let critical_s = reached.times_s(FailsafeLevel::Critical).next();
        let failsafe = &self.settings.failsafe;
        let row = critical_s.and_then(|critical_s| self.rows.iter().find(|row| row.time_s >= critical_s));
        let is_in_force = row.is_some_and(|row| failsafe.is_in_force(&failsafe.low, &row.state));
        match (low.as_slice(), critical_s) {
            ([], Some(critical_s)) if is_in_force => vec![critical_s],
            _ => low,
        }
    }

    /// Puts a level into the rows of these times instead of those that were computed.
    fn place(&mut self, level: FailsafeLevel, times_s: &[f64]) {
        for row in &mut self.rows {
            row.reached = row.reached.iter().copied().filter(|of| *of != level).collect();
            row.events
                .retain(|event| !matches!(event, PackEvent::Failsafe { level: of, .. } if *of == level));
        }
        for time_s in times_s {
            let place = self.rows.partition_point(|row| row.time_s < *time_s);
            if let Some(row) = self.rows.get_mut(place) {
                let mut reached: Vec<FailsafeLevel> = row.reached.iter().copied().chain([level]).collect();
                reached.sort_unstable();
                row.reached = ReachedLevels::from_iter(reached);
                row.events.push(PackEvent::failsafe(
                    level,
                    row.state.readings.voltage_v,
                    &row.state,
                ));
            }
        }
    }
}

/// The levels whose thresholds, and all that they are compared with, are the same with both settings.
pub fn unchanged_levels(own: &PackSettings, changed: &PackSettings) -> Vec<FailsafeLevel> {
    let of_level = |mut settings: PackSettings, level| {
        let failsafe = &mut settings.failsafe;
        let (thresholds, other) = match level {
            FailsafeLevel::Critical => (failsafe.critical, &mut failsafe.low),
            _ => (failsafe.low, &mut failsafe.critical),
        };
        // The usable charge ends at the critical voltage.
        if thresholds.usable_pct.is_none() {
            *other = Thresholds::default();
        }
        settings
    };
    let mut levels = vec![FailsafeLevel::Low, FailsafeLevel::Critical];
    levels.retain(|level| of_level(*own, *level) == of_level(*changed, *level));
    levels
}

/// Gives the readings of the trace to `replay`, and between them the parameters that it sets.
pub fn run(trace: &Trace, mut replay: Replay) -> Outcome {
    let mut settings = *replay.settings();
    let mut rows = Vec::with_capacity(trace.samples.len());
    feed(trace, &mut replay, |replay, sample, update| {
        if sample.armed {
            settings = *replay.settings();
        }
        rows.push(Row {
            time_s: sample.time_s,
            pack: replay.pack,
            state: replay.state,
            events: announced(&update).copied().collect(),
            reached: update.failsafe,
            reported: sample.reported,
        });
    });
    Outcome::of(rows, settings, &replay)
}

fn feed(trace: &Trace, replay: &mut Replay, mut each: impl FnMut(&Replay, &Sample, PackUpdate)) {
    let mut changes = trace.changes.iter().peekable();
    for (readings, sample) in trace.samples.iter().enumerate() {
        while let Some(change) = changes.next_if(|change| change.readings <= readings) {
            replay.set(change.assignment);
        }
        let update = replay.update(sample);
        each(replay, sample, update);
    }
}

/// Explains the estimate at a time of the trace, in seconds: its assumptions, and their changes in ten seconds and in a minute.
///
/// # Errors
/// A time outside of the trace, in words.
pub fn explain(trace: &Trace, mut replay: Replay, at_s: f64) -> Result<String, String> {
    let times_s =
        [trace.samples.first(), trace.samples.last()].map(|sample| sample.map(|sample| sample.time_s));
    let [Some(first_s), Some(last_s)] = times_s else {
        return Err("no reading".into());
    };
    if !(first_s..=last_s).contains(&at_s) {
        let (first, last) = (clock(first_s), clock(last_s));
        return Err(format!("no reading at {}: it has {first} to {last}", clock(at_s)));
    }
    let mut method = "";
    let readings_until = |time_s| trace.samples.partition_point(|sample| sample.time_s <= time_s);
    let explained_after = EXPLAINED_AGO_S.map(|ago_s| readings_until(at_s - ago_s));
    let mut quantities = EXPLAINED_AGO_S.map(|_| Vec::new());
    let mut readings = 0;
    feed(trace, &mut replay, |replay, _, _| {
        readings += 1;
        for (after, quantities) in explained_after.iter().zip(&mut quantities) {
            if readings == *after {
                let assumed = replay.monitor.explain(&replay.settings);
                method = assumed.0;
                *quantities = assumed.1.collect();
            }
        }
    });
    let [minute_ago, block_ago, now] = quantities;
    let mut text = format!("At {} {method}:\n", clock(at_s));
    for (name, value, sigma) in now {
        text += &format!("  {name}: {}", rounded(value, 1));
        if let Some(sigma) = sigma {
            text += &format!(" ± {}", rounded(sigma, 1));
        }
        for (ago, before) in [("10 s", &block_ago), ("a minute", &minute_ago)] {
            if let Some((_, before, _)) = before.iter().find(|(of, ..)| *of == name) {
                let change = rounded(value - before, 1);
                let plus = if change.starts_with('-') { "" } else { "+" };
                text += &format!(", {plus}{change} in {ago}");
            }
        }
        text.push('\n');
    }
    Ok(text)
}

/// Times at which assumptions are compared, before the one that is explained, in seconds: a minute, and a block of the estimator.
const EXPLAINED_AGO_S: [f64; 3] = [60.0, 10.0, 0.0];

/// Events that are announced to ground stations: of the levels that are reached in one tick, the worst.
fn announced(update: &PackUpdate) -> impl Iterator<Item = &PackEvent> {
    let is_skipped = |event: &PackEvent| match event {
        PackEvent::Failsafe { level, .. } => Some(level) != update.failsafe.last(),
        PackEvent::NotLearnt(_) => true,
        _ => false,
    };
    update.events.iter().filter(move |event| !is_skipped(event))
}

fn tick(sample: &Sample) -> Tick {
    Tick {
        now: Instant::from_micros((sample.time_s * 1e6).round() as u64),
        load_state: if sample.armed {
            LoadState::On
        } else {
            LoadState::Off
        },
    }
}

fn reading(sample: &Sample, inputs: Inputs) -> Result<Measurement, ReadError> {
    if !sample.healthy {
        return Err(ReadError::Timeout);
    }
    Ok(Measurement {
        voltage_v: sample.voltage_v.filter(|_| inputs.voltage),
        current_a: sample.current_a.filter(|_| inputs.current),
        temperature_c: sample.temperature_c,
        cells: sample.cells,
        ..Measurement::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;
    use crate::drive::tests::trace_of;
    use embassy_futures::block_on;
    use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
    use fastrand::Rng;
    use nor_flash::FlashModel;
    use rover_battmon::autopilot::LogStep;
    use rover_battmon::mavlink::LinkKind;
    use rover_battmon::recorder::Ring;
    use rover_battmon::sensor::{AnalogPin, AnalogReadings};
    use rover_battmon::system::LogReader;
    use rover_battmon_tools::recordings::dataflash;
    use support::desk::{DIVIDER, Desk, conversions, start_with};
    use support::requests::arm_by_force;

    fn assigned(trace: &str, assignments: &[Assignment]) -> Result<Parameters, String> {
        let trace = trace_of(trace);
        assign(Parameters::defaults(), assignments, Pack::First, trace.measured())
    }

    fn inputs(trace: &str, assignments: &[&str]) -> Result<Inputs, String> {
        let assignments: Result<Vec<Assignment>, _> = assignments.iter().map(|text| text.parse()).collect();
        Inputs::from_parameters(&assigned(trace, &assignments?)?, Pack::First)
    }

    const WITH_CURRENT: &str = "t_s,voltage_v,current_a\n0,7.9,1.5\n";
    const WITHOUT_CURRENT: &str = "t_s,voltage_v\n0,7.9\n";

    #[test]
    fn the_monitor_is_given_what_the_trace_has_or_less() {
        let both = Inputs {
            voltage: true,
            current: true,
        };
        let voltage = Inputs {
            current: false,
            ..both
        };
        let current = Inputs {
            voltage: false,
            ..both
        };
        assert_eq!(inputs(WITH_CURRENT, &[]), Ok(both));
        assert_eq!(inputs(WITHOUT_CURRENT, &[]), Ok(voltage));
        assert_eq!(inputs(WITH_CURRENT, &["BATT_MONITOR=3"]), Ok(voltage));
        assert_eq!(inputs(WITH_CURRENT, &["BATT_MONITOR=31"]), Ok(current));
    }

    #[test]
    fn what_the_user_assigns_holds_whatever_the_recording_sets() {
        let assignments: [Assignment; 1] = ["BATT_LOW_VOLT=10".parse().expect("an assignment")];
        let parameters = assigned(WITH_CURRENT, &assignments).expect("in range");
        let replay = Replay::new(Pack::First, &parameters, &assignments, LearntPack::UNKNOWN);
        let mut replay = replay.expect("what the trace has");
        for set in [
            "BATT_LOW_VOLT=9",
            "BATT_CRT_VOLT=8",
            "BATT_CRT_VOLT=-1",
            "BATT_MONITOR=0",
        ] {
            replay.set(set.parse().expect("an assignment"));
        }
        let thresholds = replay.settings().failsafe;
        assert_eq!(
            (thresholds.low.voltage_v, thresholds.critical.voltage_v),
            (Some(10.0), Some(8.0))
        );
    }

    #[test]
    fn a_level_is_unchanged_if_nothing_is_that_it_depends_on() {
        let levels = |set: &[&str]| {
            let assignments: Vec<Assignment> = set
                .iter()
                .map(|text| text.parse().expect("an assignment"))
                .collect();
            let own: [Assignment; 1] = ["BATT_LOW_VOLT=10.5".parse().expect("an assignment")];
            let [own, changed] = [&own[..], &[&own[..], &assignments].concat()]
                .map(|assignments| assigned(WITH_CURRENT, assignments).expect("in range"));
            unchanged_levels(&settings(&own, Pack::First), &settings(&changed, Pack::First))
        };
        use FailsafeLevel::{Critical, Low};
        for (set, expected) in [
            (&[][..], vec![Low, Critical]),
            (&["BATT_LOW_VOLT=10.5"], vec![Low, Critical]),
            (&["BATT_LOW_VOLT=10.8"], vec![Critical]),
            (&["BATT_CRT_MAH=100"], vec![Low]),
            (&["BATT_CRT_VOLT=9", "BATT_FS_PCT_EN=1"], vec![]),
            (&["BATT_LOW_TIMER=3"], vec![]),
            (&["BATT_CAPACITY=2000"], vec![]),
        ] {
            assert_eq!(levels(set), expected, "{set:?}");
        }
    }

    #[test]
    fn changes_are_parameters_that_differ_once_each() {
        let assignments: [Assignment; 3] = ["BATT_LOW_VOLT=10", "BATT_CELLS=0", "BATT_LOW_VOLT=10.8"]
            .map(|text| text.parse().expect("an assignment"));
        let changed = assigned(WITH_CURRENT, &assignments).expect("in range");
        assert_eq!(
            changes(&Parameters::defaults(), &changed, &assignments),
            ["BATT_LOW_VOLT 10.8 instead of 0"]
        );
    }

    #[test]
    fn what_can_not_be_set_is_said() {
        for (assignment, expected) in [
            ("BATT_CELLS", "NAME=VALUE is needed"),
            ("BATT_SELLS=3", "no parameter BATT_SELLS"),
            ("BATT_CELLS=three", "\"three\" is not a number for BATT_CELLS"),
            ("BATT_CELLS=99", "BATT_CELLS can't be 99: 0 to 16"),
            ("BATT_CAPACITY=NaN", "BATT_CAPACITY can't be NaN: 0 to 1000000"),
            ("BATT_FS_VOLTSRC=3", "BATT_FS_VOLTSRC can't be 3: 0 to 2"),
            (
                "BATT_SUM_MASK=512",
                "BATT_SUM_MASK can't be 512: a sum of 1, 2, 4, 8, 16, 32, 64, 128, 256",
            ),
            ("BATT_LRN_CAP=2000", "BATT_LRN_CAP can't be set"),
            (
                "BATT_MONITOR=10",
                "BATT_MONITOR 10 can't be replayed: 3, 4 and 31 can",
            ),
        ] {
            assert_eq!(inputs(WITH_CURRENT, &[assignment]), Err(expected.into()));
        }
    }

    /// A stay of this firmware on a desk, with a pack that a load of this seed draws from full to empty in two minutes: its log, and
    /// the ticks in which levels were reached.
    fn driven(seed: u64, set: &[(&str, f32)]) -> (Vec<u8>, Levels) {
        const CAPACITY_AS: f32 = 0.4 * 3600.0;
        let mut random = Rng::with_seed(seed);
        let mut desk = Desk::starting(start_with(set));
        desk.connect(LinkKind::Direct);
        let mut flash = FlashModel::<4096, 256, 32>::blank();
        desk.autopilot.logs_found(block_on(Ring::scan(
            &mut flash,
            FlashModel::<4096, 256, 32>::REGION,
        )));
        let (mut levels, mut before) = (Levels::default(), FailsafeLevel::None);
        let (mut drawn_as, mut current_a) = (0.0, 0.0);
        for turn in 0..6500u64 {
            // The tasks keep their own time.
            desk.now_us = 20_000 * turn + 3_300;
            desk.drive();
            if turn == 500 {
                desk.ask(&arm_by_force());
            }
            while let Some(step) = desk.autopilot.next_log_step(desk.now()) {
                match step {
                    LogStep::Program { address, bytes } => {
                        block_on(flash.write(address, &bytes)).expect("it works");
                        desk.autopilot.log_written(Ok(()), desk.now());
                    }
                    LogStep::Erase(erasure) => {
                        let from = erasure.address();
                        block_on(flash.erase(from, from + 4096)).expect("it works");
                        block_on(flash.write(erasure.mark_address(), &erasure.mark())).expect("it works");
                        desk.autopilot.log_erased(erasure, Ok(()));
                    }
                }
            }
            if turn % 5 != 0 {
                continue;
            }
            desk.now_us = 20_000 * turn + 15_400;
            if turn > 500 && random.f32() < 0.04 {
                current_a = 24.0 * random.f32();
            }
            drawn_as += 0.1 * current_a;
            let open_v = 12.6 - 2.6 * drawn_as / CAPACITY_AS;
            let voltage_v = open_v - 0.05 * current_a + 0.04 * (random.f32() - 0.5);
            let mut readings = AnalogReadings::NONE;
            readings.set(AnalogPin::Gp26, Ok(conversions(voltage_v / DIVIDER)));
            readings.set(AnalogPin::Gp27, Ok(conversions(current_a / 17.0)));
            desk.sample(readings);
            let level = desk.autopilot.battery(Pack::First).failsafe;
            let tick_s = (desk.now_us / 1000) as f64 / 1e3;
            for reached in [FailsafeLevel::Low, FailsafeLevel::Critical] {
                if before < reached && reached <= level {
                    levels.reach(reached, tick_s);
                }
            }
            before = level;
        }
        let mut chip = vec![0; FlashModel::<4096, 256, 32>::REGION.end as usize];
        block_on(flash.read(0, &mut chip)).expect("it works");
        let (mut log, reader) = (Vec::new(), LogReader::Browser(0));
        while let Some(piece) = desk.autopilot.locate_log(1, log.len() as u32, reader, desk.now()) {
            log.extend_from_slice(&chip[piece.address as usize..][..piece.bytes as usize]);
        }
        (log, levels)
    }

    /// Levels by the readings of a log, and those that follow it.
    fn replayed(log: &[u8]) -> [Levels; 2] {
        let Drive { trace, survey } =
            Drive::read(|| Ok(Box::new(dataflash::binary(log))), Pack::First).expect("a drive");
        let own = survey.parameters.clone().expect("the log has them");
        let own = assign(own, &[], Pack::First, trace.measured()).expect("in range");
        let replay = Replay::new(Pack::First, &own, &[], LearntPack::UNKNOWN).expect("what the log has");
        let mut outcome = run(&trace, replay);
        let computed = outcome.levels;
        let both = vec![FailsafeLevel::Low, FailsafeLevel::Critical];
        outcome.follow(
            both,
            survey.reached(Pack::First),
            survey.recorded_timers(Pack::First),
        );
        [computed, outcome.levels]
    }

    /// Whether two levels are of the same tick: a text has the time of the drive task, up to 20 ms before.
    fn is_same_tick(one_s: Option<f64>, other_s: Option<f64>) -> bool {
        match one_s.zip(other_s) {
            Some((one_s, other_s)) => (one_s - other_s).abs() < 0.021,
            None => one_s == other_s,
        }
    }

    #[test]
    fn a_replay_reaches_each_level_in_the_tick_in_which_the_board_did() {
        let pack = [
            ("BATT_MONITOR", 4.0),
            ("BATT_CURR_PIN", 27.0),
            ("BATT_AMP_PERVLT", 17.0),
            ("BATT_CELLS", 3.0),
            ("BATT_CAPACITY", 400.0),
            ("BATT_LOW_TIMER", 3.0),
        ];
        let volts = [("BATT_LOW_VOLT", 10.9), ("BATT_CRT_VOLT", 10.4)];
        let resting = [volts[0], volts[1], ("BATT_FS_VOLTSRC", 1.0)];
        let charge = [("BATT_LOW_MAH", 150.0), ("BATT_CRT_MAH", 70.0)];
        let percent = [
            ("BATT_FS_PCT_EN", 1.0),
            ("BATT_LOW_PCT", 40.0),
            ("BATT_CRT_PCT", 20.0),
        ];
        for (name, thresholds) in [
            ("terminal", &volts[..]),
            ("resting", &resting),
            ("mAh", &charge),
            ("%", &percent),
        ] {
            let (mut low, mut critical) = (0, 0);
            for (seed, rate_hz) in (0..50).flat_map(|seed| [0.0, 1.0, 5.0].map(|rate_hz| (seed, rate_hz))) {
                let set = [&pack[..], thresholds, &[("LOG_BLK_RATEMAX", rate_hz)]].concat();
                let (log, levels) = driven(seed, &set);
                let [computed, followed] = replayed(&log);
                let case = format!(
                    "{name}, seed {seed}, {rate_hz} Hz: {levels:?}, computed {computed:?}, followed {followed:?}"
                );
                let shown = match name {
                    "terminal" => vec![computed, followed],
                    _ => vec![followed],
                };
                for replayed in shown {
                    assert!(is_same_tick(replayed.low_s, levels.low_s), "{case}");
                    assert!(is_same_tick(replayed.critical_s, levels.critical_s), "{case}");
                }
                low += usize::from(levels.low_s.is_some());
                critical += usize::from(levels.critical_s.is_some());
            }
            assert!(low >= 100 && critical >= 75, "{name}: {low}, {critical} of 150");
        }
    }
}
