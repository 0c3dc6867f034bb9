//! Results of a replay, in words. Anything that was not computed is unknown.

use std::fmt;
use std::mem::discriminant;

use rover_battmon::battery::{
    FailsafeLevel, FailsafeSettings, LearntPack, LessonObstacle, PackEvent, PackNotice, PackStatus,
    SuggestedThresholds,
};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::BatteryParameter;

use crate::assignments::Assignment;
use crate::drive::{Change, Trace};
use crate::failsafes::{self, Levels};
use crate::report::{Row, events};
use crate::run::Outcome;
use crate::survey::ArmedBefore;
use crate::words::{clock, duration, quantity, rounded, times};

/// The remaining charge lies within this many standard deviations in 19 of 20 cases.
const SIGMAS: f32 = 2.0;

/// This many parameters that were set during the recording are listed.
const LISTED_CHANGES: usize = 5;

/// A replay, to be shown in words.
pub struct Summary<'a> {
    /// Subject of the replay.
    pub trace: &'a Trace,
    /// Its result.
    pub outcome: &'a Outcome,
    /// Which pack it is of.
    pub pack: Pack,
    /// Parameters that the user has set, whatever the recording sets.
    pub assignments: &'a [Assignment],
    /// Knowledge of the pack before.
    pub known: &'a LearntPack,
    /// Why the vehicle is taken for armed at the beginning, if not by an entry.
    pub armed_before: Option<ArmedBefore>,
    /// When levels were reached in the log.
    pub in_log: Levels,
    /// Lines on the failsafes of the log itself.
    pub recorded: String,
}

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = &self.outcome.rows;
        writeln!(f, "{}", length(self.trace))?;
        if let Some(reason) = self.armed_before {
            writeln!(f, "Taken for armed from the beginning: {reason}")?;
        }
        self.backward_steps(f)?;
        self.changes(f)?;
        writeln!(f, "Voltage: {}", voltages(rows))?;
        writeln!(f, "Drawn: {}", drawn(rows))?;
        writeln!(f, "Remaining at the end: {}", remaining(rows))?;
        write!(f, "Learnt: {}", learnt(self.known, &self.outcome.learnt))?;
        if let Some(obstacle) = self.obstacle() {
            write!(f, ": {obstacle}")?;
        }
        writeln!(f)?;
        self.announced(f)?;
        write!(f, "{}", self.recorded)?;
        writeln!(f, "Failsafe: {}", self.failsafe())
    }
}

fn length(trace: &Trace) -> String {
    let readings = trace.samples.len();
    let armed_s: f64 = trace
        .samples
        .windows(2)
        .filter(|pair| pair[0].armed)
        .map(|pair| (pair[1].time_s - pair[0].time_s).max(0.0))
        .sum();
    let [first_s, last_s] = [trace.samples.first(), trace.samples.last()]
        .map(|sample| sample.map_or(0.0, |sample| sample.time_s));
    format!(
        "{}, from {} to {}, {readings} readings; armed for {}",
        duration(last_s - first_s),
        clock(first_s),
        clock(last_s),
        duration(armed_s)
    )
}

/// The readings of a connected pack.
fn healthy(rows: &[Row]) -> impl DoubleEndedIterator<Item = (&Row, f32)> {
    rows.iter()
        .filter(|row| row.state.status == PackStatus::Healthy)
        .filter_map(|row| Some((row, row.state.readings.voltage_v?)))
}

fn voltages(rows: &[Row]) -> String {
    let weakest = healthy(rows).min_by(|(_, a), (_, b)| a.total_cmp(b));
    let ends = healthy(rows).next().zip(healthy(rows).next_back());
    let Some(((weakest, weakest_v), ((_, first_v), (_, last_v)))) = weakest.zip(ends) else {
        return "unknown".into();
    };
    let current_a = weakest.state.readings.current_a;
    let load = current_a.map_or(String::new(), |current_a| {
        format!(" at {} A", rounded(current_a, 1))
    });
    format!(
        "{first_v:.2} V at the start, {last_v:.2} V at the end; weakest at {}: {weakest_v:.2} V{load}",
        clock(weakest.time_s)
    )
}

