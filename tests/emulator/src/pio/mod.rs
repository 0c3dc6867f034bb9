//! PIO: the two blocks of four state machines each (datasheet 3).
//!
//! State machines are stepped in the cycles of their own clocks, and not at all while they wait, so an idle block costs
//! nothing. What a block makes of its pins is kept with the cycle of each change ([`Pio::take_changes`]): it does not
//! depend on where the processor's instructions end. OUT_STICKY, INLINE_OUT_EN and forced interrupts are not modelled; using
//! them is a panic. The inputs come without the two cycles of their synchroniser.
//!
//! `picoem-common` has a model, too. It was tried, and differs from the datasheet: pins are high after reset and low while
//! nothing is enabled, FDEBUG stays 0, an empty OSR is filled and shifted in one cycle, X-- stops at 0, SM_RESTART clears
//! the program counter, and INTR has its bits in another order.

mod divider;
mod fifo;
mod instruction;
mod machine;
#[cfg(test)]
mod tests;

use super::clock::{Cycle, NEVER};
use super::peripheral::Peripheral;
use super::register::{RegisterWrite, bit, field};
pub use machine::Outputs;
use machine::{Machine, Shared};

const MACHINES: usize = 4;

const CTRL: u32 = 0x000;
const FSTAT: u32 = 0x004;
const FDEBUG: u32 = 0x008;
const FLEVEL: u32 = 0x00c;
const TXF0: u32 = 0x010;
const TXF3: u32 = 0x01c;
const RXF0: u32 = 0x020;
const RXF3: u32 = 0x02c;
const IRQ: u32 = 0x030;
const IRQ_FORCE: u32 = 0x034;
const INPUT_SYNC_BYPASS: u32 = 0x038;
const INSTR_MEM0: u32 = 0x048;
const INSTR_MEM31: u32 = 0x0c4;
const SM0: u32 = 0x0c8;
const SM3_END: u32 = SM0 + MACHINES as u32 * MACHINE_BYTES;
const MACHINE_BYTES: u32 = 0x18;
const INTR: u32 = 0x128;
const IRQ0_INTE: u32 = 0x12c;
const IRQ1_INTS: u32 = 0x140;

/// Registers of a state machine.
const CLKDIV: u32 = 0x00;
const EXECCTRL: u32 = 0x04;
const SHIFTCTRL: u32 = 0x08;
const ADDR: u32 = 0x0c;
const INSTR: u32 = 0x10;
const PINCTRL: u32 = 0x14;

const EXEC_STALLED: u32 = 31;
const EXECCTRL_MASK: u32 = 0x7fff_ff9f;
const STICKY_AND_INLINE: u32 = 0b11 << 17;
const SOURCES: u32 = 0xfff;

/// Interrupt lines (datasheet 2.3.2) and DMA requests (2.5.3.1) of a block.
#[derive(Clone, Copy, Debug)]
pub struct PioPlace {
    /// Of IRQ0; that of IRQ1 is the next.
    pub interrupt_line: u32,
    /// The first of four for TX FIFOs, which four for RX FIFOs follow.
    pub dma_request: u32,
}

/// Something at a block's pins that answers from one cycle of a state machine to the next.
pub trait PinDevice {
    /// The block makes this of its pins from now on.
    fn follow(&mut self, outputs: Outputs, now: Cycle);

    /// What the device makes of the pins, as the block sees it.
    fn levels(&self) -> Outputs;

    /// Do everything that is due up to and including `now`.
    fn advance(&mut self, now: Cycle);

    /// When [`Self::advance`] is needed next.
    fn next_event(&self) -> Cycle;
}

#[derive(Clone, Debug)]
pub struct Pio {
    place: PioPlace,
    machines: [Machine; MACHINES],
    shared: Shared,
    tx_over: u32,
    rx_under: u32,
    sync_bypass: u32,
    /// INTE of both interrupts.
    enabled: [u32; 2],
    /// What was made of the pins, and when it was changed, since that was taken last.
    changes: Vec<(Cycle, Outputs)>,
}

impl Pio {
    pub fn new(place: PioPlace) -> Self {
        Self {
            place,
            machines: [0, 1, 2, 3].map(Machine::new),
            shared: Shared {
                memory: [0; 32],
                flags: 0,
                inputs: 0,
                outputs: Outputs::default(),
            },
            tx_over: 0,
            rx_under: 0,
            sync_bypass: 0,
            enabled: [0; 2],
            changes: Vec::new(),
        }
    }

    /// The level at which the block drives a pin whose function it is.
    pub fn level(&self, pin: usize) -> Option<bool> {
        self.shared.outputs.level(pin)
    }

    /// What it has made of its pins since this was taken last, and since when.
    pub fn take_changes(&mut self) -> Vec<(Cycle, Outputs)> {
        std::mem::take(&mut self.changes)
    }

