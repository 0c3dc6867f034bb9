//! Log files in a folder of the host, as ArduPilot's simulator writes them.

use std::collections::{HashMap, HashSet};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Seek, Write};
use std::path::PathBuf;

use embassy_futures::block_on;
use rover_battmon::memory::flash_map;
use rover_battmon::recorder::{LogSource, Ring};

use super::SimulatedFlash;

/// A folder with a copy of each log file that has begun in the flash since the folder was opened: `00000001.BIN` and so
/// on.
///
/// Numbers continue after those of the files that are there, and are not those in the flash.
#[derive(Debug)]
pub struct LogFolder {
    path: PathBuf,
    flash: SimulatedFlash,
    /// The files in the flash, by number; without a copy if they began before the folder was opened.
    known: HashMap<u16, Option<(PathBuf, File)>>,
    next_number: u32,
    /// Files whose latest copy has failed.
    behind: HashSet<u16>,
    /// A file was erased before all of it was copied.
    has_lost: bool,
}

impl LogFolder {
    /// Opens the folder at `path` for the log in `flash`. It is created if it is missing.
    ///
    /// # Errors
    /// It can't be created or read.
    pub fn open(path: PathBuf, flash: SimulatedFlash) -> io::Result<Self> {
        fs::create_dir_all(&path)?;
        let mut newest = 0;
        for entry in fs::read_dir(&path)? {
            newest = newest.max(log_number(&entry?.file_name()).unwrap_or(0));
        }
        let mut folder = Self {
            path,
            flash,
            known: HashMap::new(),
            next_number: newest + 1,
            behind: HashSet::new(),
            has_lost: false,
        };
        let ring = folder.ring();
        folder.known = ring.files().iter().map(|file| (file.number, None)).collect();
        Ok(folder)
    }

    /// Copies what was written to the flash since the last time that this succeeded.
    ///
    /// # Errors
    /// A file can't be written now, or its content is lost since it could not be before.
    pub fn update(&mut self) -> io::Result<()> {
        let ring = self.ring();
        let is_there = |number: u16| ring.files().iter().any(|file| file.number == number);
        self.has_lost |= self.behind.iter().any(|number| !is_there(*number));
        // After an erase and a restart numbers come again.
        self.known.retain(|number, _| is_there(*number));
        self.behind.clear();
        let mut failure = None;
        for file in ring.files() {
            if let Err(error) = self.copy(file.number, &ring) {
                self.behind.insert(file.number);
                failure = Some(error);
            }
        }
        match failure {
            Some(error) => Err(error),
            None if self.has_lost => Err(io::Error::other("a log was erased before it was copied")),
            None => Ok(()),
        }
    }

    fn copy(&mut self, number: u16, ring: &Ring) -> io::Result<()> {
        if !self.known.contains_key(&number) {
            let copy = self.new_copy()?;
            self.known.insert(number, Some(copy));
        }
        let Some(Some((path, copy))) = self.known.get_mut(&number) else {
            return Ok(());
        };
        if !path.exists() {
            // It was removed, perhaps with its folder: all of it once more.
            *copy = File::create_new(path)?;
        }
        extend(copy, number, ring, &self.flash)
    }

    /// Present content of the flash.
    fn ring(&mut self) -> Ring {
        block_on(Ring::scan(&mut self.flash, flash_map::LOG))
    }

    /// With the next number that is free.
    fn new_copy(&mut self) -> io::Result<(PathBuf, File)> {
        loop {
            let name = format!("{:08}.BIN", self.next_number);
            let path = self.path.join(name);
            match File::create_new(&path) {
                // Another simulator uses the folder.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => self.next_number += 1,
                Err(error) => return Err(error),
                Ok(copy) => {
                    self.next_number += 1;
                    return Ok((path, copy));
                }
            }
        }
    }
}

