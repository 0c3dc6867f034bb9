//! The drives of one pack, in the order of time, and what they say of its age.

use std::collections::BTreeMap;
use std::ops::Range;

use rover_battmon::battery::{END_OF_LIFE_LOSS, Faults};

use crate::table::{Estimate, Identity, Row};
use crate::words::{counted, date, utc};

/// A pack at or below this state of health is at the end of its life, by the rule that the board has for it.
const END_OF_LIFE_PCT: f64 = 100.0 * (1.0 - END_OF_LIFE_LOSS) as f64;

/// Faults in the last drive that a pack is to be looked at for: those that the board asks for service by, or that a pack
/// reports itself.
const TO_SERVICE: Faults = Faults::CELL_FAIL
    .union(Faults::DEEP_DISCHARGE)
    .union(Faults::BAD_BATTERY)
    .union(Faults::NEEDS_SERVICE);

/// Changes that are not worth a word: of the capacity, and of the resistance, relative to the first.
const LIKE_CAPACITY: f64 = 0.03;
const LIKE_RESISTANCE: f64 = 0.1;

/// The resistance has doubled, in round numbers.
const DOUBLED: Range<f64> = 1.95..2.05;

/// Whether a pack is to be looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Attention {
    /// It is worn, or its last drive had a fault of the pack.
    Needed,
    /// It is fit, as far as that is known.
    NotNeeded,
}

/// A pack over its drives.
pub struct Life<'a> {
    /// Its name.
    pub name: String,
    /// Its drives, the oldest first.
    pub drives: Vec<&'a Row>,
}

impl<'a> Life<'a> {
    /// All packs: those that need attention first, then the most worn.
    pub fn all(rows: &'a [Row]) -> Vec<Self> {
        let mut packs: BTreeMap<Identity, Vec<&Row>> = BTreeMap::new();
        for row in rows {
            packs.entry(Identity::of(row)).or_default().push(row);
        }
        let lives = packs.into_iter().map(|(identity, mut drives)| {
            drives.sort_by(|a, b| moment(a).total_cmp(&moment(b)));
            Self {
                name: identity.name(),
                drives,
            }
        });
        let mut lives: Vec<Self> = lives.collect();
        let worn = |life: &Self| life.health_pct().unwrap_or(f64::INFINITY);
        lives.sort_by(|a, b| {
            let by_attention = a.attention().cmp(&b.attention());
            by_attention.then(worn(a).total_cmp(&worn(b)))
        });
        lives
    }

    /// Whether it is to be looked at.
    pub fn attention(&self) -> Attention {
        let is_worn = self
            .health_pct()
            .is_some_and(|health_pct| health_pct <= END_OF_LIFE_PCT);
        match is_worn || !self.last_faults().is_empty() {
            true => Attention::Needed,
            false => Attention::NotNeeded,
        }
    }

    /// Its age, in a sentence.
    pub fn sentence(&self) -> String {
        let faults = self.last_faults();
        let texts = [
            self.capacity(),
            self.resistance(),
            self.health_pct()
                .map(|health_pct| format!("state of health {health_pct:.0} %")),
            (!faults.is_empty()).then(|| format!("in the last drive {}", names(faults))),
        ];
        let texts: Vec<String> = texts.into_iter().flatten().collect();
        let drives = counted(self.drives.len() as u64, "drive");
        match texts.as_slice() {
            [] => format!("{drives}: nothing is known of its age."),
            texts => format!("{drives}: {}.", texts.join(", ")),
        }
    }

    /// Whether nothing is known of its age, and nothing is to be looked at.
    pub fn is_unknown(&self) -> bool {
        let is_known = |row: &&Row| {
            row.capacity_mah
                .value
                .or(row.resistance_mohm.value)
                .or(row.health_pct.value)
                .is_some()
        };
        self.attention() == Attention::NotNeeded && !self.drives.iter().any(is_known)
    }

    /// Its last drive: when, with which rover and in which log.
    pub fn last_drive(&self) -> String {
        let Some(row) = self.drives.last() else {
            return String::new();
        };
        let when = row.start_utc_s.map(|start_s| format!(" on {}", utc(start_s)));
        let rover = row.system_id.map(|id| format!(" with rover {id}"));
        let board = row.board_id.as_ref().map(|id| format!(", board {id}"));
        let texts = [when, rover, board].map(Option::unwrap_or_default);
        format!("Last drive{}: {}.", texts.concat(), row.path)
    }

    fn capacity(&self) -> Option<String> {
        let (_, first, last) = self.ends(|row| row.capacity_mah)?;
        let change = last / first - 1.0;
        let percent = (100.0 * change.abs()).round();
        Some(match change {
            _ if change.abs() < LIKE_CAPACITY => "as much capacity as at first".into(),
            ..0.0 => format!("{percent} % less capacity than at first"),
            _ => format!("{percent} % more capacity than at first"),
        })
    }

