//! Map of the flash chip, for the board and the simulator.
//!
//! Ranges are offsets from the start of the chip, in bytes. What is kept stays where it was in every release, so that an
//! update finds it: a new part is taken from the end of the program, or goes below the others.

use core::ops::Range;

/// Size of the Pico's flash chip, a W25Q16JV, in bytes.
pub const CHIP_BYTES: u32 = 2048 * KIB;

/// The unit of erase, in bytes.
pub const SECTOR_BYTES: u32 = 4 * KIB;

/// The program (`memory.x`).
pub const PROGRAM: Range<u32> = 0..760 * KIB;

/// Names and passwords of Wi-Fi networks.
pub const WIFI: Range<u32> = PROGRAM.end..768 * KIB;

/// The ring of log files.
pub const LOG: Range<u32> = WIFI.end..2008 * KIB;

/// Learnt data of the packs.
pub const LEARNT: Range<u32> = LOG.end..2024 * KIB;

/// The signing key.
pub const SIGNING: Range<u32> = LEARNT.end..2032 * KIB;

/// The parameters.
pub const PARAMETERS: Range<u32> = SIGNING.end..CHIP_BYTES;

const KIB: u32 = 1024;