/// Appends to a copy what the flash holds beyond its end.
fn extend(copy: &mut File, number: u16, ring: &Ring, flash: &SimulatedFlash) -> io::Result<()> {
    while let Some(piece) = ring.locate(number, copy.stream_position()? as u32) {
        let mut bytes = vec![0; piece.bytes as usize];
        let read = flash.read_log(piece.address, &mut bytes);
        read.map_err(|_| io::Error::other("the flash can't be read"))?;
        copy.write_all(&bytes)?;
    }
    Ok(())
}

/// The number of a log file with this name.
fn log_number(name: &OsStr) -> Option<u32> {
    let digits = name
        .to_str()?
        .strip_suffix(".BIN")
        .filter(|digits| digits.len() == 8)?;
    digits.parse().ok()
}

#[cfg(test)]
mod tests {
    use embedded_storage_async::nor_flash::NorFlash;

    use super::super::test_folder::Folder;
    use super::*;

    /// A flash with a log that is written by the recorder's own means.
    struct Recorder {
        flash: SimulatedFlash,
        ring: Ring,
    }

    impl Recorder {
        fn new() -> Self {
            let flash = SimulatedFlash::open(None).unwrap();
            let ring = Ring::new(flash_map::LOG);
            let mut recorder = Self { flash, ring };
            recorder.erase_ahead();
            recorder
        }

        fn erase_ahead(&mut self) {
            while let Some(erasure) = self.ring.next_erase(10) {
                block_on(self.flash.write(erasure.mark_address(), &erasure.mark())).unwrap();
                self.ring.erased(erasure, Ok(()));
            }
        }

        /// Begins a file with this content.
        fn begin(&mut self, content: &[u8]) {
            self.ring.open().unwrap();
            self.append(content);
        }

        fn append(&mut self, mut content: &[u8]) {
            while !content.is_empty() {
                let program = self.ring.next_program(content).unwrap();
                block_on(self.flash.write(program.address(), program.bytes())).unwrap();
                let appended = self.ring.programmed(Ok(()));
                content = &content[appended..];
            }
        }

        /// Everything is erased, and the next file is the first again.
        fn erase_and_restart(&mut self) {
            let (from, to) = (flash_map::LOG.start, flash_map::LOG.end);
            block_on(self.flash.erase(from, to)).unwrap();
            self.ring = Ring::new(flash_map::LOG);
            self.erase_ahead();
        }

        fn folder(&self, folder: &Folder) -> LogFolder {
            LogFolder::open(folder.0.clone(), self.flash.clone()).unwrap()
        }
    }

    /// Names and contents of a folder's files.
    fn files(folder: &Folder) -> Vec<(String, Vec<u8>)> {
        let entries = fs::read_dir(&folder.0).unwrap().map(Result::unwrap);
        let mut files: Vec<_> = entries
            .map(|entry| {
                let name = entry.file_name().into_string().unwrap();
                (name, fs::read(entry.path()).unwrap())
            })
            .collect();
        files.sort();
        files
    }

    fn file(name: &str, content: &[u8]) -> (String, Vec<u8>) {
        (name.into(), content.into())
    }

