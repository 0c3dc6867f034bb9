//! The state of a ring of log files.

use core::num::NonZeroU32;
use core::ops::Range;

use embedded_storage_async::nor_flash::ReadNorFlash;

use super::directory::{Directory, LogFile};
use super::front::{
    DATE_AT, DATE_BYTES, FRONT_BYTES, HEADER_BYTES, Header, MARK_AT, MARK_BYTES, PAYLOAD_BYTES, date, mark,
};
use super::geometry::{Geometry, SectorSet};
use super::scan::{Scan, scan};

/// Bytes that the flash programs at once.
const PAGE_BYTES: u32 = 256;

/// A ring of log files in flash.
///
/// ```
/// use rover_battmon::recorder::{PAYLOAD_BYTES, Ring};
///
/// // Sixteen sectors that were never used, on a flash that is a piece of RAM here.
/// let mut flash = [0xFF_u8; 16 * 4096];
/// let mut ring = Ring::new(0..16 * 4096);
/// while let Some(erasure) = ring.next_erase(4) {
///     flash[erasure.address() as usize..][..4096].fill(0xFF);
///     flash[erasure.mark_address() as usize..][..8].copy_from_slice(&erasure.mark());
///     ring.erased(erasure, Ok(()));
/// }
/// assert_eq!(ring.room(), 4 * PAYLOAD_BYTES);
///
/// let number = ring.open().unwrap();
/// let mut record = &b"fourteen bytes"[..];
/// while !record.is_empty() {
///     let program = ring.next_program(record).unwrap();
///     let place = program.address() as usize;
///     flash[place..][..program.bytes().len()].copy_from_slice(program.bytes());
///     let appended = ring.programmed(Ok(()));
///     record = &record[appended..];
/// }
/// let piece = ring.locate(number, 9).unwrap();
/// assert_eq!(&flash[piece.address as usize..][..piece.bytes as usize], b"bytes");
/// ```
#[derive(Debug)]
pub struct Ring {
    geometry: Geometry,
    directory: Directory,
    /// The newest file of the directory, if it is open.
    open: Option<OpenFile>,
    next_number: u16,
    /// The sector to begin next, if it is ready. Before it, everything was begun or can't be used.
    next: u32,
    /// The sector to erase next. Those from `next` to here were erased, or can't be.
    erased_to: u32,
    /// All sectors before this one are to be erased, however many are ready.
    due_to: u32,
    /// The positions of sectors that were erased and not begun.
    ready: SectorSet,
}

// It is kept in RAM all the time.
const _: () = assert!(size_of::<Ring>() <= 1160);

/// Progress of the open file.
#[derive(Debug, Default)]
struct OpenFile {
    /// Its sectors with a header.
    begun: u16,
    in_flight: Option<InFlight>,
}

/// An operation that was handed out, and not reported yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InFlight {
    Header,
    /// This many bytes of the file.
    Data(u32),
    /// When the file began, in seconds since 1970.
    Date(NonZeroU32),
}

/// Place of a file's bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Address of the first, as offset from the start of the flash.
    pub address: u32,
    /// Number of bytes that follow one another there, at least one.
    pub bytes: u32,
}

/// Why no file can be opened, or nothing can be appended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum AppendError {
    /// No file is open: none was opened, or it ended because of a failed operation or an unusable sector. Another one can
    /// be opened.
    Closed,
    /// The next sector is not erased: erase [`Ring::next_erase`] first. An open file stays open.
    NoErasedSpace,
}

/// Bytes to be programmed into flash that is blank there. They do not cross the end of a page of 256 bytes.
#[derive(Debug)]
pub struct Program<'a> {
    address: u32,
    content: Content<'a>,
}

#[derive(Debug)]
enum Content<'a> {
    Header([u8; HEADER_BYTES]),
    Data(&'a [u8]),
    Date([u8; DATE_BYTES]),
}

/// A sector to be erased, and then marked.
#[derive(Debug)]
pub struct Erasure {
    address: u32,
    sequence: u32,
    mark: [u8; MARK_BYTES],
    is_first_use: bool,
}

