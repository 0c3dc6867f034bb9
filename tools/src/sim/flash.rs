//! Simulated flash chip behind Wi-Fi's networks ([`flash_map`]), in memory and optionally in a file.

use std::cell::RefMut;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use nor_flash::{FlashModel, Reprogramming, SharedFlash};
use rover_battmon::memory::flash_map;
use rover_battmon::recorder::{LogSource, ReadFailed};

/// The image has neither the program nor what only a board with a radio stores. It begins where the program's constants are on a
/// board, as the log did once: files of that time are still read.
const IMAGE: Range<u32> = flash_map::CONSTANTS.start..flash_map::CHIP_BYTES;
const IMAGE_BYTES: usize = (IMAGE.end - IMAGE.start) as usize;

const SECTOR_BYTES: usize = flash_map::SECTOR_BYTES as usize;
const PAGE_BYTES: usize = 256;
const SECTORS: usize = IMAGE_BYTES / SECTOR_BYTES;
const FIRST_SECTOR: usize = IMAGE.start as usize / SECTOR_BYTES;

/// The part of a board's chip that is simulated.
pub type ChipModel = FlashModel<SECTOR_BYTES, PAGE_BYTES, SECTORS, FIRST_SECTOR>;

/// A board's flash chip. A clone is the same chip.
#[derive(Clone, Debug)]
pub struct SimulatedFlash {
    chip: SharedFlash<SECTOR_BYTES, PAGE_BYTES, SECTORS, FIRST_SECTOR>,
    file: Option<Rc<ImageFile>>,
}

/// The chip has failed, or the image file can't be written.
#[derive(Debug)]
pub struct FlashError(pub io::Error);

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl SimulatedFlash {
    /// An erased chip, in memory only.
    pub fn blank() -> Self {
        let chip = SharedFlash::blank();
        // An image may have anything where nothing is expected.
        chip.chip().reprogramming = Reprogramming::ClearsBits;
        Self { chip, file: None }
    }

    /// A chip whose content is kept in `file`, if given; a missing file is an erased chip.
    ///
    /// The file is locked until the last clone is dropped.
    ///
    /// # Errors
    /// The file can't be read or written, is not a flash image, or is locked by another chip.
    pub fn open(file: Option<PathBuf>) -> io::Result<Self> {
        let mut flash = Self::blank();
        let Some(path) = file else {
            return Ok(flash);
        };
        let file = ImageFile::lock(&path)?;
        match file.read()? {
            Some(content) if content.len() == IMAGE_BYTES => flash.chip().region().copy_from_slice(&content),
            Some(_) => return Err(io::Error::new(ErrorKind::InvalidData, "it is not a flash image")),
            None => file.replace(flash.chip().region())?,
        }
        flash.file = Some(Rc::new(file));
        Ok(flash)
    }

    /// The chip itself: its counters, and faults to inject.
    pub fn chip(&self) -> RefMut<'_, ChipModel> {
        self.chip.chip()
    }

    /// The content of a range of the chip.
    ///
    /// # Panics
    /// The range is not simulated.
    pub fn content(&self, range: Range<u32>) -> Vec<u8> {
        self.part(range).expect("it is simulated")
    }

    /// The content of a range.
    fn part(&self, range: Range<u32>) -> Result<Vec<u8>, FlashError> {
        let place = place(range)?;
        Ok(self.chip().region()[place].to_vec())
    }

    /// Writes a range that has changed to the file. If that fails, the chip has what it had `before`.
    fn keep(&self, from: u32, before: &[u8]) -> Result<(), FlashError> {
        let Some(file) = &self.file else {
            return Ok(());
        };
        let place = place(from..from + before.len() as u32)?;
        let mut chip = self.chip();
        let content = chip.region();
        let written = if flash_map::LOG.contains(&from) {
            // The log is written often, and may lose its end.
            file.overwrite(place.start as u64, &content[place.clone()])
        } else {
            file.replace(content)
        };
        if written.is_err() {
            content[place].copy_from_slice(before);
        }
        written.map_err(FlashError)
    }
}

