//! A condition that is reported once when it begins and once when it ends, however often it comes and goes.

/// A condition that is reported once.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Condition {
    /// Not reported, or its end was.
    #[default]
    Absent,
    /// Its beginning was reported.
    Reported {
        /// How long it has been absent since, in seconds.
        absent_s: f32,
    },
}

/// Evidence of a condition in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Evidence {
    Present,
    /// Neither enough to report it, nor its end.
    Ambiguous,
    Absent,
}

impl Evidence {
    pub fn of(is_present: bool) -> Self {
        if is_present { Self::Present } else { Self::Absent }
    }
}

/// What has to be reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    Begins,
    Ends,
}

impl Condition {
    /// Takes the evidence of a tick, `dt_s` seconds after the one before. The condition ends after an absence of
    /// `recovery_s` seconds.
    pub fn update(&mut self, dt_s: f32, evidence: Evidence, recovery_s: f32) -> Option<Change> {
        match (&mut *self, evidence) {
            (Self::Absent, Evidence::Present) => {
                *self = Self::Reported { absent_s: 0.0 };
                return Some(Change::Begins);
            }
            (Self::Absent, _) => {}
            (Self::Reported { absent_s }, Evidence::Absent) => {
                *absent_s += dt_s;
                if *absent_s >= recovery_s {
                    *self = Self::Absent;
                    return Some(Change::Ends);
                }
            }
            (Self::Reported { absent_s }, _) => *absent_s = 0.0,
        }
        None
    }
}
