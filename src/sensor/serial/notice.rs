//! What a device on the serial line reports of itself, for ground stations.

use core::fmt;

use super::protocols::TorqeedoCondition;

/// A change in the state of a device on the serial line, reported once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SerialNotice {
    /// What a Torqeedo motor or its battery reports to be wrong.
    Torqeedo(TorqeedoCondition),
}

/// How urgent a notice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Urgency {
    /// Nothing is wrong.
    Info,
    /// Something is wrong with the device.
    Warning,
    /// The device stops, or is about to.
    Critical,
}

impl SerialNotice {
    /// How urgent it is.
    pub fn urgency(&self) -> Urgency {
        match self {
            Self::Torqeedo(condition) if condition.is_good() => Urgency::Info,
            Self::Torqeedo(_) => Urgency::Warning,
        }
    }
}

impl fmt::Display for SerialNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Torqeedo(condition) => write!(f, "{condition}"),
        }
    }
}
