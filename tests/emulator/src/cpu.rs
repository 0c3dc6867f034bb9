//! Core 0: the crate's Cortex-M0+ with the parts of the architecture that it leaves out.
//!
//! Added here: preemption of a handler by a more urgent interrupt, waking from WFE and WFI by the
//! rules of the architecture, lockup, and the faults a test puts in.

use std::ops::Range;

use rp2040_emu::CortexM0Plus;
use rp2040_emu::core::Registers;

use super::boot_rom;
use super::bus::{SystemBus, Width};
use super::interrupts::would_preempt;
use super::memory::{FLASH_BASE, FLASH_SIZE, RAM_BASE, RAM_SIZE};
use super::random::Random;

const IPSR_MASK: u32 = 0x1ff;
const HARD_FAULT: u32 = 3;
const WFI: u32 = 0xbf30;
const THUMB: u32 = 1 << 24;
const FLASH: Range<u64> = FLASH_BASE as u64..FLASH_BASE as u64 + FLASH_SIZE as u64;
const RAM: Range<u64> = RAM_BASE as u64..RAM_BASE as u64 + RAM_SIZE as u64;
/// ISB SY.
pub(super) const ISB: [u16; 2] = [0xf3bf, 0x8f6f];

/// What the processor is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CpuState {
    Running,
    /// Asleep in WFE.
    WaitingForEvent,
    /// Asleep in WFI.
    WaitingForInterrupt,
    /// A fault came while a HardFault was being entered or handled: the core has stopped until
    /// something resets it (ARMv6-M B1.5.15).
    LockedUp,
}

pub struct Cpu {
    pub core: CortexM0Plus,
    state: CpuState,
    /// The address at which a test makes the program in thread mode go on.
    derailment: Option<u32>,
    /// Whether the instruction before changed PRIMASK.
    pub(super) changed_primask: bool,
}

/// The crate's core cannot be cloned. The copy decodes instructions again, and the rest of the core's state is empty between them.
impl Clone for Cpu {
    fn clone(&self) -> Self {
        let mut core = CortexM0Plus::new();
        core.regs = Registers { ..self.core.regs };
        core.cycles = self.core.cycles;
        if self.core.is_halted() {
            core.halt();
        }
        Self { core, ..*self }
    }
}

impl Cpu {
    /// A processor that leaves reset with these values from its vector table. What the other
    /// registers hold then is not defined (ARMv6-M B1.5.5).
    pub fn at_reset(stack_pointer: u32, entry: u32, random: &mut Random) -> Self {
        let mut core = CortexM0Plus::new();
        (0..=12).for_each(|number| core.set_reg(number, random.next_u64() as u32));
        core.regs.msp = stack_pointer & !3;
        core.regs.r[13] = stack_pointer & !3;
        core.regs.r[15] = entry & !1;
        core.regs.xpsr = THUMB;
        Self {
            core,
            state: CpuState::Running,
            derailment: None,
            changed_primask: false,
        }
    }

    pub fn state(&self) -> CpuState {
        self.state
    }

    pub fn is_running(&self) -> bool {
        self.state == CpuState::Running
    }

    /// The number of the exception being handled; 0 in thread mode.
    pub fn active_exception(&self) -> u32 {
        self.core.regs.xpsr & IPSR_MASK
    }

    /// Have the program go on at an address from the next moment at which it is in thread mode with interrupts on.
    pub fn derail(&mut self, address: u32) {
        self.derailment = Some(address);
    }

    /// Wake up if there is a reason to (ARMv6-M B1.5.18, B1.5.19).
    pub fn wake_if_due(&mut self, bus: &mut SystemBus) {
        let interrupt = would_preempt(&bus.chip.nvic, &bus.chip.ppb);
        let masked = self.core.regs.primask & 1 != 0;
        match self.state {
            CpuState::WaitingForEvent if bus.chip.event_flag => {
                bus.chip.event_flag = false;
                self.wake(bus);
            }
            CpuState::WaitingForEvent if interrupt && !masked => self.wake(bus),
            // WFI wakes for an interrupt that PRIMASK keeps from being taken, too.
            CpuState::WaitingForInterrupt if interrupt => self.wake(bus),
            CpuState::WaitingForEvent | CpuState::WaitingForInterrupt if self.derailment.is_some() => {
                self.wake(bus);
            }
            _ => {}
        }
    }

    fn wake(&mut self, bus: &mut SystemBus) {
        bus.chip.wfe_waiting = false;
        self.core.wake();
        self.state = CpuState::Running;
    }