    fn resistance(&self) -> Option<String> {
        let (row, first, last) = self.ends(|row| row.resistance_mohm)?;
        let since = row
            .start_utc_s
            .map_or("at first".into(), |start_s| format!("on {}", date(start_s)));
        let factor = last / first;
        Some(if (factor - 1.0).abs() < LIKE_RESISTANCE {
            format!("its resistance is as {since}")
        } else if DOUBLED.contains(&factor) {
            format!("its resistance is twice that {since}")
        } else {
            format!("its resistance is {factor:.1} times that {since}")
        })
    }

    /// The first drive in which a value is known, the value then, and the one in the last such drive.
    fn ends(&self, value: impl Fn(&Row) -> Estimate) -> Option<(&Row, f64, f64)> {
        let mut known = self
            .drives
            .iter()
            .filter_map(|row| Some((*row, value(row).value?)));
        let (row, first) = known.next()?;
        let (_, last) = known.next_back()?;
        Some((row, first, last))
    }

    fn health_pct(&self) -> Option<f64> {
        self.drives.iter().rev().find_map(|row| row.health_pct.value)
    }

    fn last_faults(&self) -> Faults {
        let last = self.drives.last();
        last.map_or(Faults::empty(), |row| row.faults & TO_SERVICE)
    }
}

/// Drives without a date come first, in the order of their paths, as they are.
fn moment(row: &Row) -> f64 {
    row.start_utc_s.unwrap_or(f64::NEG_INFINITY)
}

fn names(faults: Faults) -> String {
    let names: Vec<&str> = faults.iter_names().map(|(name, _)| name).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(serial_number: Option<i32>, day: f64, capacity_mah: f64, health_pct: f64) -> Row {
        let known = |value| Estimate {
            value: Some(value),
            sigma: None,
        };
        Row {
            path: "logs/a.BIN".into(),
            pack: 1,
            serial_number,
            start_utc_s: Some(1_777_800_000.0 + 86_400.0 * day),
            capacity_mah: known(capacity_mah),
            resistance_mohm: known(2e5 / health_pct.powi(2)),
            health_pct: known(health_pct),
            ..Row::default()
        }
    }

    #[test]
    fn a_worn_pack_comes_first_with_what_has_changed_since_when() {
        let rows = [
            drive(Some(7), 1.0, 2200.0, 100.0),
            drive(Some(8), 9.0, 1782.0, 71.0),
            drive(Some(8), 0.0, 2200.0, 100.0),
            drive(Some(7), 2.0, 2190.0, 99.0),
        ];
        let lives = Life::all(&rows);
        let said: Vec<_> = lives
            .iter()
            .map(|life| (life.name.as_str(), life.sentence()))
            .collect();
        assert_eq!(
            said,
            [
                (
                    "Pack 8",
                    "2 drives: 19 % less capacity than at first, its resistance is twice that on 2026-05-03, state of health 71 %."
                        .into()
                ),
                (
                    "Pack 7",
                    "2 drives: as much capacity as at first, its resistance is as on 2026-05-04, state of health 99 %.".into()
                ),
            ]
        );
        let attention = lives.iter().map(Life::attention).collect::<Vec<_>>();
        assert_eq!(attention, [Attention::Needed, Attention::NotNeeded]);
    }

    #[test]
    fn a_fault_of_the_last_drive_needs_attention_and_an_older_one_does_not() {
        let sound = drive(Some(7), 1.0, 2200.0, 100.0);
        let failed = Row {
            faults: Faults::CELL_FAIL | Faults::OVER_TEMPERATURE,
            ..drive(Some(7), 2.0, 2200.0, 100.0)
        };
        let attention = |rows: &[Row]| Life::all(rows)[0].attention();
        assert_eq!(attention(&[sound.clone(), failed.clone()]), Attention::Needed);
        let later = drive(Some(7), 3.0, 2200.0, 100.0);
        assert_eq!(attention(&[sound, failed, later]), Attention::NotNeeded);
    }

    #[test]
    fn without_a_serial_number_the_board_or_the_folder_says_which_pack_it_is() {
        let of_board = |board: &str| Row {
            board_id: Some(board.into()),
            ..drive(None, 0.0, 2200.0, 100.0)
        };
        let rows = [
            of_board("A"),
            of_board("B"),
            of_board("A"),
            drive(None, 0.0, 2200.0, 100.0),
            Row::default(),
        ];
        let names: Vec<String> = Life::all(&rows).iter().map(|life| life.name.clone()).collect();
        assert_eq!(
            names,
            [
                "Pack 1 of board A",
                "Pack 1 of board B",
                "Pack 1 of the logs in logs",
                "Pack 0 of the logs in "
            ]
        );
        let unknown = [Row::default()];
        assert_eq!(
            Life::all(&unknown)[0].sentence(),
            "1 drive: nothing is known of its age."
        );
    }
}
