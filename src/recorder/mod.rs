//! The log of drives in flash: a ring of files.

/// A log file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct LogFile {
    /// Its number, from 1; after 65535 follows 1 again.
    pub number: u16,
    /// Its length in bytes.
    pub bytes: u32,
}
