//! The instructions that most of a program consists of, executed without the bookkeeping of the CPU crate.
//!
//! What touches registers of peripherals, changes the processor's mode, faults or could, and whatever is in neither flash nor
//! RAM, is left to the crate ([`Cpu::step`]). Flags, cycles and counts are the crate's, instruction by instruction: [`tests`]
//! compares both for every encoding.

mod arithmetic;
mod flags;
mod kind;
mod loads_and_stores;
mod operands;
#[cfg(test)]
mod tests;

use super::bus::{CODE_PAGES, SystemBus};
use super::clock::Cycle;
use super::cpu::{Cpu, ISB};
use super::interrupts::would_preempt;
use super::memory::{FLASH_BASE, FLASH_SIZE, RAM_BASE, RAM_SIZE};
use super::xip_cache::XipCache;
use flags::Flags;
use kind::{KINDS, Kind};
use operands::{Instruction, Step};

const SP: usize = 13;
const LR: usize = 14;
const PC: usize = 15;

/// What a return from an exception branches to is for the crate.
const EXCEPTION_RETURN: u32 = 0xf000_0000;

/// The state of a processor that executes here.
struct Core<'a> {
    r: [u32; 16],
    flags: Flags,
    primask: u32,
    lowest_stack_pointer: u32,
    ram: &'a mut [u8; RAM_SIZE],
    flash: &'a [u8; FLASH_SIZE],
    cache: &'a mut XipCache,
    /// Where a store would make decoded instructions stale: such are for the crate.
    code_pages: &'a [bool; CODE_PAGES],
    /// A store here has to be noted.
    watched: u32,
    /// What the instruction did has to be looked at before the next one.
    notice: Option<Notice>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Notice {
    PrimaskChanged,
    WatchedStored,
}

impl Cpu {
    /// Executes up to `end`, or to the first instruction that is not for here, or after a store that has to be looked at.
    pub fn run_fast(&mut self, bus: &mut SystemBus, end: Cycle, lowest_stack_pointer: &mut u32) {
        if !self.may_run_fast(bus) {
            return;
        }
        let Some(flags) = Flags::of(self.core.regs.xpsr) else {
            return;
        };
        let (mut now, mut last_pc, mut count) = (bus.now, bus.pc, 0);
        let mut changed_primask = false;
        let (ram, flash) = bus.memory.ram_and_flash();
        let mut core = Core {
            r: self.core.regs.r,
            flags,
            primask: self.core.regs.primask,
            lowest_stack_pointer: *lowest_stack_pointer,
            ram,
            flash,
            cache: &mut bus.soc.xip_control.cache,
            code_pages: &bus.code_pages,
            watched: bus.rtt.watched(),
            notice: None,
        };
        let mut pc = core.r[PC];
        let mut stored = false;
        while now < end {
            let step = core.step(pc);
            // Also for an instruction that is left to the crate: it finds in the cache what was read here.
            now += core.cache.take_waiting();
            let Some(step) = step else { break };
            count += 1;
            last_pc = pc;
            pc = step.next;
            now += step.cycles;
            changed_primask = false;
            match core.notice.take() {
                None => {}
                Some(Notice::WatchedStored) => {
                    stored = true;
                    break;
                }
                Some(Notice::PrimaskChanged) => {
                    changed_primask = true;
                    if core.primask == 0 && would_preempt(&bus.chip.nvic, &bus.chip.ppb) {
                        break;
                    }
                    // The barrier that ends a critical section counts as no instruction, as in `Cpu::step`.
                    if now < end && core.is_barrier(pc) {
                        changed_primask = false;
                        pc = pc.wrapping_add(4);
                        now += 1;
                    }
                }
            }
        }
        core.r[PC] = pc;
        *lowest_stack_pointer = core.lowest_stack_pointer;
        let regs = &mut self.core.regs;
        (regs.r, regs.primask) = (core.r, core.primask);
        regs.xpsr = core.flags.put_into(regs.xpsr);
        self.changed_primask = changed_primask;
        (bus.now, bus.pc) = (now, last_pc);
        bus.instructions += count;
        if stored {
            bus.rtt.note_stored(bus.rtt.watched());
        }
    }
}

