//! Resets that follow each other too quickly, which may be the parameters' fault.

/// After so many starts that nobody asked for, one soon after the other, the parameters are not trusted any more.
const LIMIT: u32 = 5;

/// A program that has run for so long is not in a loop of resets.
const STEADY_AFTER_S: u64 = 30;

/// How a start came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Somebody switched the board on or restarted it.
    AskedFor,
    /// The program before it has crashed.
    AfterCrash,
}

/// Which parameters a start is made with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterSource {
    /// Those in flash.
    Stored,
    /// All at their defaults.
    Defaults,
}

/// Starts after a crash, without one that was asked for and without a program that ran steadily in between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QuickResets(u32);

impl QuickResets {
    /// The number with this start, if there were `before` so far.
    pub fn counted(before: u32, start: Start) -> Self {
        match start {
            Start::AskedFor => Self(0),
            Start::AfterCrash => Self(before.saturating_add(1)),
        }
    }

    /// Whether a program that has run for `uptime_s` ends the row: the next crash counts as the first.
    pub fn end_after(uptime_s: u64) -> bool {
        uptime_s >= STEADY_AFTER_S
    }

    /// How many there were.
    pub fn count(self) -> u32 {
        self.0
    }

    /// What to start with. The defaults stay until the program has run steadily or somebody restarts it.
    pub fn parameter_source(self) -> ParameterSource {
        if self.0 < LIMIT {
            ParameterSource::Stored
        } else {
            ParameterSource::Defaults
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(crashes: u32) -> QuickResets {
        (0..crashes).fold(QuickResets::default(), |resets, _| {
            QuickResets::counted(resets.count(), Start::AfterCrash)
        })
    }

    #[test]
    fn the_fifth_start_after_a_crash_is_made_with_defaults_and_those_after_it() {
        for crashes in 0..5 {
            assert_eq!(
                after(crashes).parameter_source(),
                ParameterSource::Stored,
                "{crashes}"
            );
        }
        for crashes in 5..10 {
            assert_eq!(
                after(crashes).parameter_source(),
                ParameterSource::Defaults,
                "{crashes}"
            );
        }
        let for_ever = QuickResets::counted(u32::MAX, Start::AfterCrash);
        assert_eq!(for_ever.parameter_source(), ParameterSource::Defaults);
    }

    #[test]
    fn half_a_minute_ends_a_row() {
        assert!(!QuickResets::end_after(29));
        assert!(QuickResets::end_after(30));
    }

    #[test]
    fn a_start_that_was_asked_for_begins_anew() {
        for crashes in [0, 4, 5, 100] {
            let resets = QuickResets::counted(after(crashes).count(), Start::AskedFor);
            assert_eq!(resets, QuickResets::default());
        }
    }
}