fn drawn(rows: &[Row]) -> String {
    let state = rows.last().map(|row| &row.state);
    match state.and_then(|state| state.consumed_mah().zip(state.consumed_wh)) {
        Some((mah, wh)) => format!("{} mAh, {} Wh", rounded(mah, 0), rounded(wh, 1)),
        None => quantity(state.and_then(|state| state.consumed_mah()), 0, "mAh"),
    }
}

fn remaining(rows: &[Row]) -> String {
    let Some(last) = rows.last() else {
        return "unknown".into();
    };
    let state = &last.state;
    let mut text = quantity(state.readings.remaining_pct, 0, "%");
    if state.cell_count.is_none() {
        text += ", as is the number of cells (BATT_CELLS)";
    }
    if state.readings.remaining_pct.is_some() {
        text += &format!(" of {}", quantity(state.capacity_mah(), 0, "mAh"));
        let within = |sigma_pct: Option<f32>| quantity(sigma_pct.map(|sigma_pct| SIGMAS * sigma_pct), 0, "%");
        let readings = &state.readings;
        text += &format!(" ± {} (19 times of 20)", within(readings.remaining_sigma_pct));
        let usable = quantity(readings.usable_pct, 0, "%");
        text += &format!(", usable {usable} ± {}", within(readings.usable_sigma_pct));
    }
    let reported_pct = last.reported.and_then(|reported| reported.remaining_pct);
    if reported_pct.is_some() {
        text += &format!("; the log has {}", quantity(reported_pct, 0, "%"));
    }
    text
}

/// Knowledge of the pack, and its age.
fn learnt(known: &LearntPack, now: &LearntPack) -> String {
    let capacity_ah = |pack: &LearntPack| pack.capacity_mah().map(|mah| mah / 1e3);
    let milliohms = |pack: &LearntPack| pack.resistance_ohm().map(|ohm| ohm * 1e3);
    let values = |pack| {
        format!(
            "capacity {}, resistance {}",
            quantity(capacity_ah(pack), 2, "Ah"),
            quantity(milliohms(pack), 0, "mΩ")
        )
    };
    let is_known = |pack| capacity_ah(pack).is_some() || milliohms(pack).is_some();
    match (is_known(known), is_known(now)) {
        (_, false) => "nothing".into(),
        (false, true) => values(now),
        (true, true) if values(known) == values(now) => format!("nothing new: {}", values(now)),
        (true, true) => format!("{}; before: {}", values(now), values(known)),
    }
}

/// The row in which a level was reached first.
pub fn reached(rows: &[Row], level: FailsafeLevel) -> Option<&Row> {
    rows.iter().find(|row| row.reached.contains(&level))
}

