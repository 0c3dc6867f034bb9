//! Why an operation failed.

/// Why an operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum StorageError {
    /// The flash driver reported an error, or reading back failed to verify.
    Flash,
    /// The content is damaged by something other than a power cut, or has another format.
    Corrupt,
    /// No space for another key. Stored values are kept.
    Full,
}
