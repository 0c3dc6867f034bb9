//! The drives of one pack in a log, as its readings come.

use std::mem;

use rover_battmon::battery::{
    BatteryState, FailsafeLevel, FailsafeTimer, Faults, LearntPack, PackStatus, ReachedLevels,
};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;
use rover_battmon_tools::recordings::entry::Sample;

use super::row::{Estimate, Remaining, Row, WhatIf};
use super::statistics::{Extremes, Span, Spread};
use crate::assignments::Assignment;
use crate::failsafes::{self, Difference, Levels, Timers};
use crate::run::{self, Replay};
use crate::survey::{ArmedBefore, Survey};

/// Texts of a kind in a row: what is repeated for ever takes no more room.
const MOST_TEXTS: usize = 20;

/// Extent of a drive in a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Nothing is missing.
    Whole,
    /// It was cut off, or is damaged.
    Damaged,
}

/// The drives of a pack.
pub struct PackDrives {
    pack: Pack,
    own: Replay,
    what_if: Option<(String, Replay)>,
    rated_mah: Option<f32>,
    reported_health_pct: Option<f32>,
    /// Common part of every row.
    common: Row,
    started_utc_s: Option<f64>,
    /// Of the first drive.
    armed_before: Option<ArmedBefore>,
    announces_failsafes: bool,
    /// The log has its failsafe as it was, to the tick.
    records_failsafe: bool,
    refusals: Vec<String>,
    /// The present drive; before the first one the log so far.
    drive: Option<Trip>,
    rows: Vec<Row>,
}

/// A drive so far.
#[derive(Default)]
struct Trip {
    is_armed: bool,
    has_reading: bool,
    start_s: f64,
    end_s: f64,
    drawn_mah: Span,
    drawn_wh: Span,
    resting_v: Extremes,
    sag_v: Extremes,
    temperature_c: Extremes,
    resistance_mohm: Spread,
    failsafes: Vec<String>,
    recorded_faults: Option<Faults>,
    replayed_faults: Faults,
    levels: Levels,
    what_if_levels: Levels,
    /// Levels that are reached in this drive, without those of an earlier one.
    reached: Levels,
    /// Levels that are reached in this drive by the log.
    recorded: Levels,
    timers: Timers,
    recorded_timers: Timers,
    remaining: Remaining,
    remaining_low: Option<Remaining>,
    remaining_critical: Option<Remaining>,
}

impl PackDrives {
    /// The drive of `pack` in a log with this knowledge; `None` if there is no reading of it.
    pub fn new(
        path: &str,
        survey: &Survey,
        pack: Pack,
        what_if: &[Assignment],
    ) -> Option<Result<Self, String>> {
        let measured = survey.measured(pack)?;
        let parameters = |assignments: &[Assignment]| {
            let own = survey.parameters.clone().unwrap_or_else(Parameters::defaults);
            run::assign(own, assignments, pack, measured)
        };
        let known = survey.known(pack).unwrap_or(LearntPack::UNKNOWN);
        let replay = |parameters: &Parameters, assigned: &[_]| Replay::new(pack, parameters, assigned, known);
        let new = || {
            let own = parameters(&[])?;
            let changed = parameters(what_if)?;
            let texts: Vec<String> = what_if.iter().map(ToString::to_string).collect();
            let settings = run::settings(&own, pack);
            Ok(Self {
                pack,
                own: replay(&own, &[])?,
                what_if: match texts.as_slice() {
                    [] => None,
                    texts => Some((texts.join(", "), replay(&changed, what_if)?)),
                },
                rated_mah: settings.capacity_mah,
                reported_health_pct: None,
                common: Row {
                    path: path.into(),
                    vehicle: survey.vehicle.clone(),
                    board_id: survey.board_id.clone(),
                    system_id: survey.system_id,
                    pack: pack.number(),
                    serial_number: settings.serial_number,
                    ..Row::default()
                },
                started_utc_s: survey.started_utc_s,
                armed_before: survey.armed_before(),
                announces_failsafes: survey.announces_failsafes(),
                records_failsafe: survey.records_failsafe(pack),
                refusals: vec![],
                drive: None,
                rows: vec![],
            })
        };
        Some(new())
    }

    /// Takes a serial number that was read.
    pub fn identify(&mut self, serial_number: i32) {
        self.common.serial_number = Some(serial_number);
    }

    /// Takes a parameter that was set.
    pub fn set(&mut self, assignment: Assignment) {
        self.own.set(assignment);
        if let Some((_, replay)) = &mut self.what_if {
            replay.set(assignment);
        }
        self.rated_mah = self.own.settings().capacity_mah;
    }

