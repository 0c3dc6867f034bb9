//! What a test sees of the flash chip, and what it can do to it.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::super::board::Board;
use super::super::memory::FLASH_SIZE;
use super::{ArmedCut, FlashChip, FlashCut, FlashMake, FlashOperation, FlashTiming, SerialChip, sector_of};

impl Board {
    /// Set how long the flash chip takes from its next operation on ([`FlashTiming::TYPICAL`] at
    /// first).
    pub fn flash_timing(&mut self, timing: FlashTiming) {
        self.flash_mut().timing = timing;
    }

    /// Solder another flash chip in, with the content of the one before; of use while the board is off.
    pub fn solder_flash(&mut self, make: FlashMake) {
        self.bus.soc.ssi.chip = SerialChip::new(make);
    }

    /// Status registers 1 and 2 of the flash chip.
    pub fn flash_status(&self) -> [u8; 2] {
        self.bus.soc.ssi.chip.status()
    }

    /// Number of times the status registers of the flash chip were stored.
    pub fn flash_status_writes(&self) -> u64 {
        self.bus.soc.ssi.chip.status_writes()
    }

    /// Cut the power at an operation of the flash chip; 1 is the next one to begin, and every
    /// sector, block and page counts. The run in which that happens returns with the board off.
    /// Replaces a cut that was set before and has not come yet.
    pub fn cut_power_at_flash_operation(&mut self, number: u64, cut: FlashCut) {
        let operations_before = number.checked_sub(1).expect("operations are counted from 1");
        self.flash_mut().armed = Some(ArmedCut {
            operations_before,
            cut,
        });
    }

    /// Erases and programs that are over, oldest first, also those cut short.
    pub fn flash_operations(&self) -> &[FlashOperation] {
        &self.bus.memory.flash.operations
    }

    /// Take the record of the operations so far.
    pub fn take_flash_operations(&mut self) -> Vec<FlashOperation> {
        std::mem::take(&mut self.flash_mut().operations)
    }

    /// Whether an erase or a program is under way.
    pub fn flash_is_busy(&self) -> bool {
        self.bus.memory.flash.is_busy()
    }

    /// How often each sector was erased since the board was made, by its offset.
    pub fn flash_erase_counts(&self) -> &BTreeMap<u32, u64> {
        &self.bus.memory.flash.erase_counts
    }

    /// What the flash chip holds, whether the board is on or off. Panics past its end.
    pub fn read_flash(&self, offset: u32, length: usize) -> Vec<u8> {
        self.bus.memory.flash.bytes[place(offset, length)].to_vec()
    }

    /// Put bytes into the flash chip from outside, as they are. Panics past its end.
    pub fn write_flash(&mut self, offset: u32, bytes: &[u8]) {
        let flash = Arc::make_mut(&mut self.flash_mut().bytes);
        flash[place(offset, bytes.len())].copy_from_slice(bytes);
        self.bus.flash_has_changed();
    }

    /// From now on no bit of the sector at this offset changes, whatever is erased or programmed.
    /// The chip takes its time as ever and reports nothing.
    pub fn wear_out_sector(&mut self, offset: u32) {
        place(offset, 1);
        self.flash_mut().worn_sectors.insert(sector_of(offset));
    }

    fn flash_mut(&mut self) -> &mut FlashChip {
        &mut self.bus.memory.flash
    }
}

fn place(offset: u32, length: usize) -> std::ops::Range<usize> {
    let range = offset as usize..offset as usize + length;
    assert!(range.end <= FLASH_SIZE, "{range:#x?} is not in flash");
    range
}
