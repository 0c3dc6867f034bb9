//! Why an operation failed, and whether it may erase.

use core::mem::discriminant;

use embedded_storage_async::nor_flash::{NorFlashError, NorFlashErrorKind};

/// Why an operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum StorageError {
    /// The flash failed.
    Flash(FlashFault),
    /// The content is damaged by something other than a power cut, or has another format.
    Corrupt,
    /// No space for another key. Stored values are kept.
    Full,
    /// A sector has to be erased, which is forbidden now. Nothing was written.
    NoErasedSpace,
}

/// Fault of the flash: the kind of the driver's error, or a difference that the driver did not notice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum FlashFault {
    /// Erased or written data read back otherwise: the flash is worn out, or the operation had no effect.
    NotVerified,
    /// The driver refused addresses that are not aligned.
    NotAligned,
    /// The driver refused addresses beyond the flash.
    OutOfBounds,
    /// The driver failed in another way.
    Other,
}

// Every parameter has room for one.
const _: () = assert!(size_of::<StorageError>() == 1);

impl StorageError {
    /// The error of a flash driver.
    pub(super) fn of_driver(error: impl NorFlashError) -> Self {
        Self::Flash(match error.kind() {
            NorFlashErrorKind::NotAligned => FlashFault::NotAligned,
            NorFlashErrorKind::OutOfBounds => FlashFault::OutOfBounds,
            _ => FlashFault::Other,
        })
    }

    /// Whether both are the same error, whatever it was in the flash.
    pub fn is_like(self, other: Self) -> bool {
        discriminant(&self) == discriminant(&other)
    }
}

/// Whether a sector may be erased now. An erase stops the processor for 45 ms, typically, and for 400 ms at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Erase {
    /// There is no real-time deadline.
    Allowed,
    /// The vehicle may be moving.
    Forbidden,
}

/// Asked immediately before each erase: the vehicle may have been armed since the operation was begun.
pub type MayErase<'a> = &'a dyn Fn() -> Erase;

impl Erase {
    /// The answer before the vehicle can be armed, and on a host.
    pub fn always() -> Self {
        Self::Allowed
    }
}
