//! Map of the flash chip, for the board and the simulator.
//!
//! Ranges are offsets from the start of the chip, in bytes. What is kept stays where it was in every release, so that an
//! update finds it. The log's checksums cover its size: where that changes, an update loses the logs and nothing else.

use core::ops::Range;

/// Size of the Pico's flash chip, a W25Q16JV, in bytes.
pub const CHIP_BYTES: u32 = 2048 * KIB;

/// The unit of erase, in bytes.
pub const SECTOR_BYTES: u32 = 4 * KIB;

/// The program, but for its [constants](CONSTANTS): `FLASH` in `memory.x`.
pub const PROGRAM: Range<u32> = 0..760 * KIB;

/// Names and passwords of Wi-Fi networks.
pub const WIFI: Range<u32> = PROGRAM.end..768 * KIB;

/// Files that the program serves: `CONSTANTS` in `memory.x`. An update replaces them with the program, and leaves what is between.
pub const CONSTANTS: Range<u32> = WIFI.end..840 * KIB;

/// The ring of log files.
pub const LOG: Range<u32> = CONSTANTS.end..2008 * KIB;

/// Learnt data of the packs.
pub const LEARNT: Range<u32> = LOG.end..2024 * KIB;

/// The signing key.
pub const SIGNING: Range<u32> = LEARNT.end..2032 * KIB;

/// The parameters.
pub const PARAMETERS: Range<u32> = SIGNING.end..CHIP_BYTES;

const KIB: u32 = 1024;

/// Embeds a file as a static: `memory.x` finds what belongs to the [constants](CONSTANTS) by its name, which bytes without one
/// do not have.
macro_rules! constant_file {
    ($name:ident, $path:literal) => {
        static $name: [u8; include_bytes!($path).len()] = *include_bytes!($path);
    };
}

pub(crate) use constant_file;
