//! The scheduler: instructions while the processor is awake, a jump to the next event while it
//! sleeps.

use super::board::{Board, STACK_POINTER};
use super::boot_rom;
use super::clock::{Cycle, cycles};
use super::register::bit;

const PROGRAM_COUNTER: usize = 15;

/// How often, at least, a condition given to [`Board::run_until`] is looked at.
const CONDITION_INTERVAL: Cycle = cycles(10);

impl Board {
    /// Let time pass. How a stretch of time is cut into runs makes no difference to what happens.
    /// The run ends early when the power is cut; with the power off time passes all the same.
    pub fn run_for(&mut self, micros: u64) {
        self.run_end += cycles(micros);
        self.run_to(self.run_end);
    }

    /// Let time pass until `time_us` after power-up; nothing happens if that is in the past.
    pub fn run_until_time(&mut self, time_us: u64) {
        self.run_end = self.run_end.max(cycles(time_us));
        self.run_to(cycles(time_us));
    }

    /// Let time pass until a condition holds, at most `timeout` microseconds. Returns whether it
    /// came to hold. While the processor is awake it is looked at every 10 µs. A power cut ends the
    /// run.
    pub fn run_until(&mut self, timeout: u64, mut condition: impl FnMut(&mut Board) -> bool) -> bool {
        let end = self.bus.now + cycles(timeout);
        let powered = self.powered;
        loop {
            self.bus.advance_stream();
            if condition(self) {
                self.run_end = self.bus.now;
                return true;
            }
            if powered && !self.powered {
                self.run_end = self.bus.now;
                return false;
            }
            if self.bus.now >= end {
                self.run_end = end;
                return false;
            }
            self.run_slice(end.min(self.bus.now + CONDITION_INTERVAL), end);
        }
    }

    fn run_to(&mut self, end: Cycle) {
        let powered = self.powered;
        while self.bus.now < end {
            self.run_slice(end, end);
            if powered && !self.powered {
                self.run_end = self.bus.now;
                break;
            }
        }
        self.bus.advance_stream();
    }

    /// One round: peripherals, interrupts, then instructions up to `awake_end` or the next event;
    /// asleep or waiting for flash, straight to the next event or to `end`.
    fn run_slice(&mut self, awake_end: Cycle, end: Cycle) {
        if !self.powered {
            self.bus.now = end;
            self.bus.soc.advance(end);
            return;
        }
        self.settle();
        if !self.powered {
            return;
        }
        let start = self.bus.now;
        let event = self.bus.next_event();
        if bit(self.halted_cores, 0) {
            self.bus.now = event.min(end).max(start + 1);
        } else if self.cpu.waits_in_rom(&self.bus) {
            self.bus.now = event.min(awake_end).max(start + 1);
            self.awake_cycles += self.bus.now - start;
        } else if self.cpu.is_running() {
            let stream = self.bus.limit_stream_lag();
            self.execute(event.min(awake_end).min(stream).max(start + 1));
            self.awake_cycles += self.bus.now - start;
        } else {
            self.bus.now = event.min(end).max(start + 1);
        }
    }

    /// Bring everything up to the present.
    fn settle(&mut self) {
        self.bus.attention = false;
        self.bus.advance();
        if self.bus.memory.flash.take_power_failure() {
            return self.cut_power();
        }
        self.reset_if_requested();
        let lines = self.bus.soc.interrupt_lines();
        let chip = &mut self.bus.chip;
        self.lines.update(lines, &mut chip.nvic, &chip.ppb);
        self.cpu.wake_if_due(&mut self.bus);
    }

    fn execute(&mut self, end: Cycle) {
        while self.bus.now < end && !self.bus.attention && self.cpu.is_running() {
            self.cpu
                .run_fast(&mut self.bus, end, &mut self.lowest_stack_pointer);
            if self.bus.rtt.written {
                self.drain_log();
            }
            if self.bus.now >= end {
                return;
            }
            let pc = self.register(PROGRAM_COUNTER);
            let taken = self.cpu.step(&mut self.bus);
            self.bus.now += taken + self.bus.soc.xip_control.cache.take_waiting();
            if self.register(PROGRAM_COUNTER) == pc && !boot_rom::is_function(pc) {
                // A branch to itself: nothing comes of it until the next event.
                self.bus.now += end.saturating_sub(self.bus.now).div_ceil(taken) * taken;
            }
            self.lowest_stack_pointer = self.lowest_stack_pointer.min(self.register(STACK_POINTER));
            if self.bus.rtt.written {
                self.drain_log();
            }
        }
    }

    fn drain_log(&mut self) {
        let bytes = self.bus.rtt.take(&mut self.bus.memory);
        self.log.receive(&bytes, self.time_us());
    }
}
