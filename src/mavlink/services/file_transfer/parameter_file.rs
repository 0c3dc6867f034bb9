//! The packed parameters as a file that is read. None of it is stored: what is asked for is built from the live values.

use core::ops::ControlFlow;

use heapless::{String, Vec};

use super::directory::Selection;
use super::packed::{
    HAS_DEFAULT, HEADER_BYTES, MAGIC, MAGIC_WITH_DEFAULTS, MAX_HEAD_BYTES, MAX_VALUE_BYTES, PackedType,
};
use crate::mavlink::messages::{FileError, MAX_FILE_BYTES};
use crate::parameter::{MAX_NAME_LENGTH, ParameterId, Parameters};

/// A record with a default, and what is put before it.
const RECORD_BYTES: usize = 2 * MAX_VALUE_BYTES + MAX_HEAD_BYTES + 2 * MAX_VALUE_BYTES;

type EncodedParameter = Vec<u8, RECORD_BYTES>;

/// An open file of parameters.
///
/// The length of a record depends on its name and type alone, so that a value that is set meanwhile moves nothing. Every
/// record has its default, if any has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ParameterFile {
    selection: Selection,
    /// Which parameters were listed when it was opened.
    list_checksum: u32,
    /// The number of parameters listed then.
    total: u16,
    /// Number of them in the file.
    count: u16,
    /// The size of the blocks in which it is read, by the first read. No value is in two blocks.
    block_bytes: Option<u8>,
    cursor: Cursor,
}

/// The start of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cursor {
    offset: u32,
    /// Records before it.
    place: u16,
}

impl Cursor {
    const FIRST: Self = Self {
        offset: HEADER_BYTES as u32,
        place: 0,
    };
}

impl ParameterFile {
    /// Opens the file; `None` if it would have no parameters.
    pub fn open(selection: Selection, parameters: &Parameters) -> Option<Self> {
        let total = parameters.listed_count() as u16;
        let behind_start = total.checked_sub(selection.start).filter(|count| *count > 0)?;
        Some(Self {
            selection,
            list_checksum: parameters.list_checksum(),
            total,
            count: selection
                .count
                .map_or(behind_start, |count| count.min(behind_start)),
            block_bytes: None,
            cursor: Cursor::FIRST,
        })
    }

    /// Its length in bytes if it is read in the largest blocks; in smaller ones it may differ by a few.
    pub fn bytes(mut self, parameters: &Parameters) -> u32 {
        self.block_bytes = Some(MAX_FILE_BYTES as u8);
        self.walk(parameters, |_, _| ControlFlow::Continue(()));
        self.cursor.offset
    }

    /// Up to `bytes` bytes from `offset` on; none at its end.
    ///
    /// # Errors
    /// Other parameters are listed than when it was opened: what was read would not fit together. With this error QGroundControl
    /// reads them one by one at once; with others it waits for 10 s first.
    pub fn read(
        &mut self,
        offset: u32,
        bytes: u8,
        parameters: &Parameters,
    ) -> Result<Vec<u8, MAX_FILE_BYTES>, FileError> {
        if parameters.list_checksum() != self.list_checksum {
            return Err(FileError::FileNotFound);
        }
        self.block_bytes.get_or_insert(bytes);
        let end = offset.saturating_add(u32::from(bytes));
        let mut block = Vec::new();
        copy(&mut block, offset, end, 0, &self.header());
        if offset < self.cursor.offset {
            self.cursor = Cursor::FIRST;
        }
        self.walk(parameters, |at, record| {
            copy(&mut block, offset, end, at, record);
            // The cursor stays before a record that is continued in the next block.
            if at.saturating_add(record.len() as u32) > end {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        Ok(block)
    }

    fn header(&self) -> [u8; HEADER_BYTES] {
        let magic = if self.selection.with_defaults {
            MAGIC_WITH_DEFAULTS
        } else {
            MAGIC
        };
        let ([a, b], [c, d], [e, f]) = (
            magic.to_le_bytes(),
            self.count.to_le_bytes(),
            self.total.to_le_bytes(),
        );
        [a, b, c, d, e, f]
    }

    /// Builds the records from the cursor on, which goes along, until `visit` stops it.
    fn walk(&mut self, parameters: &Parameters, mut visit: impl FnMut(u32, &[u8]) -> ControlFlow<()>) {
        let first = usize::from(self.selection.start) + usize::from(self.cursor.place);
        // From the one before: its name is needed.
        let mut ids = parameters.listed().skip(first.saturating_sub(1));
        let mut name_before = String::new();
        if self.cursor.place > 0 {
            name_before = ids.next().map(ParameterId::name).unwrap_or_default();
        } else if first > 0 {
            ids.next();
        }
        for id in ids {
            if self.cursor.place >= self.count {
                return;
            }
            let name = id.name();
            let record = self.record(id, &name, &name_before, parameters);
            if visit(self.cursor.offset, &record).is_break() {
                return;
            }
            self.cursor.offset = self.cursor.offset.saturating_add(record.len() as u32);
            self.cursor.place += 1;
            name_before = name;
        }
    }

    /// The record of a parameter at the cursor, with zeros before it so that its value is within one block.
    fn record(
        &self,
        id: ParameterId,
        name: &str,
        name_before: &String<MAX_NAME_LENGTH>,
        parameters: &Parameters,
    ) -> EncodedParameter {
        let packed_type = PackedType(id.row().kind);
        let common = common_bytes(name, name_before);
        let own = name.as_bytes().get(common..).unwrap_or(&[]);
        let mut flags = 0;
        let mut values: Vec<u8, { 2 * MAX_VALUE_BYTES }> = Vec::new();
        // Everything fits, as the length of a record says.
        let _ = values.extend_from_slice(&packed_type.pack(parameters.get(id)));
        if self.selection.with_defaults {
            flags = HAS_DEFAULT;
            let _ = values.extend_from_slice(&packed_type.pack(parameters.default_of(id)));
        }
        let mut record = Vec::new();
        let unpadded_bytes = 2 + own.len() + values.len();
        for _ in 0..self.padding(unpadded_bytes, values.len()) {
            let _ = record.push(0);
        }
        let _ = record.push(packed_type.number() | flags);
        let _ = record.push(common as u8 | (own.len().saturating_sub(1) as u8) << 4);
        let _ = record.extend_from_slice(own);
        let _ = record.extend_from_slice(&values);
        record
    }

    /// Number of zeros that move the values at the end of a record of this many bytes out of the block before.
    fn padding(&self, record_bytes: usize, value_bytes: usize) -> usize {
        let end = self.cursor.offset as usize + record_bytes;
        let block_bytes = usize::from(self.block_bytes.unwrap_or(0));
        match end.checked_rem(block_bytes) {
            Some(behind) if behind > 0 && behind < value_bytes => value_bytes - behind,
            _ => 0,
        }
    }
}

/// Length of the prefix that `name` shares with the one before. A record has at least one of its own.
fn common_bytes(name: &str, before: &str) -> usize {
    let pairs = name.bytes().zip(before.bytes());
    let common = pairs.take_while(|(a, b)| a == b).count();
    common.min(name.len().saturating_sub(1))
}

/// Copies what `part`, which lies at `at`, has of the bytes from `offset` to `end`.
fn copy(block: &mut Vec<u8, MAX_FILE_BYTES>, offset: u32, end: u32, at: u32, part: &[u8]) {
    for (place, byte) in (at..).zip(part) {
        if (offset..end).contains(&place) {
            // A block has room for what is read at once.
            let _ = block.push(*byte);
        }
    }
}

#[cfg(test)]
mod tests;