impl Summary<'_> {
    /// Why nothing is learnt of the pack at all.
    fn obstacle(&self) -> Option<LessonObstacle> {
        let is_learnt = self.outcome.learnt.capacity_mah().is_some();
        self.outcome.lesson_obstacle.filter(|_| !is_learnt)
    }

    fn failsafe(&self) -> String {
        let set = &self.outcome.settings.failsafe;
        let last = self.outcome.rows.last();
        if last.is_none_or(|row| set.is_disabled(&row.state)) {
            return self.suggestion();
        }
        let levels = [FailsafeLevel::Low, FailsafeLevel::Critical];
        let texts: Vec<String> = levels
            .into_iter()
            .filter_map(|level| self.failsafe_level(level))
            .collect();
        let mut text = texts.join("; ");
        if !self.trace.samples.iter().any(|sample| sample.armed) {
            text += "; the recording is never armed (column armed), and only then they act: --armed";
        }
        text
    }

    /// When its thresholds have acted, as recorded, or would have; if it has any.
    fn failsafe_level(&self, level: FailsafeLevel) -> Option<String> {
        let names = thresholds(&self.outcome.settings.failsafe, level, self.pack)?;
        let is_recorded = self.outcome.recorded.contains(&level);
        let left = |row: &Row| {
            let left_pct = row.state.readings.remaining_pct?;
            Some(format!(", {} % left", rounded(left_pct, 0)))
        };
        let left = reached(&self.outcome.rows, level)
            .and_then(left)
            .unwrap_or_default();
        let reached_at = self.outcome.levels.at_s(level).map(clock);
        let in_log_at = self.in_log.at_s(level).map(clock);
        Some(match (is_recorded, reached_at, in_log_at) {
            (true, Some(at), _) => format!("{names} acted at {at}{left} (recorded)"),
            (true, None, _) => format!("{names} did not act (recorded)"),
            (false, Some(at), _) => format!("{names} would have acted at {at}{left}"),
            (false, None, None) => format!("{names} would not have acted"),
            (false, None, Some(at)) => {
                format!(
                    "{names} is not reached by these readings; in the log {} acted at {at}",
                    failsafes::name(level)
                )
            }
        })
    }

    fn suggestion(&self) -> String {
        let last = self.outcome.rows.last();
        let Some(suggested) =
            last.and_then(|row| SuggestedThresholds::of(&row.state, &self.outcome.settings))
        else {
            return "none is set".into();
        };
        format!(
            "none is set; usual are {} {:.1} and {} {:.1}",
            BatteryParameter::LowVolt.of(self.pack).name(),
            suggested.low_v,
            BatteryParameter::CrtVolt.of(self.pack).name(),
            suggested.critical_v
        )
    }

    /// The monitor lets no time pass between two such readings.
    fn backward_steps(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let steps = || {
            self.trace
                .samples
                .windows(2)
                .filter(|pair| pair[1].time_s < pair[0].time_s)
        };
        let Some(first) = steps().next() else {
            return Ok(());
        };
        writeln!(
            f,
            "Times run backwards: {}, first from {} to {}; readings are taken in their order in the file",
            times(steps().count()),
            clock(first[0].time_s),
            clock(first[1].time_s)
        )
    }

    /// Parameters that were set during the recording hold from then on.
    fn changes(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Trace { samples, changes } = self.trace;
        let is_overridden = |change: &Change| {
            let mut assigned = self.assignments.iter();
            assigned.any(|assignment| assignment.id == change.assignment.id)
        };
        let changes: Vec<&Change> = changes.iter().filter(|change| !is_overridden(change)).collect();
        if changes.is_empty() {
            return Ok(());
        }
        let time_s = |change: &Change| {
            let sample = samples.get(change.readings).or(samples.last());
            sample.map_or(0.0, |sample| sample.time_s)
        };
        let listed = changes.iter().take(LISTED_CHANGES);
        let listed: Vec<String> = listed
            .map(|change| format!("{} at {}", change.assignment, clock(time_s(change))))
            .collect();
        write!(f, "Set during the recording: {}", listed.join(", "))?;
        match changes.len().saturating_sub(LISTED_CHANGES) {
            0 => writeln!(f),
            more => writeln!(f, ", {more} more"),
        }
    }

    /// Events that matter, each, and the first of each other kind with the number of its kind.
    fn announced(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut lines: Vec<(f64, PackNotice<'_>, usize)> = vec![];
        for (time_s, event) in events(&self.outcome.rows) {
            let of_kind = |(_, listed, _): &&mut (f64, PackNotice<'_>, usize)| {
                discriminant(listed.1) == discriminant(event.1) && !matters(event.1)
            };
            match lines.iter_mut().find(of_kind) {
                Some((.., count)) => *count += 1,
                None => lines.push((time_s, event, 1)),
            }
        }
        if lines.is_empty() {
            return writeln!(f, "Announced: nothing");
        }
        writeln!(f, "Announced:")?;
        for (time_s, event, count) in lines {
            write!(f, "  {:>7}  {event}", clock(time_s))?;
            match count {
                1 => writeln!(f)?,
                count => writeln!(f, " ({})", times(count))?,
            }
        }
        Ok(())
    }
}

/// Whether an event is listed however often it occurs: charge states, failsafes and faults.
fn matters(event: &PackEvent) -> bool {
    matches!(
        event,
        PackEvent::Charge { .. }
            | PackEvent::Failsafe { .. }
            | PackEvent::Faults(_)
            | PackEvent::ReportedFaults(_)
            | PackEvent::ReportedState { .. }
    )
}

