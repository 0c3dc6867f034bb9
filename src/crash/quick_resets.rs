//! Detection of reset loops, which stored parameters may cause.

/// Consecutive unrequested starts after which the stored parameters are not loaded.
const LIMIT: u32 = 5;

/// Uptime that ends a reset loop, in seconds.
const STABLE_AFTER_S: u64 = 30;

/// Cause of a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartKind {
    /// Power-on or a requested restart.
    Requested,
    /// The previous run crashed.
    AfterCrash,
}

/// Source of the parameters of a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterSource {
    /// Those in flash.
    Stored,
    /// All defaults.
    Defaults,
}

/// Consecutive starts after a crash, without a requested one or a stable run in between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QuickResets(u32);

impl QuickResets {
    /// The count including this start, after `before` ones.
    pub fn counted(before: u32, start: StartKind) -> Self {
        match start {
            StartKind::Requested => Self(0),
            StartKind::AfterCrash => Self(before.saturating_add(1)),
        }
    }

    /// Whether an uptime of `uptime_s` ends the loop: the next crash counts as the first.
    pub fn end_after(uptime_s: u64) -> bool {
        uptime_s >= STABLE_AFTER_S
    }

    /// The count.
    pub fn count(self) -> u32 {
        self.0
    }

    /// Source of the parameters of this start: the defaults, until a stable run or a requested restart.
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
            QuickResets::counted(resets.count(), StartKind::AfterCrash)
        })
    }

    #[test]
    fn defaults_are_used_from_the_fifth_start_after_a_crash() {
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
        let saturated = QuickResets::counted(u32::MAX, StartKind::AfterCrash);
        assert_eq!(saturated.parameter_source(), ParameterSource::Defaults);
    }

    #[test]
    fn thirty_seconds_of_uptime_end_a_loop() {
        assert!(!QuickResets::end_after(29));
        assert!(QuickResets::end_after(30));
    }

    #[test]
    fn requested_start_resets_the_count() {
        for crashes in [0, 4, 5, 100] {
            let resets = QuickResets::counted(after(crashes).count(), StartKind::Requested);
            assert_eq!(resets, QuickResets::default());
        }
    }
}
