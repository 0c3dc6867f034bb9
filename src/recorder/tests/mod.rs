use core::num::NonZeroU32;
use std::collections::{BTreeMap, BTreeSet};

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};

use super::*;
use nor_flash::FlashModel;

mod damage;
mod power_cuts;
mod space;

/// The board's sectors and pages.
type Flash<const SECTORS: usize> = FlashModel<4096, 256, SECTORS>;

type Content = Vec<u8>;

/// A ring with its flash, as the firmware drives it, and what its files have to hold.
struct Recorder<const SECTORS: usize> {
    flash: Flash<SECTORS>,
    ring: Ring,
    /// What is to be listed, oldest first.
    files: Vec<(u16, Content)>,
    /// All that was ever appended.
    history: BTreeMap<u16, Content>,
    /// The numbers of files that have to have their dates.
    dated: BTreeSet<u16>,
}

/// Power failed.
#[derive(Debug, PartialEq, Eq)]
struct PowerLost {
    /// What was being appended.
    in_flight: Content,
}

impl<const SECTORS: usize> Recorder<SECTORS> {
    /// On an erased flash.
    fn new() -> Self {
        Self::on(Flash::blank())
    }

    /// After a start. What is listed is taken for what was recorded.
    fn on(mut flash: Flash<SECTORS>) -> Self {
        let mut recorder = Self {
            ring: block_on(Ring::scan(&mut flash, Flash::<SECTORS>::REGION)),
            flash,
            files: Vec::new(),
            history: BTreeMap::new(),
            dated: BTreeSet::new(),
        };
        recorder.files = recorder.listed();
        recorder.history.extend(recorder.files.iter().cloned());
        recorder
    }

    /// A ring with this many sectors erased ahead.
    fn with_erased(sectors: u32) -> Self {
        let mut recorder = Self::new();
        recorder.erase(sectors);
        recorder
    }

    fn restart(&mut self) {
        self.ring = block_on(Ring::scan(&mut self.flash, Flash::<SECTORS>::REGION));
    }

    fn assert_files_after_restart(&mut self) {
        self.restart();
        self.assert_files();
    }

    fn numbers(&self) -> Vec<u16> {
        self.ring.files().iter().map(|file| file.number).collect()
    }

    /// What is listed, read piece by piece.
    fn listed(&mut self) -> Vec<(u16, Content)> {
        let files = self.ring.files().to_vec();
        files.iter().map(|file| (file.number, self.read(*file))).collect()
    }

    fn read(&mut self, file: LogFile) -> Content {
        let mut content = Content::new();
        while let Some(piece) = self.ring.locate(file.number, content.len() as u32) {
            content.extend(self.read_piece(piece));
        }
        assert_eq!(content.len() as u32, file.bytes, "file {}", file.number);
        content
    }

    fn read_piece(&mut self, piece: Piece) -> Content {
        let range = Flash::<SECTORS>::REGION;
        assert!(piece.bytes > 0 && piece.address >= range.start && piece.address + piece.bytes <= range.end);
        // The model reads whole words.
        let start = piece.address / 4 * 4;
        let mut bytes = vec![0; (piece.address + piece.bytes - start).next_multiple_of(4) as usize];
        block_on(self.flash.read(start, &mut bytes)).unwrap();
        let skipped = (piece.address - start) as usize;
        bytes[skipped..][..piece.bytes as usize].to_vec()
    }

    /// Files with dates have their own, and those that have to have one do.
    fn assert_dates(&self) {
        for file in self.ring.files() {
            match file.began_utc_s {
                Some(began) => assert_eq!(began, began_utc_s(file.number), "file {}", file.number),
                None => assert!(!self.dated.contains(&file.number), "file {}", file.number),
            }
        }
    }

    fn assert_files(&mut self) {
        self.assert_dates();
        let listed = self.listed();
        assert!(listed == self.files, "{:?}", self.ring.files());
        self.flash.assert_margins_are_untouched();
    }

    fn open(&mut self) -> Result<u16, AppendError> {
        self.close();
        let number = self.ring.open()?;
        // Only headers that contradict one another have a newer file with a lower number.
        self.files.retain(|(other, _)| *other != number);
        self.files.push((number, Content::new()));
        if self.files.len() > MAX_FILES {
            self.files.remove(0);
        }
        self.history.insert(number, Content::new());
        self.dated.remove(&number);
        Ok(number)
    }

    /// Opens a file with so many [`bytes`] of this seed.
    fn begin(&mut self, seed: u64, length: usize) -> u16 {
        let number = self.open().unwrap();
        assert_eq!(self.append(&bytes(seed, length)), Ok(Ok(())));
        number
    }

