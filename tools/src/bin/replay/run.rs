//! A trace through the monitor, and the parameters it is replayed with.

use rover_battmon::battery::{
    BatteryMonitor, BatteryState, FailsafeTimers, LearntPack, LessonObstacle, LoadState, Measurement,
    PackEvent, PackSettings, PackUpdate, ReadError, Tick,
};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, MonitorKind, ParameterId, Parameters, Refused};
use rover_battmon::time::Instant;
use rover_battmon_tools::recordings::entry::Sample;

use crate::assignments::Assignment;
use crate::drive::Trace;
use crate::failsafes::{Levels, Timers};
use crate::report::Row;
use crate::survey::Inputs;

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
}

impl Outcome {
    /// When each level was reached.
    pub fn levels(&self) -> Levels {
        let mut levels = Levels::default();
        for row in &self.rows {
            row.reached
                .iter()
                .for_each(|level| levels.reach(*level, row.time_s));
        }
        levels
    }

    /// Each change of the failsafe's timers.
    pub fn timers(&self) -> Timers {
        let mut timers = Timers::default();
        let mut before = FailsafeTimers::STOPPED;
        for row in &self.rows {
            let changes = row.state.failsafe_timers.changes(before);
            changes.for_each(|change| timers.add(row.time_s, change));
            before = row.state.failsafe_timers;
        }
        timers
    }
}

/// Gives the readings of the trace to `replay`, and between them the parameters that it sets.
pub fn run(trace: &Trace, mut replay: Replay) -> Outcome {
    let mut settings = *replay.settings();
    let mut changes = trace.changes.iter().peekable();
    let mut rows = Vec::with_capacity(trace.samples.len());
    for sample in &trace.samples {
        while let Some(change) = changes.next_if(|change| change.readings <= rows.len()) {
            replay.set(change.assignment);
        }
        let update = replay.update(sample);
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
    }
    Outcome {
        rows,
        settings,
        learnt: *replay.learnt(),
        lesson_obstacle: replay.lesson_obstacle(),
    }
}

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
    use crate::drive::tests::trace_of;

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
            ("BATT_FS_VOLTSRC=2", "BATT_FS_VOLTSRC can't be 2: 0, 1"),
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
}