    #[test]
    fn files_are_copied_as_they_grow() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        let mut copies = recorder.folder(&folder);
        let content: Vec<u8> = (0..10_000_u32).map(|i| (i % 251) as u8).collect();
        recorder.begin(&[]);
        for part in content.chunks(3500) {
            recorder.append(part);
            copies.update().unwrap();
            copies.update().unwrap();
        }
        recorder.begin(b"second");
        copies.update().unwrap();
        assert_eq!(
            files(&folder),
            [file("00000001.BIN", &content), file("00000002.BIN", b"second")]
        );
    }

    #[test]
    fn numbers_continue_after_those_that_are_there() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        let there = ["00000007.BIN", "00000009.txt", "12.BIN"].map(|name| file(name, b"old"));
        for (name, content) in &there {
            fs::write(folder.0.join(name), content).unwrap();
        }
        let mut copies = recorder.folder(&folder);
        recorder.begin(b"new");
        copies.update().unwrap();
        let [seven, nine, twelve] = there;
        assert_eq!(
            files(&folder),
            [seven, file("00000008.BIN", b"new"), nine, twelve]
        );
    }

    #[test]
    fn file_that_came_meanwhile_is_not_overwritten() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        let mut copies = recorder.folder(&folder);
        fs::write(folder.0.join("00000001.BIN"), "another simulator's").unwrap();
        recorder.begin(b"new");
        copies.update().unwrap();
        let other = file("00000001.BIN", b"another simulator's");
        assert_eq!(files(&folder), [other, file("00000002.BIN", b"new")]);
    }

    #[test]
    fn files_of_earlier_runs_are_not_copied() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        recorder.begin(b"of yesterday");
        let mut copies = recorder.folder(&folder);
        copies.update().unwrap();
        assert_eq!(files(&folder), []);
        recorder.begin(b"of today");
        copies.update().unwrap();
        assert_eq!(files(&folder), [file("00000001.BIN", b"of today")]);
    }

    #[test]
    fn number_that_comes_again_after_an_erase_is_another_file() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        let mut copies = recorder.folder(&folder);
        recorder.begin(b"first");
        copies.update().unwrap();
        recorder.erase_and_restart();
        copies.update().unwrap();
        recorder.begin(b"first again");
        copies.update().unwrap();
        assert_eq!(
            files(&folder),
            [
                file("00000001.BIN", b"first"),
                file("00000002.BIN", b"first again")
            ]
        );
    }

    #[test]
    fn copy_that_was_removed_is_made_once_more() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        let mut copies = recorder.folder(&folder);
        recorder.begin(b"first, ");
        copies.update().unwrap();
        fs::remove_dir_all(&folder.0).unwrap();
        recorder.append(b"second");
        assert!(copies.update().is_err());
        fs::create_dir(&folder.0).unwrap();
        copies.update().unwrap();
        assert_eq!(files(&folder), [file("00000001.BIN", b"first, second")]);
    }

    #[test]
    fn folder_that_vanished_is_an_error() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        let mut copies = recorder.folder(&folder);
        fs::remove_dir(&folder.0).unwrap();
        recorder.begin(b"new");
        assert!(copies.update().is_err());
    }

    #[test]
    fn copy_that_failed_is_made_up_for() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        let mut copies = recorder.folder(&folder);
        fs::remove_dir(&folder.0).unwrap();
        recorder.begin(b"begun");
        copies.update().unwrap_err();
        recorder.append(b" and gone on");
        fs::create_dir(&folder.0).unwrap();
        copies.update().unwrap();
        assert_eq!(files(&folder), [file("00000001.BIN", b"begun and gone on")]);
    }

    #[test]
    fn log_that_was_erased_before_it_was_copied_is_an_error_from_then_on() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        let mut copies = recorder.folder(&folder);
        recorder.begin(b"copied");
        copies.update().unwrap();
        fs::remove_dir_all(&folder.0).unwrap();
        recorder.begin(b"not copied");
        copies.update().unwrap_err();
        recorder.erase_and_restart();
        fs::create_dir(&folder.0).unwrap();
        copies.update().unwrap_err();
        copies.update().unwrap_err();
    }

    #[test]
    fn log_that_was_copied_may_be_erased_while_another_is_not() {
        let (folder, mut recorder) = (Folder::new(), Recorder::new());
        let mut copies = recorder.folder(&folder);
        recorder.begin(b"copied");
        copies.update().unwrap();
        fs::remove_dir_all(&folder.0).unwrap();
        recorder.erase_and_restart();
        copies.update().unwrap();
        recorder.begin(b"not copied");
        copies.update().unwrap_err();
        fs::create_dir(&folder.0).unwrap();
        copies.update().unwrap();
    }

    #[test]
    fn folder_is_created_unless_a_file_is_in_its_place() {
        let (folder, recorder) = (Folder::new(), Recorder::new());
        let path = folder.0.join("new/logs");
        LogFolder::open(path.clone(), recorder.flash.clone()).unwrap();
        assert!(path.is_dir());
        let taken = folder.0.join("file");
        fs::write(&taken, "").unwrap();
        assert!(LogFolder::open(taken, recorder.flash).is_err());
    }
}