/// Place of a range of the chip in the image.
fn place(range: Range<u32>) -> Result<Range<usize>, FlashError> {
    if range.start < IMAGE.start || range.start > range.end || range.end > IMAGE.end {
        return Err(FlashError(ErrorKind::InvalidInput.into()));
    }
    Ok((range.start - IMAGE.start) as usize..(range.end - IMAGE.start) as usize)
}

fn failed(error: impl NorFlashError) -> FlashError {
    FlashError(io::Error::other(format!("{error:?}")))
}

impl LogSource for SimulatedFlash {
    fn read_log(&self, address: u32, bytes: &mut [u8]) -> Result<(), ReadFailed> {
        let place = place(address..address.saturating_add(bytes.len() as u32)).map_err(|_| ReadFailed)?;
        bytes.copy_from_slice(&self.chip().region()[place]);
        Ok(())
    }
}

impl ErrorType for SimulatedFlash {
    type Error = FlashError;
}

impl ReadNorFlash for SimulatedFlash {
    const READ_SIZE: usize = 4;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        place(offset..offset + bytes.len() as u32)?;
        self.chip.read(offset, bytes).await.map_err(failed)
    }

    fn capacity(&self) -> usize {
        IMAGE.end as usize
    }
}

impl NorFlash for SimulatedFlash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let before = self.part(from..to)?;
        let erased = self.chip.erase(from, to).await.map_err(failed);
        erased.and(self.keep(from, &before))
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let before = self.part(offset..offset + bytes.len() as u32)?;
        let written = self.chip.write(offset, bytes).await.map_err(failed);
        written.and(self.keep(offset, &before))
    }
}

