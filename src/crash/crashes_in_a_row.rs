//! Detection of reset loops, which stored parameters or the radio may cause.

/// Quick crashes in a row after which the stored parameters are not loaded.
const LIMIT: u8 = 5;

/// Uptime that ends a row of quick crashes, in seconds.
const STABLE_AFTER_S: u64 = 30;

/// Kind of a start, for what is counted of crashes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartKind {
    /// Power-on or a requested restart.
    Requested,
    /// The previous run crashed.
    AfterCrash,
    /// The previous run crashed during the radio's turn.
    AfterRadioCrash,
}

/// Source of the parameters of a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterSource {
    /// The parameters in flash.
    Stored,
    /// All defaults.
    Defaults,
}

/// Starts after a crash, without a requested one in between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CrashesInARow {
    /// Without a stable run in between.
    quick: u8,
    /// All of them during the radio's turn.
    of_radio: u8,
}

impl CrashesInARow {
    /// From [`Self::to_word`], or 0.
    pub fn from_word(word: u32) -> Self {
        let [quick, of_radio, ..] = word.to_le_bytes();
        Self { quick, of_radio }
    }

    /// The counts as a word, which is retained.
    pub fn to_word(self) -> u32 {
        u32::from_le_bytes([self.quick, self.of_radio, 0, 0])
    }

    /// The counts including this start.
    pub fn with(self, start: StartKind) -> Self {
        let quick = self.quick.saturating_add(1);
        match start {
            StartKind::Requested => Self::default(),
            StartKind::AfterCrash => Self { quick, of_radio: 0 },
            StartKind::AfterRadioCrash => Self {
                quick,
                of_radio: self.of_radio.saturating_add(1),
            },
        }
    }

    /// The counts after an uptime of `uptime_s`: a stable run ends a row of quick crashes.
    pub fn after(self, uptime_s: u64) -> Self {
        match uptime_s {
            ..STABLE_AFTER_S => self,
            _ => Self { quick: 0, ..self },
        }
    }

    /// Number of crashes during the radio's turn.
    pub fn of_radio(self) -> u8 {
        self.of_radio
    }

    /// Source of the parameters of this start: the defaults, until a stable run or a requested restart.
    pub fn parameter_source(self) -> ParameterSource {
        if self.quick < LIMIT {
            ParameterSource::Stored
        } else {
            ParameterSource::Defaults
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use StartKind::{AfterCrash, AfterRadioCrash, Requested};

    /// The counts after these starts, each from the word that the one before has left.
    fn after(starts: impl IntoIterator<Item = StartKind>) -> CrashesInARow {
        let word = starts.into_iter().fold(0, |word, start| {
            CrashesInARow::from_word(word).with(start).to_word()
        });
        CrashesInARow::from_word(word)
    }

    #[test]
    fn defaults_are_used_from_the_fifth_start_after_a_crash() {
        for crashes in [0, 1, 4, 5, 6, 1000] {
            let expected = if crashes < 5 {
                ParameterSource::Stored
            } else {
                ParameterSource::Defaults
            };
            for kind in [AfterCrash, AfterRadioCrash] {
                let counts = after(vec![kind; crashes]);
                assert_eq!(counts.parameter_source(), expected, "{crashes}");
            }
        }
    }

    #[test]
    fn thirty_seconds_of_uptime_end_a_row_of_quick_crashes_only() {
        let counts = after([AfterRadioCrash; 5]);
        assert_eq!(counts.after(29), counts);
        assert_eq!(counts.after(30).parameter_source(), ParameterSource::Stored);
        assert_eq!(counts.after(30).of_radio(), 5);
    }

    #[test]
    fn requested_start_ends_every_row() {
        for crashes in [0, 4, 5, 1000] {
            let starts = vec![AfterRadioCrash; crashes].into_iter().chain([Requested]);
            assert_eq!(after(starts), CrashesInARow::default());
        }
    }

    #[test]
    fn a_crash_elsewhere_ends_the_row_of_the_radio() {
        for (starts, of_radio) in [
            (&[AfterRadioCrash][..], 1),
            (&[AfterCrash, AfterRadioCrash], 1),
            (&[AfterRadioCrash, AfterRadioCrash], 2),
            (&[AfterRadioCrash, AfterCrash], 0),
            (&[AfterRadioCrash, AfterCrash, AfterRadioCrash], 1),
            (&[AfterRadioCrash, Requested, AfterRadioCrash], 1),
        ] {
            assert_eq!(after(starts.iter().copied()).of_radio(), of_radio, "{starts:?}");
        }
    }
}
