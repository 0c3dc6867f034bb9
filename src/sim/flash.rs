//! Simulated flash for parameters, signing and what is learnt of the packs, in memory and optionally in a file.

use std::cell::RefCell;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// As on the board: four sectors for the parameters, two for signing, four for what is learnt of the packs.
const SECTOR_BYTES: usize = 4096;
const PARAMETER_BYTES: usize = 4 * SECTOR_BYTES;
const SIGNING_BYTES: usize = 2 * SECTOR_BYTES;
const LEARNT_BYTES: usize = 4 * SECTOR_BYTES;
const LEARNT_AT: usize = PARAMETER_BYTES + SIGNING_BYTES;
const FLASH_BYTES: usize = LEARNT_AT + LEARNT_BYTES;

const ERASED: u8 = 0xff;

/// NOR flash: programming clears bits, erasing a sector sets them.
///
/// A clone is the same chip.
#[derive(Clone, Debug)]
pub struct SimulatedFlash(Rc<RefCell<Chip>>);

#[derive(Debug)]
struct Chip {
    content: Vec<u8>,
    file: Option<ImageFile>,
}

/// The image file can't be written.
#[derive(Debug)]
pub struct FileError(pub io::Error);

impl NorFlashError for FileError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl SimulatedFlash {
    /// A chip whose content is kept in `file`, if given; a missing file is an erased chip.
    ///
    /// The file is locked until the last clone is dropped.
    ///
    /// # Errors
    /// The file can't be read or written, is no flash image, or is locked by another chip.
    pub fn open(file: Option<PathBuf>) -> io::Result<Self> {
        let (file, content) = match file {
            Some(path) => {
                let file = ImageFile::lock(&path)?;
                let content = file.read()?;
                (Some(file), content)
            }
            None => (None, None),
        };
        let content = match content {
            Some(content) => chip_content(content)?,
            None => vec![ERASED; FLASH_BYTES],
        };
        Ok(Self(Rc::new(RefCell::new(Chip { content, file }))))
    }

    /// Address range of the parameters.
    pub const PARAMETERS: Range<u32> = 0..PARAMETER_BYTES as u32;

    /// Address range of the signing key.
    pub const SIGNING: Range<u32> = PARAMETER_BYTES as u32..LEARNT_AT as u32;

    /// Address range of what is learnt of the packs.
    pub const LEARNT: Range<u32> = LEARNT_AT as u32..FLASH_BYTES as u32;
}

/// Chip content from an image.
fn chip_content(mut image: Vec<u8>) -> io::Result<Vec<u8>> {
    match image.len() {
        FLASH_BYTES => {}
        // Written by a version without signing, or without learning.
        PARAMETER_BYTES | LEARNT_AT => image.resize(FLASH_BYTES, ERASED),
        _ => return Err(io::Error::new(ErrorKind::InvalidData, "it is not a flash image")),
    }
    Ok(image)
}

impl Chip {
    /// Changes a range, first in the file: if that fails, nothing changes.
    fn change(&mut self, from: u32, to: u32, change: impl FnOnce(&mut [u8])) -> Result<(), FileError> {
        let mut content = self.content.clone();
        let part = content.get_mut(from as usize..to as usize);
        change(part.ok_or_else(outside)?);
        if let Some(file) = &self.file {
            file.replace(&content).map_err(FileError)?;
        }
        self.content = content;
        Ok(())
    }
}

fn outside() -> FileError {
    FileError(ErrorKind::InvalidInput.into())
}

impl ErrorType for SimulatedFlash {
    type Error = FileError;
}

impl ReadNorFlash for SimulatedFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FileError> {
        let chip = self.0.borrow();
        let part = offset as usize..offset as usize + bytes.len();
        bytes.copy_from_slice(chip.content.get(part).ok_or_else(outside)?);
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
        chip.change(from, to, |part| part.fill(ERASED))
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FileError> {
        let mut chip = self.0.borrow_mut();
        chip.change(offset, offset + bytes.len() as u32, |part| {
            for (cell, byte) in part.iter_mut().zip(bytes) {
                *cell &= byte;
            }
        })
    }
}

