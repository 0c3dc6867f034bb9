//! Whether the newest log ends while the rover is armed: then the power has ended the drive.

use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::ReadNorFlash;

use super::format::{FORMATS, Format, HEADER_BYTES, Kind};
use super::packet::SYNCHRONISATION;
use crate::recorder::{PAYLOAD_BYTES, Ring};

/// Records that are read in one turn, in some 0.3 ms.
const RECORDS_A_TURN: u32 = 32;

/// Offset of the fields behind `TimeUS`, in bytes.
const FIELDS_AT: u32 = HEADER_BYTES as u32 + 8;

/// Whether the newest file of `ring` ends while the rover is armed. `last_text` is the message after which nothing is recorded
/// although the rover may be disarmed. A file without arming says nothing. Yields to other tasks every few records.
pub async fn ends_armed<F: ReadNorFlash>(flash: &mut F, ring: &Ring, last_text: &str) -> bool {
    let Some(file) = ring.newest() else { return false };
    let mut reader = Reader {
        flash,
        ring,
        number: file.number,
        block: [0; _],
        block_at: None,
    };
    let (mut is_armed, mut at, mut records) = (false, 0, 0);
    while at < file.bytes {
        match reader.format(at).await {
            // Torn or damaged: the next record is searched for.
            None => at += 1,
            Some(format) => {
                let end = at + format.record_bytes() as u32;
                if end <= file.bytes {
                    match format.kind {
                        Kind::Arming => is_armed = reader.is_armed(at).await,
                        Kind::Message => is_armed &= !reader.has_text(at, last_text).await,
                        _ => {}
                    }
                }
                at = end;
            }
        }
        records += 1;
        if records % RECORDS_A_TURN == 0 {
            yield_now().await;
        }
    }
    is_armed
}

/// Bytes that are read at once. A payload has whole blocks of them.
const BLOCK_BYTES: u32 = 32;

const _: () = assert!(PAYLOAD_BYTES.is_multiple_of(BLOCK_BYTES));

/// Reads a file.
struct Reader<'a, F> {
    flash: &'a mut F,
    ring: &'a Ring,
    number: u16,
    block: [u8; BLOCK_BYTES as usize],
    /// Offset of the block, once one was read.
    block_at: Option<u32>,
}

impl<F: ReadNorFlash> Reader<'_, F> {
    /// The format of the record at `offset`, if there is one.
    async fn format(&mut self, offset: u32) -> Option<&'static Format> {
        for (place, expected) in SYNCHRONISATION.into_iter().enumerate() {
            if self.byte(offset + place as u32).await? != expected {
                return None;
            }
        }
        let kind = self.byte(offset + SYNCHRONISATION.len() as u32).await?;
        FORMATS.iter().find(|format| format.kind as u8 == kind)
    }

    async fn is_armed(&mut self, record: u32) -> bool {
        self.byte(record + FIELDS_AT)
            .await
            .is_some_and(|state| state != 0)
    }

    async fn has_text(&mut self, record: u32, expected: &str) -> bool {
        for (offset, expected) in (record + FIELDS_AT..).zip(expected.bytes()) {
            if self.byte(offset).await != Some(expected) {
                return false;
            }
        }
        true
    }

    /// The byte at `offset`; `None` if the file ends before, or can't be read.
    async fn byte(&mut self, offset: u32) -> Option<u8> {
        let in_block = offset % BLOCK_BYTES;
        let at = offset - in_block;
        if self.block_at != Some(at) {
            let piece = self.ring.locate(self.number, at)?;
            self.block_at = None;
            self.flash.read(piece.address, &mut self.block).await.ok()?;
            self.block_at = Some(at);
        }
        self.block.get(in_block as usize).copied()
    }
}
