//! The failsafes that a log has recorded, beside those of its replay.

use std::fmt;

use rover_battmon::battery::FailsafeLevel;
use rover_battmon::pack::Pack;

use crate::words::clock;

/// Times of the log and of the replay differ by less if both are the same event: readings are some tenths of a second apart.
const SAME_S: f64 = 2.0;

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

impl Levels {
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
}