    /// Takes the next reading.
    pub fn add(&mut self, sample: &Sample) {
        let timers = self.own.state.failsafe_timers;
        let reached = self.own.update(sample).failsafe;
        let what_if = self.what_if.as_mut();
        let reached_if = what_if.map(|(_, replay)| replay.update(sample).failsafe);
        let reported_pct = sample.reported.and_then(|reported| reported.health_pct);
        self.reported_health_pct = reported_pct.or(self.reported_health_pct);
        if self.rows.is_empty() {
            self.drive.get_or_insert_with(|| Trip::starting(sample.time_s));
        }
        if let Some(drive) = &mut self.drive {
            drive.add(sample, &self.own.state, &reached, self.records_failsafe);
            let since_s = drive.since_start_s(sample.time_s);
            let changes = self.own.state.failsafe_timers.changes(timers);
            changes.for_each(|change| drive.timers.add(since_s, change));
            if let Some(((_, replay), reached)) = self.what_if.as_ref().zip(reached_if) {
                let level = replay.state.failsafe;
                drive.reach(sample, &reached, level, |drive| &mut drive.what_if_levels);
            }
        }
    }

    /// The rover is armed.
    pub fn arm(&mut self, time_s: f64) {
        self.settle();
        self.drive = Some(Trip {
            is_armed: true,
            ..Trip::starting(time_s)
        });
    }

    /// It is disarmed.
    pub fn disarm(&mut self, time_s: f64, end: End) {
        if let Some(drive) = self.drive.take_if(|drive| drive.is_armed) {
            self.close(drive, time_s, end);
        }
    }

    /// The log ends. What it has of a pack without any drive is a row, too.
    pub fn finish(mut self, time_s: f64, end: End) -> Vec<Row> {
        if let Some(drive) = self.drive.take() {
            let end = if drive.is_armed { End::Damaged } else { end };
            let end_s = if drive.is_armed { time_s } else { drive.end_s };
            self.close(drive, end_s, end);
        }
        self.settle();
        if let Some(row) = self.rows.last_mut() {
            row.arming_refusals.append(&mut self.refusals);
        }
        self.rows
    }

    /// A failsafe begins, of the rover or of this pack.
    pub fn failsafe(&mut self, name: &str, time_s: f64) {
        if let Some(drive) = &mut self.drive {
            let since_s = drive.since_start_s(time_s).round();
            push(&mut drive.failsafes, format!("{name} {since_s} s"));
        }
    }

    /// The log has that this pack reaches a level.
    pub fn reach(&mut self, level: FailsafeLevel, time_s: f64) {
        self.failsafe(failsafes::name(level), time_s);
        self.note(level, time_s);
    }

    /// The log has it by a text, or by its timer. A low level that is skipped is reached with the critical one.
    fn note(&mut self, level: FailsafeLevel, time_s: f64) {
        let Some(drive) = &mut self.drive else {
            return;
        };
        let since_s = drive.since_start_s(time_s);
        drive.recorded.reach(level, since_s);
        if self.records_failsafe {
            let failsafe = &self.own.settings().failsafe;
            if level == FailsafeLevel::Critical && failsafe.is_in_force(&failsafe.low, &self.own.state) {
                drive.levels.reach(FailsafeLevel::Low, since_s);
            }
            drive.levels.reach(level, since_s);
        }
    }

    /// The log has that the timer of a level starts, is reset or expires.
    pub fn timer(&mut self, time_s: f64, change: (FailsafeLevel, FailsafeTimer)) {
        if let Some(drive) = &mut self.drive {
            drive.recorded_timers.add(drive.since_start_s(time_s), change);
        }
        if let (level, FailsafeTimer::Expired) = change {
            self.note(level, time_s);
        }
    }

    /// The log has a failsafe of a pack; one with a text is known already.
    pub fn unnamed_failsafe(&mut self, time_s: f64) {
        let is_named = |drive: &Trip| drive.recorded != Levels::default();
        if !self.drive.as_ref().is_some_and(is_named) {
            self.failsafe("battery", time_s);
        }
    }

    /// Arming is refused.
    pub fn refusal(&mut self, reason: &str) {
        if !self.refusals.iter().any(|known| known == reason) {
            push(&mut self.refusals, reason.into());
        }
    }

    /// Its number, as in texts.
    pub fn number(&self) -> u8 {
        self.pack.number()
    }

