//! Finds what a ring holds, after a start.

use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::ReadNorFlash;

use super::directory::Directory;
use super::front::{FRONT_BYTES, Front, Header, HeaderSlot, PAYLOAD_BYTES};
use super::geometry::{Geometry, SECTOR_BYTES, SectorSet};

const CHUNK_BYTES: usize = 128;

/// A piece of a sector. Aligned, it is copied and compared by words: half a megabyte is read at the start.
#[repr(align(4))]
struct Chunk([u8; CHUNK_BYTES]);

impl Chunk {
    fn is_blank(&self) -> bool {
        let words = self.0.as_chunks().0.iter();
        words.fold(u32::MAX, |all, word| all & u32::from_ne_bytes(*word)) == u32::MAX
    }
}

/// Content of a ring besides files.
pub struct Scan {
    /// The sector after all that were ever begun.
    pub next: u32,
    /// The sector after all that were erased for their next use.
    pub erased_to: u32,
    /// The positions of those sectors from `next` to `erased_to` that can be used.
    pub ready: SectorSet,
    /// The number of the newest file, listed or not.
    pub newest_number: Option<u16>,
}

/// Reads the front of every sector, the whole of those that are erased, and the last one of every file from its end. Adds the
/// files to `directory`, which is empty. Yields to other tasks after each sector.
pub async fn scan<F: ReadNorFlash>(flash: &mut F, geometry: Geometry, directory: &mut Directory) -> Scan {
    let mut reader = Reader { flash, geometry };
    let newest = reader.newest().await;
    let sectors = geometry.sectors();
    // The sector after those that were erased may be erased in part, and have its old mark still. Without a header,
    // only this excludes it from those that are ready.
    let after_half_erased = newest
        .erased
        .map_or(0, |erased| (erased + 2).saturating_sub(sectors));
    let after_begun = newest.begun.map_or(0, |header| header.sequence + 1);
    let next = geometry.first_sequence().max(after_begun).max(after_half_erased);
    let erased_to = newest.erased.map_or(next, |erased| next.max(erased + 1));
    let oldest = erased_to.saturating_sub(sectors);
    reader.files(oldest, after_begun, directory).await;
    Scan {
        next,
        erased_to,
        ready: reader.ready(next, erased_to).await,
        newest_number: newest.begun.map(|header| header.number),
    }
}

/// Extent to which the ring was used and erased.
#[derive(Default)]
struct Newest {
    /// The header with the highest sequence number.
    begun: Option<Header>,
    /// The highest sequence number of a mark.
    erased: Option<u32>,
}

struct Reader<'a, F> {
    flash: &'a mut F,
    geometry: Geometry,
}

impl<F: ReadNorFlash> Reader<'_, F> {
    async fn newest(&mut self) -> Newest {
        let mut newest = Newest::default();
        for position in 0..self.geometry.sectors() {
            let front = self.front(position).await;
            newest.erased = newest.erased.max(front.erased_for);
            if let HeaderSlot::Header(header) = front.header
                && newest.begun.is_none_or(|begun| begun.sequence < header.sequence)
            {
                newest.begun = Some(header);
            }
        }
        newest
    }

    /// The sectors of these that were erased, and not begun since.
    async fn ready(&mut self, next: u32, erased_to: u32) -> SectorSet {
        let mut ready = SectorSet::default();
        for sequence in next..erased_to {
            let front = self.front(sequence).await;
            let is_marked = front.header == HeaderSlot::Blank && front.erased_for == Some(sequence);
            if is_marked && self.blank_bytes(sequence).await == PAYLOAD_BYTES {
                ready.insert(self.geometry.position(sequence));
            }
        }
        ready
    }

    /// Adds the files in the sectors from `oldest` to `end`.
    async fn files(&mut self, oldest: u32, end: u32, directory: &mut Directory) {
        for sequence in oldest..end {
            if let HeaderSlot::Header(header) = self.front(sequence).await.header
                && header.sequence == sequence
                && let Some(first) = self.first_front(header, oldest).await
            {
                directory.take_over(header, first.began_utc_s);
            }
        }
        for index in 0..directory.files().len() {
            if let Some(last) = directory.last_sequence(index) {
                let blank = self.blank_bytes(last).await;
                directory.shorten(index, blank);
            }
        }
        directory.remove_empty();
    }

    /// The front of the first sector of the file with this header, unless it was erased since. The one at `oldest` may be
    /// erased in part.
    async fn first_front(&mut self, header: Header, oldest: u32) -> Option<Front> {
        let first = header.first_sequence();
        let front = self.front(first).await;
        let is_there = match front.header {
            HeaderSlot::Header(found) => first >= oldest && found.sequence == first,
            HeaderSlot::Damaged => first > oldest && front.erased_for == Some(first),
            HeaderSlot::Blank => false,
        };
        is_there.then_some(front)
    }

    /// The front of a sector; what belongs to another position of the ring proves nothing.
    async fn front(&mut self, sequence: u32) -> Front {
        yield_now().await;
        let mut bytes = [0; FRONT_BYTES as usize];
        if self
            .read(self.geometry.address(sequence), &mut bytes)
            .await
            .is_none()
        {
            return Front::UNREADABLE;
        }
        let position = self.geometry.position(sequence);
        let is_here = |found| self.geometry.position(found) == position;
        let front = Front::from_bytes(&bytes, self.geometry.sectors());
        Front {
            header: match front.header {
                HeaderSlot::Header(header) if !is_here(header.sequence) => HeaderSlot::Damaged,
                header => header,
            },
            erased_for: front.erased_for.filter(|found| is_here(*found)),
            began_utc_s: front.began_utc_s,
        }
    }

    /// The erased bytes at the end of a sector's payload.
    async fn blank_bytes(&mut self, sequence: u32) -> u32 {
        yield_now().await;
        let start = self.geometry.address(sequence);
        let mut blank = 0;
        for offset in (0..SECTOR_BYTES).step_by(CHUNK_BYTES).rev() {
            let mut chunk = Chunk([0; CHUNK_BYTES]);
            // Bytes that can't be read count as content.
            let _ = self.read(start + offset, &mut chunk.0).await;
            if !chunk.is_blank() {
                blank += chunk.0.iter().rev().take_while(|byte| **byte == 0xFF).count() as u32;
                break;
            }
            blank += CHUNK_BYTES as u32;
        }
        blank.min(PAYLOAD_BYTES)
    }

    async fn read(&mut self, address: u32, bytes: &mut [u8]) -> Option<()> {
        self.flash.read(address, bytes).await.ok()
    }
}
