//! Source of the files for readers.

/// The flash that holds the ring, which can be read at once: it is mapped into memory, or simulated.
pub trait LogSource {
    /// Reads from `address`, an offset in the flash.
    ///
    /// # Errors
    /// The flash can't be read there.
    fn read_log(&self, address: u32, bytes: &mut [u8]) -> Result<(), ReadFailed>;
}

/// The flash can't be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct ReadFailed;