impl Ring {
    /// A ring in the complete sectors of `range`, an address range of flash, at most
    /// [`MAX_SECTORS`](super::MAX_SECTORS). For a flash that holds no ring yet; otherwise [`scan`](Self::scan).
    pub fn new(range: Range<u32>) -> Self {
        let geometry = Geometry::new(range);
        let first = geometry.first_sequence();
        Self {
            geometry,
            directory: Directory::default(),
            open: None,
            next_number: 1,
            next: first,
            erased_to: first,
            due_to: first,
            ready: SectorSet::default(),
        }
    }

    /// The ring in `range` of `flash` as it was left. No file is open. What can't be read, or is not of a ring of this
    /// size, counts as space to be erased.
    pub async fn scan<F: ReadNorFlash>(flash: &mut F, range: Range<u32>) -> Self {
        let mut ring = Self::new(range);
        let Scan {
            next,
            erased_to,
            ready,
            newest_number,
        } = scan(flash, ring.geometry, &mut ring.directory).await;
        ring.next_number = newest_number.map_or(1, after);
        ring.next = next;
        ring.erased_to = erased_to;
        ring.ready = ready;
        ring.skip_unusable();
        ring
    }

    /// The sectors it has.
    pub fn sectors(&self) -> u32 {
        self.geometry.sectors()
    }

    /// The files that can be read, oldest first, the open one last.
    pub fn files(&self) -> &[LogFile] {
        self.directory.files()
    }

    /// The newest file, unless a later one was begun in vain: that was a failed write, and what happened since is not known.
    pub fn newest(&self) -> Option<LogFile> {
        let newest = self.files().last().copied();
        newest.filter(|file| after(file.number) == self.next_number)
    }

    /// Place of a file's bytes from `offset` on, as far as they follow one another; `None` beyond its end, or if
    /// there is no such file.
    pub fn locate(&self, number: u16, offset: u32) -> Option<Piece> {
        let place = self.directory.locate(number, offset)?;
        Some(Piece {
            address: self.payload_address(place.sequence) + place.offset,
            bytes: place.bytes,
        })
    }

    /// Begins a file, and returns its number. One that is open is closed, and removed if it is empty.
    ///
    /// # Errors
    /// [`AppendError::NoErasedSpace`]: no file is open then.
    pub fn open(&mut self) -> Result<u16, AppendError> {
        self.close();
        if !self.is_ready(self.next) {
            return Err(AppendError::NoErasedSpace);
        }
        let number = self.next_number;
        self.next_number = after(number);
        self.directory.push(number, self.next);
        self.open = Some(OpenFile::default());
        Ok(number)
    }

    /// Ends the open file, if there is one. It is removed if it is empty.
    pub fn close(&mut self) {
        let Some(open) = self.open.take() else {
            return;
        };
        if open.in_flight == Some(InFlight::Header) {
            // The content of the sector is unknown.
            self.spend_sector();
        }
        self.directory.pop_if_empty();
    }

    /// The file that is open.
    pub fn open_file(&self) -> Option<LogFile> {
        self.open.as_ref()?;
        self.files().last().copied()
    }

    /// Bytes that can be appended without an erase, to the open file and those after it.
    pub fn room(&self) -> u32 {
        let in_sector = self
            .open
            .as_ref()
            .zip(self.open_file())
            .map_or(0, |(open, file)| capacity(open).saturating_sub(file.bytes));
        in_sector + self.ready.count() * PAYLOAD_BYTES
    }