/// An image file that is locked against other processes. All but the log is replaced atomically.
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

    /// Overwrites a part of the image in its place.
    fn overwrite(&self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        let mut image = OpenOptions::new().write(true).open(&self.path)?;
        image.seek(SeekFrom::Start(offset))?;
        image.write_all(bytes)
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
    use embassy_futures::block_on;

    use super::super::test_folder::Folder;
    use super::*;

    impl Folder {
        fn image(&self) -> PathBuf {
            self.0.join("flash.bin")
        }

        fn open(&self) -> io::Result<SimulatedFlash> {
            SimulatedFlash::open(Some(self.image()))
        }
    }

    const ERASED: u8 = 0xff;

    fn byte_at(flash: &SimulatedFlash, address: u32) -> u8 {
        flash.content(address..address + 1)[0]
    }

    /// The first parameter's place, and the first of the log.
    const PARAMETER: u32 = flash_map::PARAMETERS.start;
    const LOG: u32 = flash_map::LOG.start;

    /// The byte at an address, in the image.
    fn in_image(folder: &Folder, address: u32) -> u8 {
        fs::read(folder.image()).unwrap()[place(address..address + 1).unwrap().start]
    }

    #[test]
    fn content_is_kept_in_the_file() {
        for address in [LOG, flash_map::LOG.end - 2, PARAMETER, flash_map::CHIP_BYTES - 2] {
            let folder = Folder::new();
            let mut flash = folder.open().unwrap();
            block_on(flash.write(address, &[1])).unwrap();
            drop(flash);
            let flash = folder.open().unwrap();
            let found = [address, address + 1].map(|address| byte_at(&flash, address));
            assert_eq!(found, [1, ERASED], "{address}");
        }
    }

    #[test]
    fn a_file_of_the_time_when_the_log_began_further_ahead_is_read() {
        let folder = Folder::new();
        fs::write(folder.image(), [ERASED; 1280 * 1024]).unwrap();
        assert!(folder.open().is_ok());
    }

    #[test]
    fn program_and_what_is_beyond_the_chip_are_outside() {
        let mut flash = SimulatedFlash::open(None).unwrap();
        for address in [0, IMAGE.start - 1, flash_map::CHIP_BYTES] {
            assert!(block_on(flash.read(address, &mut [0; 4])).is_err());
            assert!(block_on(flash.write(address, &[0])).is_err());
        }
    }

    #[test]
    fn log_is_written_in_place_and_is_kept_when_the_image_is_replaced() {
        let folder = Folder::new();
        let mut flash = folder.open().unwrap();
        let mut before = File::open(folder.image()).unwrap();
        block_on(flash.write(LOG + 3, &[7])).unwrap();
        let mut image = Vec::new();
        before.read_to_end(&mut image).unwrap();
        let logged = image[place(LOG + 3..LOG + 4).unwrap().start];
        assert_eq!((image.len(), logged), (IMAGE_BYTES, 7), "the same file");
        block_on(flash.write(PARAMETER, &[8])).unwrap();
        assert_eq!((in_image(&folder, LOG + 3), in_image(&folder, PARAMETER)), (7, 8));
        block_on(flash.erase(LOG, LOG + flash_map::SECTOR_BYTES)).unwrap();
        assert_eq!(
            (in_image(&folder, LOG + 3), in_image(&folder, PARAMETER)),
            (ERASED, 8)
        );
    }

    #[test]
    fn failed_write_of_the_log_changes_nothing_in_memory() {
        let folder = Folder::new();
        let mut flash = folder.open().unwrap();
        fs::remove_file(folder.image()).unwrap();
        assert!(block_on(flash.write(LOG, &[0x30])).is_err());
        assert_eq!(byte_at(&flash, LOG), ERASED);
    }

    #[test]
    fn image_is_replaced_atomically() {
        let (folder, mut flash) = written();
        let mut before = File::open(folder.image()).unwrap();
        block_on(flash.write(PARAMETER + 1, &[0x30])).unwrap();
        let mut image = Vec::new();
        before.read_to_end(&mut image).unwrap();
        let parameter = image[place(PARAMETER + 1..PARAMETER + 2).unwrap().start];
        assert_eq!((image.len(), parameter), (IMAGE_BYTES, ERASED));
        assert_eq!(in_image(&folder, PARAMETER + 1), 0x30);
    }

    /// A chip whose first byte of parameters is written.
    fn written() -> (Folder, SimulatedFlash) {
        let folder = Folder::new();
        let mut flash = folder.open().unwrap();
        block_on(flash.write(PARAMETER, &[0xf0])).unwrap();
        (folder, flash)
    }

    #[test]
    fn interrupted_write_leaves_the_previous_image() {
        let (folder, flash) = written();
        drop(flash);
        fs::write(beside(&folder.image(), ".next"), [0; 100]).unwrap();
        let mut flash = folder.open().unwrap();
        assert_eq!(byte_at(&flash, PARAMETER), 0xf0);
        block_on(flash.write(PARAMETER + 1, &[0x30])).unwrap();
    }

    #[test]
    fn failed_file_write_changes_nothing_in_memory() {
        let (folder, mut flash) = written();
        // A folder with the temporary file's name makes the write fail.
        let obstacle = beside(&folder.image(), ".next");
        fs::create_dir(&obstacle).unwrap();
        assert!(block_on(flash.write(PARAMETER + 1, &[0x30])).is_err());
        assert!(block_on(flash.erase(PARAMETER, PARAMETER + flash_map::SECTOR_BYTES)).is_err());
        assert_eq!(byte_at(&flash, PARAMETER), 0xf0);
        assert_eq!(in_image(&folder, PARAMETER), 0xf0);

        fs::remove_dir(&obstacle).unwrap();
        assert_eq!(byte_at(&flash, PARAMETER + 1), ERASED);
        block_on(flash.write(PARAMETER + 1, &[0x30])).unwrap();
        assert_eq!(byte_at(&flash, PARAMETER + 1), 0x30);
    }

    #[test]
    fn file_is_locked_under_every_path() {
        let (folder, flash) = written();
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
        for path in [folder.0.join("missing/flash.bin"), folder.0.clone(), "/".into()] {
            let opened = SimulatedFlash::open(Some(path.clone()));
            assert!(opened.is_err(), "{}", path.display());
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
        fs::write(folder.image(), [ERASED; IMAGE_BYTES]).unwrap();
        fs::set_permissions(folder.image(), fs::Permissions::from_mode(0o600)).unwrap();
        let link = folder.0.join("link");
        symlink(folder.image(), &link).unwrap();
        let mut flash = SimulatedFlash::open(Some(link.clone())).unwrap();
        block_on(flash.write(PARAMETER, &[0xf0])).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(
            fs::metadata(folder.image()).unwrap().permissions().mode() & 0o777,
            0o600
        );
        assert_eq!(in_image(&folder, PARAMETER), 0xf0);
    }
}
