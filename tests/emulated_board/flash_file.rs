//! A file with the content of the board's flash chip.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::PathBuf;

use support::parameter_flash;
use workbench::bench::PARAMETER_OFFSET;

const CHIP_BYTES: usize = 2 * 1024 * 1024;

pub struct FlashFile {
    path: Option<PathBuf>,
    /// The whole chip.
    pub content: Vec<u8>,
}

impl FlashFile {
    /// The content of the file, if one is given. A missing one is an erased chip, but for the parameters of every bench, and is
    /// written at once: one that can't be written is refused before a board runs for hours.
    pub fn open(path: Option<PathBuf>) -> io::Result<Self> {
        let content = match path.as_ref().map(fs::read) {
            Some(Ok(content)) if content.len() == CHIP_BYTES => content,
            Some(Ok(_)) => return Err(io::Error::new(ErrorKind::InvalidData, "it does not have 2 MiB")),
            Some(Err(error)) if error.kind() != ErrorKind::NotFound => return Err(error),
            Some(Err(_)) | None => new_chip(),
        };
        let mut file = Self { path, content };
        file.write(file.content.clone())?;
        Ok(file)
    }

    /// Replaces the content.
    pub fn write(&mut self, content: Vec<u8>) -> io::Result<()> {
        self.content = content;
        match &self.path {
            Some(path) => fs::write(path, &self.content),
            None => Ok(()),
        }
    }
}

fn new_chip() -> Vec<u8> {
    let parameters = parameter_flash::flash_with([]);
    let mut content = vec![0xff; CHIP_BYTES];
    content[PARAMETER_OFFSET as usize..][..parameters.len()].copy_from_slice(&parameters);
    content
}