    /// The next page to program to append `data`, which is not empty: the header of the next sector, or the first of
    /// `data`. [`programmed`](Self::programmed) takes the outcome, before anything else is appended.
    ///
    /// # Errors
    /// Nothing can be programmed now. That an outcome was not reported counts as a failure.
    pub fn next_program<'a>(&mut self, data: &'a [u8]) -> Result<Program<'a>, AppendError> {
        let open = self.open.as_ref().ok_or(AppendError::Closed)?;
        let (file, first) = self.directory.newest().ok_or(AppendError::Closed)?;
        if open.in_flight.is_some() {
            self.close();
            return Err(AppendError::Closed);
        }
        if file.bytes < capacity(open) {
            let sequence = first + file.bytes / PAYLOAD_BYTES;
            let address = self.payload_address(sequence) + file.bytes % PAYLOAD_BYTES;
            return Ok(self.program_data(address, data));
        }
        let header = Header {
            sequence: first + u32::from(open.begun),
            number: file.number,
            index: open.begun,
        };
        self.program_header(header)
    }

    /// The first of `data`, to the end of the page. A sector ends with a page.
    fn program_data<'a>(&mut self, address: u32, data: &'a [u8]) -> Program<'a> {
        let in_page = PAGE_BYTES - address % PAGE_BYTES;
        let data = data.get(..in_page as usize).unwrap_or(data);
        self.put_in_flight(InFlight::Data(data.len() as u32));
        Program {
            address,
            content: Content::Data(data),
        }
    }

    fn program_header<'a>(&mut self, header: Header) -> Result<Program<'a>, AppendError> {
        if header.sequence != self.next {
            // The sector can't be used, and the file can't have a gap.
            self.close();
            return Err(AppendError::Closed);
        }
        if !self.is_ready(header.sequence) {
            return Err(AppendError::NoErasedSpace);
        }
        self.put_in_flight(InFlight::Header);
        Ok(Program {
            address: self.geometry.address(header.sequence),
            content: Content::Header(header.to_bytes(self.geometry.sectors())),
        })
    }

    /// The page to program to date the open file, which began at this moment, in seconds since 1970 (UTC).
    /// [`programmed`](Self::programmed) takes the outcome. `None` if it has its date, or nothing of it was programmed yet.
    pub fn next_date(&mut self, began_utc_s: NonZeroU32) -> Option<Program<'static>> {
        let open = self.open.as_ref()?;
        let (file, first) = self.directory.newest()?;
        if open.begun == 0 || open.in_flight.is_some() || file.began_utc_s.is_some() {
            return None;
        }
        self.put_in_flight(InFlight::Date(began_utc_s));
        Some(Program {
            address: self.geometry.address(first) + DATE_AT,
            content: Content::Date(date(began_utc_s, self.geometry.sectors())),
        })
    }

    fn put_in_flight(&mut self, in_flight: InFlight) {
        if let Some(open) = &mut self.open {
            open.in_flight = Some(in_flight);
        }
    }

    /// Takes the outcome of the last [`next_program`](Self::next_program) or [`next_date`](Self::next_date), and returns how
    /// many bytes of the data are in the file now: none if it was a header or a date, if it failed, which closes the file, or
    /// if the file was closed meanwhile. It has failed if the flash reported an error, or reads back otherwise: what it holds is
    /// unknown then.
    pub fn programmed(&mut self, outcome: Result<(), ()>) -> usize {
        let Some(open) = &mut self.open else {
            return 0;
        };
        match (open.in_flight, outcome) {
            (None, _) => 0,
            (Some(_), Err(())) => {
                self.close();
                0
            }
            (Some(InFlight::Header), Ok(())) => {
                *open = OpenFile {
                    begun: open.begun.saturating_add(1),
                    in_flight: None,
                };
                self.spend_sector();
                0
            }
            (Some(InFlight::Data(bytes)), Ok(())) => {
                open.in_flight = None;
                self.directory.grow(bytes);
                bytes as usize
            }
            (Some(InFlight::Date(began_utc_s)), Ok(())) => {
                open.in_flight = None;
                self.directory.date(began_utc_s);
                0
            }
        }
    }

    /// The sector to erase next, while fewer than `target` are erased ahead, or not all are erased that
    /// [`erase_all`](Self::erase_all) has left. The oldest file is removed at once if it is there; one that is open is never
    /// erased.
    ///
    /// The caller erases the sector, programs its mark, and reports the outcome of both to [`erased`](Self::erased). If it
    /// does not begin the erase, it reports nothing.
    pub fn next_erase(&mut self, target: u32) -> Option<Erasure> {
        let is_wanted = self.ready.count() < target || self.erased_to < self.due_to;
        if !is_wanted || self.erased_to >= self.kept_from() + self.geometry.sectors() {
            return None;
        }
        if self.next_erased_file().is_some() {
            self.directory.remove_oldest();
        }
        let erased_sequence = self.erased_to - self.geometry.sectors();
        Some(Erasure {
            address: self.geometry.address(self.erased_to),
            sequence: self.erased_to,
            mark: mark(self.erased_to, self.geometry.sectors()),
            is_first_use: erased_sequence < self.geometry.first_sequence(),
        })
    }

    /// The file that the next erase removes, if it removes one.
    pub fn next_erased_file(&self) -> Option<LogFile> {
        let oldest = self.directory.oldest_sequence()?;
        let is_erased = oldest + self.geometry.sectors() <= self.erased_to;
        is_erased.then(|| self.files().first().copied()).flatten()
    }

    /// Sectors without a file: they can be erased ahead, and no file has to go for it. In an empty ring one is left out: a
    /// start takes the sector behind those that are erased for one whose erase was interrupted, and each would erase one.
    pub fn free_sectors(&self) -> u32 {
        let oldest = self.directory.oldest_sequence().unwrap_or(self.next);
        let used = self.next - oldest.min(self.next);
        self.geometry.sectors().saturating_sub(used.max(1))
    }

    /// The first sector that must not be erased.
    fn kept_from(&self) -> u32 {
        match (&self.open, self.directory.newest()) {
            (Some(_), Some((_, first))) => first,
            _ => self.next,
        }
    }

    /// Takes the outcome of an erase and its mark. After a failure the sector is left out for this lap, and the next one is
    /// tried: a caller that gets failures only has to stop.
    pub fn erased(&mut self, erasure: Erasure, outcome: Result<(), ()>) {
        if erasure.sequence != self.erased_to {
            // Reported already.
            return;
        }
        self.erased_to += 1;
        if outcome.is_ok() {
            self.ready.insert(self.geometry.position(erasure.sequence));
        }
        self.skip_unusable();
    }

    /// Removes all files, the open one too. Their sectors are due to be erased; a start before that is done lists those
    /// again that are left.
    pub fn erase_all(&mut self) {
        self.close();
        self.directory.clear();
        self.due_to = self.next + self.geometry.sectors();
    }

    /// The next sector was begun, or it is unknown what it holds.
    fn spend_sector(&mut self) {
        self.ready.remove(self.geometry.position(self.next));
        self.skip_unusable();
    }

    fn skip_unusable(&mut self) {
        while self.next < self.erased_to && !self.is_ready(self.next) {
            self.next += 1;
        }
    }

    fn is_ready(&self, sequence: u32) -> bool {
        sequence < self.erased_to && self.ready.contains(self.geometry.position(sequence))
    }

    fn payload_address(&self, sequence: u32) -> u32 {
        self.geometry.address(sequence) + FRONT_BYTES
    }
}