    /// Drives so far.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    fn close(&mut self, drive: Trip, end_s: f64, end: End) {
        let what_if = self.what_if.as_ref().map(|(parameters, _)| WhatIf {
            parameters: parameters.clone(),
            levels: drive.what_if_levels,
        });
        let resistance = drive.resistance_mohm;
        let (differences, timers) = if self.records_failsafe {
            (vec![], &drive.recorded_timers)
        } else {
            (drive.differences(self.announces_failsafes), &drive.timers)
        };
        let [timers, recorded_timers] =
            [timers, &drive.recorded_timers].map(|timers| timers.texts(in_seconds));
        self.rows.push(Row {
            start_utc_s: self.started_utc_s.map(|started_s| started_s + drive.start_s),
            start_s: drive.start_s,
            duration_s: drive.since_start_s(end_s).max(0.0),
            complete: end == End::Whole,
            drawn_mah: drive.drawn_mah.length(),
            drawn_wh: drive.drawn_wh.length(),
            rest_min_v: drive.resting_v.lowest(),
            sag_max_v: drive.sag_v.highest(),
            temperature_min_c: drive.temperature_c.lowest(),
            temperature_max_c: drive.temperature_c.highest(),
            resistance_mohm: Estimate {
                value: resistance.mean(),
                sigma: resistance.sigma(),
            },
            failsafes: drive.failsafes,
            arming_refusals: mem::take(&mut self.refusals),
            faults: drive.recorded_faults.unwrap_or(drive.replayed_faults),
            levels: drive.levels,
            remaining: drive.remaining,
            remaining_low: drive.remaining_low.unwrap_or_default(),
            remaining_critical: drive.remaining_critical.unwrap_or_default(),
            differences,
            timers,
            recorded_timers,
            armed_before: self.armed_before.take(),
            what_if,
            ..self.common.clone()
        });
    }

    /// A drive is over when the next one begins: the pack is learnt when it rests.
    fn settle(&mut self) {
        if let Some(row) = self.rows.last_mut() {
            row.serial_number = self.common.serial_number;
            row.learn(self.own.learnt(), self.rated_mah, self.reported_health_pct);
        }
    }
}

impl Trip {
    fn starting(start_s: f64) -> Self {
        Self {
            start_s,
            end_s: start_s,
            ..Self::default()
        }
    }

    /// Levels that the log has at another time than the replay.
    fn differences(&self, announces_failsafes: bool) -> Vec<String> {
        match announces_failsafes {
            true => self
                .recorded
                .differences(&self.reached)
                .iter()
                .map(Difference::in_seconds)
                .collect(),
            false => vec![],
        }
    }

    /// To the microsecond.
    fn since_start_s(&self, time_s: f64) -> f64 {
        ((time_s - self.start_s) * 1e6).round() / 1e6
    }

    fn add(&mut self, sample: &Sample, state: &BatteryState, reached: &ReachedLevels, is_recorded: bool) {
        self.end_s = sample.time_s;
        let is_first = !mem::replace(&mut self.has_reading, true);
        if !is_recorded {
            self.reach(sample, reached, state.failsafe, |drive| &mut drive.levels);
        } else if is_first && reached.is_empty() {
            // Latched in an earlier drive.
            self.levels
                .reach(state.failsafe, self.since_start_s(sample.time_s));
        }
        self.replayed_faults |= state.faults_to_show();
        let reported = sample.reported.unwrap_or_default();
        self.remaining = Remaining {
            replayed_pct: state.readings.remaining_pct.map(f64::from),
            recorded_pct: reported.remaining_pct.map(f64::from),
        };
        let since_s = self.since_start_s(sample.time_s);
        for level in reached {
            self.reached.reach(*level, since_s);
        }
        if self.levels.low_s.is_some() {
            self.remaining_low.get_or_insert(self.remaining);
        }
        if self.levels.critical_s.is_some() {
            self.remaining_critical.get_or_insert(self.remaining);
        }
        if let Some(bits) = reported.faults {
            *self.recorded_faults.get_or_insert_default() |= Faults::from_bits_truncate(bits);
        }
        if state.status != PackStatus::Healthy {
            return;
        }
        // The board has counted between the readings that are recorded.
        self.drawn_mah.add(reported.consumed_mah.or(state.consumed_mah()));
        self.drawn_wh.add(reported.consumed_wh.or(state.consumed_wh));
        self.resting_v.add(state.readings.resting_voltage_v);
        let sag_v = state.readings.resting_voltage_v.zip(state.readings.voltage_v);
        self.sag_v
            .add(sag_v.map(|(resting_v, voltage_v)| resting_v - voltage_v));
        self.temperature_c.add(state.temperature_c);
        self.resistance_mohm
            .add(state.resistance_ohm.map(|ohm| ohm * 1e3));
    }

    /// Notes which levels are reached with this reading, and the one that is latched.
    fn reach(
        &mut self,
        sample: &Sample,
        reached: &ReachedLevels,
        latched: FailsafeLevel,
        levels: fn(&mut Self) -> &mut Levels,
    ) {
        let since_s = self.since_start_s(sample.time_s);
        let levels = levels(self);
        for level in reached.iter().chain([&latched]) {
            levels.reach(*level, since_s);
        }
    }
}

fn in_seconds(time_s: f64) -> String {
    format!("{time_s:.0} s")
}

fn push(texts: &mut Vec<String>, text: String) {
    if texts.len() < MOST_TEXTS {
        texts.push(text);
    }
}
