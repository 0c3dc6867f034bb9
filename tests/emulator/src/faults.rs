//! Faults a test puts in from outside.

use super::board::Board;
use super::boot_rom::{BRANCH_TO_SELF, UNDEFINED_INSTRUCTION};

impl Board {
    /// Cut an interrupt line (datasheet 2.3.2): whatever raises it, it is never delivered.
    pub fn cut_interrupt(&mut self, line: u32) {
        self.lines.cut(line);
        self.bus.attention = true;
    }

    /// Undo [`Self::cut_interrupt`].
    pub fn restore_interrupt(&mut self, line: u32) {
        self.lines.restore(line);
        self.bus.attention = true;
    }

    /// Have the DMA make no transfers, whatever requests them, until [`Self::release_dma`].
    pub fn hold_dma(&mut self) {
        self.bus.soc.dma.hold();
        self.bus.attention = true;
    }

    /// Undo [`Self::hold_dma`].
    pub fn release_dma(&mut self) {
        self.bus.soc.dma.release();
        self.bus.attention = true;
    }

    /// Have the next transfer of a DMA channel (0 to 11) end in a bus error at its read address, which halts the channel
    /// (datasheet 2.5, CTRL.AHB_ERROR). Nothing is read.
    pub fn fail_dma_transfer(&mut self, channel: usize) {
        self.bus.soc.dma.fail_transfer(channel);
    }

    /// Have an armed alarm of TIMER (0 to 3) never match.
    pub fn lose_timer_alarm(&mut self, number: usize) {
        self.bus.soc.timer.lose_alarm(number);
        self.bus.attention = true;
    }

    /// Hang the program: at the next moment in thread mode with interrupts on, it branches to
    /// itself until the next reset. Interrupts go on.
    pub fn hang_program(&mut self) {
        self.derail(BRANCH_TO_SELF);
    }

    /// Make the program run into an undefined instruction in thread mode.
    pub fn run_undefined_instruction(&mut self) {
        self.derail(UNDEFINED_INSTRUCTION);
    }

    fn derail(&mut self, address: u32) {
        self.cpu.derail(address);
        self.bus.attention = true;
    }

    /// A debugger halts cores (one bit each), or lets them go on. A reset of the chip ends it.
    pub fn halt_cores(&mut self, cores: u32) {
        let now = self.bus.now;
        self.halted_cores = cores;
        self.bus.soc.timer.set_halted_cores(cores, now);
        self.bus.soc.watchdog.set_halted_cores(cores, now);
        self.bus.attention = true;
    }

    /// A probe that reads the log in blocking mode, as it sets it up, has its cable pulled: nothing reads any more.
    pub fn pull_probe_cable(&mut self) {
        self.bus.rtt.pull_cable(&mut self.bus.memory);
    }

    /// Have nothing between the registers of XIP_SSI and RAM, which the datasheet leaves open, answer without a bus error.
    pub fn answer_below_ram(&mut self) {
        self.bus.answers_below_ram = true;
    }

    /// Overwrite a core register, the stack pointer for example; numbers as in
    /// [`Board::register`].
    pub fn set_register(&mut self, number: usize, value: u32) {
        self.cpu.core.set_reg(number, value);
    }
}
