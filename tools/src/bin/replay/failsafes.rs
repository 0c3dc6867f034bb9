//! The failsafes that a log has recorded, and those of its replay.

use std::fmt;

use rover_battmon::battery::{FailsafeLevel, FailsafeTimer};
use rover_battmon::pack::Pack;

use crate::words::clock;

/// Times of the log and of the replay differ by less if both are the same event: readings are some tenths of a second apart.
const SAME_S: f64 = 2.0;

/// Records of one tick differ by less, and those of two by more.
const SAME_TICK_S: f64 = 0.05;

/// Changes of a pack's timers that are kept: those of a voltage that crosses its threshold with every reading are no news.
const MOST_CHANGES: usize = 1000;

/// The words of the board and of ArduPilot for the levels of a pack's failsafe.
const LEVELS: [(&str, FailsafeLevel); 3] = [
    ("is low ", FailsafeLevel::Low),
    ("is critical ", FailsafeLevel::Critical),
    ("is missing", FailsafeLevel::Unhealthy),
];

/// When each level of the failsafe was reached, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Levels {
    /// Low.
    pub low_s: Option<f64>,
    /// Critical.
    pub critical_s: Option<f64>,
}

/// Each time a level of a pack's failsafe is reached, in seconds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reached(Vec<(f64, FailsafeLevel)>);

/// Changes of the timers of a pack's failsafe, with their times in seconds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timers(Vec<(f64, FailsafeLevel, FailsafeTimer)>);

/// A level at different times in a log and its replay; `None` is not at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    level: &'static str,
    recorded_s: Option<f64>,
    replayed_s: Option<f64>,
}

/// The level of a pack's failsafe that a text announces.
pub fn announced(text: &str) -> Option<(Pack, FailsafeLevel)> {
    let (number, event) = text.strip_prefix("Battery ")?.split_once(' ')?;
    let pack = Pack::ALL
        .into_iter()
        .find(|pack| pack.number().to_string() == number)?;
    let (_, level) = LEVELS.iter().find(|(words, _)| event.starts_with(words))?;
    Some((pack, *level))
}

/// The table's word for a level.
pub fn name(level: FailsafeLevel) -> &'static str {
    match level {
        FailsafeLevel::None => "none",
        FailsafeLevel::Low => "low",
        FailsafeLevel::Critical => "critical",
        FailsafeLevel::Unhealthy => "unhealthy",
    }
}

impl Reached {
    /// Notes that a level is reached: the trip of its timer and its text are of one tick.
    pub fn add(&mut self, level: FailsafeLevel, time_s: f64) {
        let is_same = |(known_s, known): &(f64, FailsafeLevel)| {
            *known == level && (time_s - known_s).abs() < SAME_TICK_S
        };
        if self.0.len() < MOST_CHANGES && !self.0.iter().any(is_same) {
            self.0.push((time_s, level));
        }
    }

    /// The times of a level.
    pub fn times_s(&self, level: FailsafeLevel) -> impl Iterator<Item = f64> {
        let of_level = move |(time_s, of): &(f64, FailsafeLevel)| (*of == level).then_some(*time_s);
        self.0.iter().filter_map(of_level)
    }

    /// The first time of each level.
    pub fn levels(&self) -> Levels {
        let mut levels = Levels::default();
        for (time_s, level) in &self.0 {
            levels.reach(*level, *time_s);
        }
        levels
    }
}

impl Levels {
    /// When this level was reached.
    pub fn at_s(&self, level: FailsafeLevel) -> Option<f64> {
        match level {
            FailsafeLevel::Low => self.low_s,
            FailsafeLevel::Critical => self.critical_s,
            FailsafeLevel::None | FailsafeLevel::Unhealthy => None,
        }
    }

    /// Has a level be reached at this time, or not at all.
    pub fn set(&mut self, level: FailsafeLevel, time_s: Option<f64>) {
        match level {
            FailsafeLevel::Low => self.low_s = time_s,
            FailsafeLevel::Critical => self.critical_s = time_s,
            FailsafeLevel::None | FailsafeLevel::Unhealthy => {}
        }
    }

    /// Notes when a level is reached for the first time.
    pub fn reach(&mut self, level: FailsafeLevel, time_s: f64) {
        match level {
            FailsafeLevel::Low => self.low_s.get_or_insert(time_s),
            FailsafeLevel::Critical => self.critical_s.get_or_insert(time_s),
            FailsafeLevel::None | FailsafeLevel::Unhealthy => return,
        };
    }

    /// Levels that a replay reaches at other times than the log has.
    pub fn differences(&self, replayed: &Self) -> Vec<Difference> {
        let levels = [
            ("low", self.low_s, replayed.low_s),
            ("critical", self.critical_s, replayed.critical_s),
        ];
        let is_same = |recorded_s: Option<f64>, replayed_s: Option<f64>| match recorded_s.zip(replayed_s) {
            Some((recorded_s, replayed_s)) => (recorded_s - replayed_s).abs() < SAME_S,
            None => recorded_s == replayed_s,
        };
        // With critical the board announces no low of the same moment.
        let is_skipped = |level, replayed_s: Option<f64>| {
            level == "low"
                && self
                    .critical_s
                    .zip(replayed_s)
                    .is_some_and(|(critical_s, low_s)| {
                        self.low_s.is_none() && (critical_s - low_s).abs() < SAME_S
                    })
        };
        let differing = levels
            .into_iter()
            .filter(|(level, recorded_s, replayed_s)| {
                !is_same(*recorded_s, *replayed_s) && !is_skipped(*level, *replayed_s)
            })
            .map(|(level, recorded_s, replayed_s)| Difference {
                level,
                recorded_s,
                replayed_s,
            });
        differing.collect()
    }
}