    fn close(&mut self) {
        self.ring.close();
        self.note_closed();
    }

    /// An empty file disappears.
    fn note_closed(&mut self) {
        if self.ring.open_file().is_none() && self.files.last().is_some_and(|(_, content)| content.is_empty())
        {
            self.files.pop();
        }
    }

    /// Appends `data` as far as possible.
    fn append(&mut self, mut data: &[u8]) -> Result<Result<(), AppendError>, PowerLost> {
        while !data.is_empty() {
            let program = match self.ring.next_program(data) {
                Ok(program) => program,
                Err(error) => {
                    self.note_closed();
                    return Ok(Err(error));
                }
            };
            let (address, bytes) = (program.address(), program.bytes());
            assert!(
                !bytes.is_empty() && address % 256 + bytes.len() as u32 <= 256,
                "beyond the page"
            );
            assert!(
                !self.flash.is_half_erased(address),
                "the sector at {address:#x} is half erased"
            );
            let is_data = data.starts_with(bytes);
            let outcome = block_on(self.flash.write(address, bytes)).map_err(drop);
            if self.flash.is_powered_off() {
                let in_flight = if is_data { bytes.to_vec() } else { Content::new() };
                return Err(PowerLost { in_flight });
            }
            let appended = self.ring.programmed(outcome);
            let (new, rest) = data.split_at(appended);
            if let Some((number, content)) = self.files.last_mut().filter(|_| appended > 0) {
                content.extend(new);
                self.history.entry(*number).or_default().extend(new);
            }
            self.note_closed();
            data = rest;
        }
        Ok(Ok(()))
    }

    /// Programs the date of the open file, if it can have one now.
    fn date(&mut self) -> Result<(), PowerLost> {
        let Some(file) = self.ring.open_file() else {
            return Ok(());
        };
        let Some(program) = self.ring.next_date(began_utc_s(file.number)) else {
            return Ok(());
        };
        let outcome = block_on(self.flash.write(program.address(), program.bytes())).map_err(drop);
        if self.flash.is_powered_off() {
            return Err(PowerLost {
                in_flight: Content::new(),
            });
        }
        assert_eq!(self.ring.programmed(outcome), 0);
        self.note_closed();
        if outcome.is_ok() {
            self.dated.insert(file.number);
        }
        Ok(())
    }

    /// Appends all of `data` to a file of its own, and closes it.
    fn record(&mut self, data: &[u8]) -> u16 {
        let number = self.open().unwrap();
        assert_eq!(self.append(data), Ok(Ok(())));
        self.close();
        number
    }

    /// Records files of one sector each, the content of which are [`bytes`] of their index.
    fn record_sectors(&mut self, sectors: u64) {
        for seed in 0..sectors {
            self.record(&bytes(seed, PAYLOAD_BYTES as usize));
            self.assert_files();
        }
    }

    /// Erases sectors until this many are ahead.
    fn erase(&mut self, target: u32) {
        while self.erase_one(target) == Ok(Erased::One) {}
    }

    fn erase_one(&mut self, target: u32) -> Result<Erased, PowerLost> {
        let before = self.listed();
        let open = self.ring.open_file();
        let Some(erasure) = self.ring.next_erase(target) else {
            return Ok(Erased::None);
        };
        assert_eq!(self.ring.open_file(), open, "an open file is never removed");
        let sector = erasure.address()..erasure.address() + SECTOR_BYTES;
        assert!(
            self.sectors().iter().all(|used| !sector.contains(used)),
            "a listed file is erased"
        );
        let removed = before.len() - self.ring.files().len();
        assert!(removed <= 1);
        self.files.drain(..removed);
        self.assert_files();

        let mut outcome = block_on(self.flash.erase(sector.start, sector.end));
        if outcome.is_ok() {
            outcome = block_on(self.flash.write(erasure.mark_address(), &erasure.mark()));
        }
        if self.flash.is_powered_off() {
            return Err(PowerLost {
                in_flight: Content::new(),
            });
        }
        self.ring.erased(erasure, outcome.map_err(drop));
        Ok(Erased::One)
    }

    /// The addresses of all pieces of files.
    fn sectors(&self) -> Vec<u32> {
        let offsets = |file: &LogFile| (0..file.bytes).step_by(PAYLOAD_BYTES as usize);
        let files = self.ring.files().iter();
        files
            .flat_map(|file| {
                offsets(file).map(|offset| self.ring.locate(file.number, offset).unwrap().address)
            })
            .collect()
    }

    fn erase_all(&mut self) {
        self.ring.erase_all();
        self.files.clear();
    }

