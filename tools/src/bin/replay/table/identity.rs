//! Which pack a row is of.

use std::fmt;
use std::path::Path;

use super::row::Row;

/// Marks of a pack, the surest first.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Identity {
    /// Its serial number.
    SerialNumber(i32),
    /// On a board that has always the same ones.
    Board(String, u8),
    /// In a folder that has the logs of one vehicle.
    Folder(String, u8),
}

impl Identity {
    /// Of the pack of a row.
    pub fn of(row: &Row) -> Self {
        match (row.serial_number, &row.board_id) {
            (Some(number), _) => Self::SerialNumber(number),
            (None, Some(board)) => Self::Board(board.clone(), row.pack),
            (None, None) => {
                let folder = Path::new(&row.path).parent().unwrap_or(Path::new(""));
                Self::Folder(folder.to_string_lossy().into_owned(), row.pack)
            }
        }
    }

    /// Its name on a page.
    pub fn name(&self) -> String {
        match self {
            Self::SerialNumber(number) => format!("Pack {number}"),
            Self::Board(board, pack) => format!("Pack {pack} of board {board}"),
            Self::Folder(folder, pack) => format!("Pack {pack} of the logs in {folder}"),
        }
    }
}

/// The key in the table.
impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SerialNumber(number) => write!(f, "serial {number}"),
            Self::Board(board, pack) => write!(f, "board {board}/{pack}"),
            Self::Folder(folder, pack) => write!(f, "folder {folder}/{pack}"),
        }
    }
}
