//! When failsafes would have acted with other parameters than those of the log.

use rover_battmon::battery::FailsafeLevel;

use crate::report::Row;
use crate::summary::reached;
use crate::words::{clock, duration};

/// Effect of `changes`, parameters with their new and old values, on a replay with the log's own parameters.
pub fn comparison(changes: &[String], own: &[Row], changed: &[Row]) -> String {
    let levels = [("low", FailsafeLevel::Low), ("critical", FailsafeLevel::Critical)];
    let lines = levels.map(|(name, level)| {
        // The seconds that are shown.
        let time_s = |rows| reached(rows, level).map(|row| row.time_s.floor());
        let difference = difference(time_s(own), time_s(changed))?;
        Some(format!("  {name} would {difference}"))
    });
    let mut lines: Vec<String> = lines.into_iter().flatten().collect();
    if lines.is_empty() {
        lines.push("  no failsafe, as before".into());
    }
    format!("With {}:\n{}\n", changes.join(", "), lines.join("\n"))
}

/// Difference of the moment with the changes from that with the log's own parameters; `None` without both.
fn difference(own_s: Option<f64>, changed_s: Option<f64>) -> Option<String> {
    let text = match (own_s, changed_s) {
        (None, None) => return None,
        (None, Some(changed_s)) => format!("have come at {} instead of not at all", clock(changed_s)),
        (Some(own_s), None) => format!("not have come, instead of at {}", clock(own_s)),
        (Some(own_s), Some(changed_s)) if own_s == changed_s => {
            format!("have come at {} all the same", clock(own_s))
        }
        (Some(own_s), Some(changed_s)) => {
            let direction = if changed_s < own_s { "earlier" } else { "later" };
            format!(
                "have come {} {direction}, at {} instead of {}",
                duration((changed_s - own_s).abs()),
                clock(changed_s),
                clock(own_s)
            )
        }
    };
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::tests::row;

    #[test]
    fn every_difference_has_its_words() {
        for (own_s, changed_s, expected) in [
            (None, None, None),
            (None, Some(391.0), Some("have come at 6:31 instead of not at all")),
            (Some(581.0), None, Some("not have come, instead of at 9:41")),
            (Some(581.0), Some(581.0), Some("have come at 9:41 all the same")),
            (
                Some(581.0),
                Some(391.0),
                Some("have come 3 min 10 s earlier, at 6:31 instead of 9:41"),
            ),
            (
                Some(391.0),
                Some(581.0),
                Some("have come 3 min 10 s later, at 9:41 instead of 6:31"),
            ),
        ] {
            assert_eq!(difference(own_s, changed_s).as_deref(), expected);
        }
    }

    #[test]
    fn levels_are_compared_that_were_reached_either_time() {
        let own = [
            row(0.0, FailsafeLevel::None),
            row(90.0, FailsafeLevel::Low),
            row(91.0, FailsafeLevel::Low),
        ];
        let changed = [row(0.0, FailsafeLevel::None), row(60.0, FailsafeLevel::Low)];
        let changes = ["BATT_LOW_VOLT 11 instead of 10.5".to_string()];
        assert_eq!(
            comparison(&changes, &own, &changed),
            "With BATT_LOW_VOLT 11 instead of 10.5:\n  low would have come 30 s earlier, at 1:00 instead of 1:30\n"
        );
        let none = comparison(&changes, &[], &[]);
        assert!(none.ends_with(":\n  no failsafe, as before\n"));
    }
}
