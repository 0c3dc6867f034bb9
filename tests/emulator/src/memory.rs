//! Boot ROM, flash and RAM: the bytes and where they are (datasheet 2.2, 2.6).

use super::bus::Width;
use super::flash::FlashChip;

pub const ROM_SIZE: usize = 16 * 1024;
pub const FLASH_BASE: u32 = 0x1000_0000;
/// The Pico's flash chip, 2 MB.
pub const FLASH_SIZE: usize = 2 * 1024 * 1024;
pub const RAM_BASE: u32 = 0x2000_0000;
pub const RAM_SIZE: usize = 264 * 1024;

/// The four ways to see the flash through the cache differ only in caching, which is not modelled.
pub const FLASH_END: u32 = 0x1400_0000;
const FLASH_NO_ALLOCATE: u32 = 0x1100_0000;

/// A store to flash through the allocating alias drops the cache line and is otherwise ignored;
/// through the other aliases it is a bus error, as XIP_CTRL.ERR_BADWRITE is set after reset
/// (datasheet 2.6.3.6).
pub fn is_cached_flash(address: u32) -> bool {
    (FLASH_BASE..FLASH_NO_ALLOCATE).contains(&address)
}

/// Flash as it is read by address.
pub fn is_flash(address: u32) -> bool {
    (FLASH_BASE..FLASH_END).contains(&address)
}

#[derive(Clone)]
pub struct Memory {
    pub rom: Vec<u8>,
    pub flash: FlashChip,
    pub ram: Vec<u8>,
}

impl Memory {
    pub fn new(rom: Vec<u8>, flash: FlashChip) -> Self {
        assert_eq!(
            (rom.len(), flash.bytes().len()),
            (ROM_SIZE, FLASH_SIZE),
            "sizes of ROM and flash"
        );
        Self {
            rom,
            flash,
            ram: vec![0; RAM_SIZE],
        }
    }

    /// RAM, and the flash it is read with.
    #[inline]
    pub fn ram_and_flash(&mut self) -> (&mut [u8; RAM_SIZE], &[u8; FLASH_SIZE]) {
        let ram = self.ram.first_chunk_mut();
        let flash = self.flash.bytes().first_chunk();
        (
            ram.expect("the size was checked"),
            flash.expect("the size was checked"),
        )
    }

    /// `None` where there is no memory.
    #[inline]
    pub fn load(&self, address: u32, width: Width) -> Option<u32> {
        match address {
            RAM_BASE.. => get(&self.ram, (address - RAM_BASE) as usize, width),
            FLASH_BASE..FLASH_END => get(self.flash.bytes(), flash_offset(address), width),
            0..FLASH_BASE => get(&self.rom, address as usize, width),
            _ => None,
        }
    }

    /// Store into RAM; `None` anywhere else.
    #[inline]
    pub fn store(&mut self, address: u32, value: u32, width: Width) -> Option<()> {
        let offset = address.checked_sub(RAM_BASE)? as usize;
        let place = self.ram.get_mut(offset..)?;
        match width {
            Width::Byte => *place.first_mut()? = value as u8,
            Width::Half => *place.first_chunk_mut()? = (value as u16).to_le_bytes(),
            Width::Word => *place.first_chunk_mut()? = value.to_le_bytes(),
        }
        Some(())
    }
}

/// The flash chip has 21 address lines: it repeats every 2 MB.
fn flash_offset(address: u32) -> usize {
    address as usize % FLASH_SIZE
}

#[inline]
fn get(bytes: &[u8], offset: usize, width: Width) -> Option<u32> {
    let bytes = bytes.get(offset..)?;
    match width {
        Width::Byte => bytes.first().copied().map(u32::from),
        Width::Half => bytes
            .first_chunk()
            .map(|half| u32::from(u16::from_le_bytes(*half))),
        Width::Word => bytes.first_chunk().map(|word| u32::from_le_bytes(*word)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn memory() -> Memory {
        let mut flash = vec![0xff; FLASH_SIZE];
        flash[..4].copy_from_slice(&[1, 2, 3, 4]);
        Memory::new(vec![0; ROM_SIZE], FlashChip::new(flash, 1))
    }

    #[test]
    fn ram_is_264_kb_and_nothing_lies_next_to_it() {
        let mut memory = memory();
        let end = RAM_BASE + RAM_SIZE as u32;
        assert_eq!(end, 0x2004_2000);
        assert_eq!(memory.store(end - 4, 0x0102_0304, Width::Word), Some(()));
        assert_eq!(memory.load(end - 2, Width::Half), Some(0x0102));
        assert_eq!(memory.store(end - 2, 0, Width::Word), None);
        assert_eq!(memory.load(RAM_BASE - 4, Width::Word), None);
    }

    #[test]
    fn flash_is_seen_through_four_aliases_and_repeats() {
        let memory = memory();
        for base in [0x1000_0000, 0x1100_0000, 0x1200_0000, 0x1300_0000, 0x1020_0000] {
            assert_eq!(memory.load(base, Width::Word), Some(0x0403_0201));
        }
        assert_eq!(memory.load(0x1400_0000, Width::Word), None);
    }

    #[test]
    fn rom_and_flash_cannot_be_stored_to() {
        let mut memory = memory();
        assert_eq!(memory.store(0, 1, Width::Word), None);
        assert_eq!(memory.store(FLASH_BASE, 1, Width::Word), None);
    }
}
