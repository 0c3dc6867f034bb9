//! A ring of log files in flash, safe from power cuts at any moment.
//!
//! A file is a run of consecutive sectors, the first of them its own. Files are numbered; the oldest is erased whole when
//! its space is needed. [`Ring`] knows what is where and decides what has to be programmed and erased next; its caller
//! does it, and reports the outcome. Only [`Ring::scan`] reads the flash. The ring does not know what a file holds;
//! [`dataflash`] encodes its records.
//!
//! | bytes of a sector | content |
//! |---|---|
//! | first 16 | header, programmed when the sector is begun: magic, sequence number, file number and the sector's index in the file, CRC-32 |
//! | 8 | mark, programmed after each complete erase: the sequence number for which it was erased, CRC-32 |
//! | 8 | in the first sector of a file its date, programmed once when it is known: when the file began, in seconds since 1970, CRC-32 |
//! | [`PAYLOAD_BYTES`] | content of the file |
//!
//! Sequence numbers rise by one with each sector; the position in the ring is the remainder of their division by the
//! number of sectors, which enters the checksums too. They can't wrap: flash is worn out after some 100,000 laps.
//!
//! # Power cuts
//! - A sector is begun only if its mark is the one for its next use and the rest of it is blank. An erase that was
//!   interrupted leaves no such mark, so its sector is erased again.
//! - A header that was interrupted makes its sector unusable for this lap: another erase for the same sequence number
//!   could leave the right mark in a sector that is half erased.
//! - After a start nothing is appended to what is there. The file that was open ends at its last byte that is not 0xFF.
//!   So the last bytes may be torn, and bytes 0xFF at the very end of a file are lost at the next start: a file should end
//!   with another one.
//! - The oldest file is not listed again once the erase of its first sector was begun, unless that had no effect at all.
//!   After an interrupted [`Ring::erase_all`], files that were not erased yet are listed again.
//!
//! # Damage
//! A file is readable with damaged headers as long as one of its sectors after them has an intact one; what is in the
//! sectors is returned as it stands. If its first header is damaged, its first mark has to be intact, and it is not listed
//! once that sector is the next to be erased.
//!
//! A program that fails ends the file; the next one begins in the next sector. A sector that can't be erased is left out
//! for a lap.

pub mod dataflash;
mod directory;
mod front;
mod geometry;
mod ring;
mod scan;
mod source;

pub use directory::{LogFile, MAX_FILES};
pub use front::PAYLOAD_BYTES;
pub use geometry::{MAX_SECTORS, SECTOR_BYTES};
pub use ring::{AppendError, Erasure, Piece, Program, Ring};
pub use source::{LogSource, ReadFailed};

#[cfg(test)]
mod tests;