    /// The levels at the pins are these from now on.
    pub fn set_inputs(&mut self, levels: u32, now: Cycle) {
        if self.shared.inputs != levels {
            self.shared.inputs = levels;
            self.wake_all(now);
        }
    }

    /// Something that a state machine may wait for has changed.
    fn wake_all(&mut self, now: Cycle) {
        self.machines.iter_mut().for_each(|machine| machine.wake(now));
    }

    /// Like [`Peripheral::advance`], with a device at the pins.
    pub fn advance_with(&mut self, device: &mut impl PinDevice, now: Cycle) {
        device.follow(self.shared.outputs, now);
        self.take_levels(device.levels(), now);
        loop {
            let next = self.next_tick().min(device.next_event());
            if next > now {
                return;
            }
            device.advance(next);
            if self.next_tick() == next {
                self.tick(next);
                device.follow(self.shared.outputs, next);
            }
            self.take_levels(device.levels(), next);
        }
    }

    fn take_levels(&mut self, levels: Outputs, now: Cycle) {
        self.set_inputs(self.shared.inputs & !levels.driven | levels.high, now);
    }

    fn next_tick(&self) -> Cycle {
        let ticks = self.machines.iter().map(|machine| machine.next_tick);
        ticks.min().unwrap_or(NEVER)
    }

    /// Everything that happens in one cycle. Of two state machines that set a pin the higher one wins (3.5.6.1).
    fn tick(&mut self, now: Cycle) {
        let before = (self.shared.flags, self.shared.outputs);
        for machine in &mut self.machines {
            if machine.next_tick == now {
                machine.tick(&mut self.shared);
            }
        }
        if self.shared.flags != before.0 {
            self.wake_all(now);
        }
        self.note_outputs(before.1, now);
    }

    fn note_outputs(&mut self, before: Outputs, now: Cycle) {
        if self.shared.outputs != before {
            self.changes.push((now, self.shared.outputs));
        }
    }

    /// A bit for each state machine, the first at `lowest`.
    fn bits(&self, lowest: u32, is_set: impl Fn(&Machine) -> bool) -> u32 {
        let bits = self.machines.iter().enumerate();
        bits.fold(0, |bits, (number, machine)| {
            bits | u32::from(is_set(machine)) << (lowest + number as u32)
        })
    }

    fn fifo_status(&self) -> u32 {
        self.bits(0, |machine| machine.rx.is_full())
            | self.bits(8, |machine| machine.rx.is_empty())
            | self.bits(16, |machine| machine.tx.is_full())
            | self.bits(24, |machine| machine.tx.is_empty())
    }

    fn fifo_levels(&self) -> u32 {
        let levels = self.machines.iter().rev();
        levels.fold(0, |levels, machine| {
            levels << 8 | machine.rx.level() << 4 | machine.tx.level()
        })
    }

    fn fifo_debug(&self) -> u32 {
        self.bits(0, |machine| machine.rx_stall)
            | self.rx_under << 8
            | self.tx_over << 16
            | self.bits(24, |machine| machine.tx_stall)
    }

    fn clear_fifo_debug(&mut self, cleared: u32) {
        self.rx_under &= !field(cleared, 8, 4);
        self.tx_over &= !field(cleared, 16, 4);
        for (number, machine) in (0..).zip(&mut self.machines) {
            machine.rx_stall &= !bit(cleared, number);
            machine.tx_stall &= !bit(cleared, 24 + number);
        }
    }

    fn raw_interrupts(&self) -> u32 {
        self.bits(0, |machine| !machine.rx.is_empty())
            | self.bits(4, |machine| !machine.tx.is_full())
            | field(self.shared.flags, 0, 4) << 8
    }

    fn interrupt_status(&self, number: usize) -> u32 {
        self.raw_interrupts() & self.enabled[number]
    }

    fn control(&mut self, ctrl: u32, now: Cycle) {
        for (number, machine) in (0..).zip(&mut self.machines) {
            machine.enabled = bit(ctrl, number);
            if bit(ctrl, 4 + number) {
                machine.restart();
            }
            if bit(ctrl, 8 + number) {
                machine.divider.restart(now);
                machine.next_tick = NEVER;
            }
        }
    }

    fn read_machine(&self, number: usize, offset: u32) -> u32 {
        let machine = &self.machines[number];
        match offset {
            CLKDIV => machine.divider.register(),
            EXECCTRL => machine.exec_control | u32::from(machine.is_executing_stalled()) << EXEC_STALLED,
            SHIFTCTRL => machine.shift_control(),
            ADDR => machine.program_counter(),
            INSTR => machine.instruction(&self.shared),
            _ => machine.pin_control,
        }
    }

