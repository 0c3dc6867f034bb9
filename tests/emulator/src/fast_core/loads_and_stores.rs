//! Loads from RAM and flash, stores to RAM. What is elsewhere, or not aligned, is for the crate.

use super::super::bus::{CODE_PAGE_BYTES, CODE_PAGES};
use super::super::memory::{FLASH_BASE, FLASH_SIZE, RAM_BASE, RAM_SIZE};
use super::{Core, EXCEPTION_RETURN, Instruction, LR, Notice, SP, Step};

const CODE_PAGE: usize = CODE_PAGE_BYTES as usize;
const WORD: u32 = 4;
const _: () = assert!(CODE_PAGES * CODE_PAGE == RAM_SIZE);

impl Core<'_> {
    #[inline(always)]
    pub fn sum_of_pair(&self, i: Instruction) -> u32 {
        self.r[i.low(3)].wrapping_add(self.r[i.low(6)])
    }

    /// A base register and an immediate in units of `1 << shift`.
    #[inline(always)]
    pub fn base_and(&self, i: Instruction, shift: u32) -> u32 {
        self.r[i.low(3)].wrapping_add(i.immediate5() << shift)
    }

    #[inline(always)]
    fn load<const BYTES: usize>(&mut self, address: u32) -> Option<[u8; BYTES]> {
        if !(address as usize).is_multiple_of(BYTES) {
            return None;
        }
        let offset = address.wrapping_sub(RAM_BASE) as usize;
        if offset < RAM_SIZE {
            return self.ram[offset..].first_chunk().copied();
        }
        let offset = address.wrapping_sub(FLASH_BASE) as usize;
        if offset < FLASH_SIZE {
            self.cache.read(address);
            return self.flash[offset..].first_chunk().copied();
        }
        None
    }

    #[inline(always)]
    fn load_word(&mut self, address: u32) -> Option<u32> {
        self.load(address).map(u32::from_le_bytes)
    }

    #[inline(always)]
    pub fn ldr(&mut self, i: Instruction, register: usize, address: u32) -> Option<Step> {
        self.r[register] = self.load_word(address)?;
        i.done(2)
    }

    #[inline(always)]
    pub fn ldrh(&mut self, i: Instruction, address: u32) -> Option<Step> {
        self.r[i.low(0)] = u32::from(u16::from_le_bytes(self.load(address)?));
        i.done(2)
    }

    #[inline(always)]
    pub fn ldrb(&mut self, i: Instruction, address: u32) -> Option<Step> {
        self.r[i.low(0)] = u32::from(u8::from_le_bytes(self.load(address)?));
        i.done(2)
    }

    #[inline(always)]
    pub fn ldrsh(&mut self, i: Instruction, address: u32) -> Option<Step> {
        self.r[i.low(0)] = i16::from_le_bytes(self.load(address)?) as u32;
        i.done(2)
    }

    #[inline(always)]
    pub fn ldrsb(&mut self, i: Instruction, address: u32) -> Option<Step> {
        self.r[i.low(0)] = i8::from_le_bytes(self.load(address)?) as u32;
        i.done(2)
    }

    #[inline(always)]
    fn store<const BYTES: usize>(
        &mut self,
        i: Instruction,
        address: u32,
        value: [u8; BYTES],
    ) -> Option<Step> {
        let offset = self.place_in_ram(address, BYTES)?;
        if self.code_pages[offset / CODE_PAGE] {
            return None;
        }
        *self.ram[offset..].first_chunk_mut()? = value;
        if address == self.watched {
            self.notice = Some(Notice::WatchedStored);
        }
        i.done(2)
    }

    #[inline(always)]
    pub fn store_word(&mut self, i: Instruction, register: usize, address: u32) -> Option<Step> {
        self.store(i, address, self.r[register].to_le_bytes())
    }

    #[inline(always)]
    pub fn store_half(&mut self, i: Instruction, address: u32) -> Option<Step> {
        self.store(i, address, (self.r[i.low(0)] as u16).to_le_bytes())
    }

    #[inline(always)]
    pub fn store_byte(&mut self, i: Instruction, address: u32) -> Option<Step> {
        self.store(i, address, (self.r[i.low(0)] as u8).to_le_bytes())
    }

    /// Where in RAM an address lies that is a multiple of `align`.
    #[inline(always)]
    fn place_in_ram(&self, address: u32, align: usize) -> Option<usize> {
        let offset = address.wrapping_sub(RAM_BASE) as usize;
        (offset < RAM_SIZE && (address as usize).is_multiple_of(align)).then_some(offset)
    }

    /// Stores the listed registers from an address upwards; `None` without having stored anything.
    #[inline(always)]
    fn store_list(&mut self, mut list: u32, address: u32) -> Option<()> {
        let bytes = WORD * list.count_ones();
        let mut offset = self.place_in_ram(address, 4)?;
        let last = (offset + bytes as usize).saturating_sub(1);
        let is_code = |offset: usize| self.code_pages.get(offset / CODE_PAGE).copied();
        if is_code(offset)? || is_code(last)? || self.watched.wrapping_sub(address) < bytes {
            return None;
        }
        while list != 0 {
            let register = list.trailing_zeros() as usize;
            list &= list - 1;
            *self.ram[offset..].first_chunk_mut()? = self.r[register & 15].to_le_bytes();
            offset += 4;
        }
        Some(())
    }

    #[inline(always)]
    pub fn push(&mut self, i: Instruction) -> Option<Step> {
        let list = i.immediate8() | u32::from(i.opcode >> 8 & 1) << LR;
        let words = list.count_ones();
        let base = self.r[SP].wrapping_sub(WORD * words);
        self.store_list(list, base)?;
        self.r[SP] = base;
        self.lowest_stack_pointer = self.lowest_stack_pointer.min(base);
        i.done(1 + u64::from(words))
    }

    #[inline(always)]
    pub fn store_multiple(&mut self, i: Instruction) -> Option<Step> {
        let (list, base) = (i.immediate8(), self.r[i.low(8)]);
        self.store_list(list, base)?;
        let words = list.count_ones();
        self.r[i.low(8)] = base.wrapping_add(WORD * words);
        i.done(1 + u64::from(words))
    }

    /// Loads the listed low registers from an address on, all of which is memory.
    #[inline(always)]
    fn load_list(&mut self, mut list: u32, mut address: u32) {
        while list != 0 {
            let register = list.trailing_zeros() as usize;
            list &= list - 1;
            self.r[register & 7] = self.load_word(address).unwrap_or(0);
            address = address.wrapping_add(WORD);
        }
    }

    #[inline(always)]
    pub fn pop(&mut self, i: Instruction) -> Option<Step> {
        let list = i.immediate8();
        let base = self.r[SP];
        let pops_pc = i.opcode & 0x100 != 0;
        let words = list.count_ones() + u32::from(pops_pc);
        let end = base.wrapping_add(WORD * words);
        self.place_in_ram(base, 4)?;
        if words != 0 {
            self.place_in_ram(end.wrapping_sub(WORD), 4)?;
        }
        let step = if pops_pc {
            let target = self.load_word(end.wrapping_sub(WORD))?;
            if target & 1 == 0 || target >= EXCEPTION_RETURN {
                return None;
            }
            i.jump(target & !1, 4 + u64::from(words))?
        } else {
            i.done(1 + u64::from(words))?
        };
        self.load_list(list, base);
        self.r[SP] = end;
        Some(step)
    }

    #[inline(always)]
    pub fn load_multiple(&mut self, i: Instruction) -> Option<Step> {
        let (list, base) = (i.immediate8(), self.r[i.low(8)]);
        if list == 0 {
            return None;
        }
        let end = base.wrapping_add(WORD * list.count_ones());
        let last = end.wrapping_sub(WORD);
        // RAM and flash do not touch: what begins and ends in memory is in one of them.
        if last < base || !is_word_of_memory(base) || !is_word_of_memory(last) {
            return None;
        }
        self.load_list(list, base);
        if list & 1 << i.low(8) == 0 {
            self.r[i.low(8)] = end;
        }
        i.done(1 + u64::from(list.count_ones()))
    }
}

#[inline(always)]
fn is_word_of_memory(address: u32) -> bool {
    let is_in = |base, size| (address.wrapping_sub(base) as usize) < size;
    address.is_multiple_of(WORD) && (is_in(RAM_BASE, RAM_SIZE) || is_in(FLASH_BASE, FLASH_SIZE))
}
