//! Ends of a run that its driver did not ask for, and the mark in RAM by which the next start knows of them.

use crate::memory::retained::{SealedValue, sealed, sealed_value};

/// Identifies this layout.
const MAGIC: u32 = u32::from_le_bytes(*b"DRV1");

/// End of a run that the driver did not ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interruption {
    /// It crashed.
    Crash,
    /// The power was gone while armed, for a moment that RAM has outlived.
    PowerDip,
    /// The power went off while armed.
    PowerOff,
    /// It was reset while armed, by the RUN pin or a debugger.
    Reset,
}

/// Cause of a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartCause {
    /// A crash.
    Crash,
    /// The power came on.
    Power,
    /// The RUN pin or a debugger.
    Reset,
    /// The firmware restarted itself.
    Request,
}

/// State of the drive, retained for the next start. An interruption stays until the rover is armed again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveMark {
    /// Disarmed, or restarted at the request of a station.
    Disarmed,
    /// Armed.
    Armed,
    /// Not armed since a run was interrupted.
    Interrupted(Interruption),
}

/// The end of the run before a start, as far as RAM knows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunEnd {
    /// It was not interrupted.
    #[default]
    Complete,
    /// It was interrupted, or one before it, and the rover was not armed since.
    Interrupted(Interruption),
    /// The rover was not armed since RAM was lost: the newest log may show the end of its last drive.
    Unknown,
}

/// Codes of the marks.
const DISARMED: u32 = 0;
const ARMED: u32 = 1;
const CRASH: u32 = 2;
const POWER_DIP: u32 = 3;
const RESET: u32 = 4;

impl DriveMark {
    /// The mark as words with magic number and checksum.
    pub fn to_words(self) -> SealedValue {
        let code = match self {
            Self::Disarmed => DISARMED,
            Self::Armed => ARMED,
            Self::Interrupted(Interruption::Crash) => CRASH,
            Self::Interrupted(Interruption::PowerDip | Interruption::PowerOff) => POWER_DIP,
            Self::Interrupted(Interruption::Reset) => RESET,
        };
        sealed(code, MAGIC)
    }

    /// The mark in `words`, if they are valid.
    pub fn from_words(words: &SealedValue) -> Option<Self> {
        let mark = match sealed_value(words, MAGIC)? {
            DISARMED => Self::Disarmed,
            ARMED => Self::Armed,
            CRASH => Self::Interrupted(Interruption::Crash),
            POWER_DIP => Self::Interrupted(Interruption::PowerDip),
            RESET => Self::Interrupted(Interruption::Reset),
            _ => return None,
        };
        Some(mark)
    }

    /// The mark of a start, by the one `before` it, if that was retained.
    pub fn after(before: Option<Self>, cause: StartCause) -> Option<Self> {
        match (before, cause) {
            (_, StartCause::Crash) => Some(Self::Interrupted(Interruption::Crash)),
            (Some(Self::Armed), StartCause::Power) => Some(Self::Interrupted(Interruption::PowerDip)),
            (Some(Self::Armed), StartCause::Reset | StartCause::Request) => {
                Some(Self::Interrupted(Interruption::Reset))
            }
            (before, _) => before,
        }
    }
}

impl RunEnd {
    /// By the mark of a start.
    pub fn new(mark: Option<DriveMark>) -> Self {
        match mark {
            Some(DriveMark::Interrupted(interruption)) => Self::Interrupted(interruption),
            Some(DriveMark::Disarmed | DriveMark::Armed) => Self::Complete,
            None => Self::Unknown,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Interruption::{Crash, PowerDip, Reset};
    use proptest::prelude::*;

    const MARKS: [DriveMark; 5] = [
        DriveMark::Disarmed,
        DriveMark::Armed,
        DriveMark::Interrupted(Crash),
        DriveMark::Interrupted(PowerDip),
        DriveMark::Interrupted(Reset),
    ];

    #[test]
    fn marks_round_trip() {
        for mark in MARKS {
            assert_eq!(DriveMark::from_words(&mark.to_words()), Some(mark));
        }
    }

    #[test]
    fn an_interruption_stays_until_the_next_arming() {
        for (before, cause, expected) in [
            (
                Some(DriveMark::Armed),
                StartCause::Power,
                RunEnd::Interrupted(PowerDip),
            ),
            (
                Some(DriveMark::Armed),
                StartCause::Reset,
                RunEnd::Interrupted(Reset),
            ),
            (
                Some(DriveMark::Armed),
                StartCause::Crash,
                RunEnd::Interrupted(Crash),
            ),
            (
                Some(DriveMark::Disarmed),
                StartCause::Crash,
                RunEnd::Interrupted(Crash),
            ),
            (None, StartCause::Crash, RunEnd::Interrupted(Crash)),
            (Some(DriveMark::Disarmed), StartCause::Power, RunEnd::Complete),
            (Some(DriveMark::Disarmed), StartCause::Request, RunEnd::Complete),
            (None, StartCause::Power, RunEnd::Unknown),
            (None, StartCause::Reset, RunEnd::Unknown),
            (None, StartCause::Request, RunEnd::Unknown),
        ] {
            let mark = DriveMark::after(before, cause);
            assert_eq!(RunEnd::new(mark), expected, "{before:?} {cause:?}");
            for next in [StartCause::Power, StartCause::Reset, StartCause::Request] {
                assert_eq!(
                    RunEnd::new(DriveMark::after(mark, next)),
                    expected,
                    "{before:?} {cause:?}"
                );
            }
        }
    }

    proptest! {
        #[test]
        fn any_flipped_bit_is_no_mark(index in 0..MARKS.len(), bit in 0..96_usize) {
            let mut words = MARKS[index].to_words();
            words[bit / 32] ^= 1 << (bit % 32);
            prop_assert_eq!(DriveMark::from_words(&words), None);
        }
    }
}