    /// The front of the sector that has this position, to be damaged.
    fn front(&mut self, position: usize) -> &mut [u8] {
        &mut self.flash.region()[position * 4096..][..32]
    }
}

#[derive(Debug, PartialEq, Eq)]
enum Erased {
    One,
    None,
}

/// When the file with this number began.
fn began_utc_s(number: u16) -> NonZeroU32 {
    NonZeroU32::MIN.saturating_add(1_800_000_000 + u32::from(number))
}

fn undated(number: u16, bytes: u32) -> LogFile {
    LogFile {
        number,
        bytes,
        began_utc_s: None,
    }
}

/// Bytes that do not repeat soon, and do not end with 0xFF.
fn bytes(seed: u64, length: usize) -> Content {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut bytes: Content = (0..length).map(|_| random.u8(..)).collect();
    if let Some(last) = bytes.last_mut() {
        *last &= 0x7F;
    }
    bytes
}

#[test]
fn files_are_listed_and_read_back_whole() {
    let mut recorder = Recorder::<16>::with_erased(12);
    for (seed, length) in [1, 200, 4064, 4065, 12_345].into_iter().enumerate() {
        recorder.record(&bytes(seed as u64, length));
    }
    assert_eq!(recorder.numbers(), [1, 2, 3, 4, 5]);
    recorder.assert_files();
    recorder.assert_files_after_restart();
}

#[test]
fn file_is_read_while_it_is_appended_to() {
    let mut recorder = Recorder::<4>::with_erased(3);
    recorder.open().unwrap();
    for seed in 0..90 {
        assert_eq!(recorder.append(&bytes(seed, 100)), Ok(Ok(())));
        recorder.assert_files();
    }
}

#[test]
fn nothing_is_located_beyond_the_end() {
    let mut recorder = Recorder::<4>::with_erased(3);
    let number = recorder.record(&bytes(0, 5000));
    let piece = recorder.ring.locate(number, 4999).unwrap();
    assert_eq!(piece.bytes, 1);
    for offset in [5000, 5001, u32::MAX] {
        assert_eq!(recorder.ring.locate(number, offset), None);
    }
    assert_eq!(recorder.ring.locate(number + 1, 0), None);
}

#[test]
fn first_file_after_a_start_begins_in_a_fresh_sector() {
    let mut recorder = Recorder::<4>::with_erased(3);
    recorder.begin(0, 10);
    recorder.restart();
    assert_eq!(recorder.record(&bytes(1, 10)), 2);
    recorder.assert_files();
    let sectors = recorder.sectors();
    let numbers = sectors.iter().map(|address| address / SECTOR_BYTES);
    assert!(numbers.eq([1, 2]), "{sectors:?}");
}

#[test]
fn blank_bytes_at_the_end_are_lost_at_the_next_start() {
    let mut recorder = Recorder::<4>::with_erased(3);
    let number = recorder.record(&[0xFF, 1, 0xFF, 0xFF]);
    assert_eq!(recorder.ring.files(), [undated(number, 4)]);
    recorder.restart();
    assert_eq!(recorder.listed(), [(number, vec![0xFF, 1])]);
}

#[test]
fn empty_files_are_not_listed() {
    let mut recorder = Recorder::<4>::with_erased(3);
    let number = recorder.open().unwrap();
    assert_eq!(recorder.ring.files(), [undated(number, 0)]);
    // Its sector is not used up.
    recorder.close();
    assert_eq!(recorder.ring.room(), 3 * PAYLOAD_BYTES);
    recorder.open().unwrap();
    let header = recorder.ring.next_program(&[1]).unwrap();
    block_on(recorder.flash.write(header.address(), header.bytes())).unwrap();
    recorder.ring.programmed(Ok(()));
    recorder.restart();
    assert_eq!(recorder.ring.files(), []);
    assert_eq!(recorder.ring.open(), Ok(3));
}

#[test]
fn failed_program_ends_the_file() {
    for operation in 0..20 {
        let mut recorder = Recorder::<8>::with_erased(6);
        recorder.flash.refuse_after(operation);
        recorder.open().unwrap();
        let appended = recorder.append(&bytes(operation, 6000));
        assert_eq!(appended, Ok(Err(AppendError::Closed)));
        recorder.assert_files();
        recorder.record(&bytes(99, 5000));
        recorder.assert_files();
        recorder.assert_files_after_restart();
    }
}

#[test]
fn program_without_an_outcome_ends_the_file() {
    let mut recorder = Recorder::<8>::with_erased(6);
    for prepared in [0, 10] {
        recorder.begin(0, prepared);
        // As if the future was dropped in the middle.
        let program = recorder.ring.next_program(&[1; 20]).unwrap();
        block_on(recorder.flash.write(program.address(), program.bytes())).unwrap();
        assert_eq!(recorder.append(&[2; 20]), Ok(Err(AppendError::Closed)));
        recorder.record(&bytes(1, 300));
        recorder.assert_files();
    }
}

