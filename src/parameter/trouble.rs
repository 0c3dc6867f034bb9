//! Causes for which the live values may not be the owner's.

use core::fmt;

use bitflags::bitflags;

use super::{ParameterId, ParameterIdSet, VehicleParameter};
use crate::announce::{Announce, Severity};

/// The parameter that confirms. Its key has the mark; it reads 0.
pub(super) const CHECKED: ParameterId = ParameterId::Vehicle(VehicleParameter::ParamChecked);

bitflags! {
    /// Causes that are not known by a parameter.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(super) struct Doubts: u8 {
        /// Unreadable values are at an older value or their default.
        const DAMAGED = 1;
        /// A file of parameters has begun, and has not ended.
        const HALF_LOADED = 1 << 1;
        /// The others have ended, but the mark is taken back once everything else is saved.
        const ENDED = 1 << 6;
        /// Stored values were not read. Of this start alone: not in the mark.
        const NOT_READ = 1 << 7;
    }
}

impl Doubts {
    /// The doubts that the mark has.
    pub fn marked(self) -> Self {
        self - Self::ENDED - Self::NOT_READ
    }
}

/// Files of parameters that have begun since the start, and were not ended by a whole one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HalfFile {
    /// Parameters that they have changed.
    pub changed: ParameterIdSet,
    /// The most parameters that one of their headers announced.
    pub announced: u16,
    /// Parameters that the latest one lacks of these.
    pub missing: u16,
}

/// Cause for which the live values may not be the owner's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ParameterTrouble {
    /// Stored values were not read at this start, and are not known.
    NotRead,
    /// Stored values are lost, and with them their names.
    Damaged,
    /// A file of parameters did not come whole.
    HalfLoaded {
        /// Parameters of the latest file that did not come; `None` if unknown, as after a restart.
        missing: Option<u16>,
    },
    /// Stored values are out of the range of this firmware: the first one or two of them. Others follow once these are confirmed.
    DoesNotFit(ParameterId, Option<ParameterId>),
}

impl Announce for ParameterTrouble {
    fn severity(&self) -> Severity {
        Severity::Critical
    }
}

/// The cause, and how it ends.
impl fmt::Display for ParameterTrouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotRead => return f.write_str("Stored parameters not read: restart"),
            Self::Damaged => f.write_str("Parameters damaged")?,
            Self::HalfLoaded { missing: None } => f.write_str("Parameters half loaded")?,
            Self::HalfLoaded {
                missing: Some(missing),
            } => write!(f, "Parameters half loaded, {missing} missing")?,
            Self::DoesNotFit(first, None) => write!(f, "Stored {} does not fit", first.name())?,
            // Shorter: it has to fit with the longest names.
            Self::DoesNotFit(first, Some(second)) => {
                return write!(
                    f,
                    "Stored {}, {} do not fit: check, then set PARAM_CHECKED 1",
                    first.name(),
                    second.name()
                );
            }
        }
        f.write_str(": check them, then set PARAM_CHECKED 1")
    }
}