impl Timers {
    /// Notes that the timer of a level starts, is reset or expires.
    pub fn add(&mut self, time_s: f64, (level, timer): (FailsafeLevel, FailsafeTimer)) {
        if self.0.len() < MOST_CHANGES {
            self.0.push((time_s, level, timer));
        }
    }

    /// Has the changes of these levels as another one has them.
    pub fn follow(&mut self, recorded: &Self, levels: &[FailsafeLevel]) {
        self.0.retain(|(_, level, _)| !levels.contains(level));
        let followed = recorded.0.iter().filter(|(_, level, _)| levels.contains(level));
        self.0.extend(followed);
        self.0.sort_by(|a, b| a.0.total_cmp(&b.0));
    }

    /// As in `low started 0:31`.
    pub fn texts(&self, in_words: fn(f64) -> String) -> Vec<String> {
        let text = |place| self.text(place, in_words);
        (0..self.0.len()).map(text).collect()
    }

    fn text(&self, place: usize, in_words: fn(f64) -> String) -> String {
        let (time_s, level, timer) = self.0[place];
        let change = match timer {
            FailsafeTimer::Stopped => "reset",
            FailsafeTimer::Running => "started",
            FailsafeTimer::Expired => "tripped",
        };
        format!("{} {change} {}", name(level), in_words(time_s))
    }
}

impl Difference {
    /// In seconds, as the table has it.
    pub fn in_seconds(&self) -> String {
        let seconds = |time_s: Option<f64>| time_s.map_or("never".into(), |time_s| format!("{time_s:.0} s"));
        let (recorded, replayed) = (seconds(self.recorded_s), seconds(self.replayed_s));
        format!("{} recorded {recorded}, replayed {replayed}", self.level)
    }
}

/// As in `low never in the log and at 0:34 in the replay`.
impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at =
            |time_s: Option<f64>| time_s.map_or("never".into(), |time_s| format!("at {}", clock(time_s)));
        let (recorded, replayed) = (at(self.recorded_s), at(self.replayed_s));
        write!(
            f,
            "{} {recorded} in the log and {replayed} in the replay",
            self.level
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_packs_have_levels() {
        for (text, expected) in [
            (
                "Battery 1 is low 10.40V used 300 mAh",
                Some((Pack::First, FailsafeLevel::Low)),
            ),
            (
                "Battery 2 is critical 6.40V used 300 mAh",
                Some((Pack::Second, FailsafeLevel::Critical)),
            ),
            (
                "Battery 1 is missing",
                Some((Pack::First, FailsafeLevel::Unhealthy)),
            ),
            ("Battery 1 low: 10.91V 15% usable", None),
            ("Battery is low 1V", None),
            ("PreArm: Battery 1 is low 10.4V", None),
        ] {
            assert_eq!(announced(text), expected, "{text}");
        }
    }

    #[test]
    fn levels_at_other_times_differ() {
        let levels = |low_s, critical_s| Levels { low_s, critical_s };
        for (recorded, replayed, expected) in [
            (levels(Some(10.0), None), levels(Some(11.5), None), ""),
            (levels(None, None), levels(None, None), ""),
            (levels(None, Some(9.9)), levels(Some(10.0), Some(10.0)), ""),
            (
                levels(Some(10.0), Some(20.0)),
                levels(Some(13.0), None),
                "low at 0:10 in the log and at 0:13 in the replay; critical at 0:20 in the log and never in the replay",
            ),
            (
                levels(None, None),
                levels(Some(34.0), None),
                "low never in the log and at 0:34 in the replay",
            ),
        ] {
            let texts: Vec<String> = recorded
                .differences(&replayed)
                .iter()
                .map(ToString::to_string)
                .collect();
            assert_eq!(texts.join("; "), expected);
        }
    }

    #[test]
    fn a_trip_and_its_text_are_one_and_the_next_is_another() {
        let mut reached = Reached::default();
        for (level, time_s) in [
            (FailsafeLevel::Low, 10.0),
            (FailsafeLevel::Low, 10.018),
            (FailsafeLevel::Critical, 12.0),
            (FailsafeLevel::Low, 500.0),
        ] {
            reached.add(level, time_s);
        }
        assert!(reached.times_s(FailsafeLevel::Low).eq([10.0, 500.0]));
        let (low_s, critical_s) = (Some(10.0), Some(12.0));
        assert_eq!(reached.levels(), Levels { low_s, critical_s });
    }

    #[test]
    fn timers_follow_those_of_the_log_for_a_level() {
        use FailsafeTimer::{Expired, Running};
        let of = |changes: &[(f64, FailsafeLevel, FailsafeTimer)]| Timers(changes.to_vec());
        let (low, critical) = (FailsafeLevel::Low, FailsafeLevel::Critical);
        let mut replayed = of(&[
            (1.4, low, Running),
            (2.0, critical, Running),
            (11.9, low, Expired),
        ]);
        let recorded = of(&[
            (1.0, low, Running),
            (1.9, critical, Running),
            (11.0, low, Expired),
        ]);
        replayed.follow(&recorded, &[low]);
        let expected = [
            (1.0, low, Running),
            (2.0, critical, Running),
            (11.0, low, Expired),
        ];
        assert_eq!(replayed, of(&expected));
    }
}
