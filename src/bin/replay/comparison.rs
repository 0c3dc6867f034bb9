//! When failsafes would have acted with other parameters than those of the log.

use std::fmt;

use rover_battmon::battery::FailsafeLevel;

use crate::report::Row;
use crate::summary::reached_s;
use crate::words::{clock, duration};

/// Two replays of one log.
pub struct Comparison<'a> {
    /// What was changed: parameters with their new and old values.
    pub changes: &'a [String],
    /// With the log's own parameters.
    pub own: &'a [Row],
    /// With the changes.
    pub changed: &'a [Row],
}

impl fmt::Display for Comparison<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "With {}:", self.changes.join(", "))?;
        for (name, level) in [("low", FailsafeLevel::Low), ("critical", FailsafeLevel::Critical)] {
            let [own_s, changed_s] = [self.own, self.changed].map(|rows| reached_s(rows, level));
            writeln!(f, "  {name} {}", difference(own_s, changed_s))?;
        }
        Ok(())
    }
}

/// How the moment with the changes differs from that with the log's own parameters.
fn difference(own_s: Option<f64>, changed_s: Option<f64>) -> String {
    match (own_s, changed_s) {
        (None, None) => "would not have come, as with the log's own".into(),
        (None, Some(changed_s)) => format!(
            "would have come at {}, not at all with the log's own",
            clock(changed_s)
        ),
        (Some(own_s), None) => format!("would not have come, instead of at {}", clock(own_s)),
        (Some(own_s), Some(changed_s)) if own_s == changed_s => {
            format!("would have come at {}, as with the log's own", clock(own_s))
        }
        (Some(own_s), Some(changed_s)) => {
            let direction = if changed_s < own_s { "earlier" } else { "later" };
            format!(
                "would have come {} {direction}, at {} instead of {}",
                duration((changed_s - own_s).abs()),
                clock(changed_s),
                clock(own_s)
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_difference_has_its_words() {
        for (own_s, changed_s, expected) in [
            (None, None, "would not have come, as with the log's own"),
            (
                None,
                Some(391.0),
                "would have come at 6:31, not at all with the log's own",
            ),
            (Some(581.0), None, "would not have come, instead of at 9:41"),
            (
                Some(581.0),
                Some(581.0),
                "would have come at 9:41, as with the log's own",
            ),
            (
                Some(581.0),
                Some(391.0),
                "would have come 3 min 10 s earlier, at 6:31 instead of 9:41",
            ),
            (
                Some(391.0),
                Some(581.0),
                "would have come 3 min 10 s later, at 9:41 instead of 6:31",
            ),
        ] {
            assert_eq!(difference(own_s, changed_s), expected);
        }
    }
}
