//! The program in an ELF file, as far as its hash needs it (System V ABI, chapters "ELF Header" and "Program Header").

use crate::identity::FirmwareHash;

/// A file of 32 bits, little-endian.
const START: &[u8] = b"\x7fELF\x01\x01";

/// In the file's header: where program headers are, the size of one, and how many there are.
const TABLE_AT: usize = 0x1c;
const HEADER_BYTES_AT: usize = 0x2a;
const HEADERS_AT: usize = 0x2c;

/// In a program header: the segment's type, where it is in the file and in flash, and how much of it is in the file.
const TYPE_AT: usize = 0x00;
const OFFSET_AT: usize = 0x04;
const ADDRESS_AT: usize = 0x0c;
const BYTES_AT: usize = 0x10;

/// A segment that is loaded.
const LOAD: u32 = 1;

/// The hash that the firmware in an ELF file reports; `None` if the file is damaged or has no program.
pub fn hash_of_elf(file: &[u8]) -> Option<FirmwareHash> {
    if !file.starts_with(START) {
        return None;
    }
    let table = file.get(word(file, TABLE_AT)? as usize..)?;
    let header_bytes = usize::from(half_word(file, HEADER_BYTES_AT)?);
    let headers = usize::from(half_word(file, HEADERS_AT)?);
    let mut segments = Vec::new();
    for header in 0..headers {
        segments.extend(loaded(file, table.get(header * header_bytes..)?)?);
    }
    segments.sort_by_key(|(address, _)| *address);
    let program = segments.iter().flat_map(|(_, segment)| *segment).copied();
    let program: Vec<u8> = program.collect();
    let (words, rest) = program.as_chunks();
    let is_whole = !words.is_empty() && rest.is_empty();
    is_whole.then(|| FirmwareHash::of(words.iter().copied().map(u32::from_le_bytes)))
}

/// The address and the bytes of the segment with this header, if it is one that is loaded; `None` if it is damaged.
fn loaded<'a>(file: &'a [u8], header: &[u8]) -> Option<Option<(u32, &'a [u8])>> {
    let segment = file.get(word(header, OFFSET_AT)? as usize..)?;
    let segment = segment.get(..word(header, BYTES_AT)? as usize)?;
    let address = word(header, ADDRESS_AT)?;
    Some((word(header, TYPE_AT)? == LOAD).then_some((address, segment)))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().copied().map(u32::from_le_bytes)
}

fn half_word(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().copied().map(u16::from_le_bytes)
}
