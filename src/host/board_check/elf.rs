//! The program in an ELF file, as far as its hash needs it.

use object::LittleEndian;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};

use crate::memory::identity::FirmwareHash;

/// The hash that the firmware in an ELF file reports; `None` if the file is damaged or has no program.
pub fn hash_of_elf(file: &[u8]) -> Option<FirmwareHash> {
    let header = FileHeader32::<LittleEndian>::parse(file).ok()?;
    let endian = header.endian().ok()?;
    let mut segments = Vec::new();
    for segment in header.program_headers(endian, file).ok()? {
        let bytes = segment.data(endian, file).ok()?;
        if segment.p_type(endian) == PT_LOAD {
            segments.push((segment.p_paddr(endian), bytes));
        }
    }
    segments.sort_by_key(|(address, _)| *address);
    let program = segments.iter().flat_map(|(_, segment)| *segment).copied();
    let program: Vec<u8> = program.collect();
    let (words, rest) = program.as_chunks();
    let is_whole = !words.is_empty() && rest.is_empty();
    is_whole.then(|| FirmwareHash::of(words.iter().copied().map(u32::from_le_bytes)))
}
