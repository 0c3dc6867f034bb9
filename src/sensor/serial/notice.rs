//! What a device on the serial line reports of itself, for ground stations.

use core::fmt;

/// A change in the state of a device on the serial line, reported once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SerialNotice {}

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
        match *self {}
    }
}

impl fmt::Display for SerialNotice {
    fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {}
    }
}
