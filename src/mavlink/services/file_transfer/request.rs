//! A request: its operation and the path that it names.

use core::str;

use heapless::Vec;

use super::directory::{Listed, Path};
use crate::mavlink::messages::FileError;
use crate::mavlink::requests::FileTransfer;

/// The longest path: that of parameters with all arguments.
const MAX_PATH_BYTES: usize = 64;

/// The operation of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operation {
    None,
    TerminateSession,
    ResetSessions,
    ListDirectory(Listed),
    OpenForReading,
    Read,
    OpenForWriting,
    Write,
    Checksum,
    BurstRead,
    /// To remove, create, rename or cut something.
    Change,
}

impl Operation {
    pub fn from_opcode(opcode: u8) -> Option<Self> {
        Some(match opcode {
            0 => Self::None,
            1 => Self::TerminateSession,
            2 => Self::ResetSessions,
            3 => Self::ListDirectory(Listed::Sizes),
            16 => Self::ListDirectory(Listed::SizesAndTimes),
            4 => Self::OpenForReading,
            5 => Self::Read,
            6 | 11 => Self::OpenForWriting,
            7 => Self::Write,
            8..=10 | 12 | 13 => Self::Change,
            14 => Self::Checksum,
            15 => Self::BurstRead,
            _ => return None,
        })
    }
}

/// Whether a request with this opcode can change anything but the session.
pub(in crate::mavlink) fn writes(opcode: u8) -> bool {
    let operation = Operation::from_opcode(opcode);
    matches!(operation, Some(Operation::OpenForWriting | Operation::Write))
}

/// Whether a request with this opcode, which only reads, ends the session or replaces it by another one.
pub(super) fn ends_session(opcode: u8) -> bool {
    matches!(
        Operation::from_opcode(opcode),
        Some(Operation::TerminateSession | Operation::ResetSessions | Operation::OpenForReading)
    )
}

/// The path that a request names: its data, up to a zero.
pub(super) fn path_of(request: &FileTransfer<'_>) -> Result<Path, FileError> {
    if request.size == 0 {
        return Err(FileError::InvalidDataSize);
    }
    let mut path: Vec<u8, MAX_PATH_BYTES> = Vec::new();
    for byte in request.data().take_while(|byte| *byte != 0) {
        path.push(byte).map_err(|_| FileError::FileNotFound)?;
    }
    let path = str::from_utf8(&path).ok().and_then(Path::parse);
    path.ok_or(FileError::FileNotFound)
}