/// An image file that is replaced atomically and locked against other processes.
#[derive(Debug)]
struct ImageFile {
    path: PathBuf,
    /// Temporary file of the next image, renamed over the previous one.
    next: PathBuf,
    /// Lock file: a lock on the image itself would be lost when that is replaced.
    _lock: File,
}

impl ImageFile {
    /// Locks the file at `path`, which need not exist yet.
    fn lock(path: &Path) -> io::Result<Self> {
        let path = resolved(path)?;
        if path.exists() && !path.is_file() {
            return Err(io::Error::new(ErrorKind::InvalidInput, "it is not a file"));
        }
        let lock = File::create(beside(&path, ".lock"))?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => io::Error::new(ErrorKind::ResourceBusy, "another simulator uses it"),
            TryLockError::Error(error) => error,
        })?;
        Ok(Self {
            next: beside(&path, ".next"),
            path,
            _lock: lock,
        })
    }

    /// The image; `None` if there is none yet.
    fn read(&self) -> io::Result<Option<Vec<u8>>> {
        // A write-protected file must not be replaced either.
        let mut file = match OpenOptions::new().read(true).write(true).open(&self.path) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error),
        };
        let mut image = Vec::new();
        file.read_to_end(&mut image)?;
        Ok(Some(image))
    }

    /// Replaces the image atomically.
    fn replace(&self, image: &[u8]) -> io::Result<()> {
        let mut next = File::create(&self.next)?;
        // It may contain a key, so the permissions are kept.
        if let Ok(last) = fs::metadata(&self.path) {
            next.set_permissions(last.permissions())?;
        }
        next.write_all(image)?;
        // The content must be on disk before the rename, in case of a system crash.
        next.sync_all()?;
        fs::rename(&self.next, &self.path)
    }
}

/// Canonical path of the file, which need not exist.
fn resolved(path: &Path) -> io::Result<PathBuf> {
    if let Ok(existing) = fs::canonicalize(path) {
        return Ok(existing);
    }
    let name = path
        .file_name()
        .ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "it has no file name"))?;
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let folder = fs::canonicalize(folder)
        .map_err(|error| io::Error::new(error.kind(), format!("its folder can't be used: {error}")))?;
    Ok(folder.join(name))
}

fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(suffix);
    name.into()
}

#[cfg(test)]
mod tests {
    use std::env::temp_dir;
    use std::process;
    use std::sync::atomic::{AtomicU32, Ordering};

    use embassy_futures::block_on;

    use super::*;

    /// Temporary folder of a test, removed on drop.
    struct Folder(PathBuf);

    impl Folder {
        fn new() -> Self {
            static NUMBER: AtomicU32 = AtomicU32::new(0);
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let path = temp_dir().join(format!("rover-battmon-flash-{}-{number}", process::id()));
            fs::create_dir(&path).expect("a new folder");
            Self(path)
        }

        fn image(&self) -> PathBuf {
            self.0.join("flash.bin")
        }

