//! How urgent a notice is.

/// How urgent a notice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Urgency {
    /// Nothing is wrong, or it can wait.
    Info,
    /// Something is wrong with the device.
    Warning,
    /// The device stops, or is about to.
    Critical,
}
