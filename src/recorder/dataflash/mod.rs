//! Records of a log file in ArduPilot's DataFlash format (`.BIN`), which describes itself.
//!
//! A record is 0xA3, 0x95, the number of its format and its fields, little endian. A file begins with
//! [`opening_record`]s, which say what the fields of each format are called and what their units are; then follow
//! [`Record`]s in any order. Formats, fields and units are those of ArduPilot 4.6 where it has them. Of this firmware are
//! `BATX` (what is estimated of a pack, and its extremes), `CRSH` (the crash before this start), `BRD` (which board it is),
//! `PACK` and `PCKO` (which pack it is, and what is learnt of it) and the field `LogDrop` of `PM`.
//!
//! A number with a fraction is NaN while it is unknown, as ArduPilot's current without a sensor is. Other fields use
//! ArduPilot's values for what is unknown; the functions that encode the records have them.

mod format;
mod last_arming;
mod packet;
mod record;

pub use last_arming::LastArming;
pub use packet::{MAX_RECORD_BYTES, RecordBytes, opening_record};
pub use record::{
    ArmingMethod, COMMAND_FIELD_BYTES, CommandRecord, MESSAGE_BYTES, ModeReason, Record, Subsystem,
};

#[cfg(test)]
mod tests;