impl Program<'_> {
    /// Offset from the start of the flash.
    pub fn address(&self) -> u32 {
        self.address
    }

    /// Content.
    pub fn bytes(&self) -> &[u8] {
        match &self.content {
            Content::Header(header) => header,
            Content::Data(data) => data,
            Content::Date(date) => date,
        }
    }
}

impl Erasure {
    /// The sector, [`SECTOR_BYTES`](super::SECTOR_BYTES) long, as offset from the start of the flash.
    pub fn address(&self) -> u32 {
        self.address
    }

    /// Whether no file was ever in the sector. If it reads blank it is so from the factory, or from an erase of the whole chip,
    /// and need not be erased.
    pub fn is_first_use(&self) -> bool {
        self.is_first_use
    }

    /// Address of the mark that is programmed after the erase.
    pub fn mark_address(&self) -> u32 {
        self.address + MARK_AT
    }

    /// The mark.
    pub fn mark(&self) -> [u8; MARK_BYTES] {
        self.mark
    }
}

/// Bytes that the begun sectors of a file hold.
fn capacity(open: &OpenFile) -> u32 {
    u32::from(open.begun) * PAYLOAD_BYTES
}

/// The number of the file after this one.
fn after(number: u16) -> u16 {
    number.checked_add(1).unwrap_or(1)
}
