//! What a replay has shown, in words. What was not computed is unknown.

use std::fmt;

use rover_battmon::battery::{
    FailsafeLevel, FailsafeSettings, LearntPack, PackSettings, PackStatus, SuggestedThresholds,
};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::BatteryParameter;

use crate::report::{Row, events};
use crate::trace::Trace;
use crate::words::{clock, duration, quantity};

/// The remaining charge lies within so many standard deviations in 19 of 20 cases.
const SIGMAS: f32 = 2.0;

/// So many announcements are listed.
const LISTED_EVENTS: usize = 20;

/// A replay, to be shown in words.
pub struct Summary<'a> {
    /// What was replayed.
    pub trace: &'a Trace,
    /// What came of it.
    pub rows: &'a [Row],
    /// Which pack it is of.
    pub pack: Pack,
    /// What it was replayed with.
    pub settings: &'a PackSettings,
    /// What was known of the pack before.
    pub known: &'a LearntPack,
    /// What is known of it now.
    pub learnt: &'a LearntPack,
}

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", length(self.trace))?;
        writeln!(f, "Voltage: {}", voltages(self.rows))?;
        writeln!(f, "Drawn: {}", drawn(self.rows))?;
        writeln!(f, "Remaining at the end: {}", remaining(self.rows))?;
        writeln!(f, "Learnt: {}", learnt(self.known, self.learnt))?;
        writeln!(f, "Failsafe: {}", self.failsafe())?;
        self.announced(f)
    }
}

fn length(trace: &Trace) -> String {
    let readings = trace.samples.len();
    let armed_s: f64 = trace
        .samples
        .windows(2)
        .filter(|pair| pair[0].armed)
        .map(|pair| pair[1].time_s - pair[0].time_s)
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
        .filter_map(|row| Some((row, row.state.voltage_v?)))
}

fn voltages(rows: &[Row]) -> String {
    let weakest = healthy(rows).min_by(|(_, a), (_, b)| a.total_cmp(b));
    let ends = healthy(rows).next().zip(healthy(rows).next_back());
    let Some(((weakest, weakest_v), ((_, first_v), (_, last_v)))) = weakest.zip(ends) else {
        return "unknown".into();
    };
    let load = weakest
        .state
        .current_a
        .map_or(String::new(), |current_a| format!(" at {current_a:.1} A"));
    format!(
        "{first_v:.2} V at the start, {last_v:.2} V at the end; weakest at {}: {weakest_v:.2} V{load}",
        clock(weakest.time_s)
    )
}

fn drawn(rows: &[Row]) -> String {
    let state = rows.last().map(|row| &row.state);
    match state.and_then(|state| state.consumed_mah().zip(state.consumed_wh)) {
        Some((mah, wh)) => format!("{mah:.0} mAh, {wh:.1} Wh"),
        None => quantity(state.and_then(|state| state.consumed_mah()), 0, "mAh"),
    }
}

fn remaining(rows: &[Row]) -> String {
    let Some(last) = rows.last() else {
        return "unknown".into();
    };
    let state = &last.state;
    let mut text = quantity(state.remaining_pct, 0, "%");
    if state.remaining_pct.is_some() {
        let within_pct = state.remaining_sigma_pct.map(|sigma_pct| SIGMAS * sigma_pct);
        text += &format!(" ± {} (19 times of 20)", quantity(within_pct, 0, "%"));
        text += &format!(", usable {}", quantity(state.usable_pct, 0, "%"));
    }
    if let Some(reported) = &last.reported {
        text += &format!("; the log has {}", quantity(reported.remaining_pct, 0, "%"));
    }
    text
}

/// What is known of the pack, and since when.
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

/// When a level was reached first.
pub fn reached_s(rows: &[Row], level: FailsafeLevel) -> Option<f64> {
    let row = rows.iter().find(|row| row.failsafe == level)?;
    Some(row.time_s)
}

impl Summary<'_> {
    fn failsafe(&self) -> String {
        if self.settings.failsafe.is_disabled() {
            return self.suggestion();
        }
        let levels = [FailsafeLevel::Low, FailsafeLevel::Critical];
        let texts: Vec<String> = levels
            .into_iter()
            .filter_map(|level| self.failsafe_level(level))
            .collect();
        let mut text = texts.join(", ");
        if !self.trace.samples.iter().any(|sample| sample.armed) {
            text += "; the recording is never armed (column armed), and only then they act";
        }
        text
    }

    /// When its thresholds would have acted, if it has any.
    fn failsafe_level(&self, level: FailsafeLevel) -> Option<String> {
        let names = thresholds(&self.settings.failsafe, level, self.pack)?;
        Some(match reached_s(self.rows, level) {
            Some(time_s) => format!("{names} would have acted at {}", clock(time_s)),
            None => format!("{names} would not have acted"),
        })
    }

    fn suggestion(&self) -> String {
        let last = self.rows.last();
        let Some(suggested) = last.and_then(|row| SuggestedThresholds::of(&row.state, self.settings)) else {
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

    fn announced(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = events(self.rows).count();
        if count == 0 {
            return writeln!(f, "Announced: nothing");
        }
        writeln!(f, "Announced:")?;
        for (time_s, text) in events(self.rows).take(LISTED_EVENTS) {
            writeln!(f, "  {:>7}  Battery {} {text}", clock(time_s), self.pack.number())?;
        }
        match count.saturating_sub(LISTED_EVENTS) {
            0 => Ok(()),
            more => writeln!(f, "  {more} more, in the rows"),
        }
    }
}

/// The thresholds of a level that are in effect, with their values.
fn thresholds(settings: &FailsafeSettings, level: FailsafeLevel, pack: Pack) -> Option<String> {
    let (limits, voltage, charge) = match level {
        FailsafeLevel::Critical => (
            settings.critical,
            BatteryParameter::CrtVolt,
            BatteryParameter::CrtMah,
        ),
        _ => (settings.low, BatteryParameter::LowVolt, BatteryParameter::LowMah),
    };
    let named = |parameter: BatteryParameter, value| format!("{} {value}", parameter.of(pack).name());
    let texts = [
        settings
            .timer_s
            .and(limits.voltage_v)
            .map(|volts| named(voltage, volts)),
        limits.remaining_mah.map(|mah| named(charge, mah)),
    ];
    let texts: Vec<String> = texts.into_iter().flatten().collect();
    (!texts.is_empty()).then(|| texts.join(" or "))
}