impl Core<'_> {
    /// Executes one instruction; `None` leaves it to the crate, and changes nothing but the flash cache.
    #[inline(always)]
    fn step(&mut self, pc: u32) -> Option<Step> {
        if (pc.wrapping_sub(FLASH_BASE) as usize) < FLASH_SIZE {
            self.cache.read(pc);
        }
        let opcode = self.halfword(pc)?;
        self.execute(Instruction { opcode, pc })
    }

    /// The halfword of the program at an address.
    #[inline(always)]
    fn halfword(&self, address: u32) -> Option<u16> {
        let offset = address.wrapping_sub(FLASH_BASE) as usize;
        let bytes = if offset < FLASH_SIZE {
            self.flash[offset..].first_chunk()
        } else {
            self.ram
                .get(address.wrapping_sub(RAM_BASE) as usize..)?
                .first_chunk()
        };
        bytes.copied().map(u16::from_le_bytes)
    }

    fn is_barrier(&self, pc: u32) -> bool {
        [self.halfword(pc), self.halfword(pc.wrapping_add(2))] == ISB.map(Some)
    }

    #[inline(always)]
    fn execute(&mut self, i: Instruction) -> Option<Step> {
        match KINDS[usize::from(i.opcode >> 6)] {
            Kind::LslImmediate => self.lsl_immediate(i),
            Kind::LsrImmediate => self.lsr_immediate(i),
            Kind::AsrImmediate => self.asr_immediate(i),
            Kind::AddRegister => self.set_sum(i, i.low(0), self.r[i.low(3)], self.r[i.low(6)], false),
            Kind::SubRegister => self.set_sum(i, i.low(0), self.r[i.low(3)], !self.r[i.low(6)], true),
            Kind::AddImmediate3 => self.set_sum(i, i.low(0), self.r[i.low(3)], i.immediate3(), false),
            Kind::SubImmediate3 => self.set_sum(i, i.low(0), self.r[i.low(3)], !i.immediate3(), true),
            Kind::MovImmediate => self.set_result(i, i.low(8), i.immediate8()),
            Kind::CmpImmediate => self.compare(i, self.r[i.low(8)], !i.immediate8(), true),
            Kind::AddImmediate8 => self.set_sum(i, i.low(8), self.r[i.low(8)], i.immediate8(), false),
            Kind::SubImmediate8 => self.set_sum(i, i.low(8), self.r[i.low(8)], !i.immediate8(), true),
            Kind::And => self.logic(i, |a, b| a & b),
            Kind::Eor => self.logic(i, |a, b| a ^ b),
            Kind::LslRegister => self.lsl_register(i),
            Kind::LsrRegister => self.lsr_register(i),
            Kind::AsrRegister => self.asr_register(i),
            Kind::Adc => self.set_sum(i, i.low(0), self.r[i.low(0)], self.r[i.low(3)], self.flags.c),
            Kind::Sbc => self.set_sum(i, i.low(0), self.r[i.low(0)], !self.r[i.low(3)], self.flags.c),
            Kind::Ror => self.ror(i),
            Kind::Tst => self.test(i),
            Kind::Rsb => self.set_sum(i, i.low(0), 0, !self.r[i.low(3)], true),
            Kind::CmpRegister => self.compare(i, self.r[i.low(0)], !self.r[i.low(3)], true),
            Kind::Cmn => self.compare(i, self.r[i.low(0)], self.r[i.low(3)], false),
            Kind::Orr => self.logic(i, |a, b| a | b),
            Kind::Mul => self.logic(i, u32::wrapping_mul),
            Kind::Bic => self.logic(i, |a, b| a & !b),
            Kind::Mvn => self.logic(i, |_, b| !b),
            Kind::AddHigh => self.add_high(i),
            Kind::CmpHigh => self.compare_high(i),
            Kind::MovHigh => self.mov_high(i),
            Kind::BranchExchange => self.branch_exchange(i),
            Kind::LdrLiteral => self.ldr(i, i.low(8), i.aligned_pc().wrapping_add(i.immediate8() << 2)),
            Kind::StrRegister => self.store_word(i, i.low(0), self.sum_of_pair(i)),
            Kind::StrhRegister => self.store_half(i, self.sum_of_pair(i)),
            Kind::StrbRegister => self.store_byte(i, self.sum_of_pair(i)),
            Kind::LdrsbRegister => self.ldrsb(i, self.sum_of_pair(i)),
            Kind::LdrRegister => self.ldr(i, i.low(0), self.sum_of_pair(i)),
            Kind::LdrhRegister => self.ldrh(i, self.sum_of_pair(i)),
            Kind::LdrbRegister => self.ldrb(i, self.sum_of_pair(i)),
            Kind::LdrshRegister => self.ldrsh(i, self.sum_of_pair(i)),
            Kind::StrImmediate => self.store_word(i, i.low(0), self.base_and(i, 2)),
            Kind::LdrImmediate => self.ldr(i, i.low(0), self.base_and(i, 2)),
            Kind::StrbImmediate => self.store_byte(i, self.base_and(i, 0)),
            Kind::LdrbImmediate => self.ldrb(i, self.base_and(i, 0)),
            Kind::StrhImmediate => self.store_half(i, self.base_and(i, 1)),
            Kind::LdrhImmediate => self.ldrh(i, self.base_and(i, 1)),
            Kind::StrStack => self.store_word(i, i.low(8), self.r[SP].wrapping_add(i.immediate8() << 2)),
            Kind::LdrStack => self.ldr(i, i.low(8), self.r[SP].wrapping_add(i.immediate8() << 2)),
            Kind::Adr => self.set(i, i.low(8), i.aligned_pc().wrapping_add(i.immediate8() << 2)),
            Kind::AddStack => self.set(i, i.low(8), self.r[SP].wrapping_add(i.immediate8() << 2)),
            Kind::RaiseStack => self.set_stack_pointer(i, self.r[SP].wrapping_add(i.immediate7() << 2)),
            Kind::LowerStack => self.set_stack_pointer(i, self.r[SP].wrapping_sub(i.immediate7() << 2)),
            Kind::Sxth => self.set(i, i.low(0), self.r[i.low(3)] as i16 as u32),
            Kind::Sxtb => self.set(i, i.low(0), self.r[i.low(3)] as i8 as u32),
            Kind::Uxth => self.set(i, i.low(0), self.r[i.low(3)] & 0xffff),
            Kind::Uxtb => self.set(i, i.low(0), self.r[i.low(3)] & 0xff),
            Kind::Push => self.push(i),
            Kind::ChangePrimask => self.change_primask(i),
            Kind::Rev => self.set(i, i.low(0), self.r[i.low(3)].swap_bytes()),
            Kind::Rev16 => self.set(i, i.low(0), self.r[i.low(3)].swap_bytes().rotate_right(16)),
            Kind::Revsh => self.set(i, i.low(0), (self.r[i.low(3)] as u16).swap_bytes() as i16 as u32),
            Kind::Pop => self.pop(i),
            Kind::Stm => self.store_multiple(i),
            Kind::Ldm => self.load_multiple(i),
            Kind::BranchIf => self.branch_if(i),
            Kind::Branch => i.branch(i.signed_offset(11), 3),
            Kind::ThirtyTwoBits => self.thirty_two_bits(i),
            Kind::Other => None,
        }
    }

    #[inline(always)]
    fn branch_exchange(&mut self, i: Instruction) -> Option<Step> {
        let register = i.high_source();
        let target = self.r[register];
        if register == PC || target & 1 == 0 || target >= EXCEPTION_RETURN {
            return None;
        }
        let step = i.jump(target & !1, 3)?;
        if i.opcode & 0x80 != 0 {
            self.r[LR] = i.pc.wrapping_add(2) | 1;
        }
        Some(step)
    }

    #[inline(always)]
    fn branch_if(&self, i: Instruction) -> Option<Step> {
        match self.flags.pass(i.opcode >> 8 & 15) {
            true => i.branch(i.signed_offset(8), 3),
            false => i.done(1),
        }
    }

    /// CPSIE and CPSID for PRIMASK; the other forms are for the crate.
    #[inline(always)]
    fn change_primask(&mut self, i: Instruction) -> Option<Step> {
        if i.opcode & 2 == 0 {
            return None;
        }
        let primask = u32::from(i.opcode >> 4 & 1);
        if self.primask != primask {
            self.primask = primask;
            self.notice = Some(Notice::PrimaskChanged);
        }
        i.done(1)
    }

    /// BL, MRS of PRIMASK, DSB and DMB.
    #[inline(always)]
    fn thirty_two_bits(&mut self, i: Instruction) -> Option<Step> {
        let second = self.halfword(i.pc.wrapping_add(2))?;
        if second & 0xd000 == 0xd000 {
            let step = i.branch(i.offset_of_call(second), 4)?;
            self.r[LR] = i.pc.wrapping_add(4) | 1;
            return Some(step);
        }
        match (i.opcode, second & 0xf0ff, second & 0xfff0) {
            (0xf3ef, 0x8010, _) => {
                self.r[usize::from(second >> 8 & 15)] = self.primask & 1;
                i.jump(i.pc.wrapping_add(4), 2)
            }
            (0xf3bf, _, 0x8f40 | 0x8f50) => i.jump(i.pc.wrapping_add(4), 1),
            _ => None,
        }
    }
}