    /// Execute one instruction or enter one exception; returns the cycles it took.
    #[inline]
    pub fn step(&mut self, bus: &mut SystemBus) -> u64 {
        if self.derailment.is_some() {
            self.derail_if_possible();
        }
        let pc = self.core.regs.pc();
        if boot_rom::is_function(pc) && !self.takes_interrupt(bus) {
            return boot_rom::call(&mut self.core, bus);
        }
        if bus.all_code_is_stale || !bus.stale_code.is_empty() {
            self.drop_stale_code(bus);
        }
        if self.is_barrier_of_critical_section(bus, pc) {
            self.changed_primask = false;
            self.core.regs.r[15] = pc + 4;
            return 1;
        }
        let primask = self.core.regs.primask;
        let cycles = self.step_with_preemption(bus);
        self.changed_primask = self.core.regs.primask != primask;
        bus.system_control.active_exception = self.active_exception();
        if bus.chip.wfe_waiting || self.core.is_halted() || bus.fault.is_some() {
            self.note_sleep_or_lockup(bus, pc);
        }
        u64::from(cycles.max(1))
    }

    /// Whether the instructions of [`super::fast_core`] do here what the crate's do.
    #[inline]
    pub(super) fn may_run_fast(&self, bus: &SystemBus) -> bool {
        let mpu = &bus.system_control.mpu;
        self.derailment.is_none()
            && !self.changed_primask
            && !self.core.is_halted()
            && bus.fault.is_none()
            && bus.flash_is_readable()
            && mpu.leaves_open(FLASH)
            && mpu.leaves_open(RAM)
            && !self.takes_interrupt(bus)
    }

    #[cfg(test)]
    pub(super) fn restart_with(&mut self, registers: [u32; 16], xpsr: u32, primask: u32) {
        self.core.wake();
        self.state = CpuState::Running;
        self.changed_primask = false;
        let regs = &mut self.core.regs;
        (regs.r, regs.xpsr, regs.primask, regs.control) = (registers, xpsr, primask, 0);
        regs.msp = registers[13];
    }

    /// Whether the next instruction is the ISB with which every critical section ends. The crate forgets all it has decoded
    /// then, which takes longer than the section; here stale code is dropped when it is written.
    fn is_barrier_of_critical_section(&self, bus: &SystemBus, pc: u32) -> bool {
        self.changed_primask
            && !self.takes_interrupt(bus)
            && bus.memory.load(pc, Width::Half) == Some(ISB[0].into())
            && bus.memory.load(pc + 2, Width::Half) == Some(ISB[1].into())
    }

    /// Whether it stands in the boot ROM and waits, for the flash chip or the wires to it. Only an interrupt goes on.
    pub fn waits_in_rom(&self, bus: &SystemBus) -> bool {
        boot_rom::waits(bus, self.core.regs.pc()) && !self.takes_interrupt(bus)
    }

    #[inline]
    fn takes_interrupt(&self, bus: &SystemBus) -> bool {
        self.core.regs.primask & 1 == 0 && would_preempt(&bus.chip.nvic, &bus.chip.ppb)
    }

    /// The crate's core takes no interrupt while any exception is active. For the one step in
    /// which a more urgent one has to be taken, the active ones are hidden from it.
    #[inline]
    fn step_with_preemption(&mut self, bus: &mut SystemBus) -> u32 {
        let preempts = bus.chip.ppb.any_active() && self.takes_interrupt(bus);
        let hidden = if preempts {
            std::mem::take(&mut bus.chip.ppb.active)
        } else {
            0
        };
        let cycles = self.core.step(bus);
        bus.chip.ppb.active |= hidden;
        cycles
    }

    #[cold]
    fn drop_stale_code(&mut self, bus: &mut SystemBus) {
        if std::mem::take(&mut bus.all_code_is_stale) {
            self.core.invalidate_decode_cache_all();
        }
        if !bus.stale_code.is_empty() {
            self.core.invalidate_decode_cache_entries(&bus.stale_code);
            bus.stale_code.clear();
        }
    }

    fn note_sleep_or_lockup(&mut self, bus: &mut SystemBus, pc: u32) {
        if bus.chip.wfe_waiting {
            self.state = CpuState::WaitingForEvent;
        } else if self.core.is_halted() {
            // WFI is the only instruction that halts the crate's core without a fault.
            let slept = bus.memory.load(pc, Width::Half) == Some(WFI);
            self.state = if slept {
                CpuState::WaitingForInterrupt
            } else {
                CpuState::LockedUp
            };
        } else if bus.fault.is_some() && self.active_exception() == HARD_FAULT {
            // A fault that is still open after a step happened while the exception was entered:
            // its frame could not be stacked, or its vector not be read.
            self.core.halt();
            self.state = CpuState::LockedUp;
        }
    }

    #[cold]
    fn derail_if_possible(&mut self) {
        let in_thread_mode = self.active_exception() == 0;
        if let Some(address) = self.derailment
            && in_thread_mode
            && !boot_rom::starts_program(self.core.regs.pc())
            && self.core.regs.primask & 1 == 0
        {
            self.derailment = None;
            self.core.regs.r[15] = address;
        }
    }
}