    fn write_machine(&mut self, number: usize, offset: u32, write: RegisterWrite, now: Cycle) {
        let value = write.applied_to(self.read_machine(number, offset));
        let machine = &mut self.machines[number];
        match offset {
            CLKDIV => {
                machine.divider.set_register(value, now);
                machine.next_tick = NEVER;
            }
            EXECCTRL => {
                assert!(
                    value & STICKY_AND_INLINE == 0,
                    "PIO: OUT_STICKY and INLINE_OUT_EN are not modelled"
                );
                machine.exec_control = value & EXECCTRL_MASK;
            }
            SHIFTCTRL => machine.set_shift_control(value & 0xffff_0000),
            INSTR => machine.execute_at_once(value as u16, &mut self.shared),
            PINCTRL => machine.pin_control = value,
            _ => {}
        }
    }
}

/// Which state machine's register of a row of four.
fn number(offset: u32, first: u32) -> usize {
    ((offset - first) / 4) as usize
}

impl Peripheral for Pio {
    fn read(&mut self, offset: u32, now: Cycle) -> u32 {
        match offset {
            CTRL => self.bits(0, |machine| machine.enabled),
            FSTAT => self.fifo_status(),
            FDEBUG => self.fifo_debug(),
            FLEVEL => self.fifo_levels(),
            RXF0..=RXF3 => {
                let number = number(offset, RXF0);
                let word = self.machines[number].rx.pop();
                self.rx_under |= u32::from(word.is_none()) << number;
                self.wake_all(now);
                word.unwrap_or(0)
            }
            IRQ => self.shared.flags,
            INPUT_SYNC_BYPASS => self.sync_bypass,
            SM0..SM3_END => {
                let offset = offset - SM0;
                self.read_machine((offset / MACHINE_BYTES) as usize, offset % MACHINE_BYTES)
            }
            INTR => self.raw_interrupts(),
            IRQ0_INTE..=IRQ1_INTS => {
                let (interrupt, register) = interrupt_register(offset);
                match register {
                    0 => self.enabled[interrupt],
                    1 => 0,
                    _ => self.interrupt_status(interrupt),
                }
            }
            // TXF and INSTR_MEM are for writing only.
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        let outputs = self.shared.outputs;
        match offset {
            CTRL => {
                let ctrl = write.applied_to(self.bits(0, |machine| machine.enabled));
                self.control(ctrl, now);
            }
            FDEBUG => self.clear_fifo_debug(write.value),
            TXF0..=TXF3 => {
                let number = number(offset, TXF0);
                let has_place = self.machines[number].tx.push(write.value);
                self.tx_over |= u32::from(!has_place) << number;
            }
            IRQ => self.shared.flags &= !write.value,
            IRQ_FORCE => self.shared.flags |= write.value & 0xff,
            INPUT_SYNC_BYPASS => write.update(&mut self.sync_bypass, u32::MAX),
            INSTR_MEM0..=INSTR_MEM31 => {
                self.shared.memory[number(offset, INSTR_MEM0)] = write.value as u16;
            }
            SM0..SM3_END => {
                let offset = offset - SM0;
                let number = (offset / MACHINE_BYTES) as usize;
                self.write_machine(number, offset % MACHINE_BYTES, write, now);
            }
            IRQ0_INTE..=IRQ1_INTS => {
                let (interrupt, register) = interrupt_register(offset);
                match register {
                    0 => write.update(&mut self.enabled[interrupt], SOURCES),
                    1 => panic!("PIO: forced interrupts are not modelled"),
                    _ => {}
                }
            }
            _ => {}
        }
        self.note_outputs(outputs, now);
        self.wake_all(now);
    }

    fn reset(&mut self, now: Cycle) {
        let before = self.shared.outputs;
        let (inputs, changes) = (self.shared.inputs, std::mem::take(&mut self.changes));
        *self = Self::new(self.place);
        self.shared.inputs = inputs;
        self.changes = changes;
        self.note_outputs(before, now);
    }

    fn advance(&mut self, now: Cycle) {
        loop {
            let next = self.next_tick();
            if next > now {
                return;
            }
            self.tick(next);
        }
    }

    /// What is before it changes the pins only, for which [`Pio::take_changes`] has the times.
    fn next_event(&self) -> Cycle {
        let events = self
            .machines
            .iter()
            .map(|machine| machine.next_event(&self.shared));
        events.min().unwrap_or(NEVER)
    }

    fn interrupt_lines(&self) -> u32 {
        (0..self.enabled.len()).fold(0, |lines, number| {
            // Looked at before each instruction that follows an access to a register: mostly nothing is enabled.
            let is_raised = self.enabled[number] != 0 && self.interrupt_status(number) != 0;
            lines | u32::from(is_raised) << (self.place.interrupt_line + number as u32)
        })
    }

    fn dma_requests(&self) -> u64 {
        let requests =
            self.bits(0, |machine| !machine.tx.is_full()) | self.bits(4, |machine| !machine.rx.is_empty());
        u64::from(requests) << self.place.dma_request
    }
}

/// Which interrupt's register, and which of INTE, INTF and INTS it is.
fn interrupt_register(offset: u32) -> (usize, u32) {
    let register = (offset - IRQ0_INTE) / 4;
    ((register / 3) as usize, register % 3)
}