/// The thresholds of a level that are in effect, with their values.
fn thresholds(settings: &FailsafeSettings, level: FailsafeLevel, pack: Pack) -> Option<String> {
    use BatteryParameter::{CrtMah, CrtPct, CrtVolt, LowMah, LowPct, LowVolt};
    let (limits, [voltage, charge, percent]) = match level {
        FailsafeLevel::Critical => (settings.critical, [CrtVolt, CrtMah, CrtPct]),
        _ => (settings.low, [LowVolt, LowMah, LowPct]),
    };
    let named = |parameter: BatteryParameter, value| format!("{} {value}", parameter.of(pack).name());
    let texts = [
        settings
            .timer_s
            .and(limits.voltage_v)
            .map(|volts| named(voltage, volts)),
        limits.remaining_mah.map(|mah| named(charge, mah)),
        limits.usable_pct.map(|usable_pct| named(percent, usable_pct)),
    ];
    let texts: Vec<String> = texts.into_iter().flatten().collect();
    (!texts.is_empty()).then(|| texts.join(" or "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::tests::trace_of as trace;
    use crate::run::{Replay, assign};
    use crate::{plot, report, run};
    use proptest::prelude::*;
    use rover_battmon::parameter::Parameters;
    use rover_battmon_tools::recordings::entry::Sample;

    /// Remark on a trace that is replayed with these parameters.
    fn summary(trace: &Trace, assignments: &[&str]) -> String {
        let assignments: Vec<_> = assignments
            .iter()
            .map(|text| text.parse().expect("an assignment"))
            .collect();
        let pack = Pack::First;
        let parameters =
            assign(Parameters::defaults(), &assignments, pack, trace.measured()).expect("in range");
        let replay = Replay::new(pack, &parameters, &assignments, LearntPack::UNKNOWN);
        let outcome = run::run(trace, replay.expect("what the trace has"));
        // Nothing that is said, written or drawn may fail.
        let _ = report::csv(&outcome.rows);
        let _ = plot::plot(&outcome.rows, "", "", &outcome.settings.failsafe);
        Summary {
            trace,
            outcome: &outcome,
            pack,
            assignments: &assignments,
            known: &LearntPack::UNKNOWN,
            armed_before: None,
            in_log: Levels::default(),
            recorded: String::new(),
        }
        .to_string()
    }

    #[test]
    fn what_is_unknown_is_said_to_be() {
        let text = summary(&trace("t_s,voltage_v\n0,\n65,\n"), &[]);
        let expected = "1 min 5 s, from 0:00 to 1:05, 2 readings; armed for 0 s\n\
                        Voltage: unknown\n\
                        Drawn: unknown\n\
                        Remaining at the end: unknown, as is the number of cells (BATT_CELLS)\n\
                        Learnt: nothing: charge unknown at the start\n\
                        Announced: nothing\n\
                        Failsafe: none is set\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn times_that_run_backwards_are_said_and_add_no_time() {
        let samples = [0.0, 300.0, 100.0, 160.0, 160.0, 150.0].map(|time_s| Sample {
            time_s,
            armed: true,
            ..Sample::NONE
        });
        let trace = Trace {
            samples: samples.into(),
            changes: vec![],
        };
        let text = summary(&trace, &[]);
        let expected = "2 min 30 s, from 0:00 to 2:30, 6 readings; armed for 6 min 0 s\n\
                        Times run backwards: twice, first from 5:00 to 1:40; readings are taken in their order in the file\n";
        assert!(text.starts_with(expected), "{text}");
    }

    #[test]
    fn the_weakest_moment_is_said_with_its_load() {
        let trace = trace("t_s,voltage_v,current_a\n0,12,0\n724,9.91,14.2\n725,11,1\n");
        let text = summary(&trace, &[]);
        let expected =
            "Voltage: 12.00 V at the start, 11.00 V at the end; weakest at 12:04: 9.91 V at 14.2 A\n";
        assert!(text.contains(expected), "{text}");
    }

    #[test]
    fn thresholds_say_when_they_would_have_acted_or_why_not() {
        let rows: String = (0..400)
            .map(|tenth| format!("{},10.4,1,1\n", f64::from(tenth) / 10.0))
            .collect();
        let armed = trace(&format!("t_s,voltage_v,current_a,armed\n{rows}"));
        let disarmed = trace(&format!("t_s,voltage_v,current_a,note\n{rows}"));
        for (trace, assignments, expected) in [
            (
                &armed,
                ["BATT_LOW_VOLT=10.5", "BATT_CRT_VOLT=9.9"],
                "BATT_LOW_VOLT 10.5 would have acted at 0:10; BATT_CRT_VOLT 9.9 would not have acted\n",
            ),
            (
                &armed,
                ["BATT_LOW_VOLT=10.5", "BATT_LOW_MAH=500"],
                "BATT_LOW_VOLT 10.5 or BATT_LOW_MAH 500 would have acted at 0:10\n",
            ),
            // Low is skipped, and counts all the same.
            (
                &armed,
                ["BATT_LOW_VOLT=10.5", "BATT_CRT_VOLT=10.45"],
                "BATT_LOW_VOLT 10.5 would have acted at 0:10; BATT_CRT_VOLT 10.45 would have acted at 0:10\n",
            ),
            (
                &armed,
                ["BATT_LOW_VOLT=10.5", "BATT_LOW_TIMER=0"],
                "none is set\n",
            ),
            (
                &armed,
                ["BATT_LOW_VOLT=0", "BATT_CELLS=3"],
                "none is set; usual are BATT_LOW_VOLT 10.5 and BATT_CRT_VOLT 10.2\n",
            ),
            (
                &disarmed,
                ["BATT_LOW_VOLT=10.5", "BATT_LOW_TIMER=1"],
                "BATT_LOW_VOLT 10.5 would not have acted; the recording is never armed (column armed), and only then they \
                 act: --armed\n",
            ),
        ] {
            let text = summary(trace, &assignments);
            let (_, said) = text.split_once("Failsafe: ").expect("a line of it");
            assert_eq!(said, expected);
        }
    }

    #[test]
    fn what_was_learnt_is_said_with_what_was_known() {
        let pack = |mah: u32| -> LearntPack {
            let text = format!(
                "cells 3\ndrives 1\ncapacity_mah_sigma {mah} 0.03\nresistance_ohm_now_first 0.0152 0.0152\n"
            );
            text.parse().expect("a pack")
        };
        let [older, newer] = [pack(3000), pack(2950)];
        for (known, now, expected) in [
            (&LearntPack::UNKNOWN, &LearntPack::UNKNOWN, "nothing"),
            (&LearntPack::UNKNOWN, &newer, "capacity 2.95 Ah, resistance 46 mΩ"),
            (&newer, &newer, "nothing new: capacity 2.95 Ah, resistance 46 mΩ"),
            (
                &older,
                &newer,
                "capacity 2.95 Ah, resistance 46 mΩ; before: capacity 3.00 Ah, resistance 46 mΩ",
            ),
        ] {
            assert_eq!(learnt(known, now), expected);
        }
    }

    #[test]
    fn announcements_that_repeat_are_counted_and_those_that_matter_are_listed() {
        // Its sensor fails every 40 s; between its failures it falls, and is low after 600 s.
        let row = |second: u32| {
            let volts = if second < 600 { 11.5 } else { 10.4 };
            format!("{second},{volts},1,{},1\n", second / 20 % 2)
        };
        let rows: String = (0..1000).map(row).collect();
        let trace = trace(&format!("t_s,voltage_v,current_a,healthy,armed\n{rows}"));
        let text = summary(&trace, &["BATT_CELLS=3", "BATT_LOW_VOLT=10.5"]);
        let (_, listed) = text.split_once("Announced:\n").expect("announcements");
        assert_eq!(listed.matches(" healthy again").count(), 1, "{text}");
        assert!(listed.contains(" healthy again (25 times)\n"), "{text}");
        assert!(listed.contains(" Battery 1 is low 10.40V"), "{text}");
    }

    prop_compose! {
        fn sample()(
            step_s in prop::sample::select(vec![0.0, 0.1, 0.5, 20.0, 1e8]),
            voltage_v in prop::option::of(-1.0f32..60.0),
            current_a in prop::option::of(-200.0f32..200.0),
            healthy in any::<bool>(),
            armed in any::<bool>(),
        ) -> (f64, Sample) {
            (step_s, Sample { voltage_v, current_a, healthy, armed, ..Sample::NONE })
        }
    }

    proptest! {
        #[test]
        fn any_trace_has_a_summary(steps in prop::collection::vec(sample(), 0..50)) {
            let mut time_s = 0.0;
            let samples = steps.into_iter().map(|(step_s, sample)| {
                time_s += step_s;
                Sample { time_s, ..sample }
            });
            let trace = Trace { samples: samples.collect(), changes: vec![] };
            let text = summary(&trace, &["BATT_LOW_VOLT=10.5"]);
            prop_assert!(text.lines().count() >= 7, "{text}");
        }
    }
}
