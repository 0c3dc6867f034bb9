//! The parameters' part of the flash, in memory and optionally in a file.

use std::fs;
use std::io;
use std::path::PathBuf;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// Four sectors, as on the board.
const SECTOR_BYTES: usize = 4096;
const FLASH_BYTES: usize = 4 * SECTOR_BYTES;

const ERASED: u8 = 0xff;

/// A flash chip that behaves as NOR flash does: programming clears bits, only erasing a sector sets them.
#[derive(Debug)]
pub struct SimulatedFlash {
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
            Some(Ok(_)) => {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    "it is not a flash image",
                ));
            }
            Some(Err(error)) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            Some(Err(_)) | None => vec![ERASED; FLASH_BYTES],
        };
        Ok(Self { content, file })
    }

    /// Where the parameters are: everywhere.
    pub fn range(&self) -> std::ops::Range<u32> {
        0..FLASH_BYTES as u32
    }

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
        let part = self.part(offset, offset + bytes.len() as u32)?;
        bytes.copy_from_slice(part);
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
        self.part(from, to)?.fill(ERASED);
        self.save()
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FileError> {
        let part = self.part(offset, offset + bytes.len() as u32)?;
        for (cell, byte) in part.iter_mut().zip(bytes) {
            *cell &= byte;
        }
        self.save()
    }
}
