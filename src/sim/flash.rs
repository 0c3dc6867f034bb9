//! The part of the flash that is written while the firmware runs, in memory and optionally in a file.

use std::cell::RefCell;
use std::fs;
use std::io;
use std::ops::Range;
use std::path::PathBuf;
use std::rc::Rc;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// As on the board: four sectors for the parameters, two for signing.
const SECTOR_BYTES: usize = 4096;
const PARAMETER_BYTES: usize = 4 * SECTOR_BYTES;
const SIGNING_BYTES: usize = 2 * SECTOR_BYTES;
const FLASH_BYTES: usize = PARAMETER_BYTES + SIGNING_BYTES;

const ERASED: u8 = 0xff;

/// A flash chip that behaves as NOR flash does: programming clears bits, only erasing a sector sets them.
///
/// A clone is the same chip.
#[derive(Clone, Debug)]
pub struct SimulatedFlash(Rc<RefCell<Chip>>);

#[derive(Debug)]
struct Chip {
    content: Vec<u8>,
    file: Option<PathBuf>,
}

/// The file that keeps the content can't be written.
#[derive(Debug)]
pub struct FileError(pub io::Error);

impl NorFlashError for FileError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl SimulatedFlash {
    /// A chip whose content is kept in `file`, or nowhere. A file that does not exist yet is an erased chip.
    ///
    /// # Errors
    /// The file can't be read, or is not an image of such a chip.
    pub fn open(file: Option<PathBuf>) -> io::Result<Self> {
        let content = match file.as_ref().map(fs::read) {
            Some(Ok(content)) if content.len() == FLASH_BYTES => content,
            // From a simulator that knew no signing.
            Some(Ok(mut content)) if content.len() == PARAMETER_BYTES => {
                content.resize(FLASH_BYTES, ERASED);
                content
            }
            Some(Ok(_)) => {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    "it is not a flash image",
                ));
            }
            Some(Err(error)) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            Some(Err(_)) | None => vec![ERASED; FLASH_BYTES],
        };
        Ok(Self(Rc::new(RefCell::new(Chip { content, file }))))
    }

    /// Where the parameters are.
    pub const PARAMETERS: Range<u32> = 0..PARAMETER_BYTES as u32;

    /// Where the signing key is.
    pub const SIGNING: Range<u32> = PARAMETER_BYTES as u32..FLASH_BYTES as u32;
}

impl Chip {
    fn save(&self) -> Result<(), FileError> {
        match &self.file {
            Some(file) => fs::write(file, &self.content).map_err(FileError),
            None => Ok(()),
        }
    }

    fn part(&mut self, from: u32, to: u32) -> Result<&mut [u8], FileError> {
        let outside = || FileError(io::Error::from(io::ErrorKind::InvalidInput));
        self.content
            .get_mut(from as usize..to as usize)
            .ok_or_else(outside)
    }
}

impl ErrorType for SimulatedFlash {
    type Error = FileError;
}

impl ReadNorFlash for SimulatedFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FileError> {
        let mut chip = self.0.borrow_mut();
        bytes.copy_from_slice(chip.part(offset, offset + bytes.len() as u32)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for SimulatedFlash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FileError> {
        let mut chip = self.0.borrow_mut();
        chip.part(from, to)?.fill(ERASED);
        chip.save()
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FileError> {
        let mut chip = self.0.borrow_mut();
        let part = chip.part(offset, offset + bytes.len() as u32)?;
        for (cell, byte) in part.iter_mut().zip(bytes) {
            *cell &= byte;
        }
        chip.save()
    }
}
