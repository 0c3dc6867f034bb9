//! The release firmware as the ELF file describes it: flash image, symbols, sections, log strings.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use defmt_decoder::Table;
use object::read::elf::{ElfFile32, FileHeader, ProgramHeader};
use object::{LittleEndian, Object, ObjectSection, ObjectSymbol};

use super::memory::{FLASH_BASE, FLASH_SIZE};

/// The second stage in the first bytes of flash, and its checksum (2.8.1.3.1).
pub const SECOND_STAGE_BYTES: usize = 256;

/// A firmware image. Cheap to clone; load it once and power up as many boards as needed.
#[derive(Clone)]
pub struct Firmware {
    flash: Arc<Vec<u8>>,
    contents: Arc<Contents>,
}

struct Contents {
    symbols: HashMap<String, u32>,
    sections: HashMap<String, Range<u32>>,
    log_table: Option<&'static Table>,
}

/// Equal are files with equal bytes in flash.
impl PartialEq for Firmware {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.contents, &other.contents) && self.flash == other.flash
    }
}

impl Firmware {
    /// Load an ELF file linked for the RP2040's flash.
    ///
    /// Panics with a sentence that says what is wrong with the file.
    pub fn load(path: impl AsRef<Path>) -> Self {
        let path = path.as_ref();
        let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Self::from_elf(&bytes).unwrap_or_else(|reason| panic!("{}: {reason}", path.display()))
    }

    fn from_elf(bytes: &[u8]) -> Result<Self, String> {
        let elf = ElfFile32::<LittleEndian>::parse(bytes).map_err(|error| error.to_string())?;
        let flash = flash_image(&elf, bytes)?;
        if !has_second_stage(&flash) {
            return Err(
                "no second stage with a valid checksum in the first 256 bytes: it would not boot".into(),
            );
        }
        let symbols = elf
            .symbols()
            .filter_map(|symbol| Some((symbol.name().ok()?.to_owned(), symbol.address() as u32)));
        let sections = elf.sections().filter_map(|section| {
            let start = section.address() as u32;
            Some((
                section.name().ok()?.to_owned(),
                start..start + section.size() as u32,
            ))
        });
        // A stream decoder borrows its table, and both live as long as the test process.
        let log_table = Table::parse(bytes).map_err(|error| error.to_string())?;
        let log_table = log_table.map(|table| &*Box::leak(Box::new(table)));
        let (symbols, sections) = (symbols.collect(), sections.collect());
        Ok(Self {
            flash: Arc::new(flash),
            contents: Arc::new(Contents {
                symbols,
                sections,
                log_table,
            }),
        })
    }

    /// An image given byte by byte, for tests of the emulator itself.
    pub fn from_flash(flash: Vec<u8>) -> Self {
        let contents = Contents {
            symbols: HashMap::new(),
            sections: HashMap::new(),
            log_table: None,
        };
        Self {
            flash: Arc::new(flash),
            contents: Arc::new(contents),
        }
    }

    /// This firmware with other bytes in flash at an offset, where it keeps its data for
    /// example. Panics past the end of flash.
    pub fn with_flash(&self, offset: u32, bytes: &[u8]) -> Self {
        let mut flash = self.flash.to_vec();
        let place = offset as usize..offset as usize + bytes.len();
        flash
            .get_mut(place.clone())
            .unwrap_or_else(|| panic!("{place:#x?} is not in flash"))
            .copy_from_slice(bytes);
        Self {
            flash: Arc::new(flash),
            contents: Arc::clone(&self.contents),
        }
    }

    pub(super) fn shared_flash(&self) -> Arc<Vec<u8>> {
        Arc::clone(&self.flash)
    }

    /// Address of a symbol. Panics when the ELF has none of this name.
    pub fn symbol(&self, name: &str) -> u32 {
        self.find_symbol(name)
            .unwrap_or_else(|| panic!("the firmware has no symbol {name:?}"))
    }

    pub fn find_symbol(&self, name: &str) -> Option<u32> {
        self.contents.symbols.get(name).copied()
    }

    /// Addresses of a section such as `.data`, `.bss` or `.uninit`. Panics when there is none.
    pub fn section(&self, name: &str) -> Range<u32> {
        let range = self.contents.sections.get(name);
        range
            .cloned()
            .unwrap_or_else(|| panic!("the firmware has no section {name:?}"))
    }

    /// The strings of the defmt log, if the firmware logs.
    pub fn log_table(&self) -> Option<&'static Table> {
        self.contents.log_table
    }
}

/// Erased flash with the load segments put in at their physical addresses.
fn flash_image(elf: &ElfFile32<LittleEndian>, bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut flash = vec![0xff; FLASH_SIZE];
    let endian = elf.elf_header().endian().map_err(|error| error.to_string())?;
    for segment in elf.elf_program_headers() {
        let data = segment
            .data(endian, bytes)
            .map_err(|()| "a segment lies outside the file")?;
        if segment.p_type(endian) != object::elf::PT_LOAD || data.is_empty() {
            continue;
        }
        let address = segment.p_paddr(endian);
        let place = address.checked_sub(FLASH_BASE).map(|offset| offset as usize);
        let place = place.and_then(|offset| flash.get_mut(offset..offset + data.len()));
        place
            .ok_or_else(|| format!("a segment at {address:#x} is not in flash"))?
            .copy_from_slice(data);
    }
    Ok(flash)
}

/// The boot ROM starts a second stage only if its checksum is right; otherwise it waits for USB.
pub fn has_second_stage(flash: &[u8]) -> bool {
    let (code, stored) = flash[..SECOND_STAGE_BYTES].split_at(SECOND_STAGE_BYTES - 4);
    let computed = code.iter().fold(0xffff_ffff, |crc, &byte| crc32_step(crc, byte));
    computed.to_le_bytes() == stored
}

/// CRC-32 with polynomial 0x04c11db7, most significant bit first.
fn crc32_step(crc: u32, byte: u8) -> u32 {
    (0..8).fold(crc ^ u32::from(byte) << 24, |crc, _| {
        let shifted = crc << 1;
        if crc >> 31 != 0 {
            shifted ^ 0x04c1_1db7
        } else {
            shifted
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_crc32_mpeg2() {
        let crc = b"123456789"
            .iter()
            .fold(0xffff_ffff, |crc, &byte| crc32_step(crc, byte));
        assert_eq!(crc, 0x0376_e6e7, "check value of CRC-32/MPEG-2");
    }

    #[test]
    fn erased_flash_has_no_second_stage() {
        assert!(!has_second_stage(&vec![0xff; FLASH_SIZE]));
    }

    #[test]
    fn a_file_that_is_no_elf_is_refused() {
        assert!(Firmware::from_elf(b"not an ELF file").is_err());
    }
}