#[test]
fn outcome_for_a_file_that_was_closed_meanwhile_is_ignored() {
    let mut recorder = Recorder::<8>::with_erased(6);
    for prepared in [0, 10] {
        recorder.begin(0, prepared);
        let program = recorder.ring.next_program(&[1; 20]).unwrap();
        block_on(recorder.flash.write(program.address(), program.bytes())).unwrap();
        recorder.erase_all();
        recorder.open().unwrap();
        assert_eq!(recorder.ring.programmed(Ok(())), 0);
        assert_eq!(recorder.append(&bytes(1, 300)), Ok(Ok(())));
        recorder.assert_files();
    }
}

/// The first begins in the sector of an earlier one, of a lap before.
#[test]
fn files_have_their_dates_after_a_restart_and_others_have_none() {
    let mut recorder = Recorder::<4>::with_erased(3);
    for is_dated in [true, false, true, true, false, true] {
        recorder.erase(2);
        recorder.begin(1, 100);
        if is_dated {
            assert_eq!(recorder.date(), Ok(()));
        }
        assert_eq!(recorder.append(&bytes(2, 300)), Ok(Ok(())));
        recorder.assert_files();
        recorder.assert_files_after_restart();
        let is_now_dated = recorder.ring.files().last().unwrap().began_utc_s.is_some();
        assert_eq!(is_now_dated, is_dated);
    }
}

#[test]
fn a_date_is_programmed_once_and_not_before_the_file_is_begun() {
    let mut recorder = Recorder::<4>::with_erased(3);
    let began = began_utc_s(1);
    assert!(recorder.ring.next_date(began).is_none(), "no file is open");
    recorder.open().unwrap();
    assert!(recorder.ring.next_date(began).is_none(), "it has no sector");
    assert_eq!(recorder.append(&bytes(1, 5000)), Ok(Ok(())));
    assert_eq!(recorder.date(), Ok(()));
    assert!(recorder.ring.next_date(began).is_none(), "it has its date");
    assert_eq!(recorder.append(&bytes(2, 10)), Ok(Ok(())));
    recorder.close();
    assert!(recorder.ring.next_date(began).is_none(), "it is closed");
    recorder.assert_files();
}

#[test]
fn a_file_has_its_date_with_a_damaged_header_too() {
    let mut recorder = Recorder::<8>::with_erased(8);
    recorder.record(&bytes(0, 100));
    recorder.begin(1, 5000);
    assert_eq!(recorder.date(), Ok(()));
    recorder.front(1)[5] ^= 1;
    recorder.assert_files_after_restart();
}

#[test]
fn a_damaged_date_is_unknown_and_the_file_is_not_harmed() {
    let mut recorder = Recorder::<4>::with_erased(3);
    recorder.begin(1, 100);
    assert_eq!(recorder.date(), Ok(()));
    recorder.front(0)[25] ^= 4;
    recorder.dated.clear();
    recorder.assert_files_after_restart();
    assert_eq!(recorder.ring.files(), [undated(1, 100)]);
}

#[test]
fn numbers_continue_from_the_newest_file_and_wrap_to_one() {
    let mut recorder = Recorder::<4>::new();
    let newest = front::Header {
        sequence: 5,
        number: u16::MAX - 1,
        index: 0,
    };
    recorder.front(1)[..16].copy_from_slice(&newest.to_bytes(4));
    recorder.flash.region()[4096 + 32] = 7;
    let mut recorder = Recorder::on(recorder.flash);
    recorder.erase(3);
    let numbers = [1, 2, 3].map(|seed| recorder.record(&bytes(seed, 10)));
    assert_eq!(numbers, [u16::MAX, 1, 2]);
    recorder.assert_files();
    recorder.assert_files_after_restart();
}

#[test]
fn ring_without_sectors_has_no_room() {
    for (start, end) in [
        (0, 0),
        (4096, 8191),
        (100, 4200),
        (9000, 100),
        (u32::MAX - 1, u32::MAX),
    ] {
        let mut ring = block_on(Ring::scan(&mut Flash::<4>::blank(), start..end));
        assert!(ring.next_erase(5).is_none());
        assert_eq!(ring.open(), Err(AppendError::NoErasedSpace));
        assert!(ring.next_program(&[1]).is_err());
        ring.erase_all();
        assert!(ring.next_erase(5).is_none());
        assert_eq!((ring.room(), ring.files()), (0, &[][..]));
    }
}