        fn open(&self) -> io::Result<SimulatedFlash> {
            SimulatedFlash::open(Some(self.image()))
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn byte_at(flash: &mut SimulatedFlash, offset: u32) -> u8 {
        let mut byte = [0];
        block_on(flash.read(offset, &mut byte)).expect("in range");
        byte[0]
    }

    #[test]
    fn content_is_kept_in_the_file() {
        let folder = Folder::new();
        let mut flash = folder.open().unwrap();
        block_on(flash.write(5, &[1])).unwrap();
        drop(flash);
        let mut flash = folder.open().unwrap();
        assert_eq!((byte_at(&mut flash, 5), byte_at(&mut flash, 6)), (1, ERASED));
    }

    #[test]
    fn image_of_an_earlier_version_keeps_its_content() {
        for bytes in [PARAMETER_BYTES, LEARNT_AT] {
            let folder = Folder::new();
            fs::write(folder.image(), vec![7; bytes]).unwrap();
            let mut flash = folder.open().unwrap();
            assert_eq!(byte_at(&mut flash, bytes as u32 - 1), 7);
            assert_eq!(byte_at(&mut flash, bytes as u32), ERASED);
            assert_eq!(byte_at(&mut flash, FLASH_BYTES as u32 - 1), ERASED);
        }
    }

    #[test]
    fn image_is_replaced_atomically() {
        let folder = Folder::new();
        let mut flash = folder.open().unwrap();
        block_on(flash.write(0, &[0xf0])).unwrap();
        let mut before = File::open(folder.image()).unwrap();
        block_on(flash.write(0, &[0x30])).unwrap();
        let mut image = Vec::new();
        before.read_to_end(&mut image).unwrap();
        assert_eq!((image.len(), image[0]), (FLASH_BYTES, 0xf0));
        assert_eq!(fs::read(folder.image()).unwrap()[0], 0x30);
    }

    #[test]
    fn interrupted_write_leaves_the_previous_image() {
        let folder = Folder::new();
        let mut flash = folder.open().unwrap();
        block_on(flash.write(0, &[0xf0])).unwrap();
        drop(flash);
        fs::write(beside(&folder.image(), ".next"), [0; 100]).unwrap();
        let mut flash = folder.open().unwrap();
        assert_eq!(byte_at(&mut flash, 0), 0xf0);
        block_on(flash.write(0, &[0x30])).unwrap();
    }

    #[test]
    fn failed_file_write_changes_nothing_in_memory() {
        let folder = Folder::new();
        let mut flash = folder.open().unwrap();
        block_on(flash.write(0, &[0xf0])).unwrap();
        // A folder with the temporary file's name makes the write fail.
        let obstacle = beside(&folder.image(), ".next");
        fs::create_dir(&obstacle).unwrap();
        assert!(block_on(flash.write(0, &[0x30])).is_err());
        assert!(block_on(flash.erase(0, SECTOR_BYTES as u32)).is_err());
        assert_eq!(byte_at(&mut flash, 0), 0xf0);
        assert_eq!(fs::read(folder.image()).unwrap()[0], 0xf0);

        fs::remove_dir(&obstacle).unwrap();
        block_on(flash.write(0, &[0x30])).unwrap();
        assert_eq!(byte_at(&mut flash, 0), 0x30);
    }

    #[test]
    fn file_is_locked_under_every_path() {
        let folder = Folder::new();
        let mut flash = folder.open().unwrap();
        block_on(flash.write(0, &[0xf0])).unwrap();
        let detour = folder
            .0
            .join("../")
            .join(folder.0.file_name().unwrap())
            .join("flash.bin");
        for path in [folder.image(), detour] {
            let error = SimulatedFlash::open(Some(path)).unwrap_err();
            assert_eq!(error.to_string(), "another simulator uses it");
        }
        let clone = flash.clone();
        drop(flash);
        assert!(folder.open().is_err(), "a clone is the same chip");
        drop(clone);
        assert!(folder.open().is_ok());
    }

    #[test]
    fn missing_folder_or_folder_as_file_is_an_error() {
        let folder = Folder::new();
        for path in [
            folder.0.join("missing/flash.bin"),
            folder.0.clone(),
            PathBuf::from("/"),
        ] {
            assert!(
                SimulatedFlash::open(Some(path.clone())).is_err(),
                "{}",
                path.display()
            );
        }
    }

    #[test]
    fn file_that_is_no_image_is_refused_and_unchanged() {
        let folder = Folder::new();
        fs::write(folder.image(), "a shopping list").unwrap();
        let error = folder.open().unwrap_err();
        assert_eq!(error.to_string(), "it is not a flash image");
        assert_eq!(fs::read(folder.image()).unwrap(), b"a shopping list");
    }

    #[cfg(unix)]
    #[test]
    fn image_keeps_permissions_and_symlinks() {
        use std::os::unix::fs::{PermissionsExt, symlink};

        let folder = Folder::new();
        drop(folder.open().unwrap());
        fs::write(folder.image(), [ERASED; FLASH_BYTES]).unwrap();
        fs::set_permissions(folder.image(), fs::Permissions::from_mode(0o600)).unwrap();
        let link = folder.0.join("link");
        symlink(folder.image(), &link).unwrap();
        let mut flash = SimulatedFlash::open(Some(link.clone())).unwrap();
        block_on(flash.write(0, &[0xf0])).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(
            fs::metadata(folder.image()).unwrap().permissions().mode() & 0o777,
            0o600
        );
        assert_eq!(fs::read(folder.image()).unwrap()[0], 0xf0);
    }
}
