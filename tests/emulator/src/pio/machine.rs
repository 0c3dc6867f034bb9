//! A state machine: what it does in a cycle of its clock (datasheet 3.2, 3.4, 3.5).

use super::super::clock::{Cycle, NEVER};
use super::super::register::{bit, field};
use super::divider::Divider;
use super::fifo::Fifo;
use super::instruction::{DelayAndSide, IN, IRQ, Instruction, JUMP, MOVE, OUT, PUSH_OR_PULL, WAIT, or_32};

/// What the four state machines of a block share.
#[derive(Clone, Debug)]
pub struct Shared {
    pub memory: [u16; 32],
    /// The eight interrupt flags.
    pub flags: u32,
    /// The levels at the pins.
    pub inputs: u32,
    pub outputs: Outputs,
}

/// What a block makes of its pins, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    pub high: u32,
    pub driven: u32,
}

impl Outputs {
    /// The level of a pin; `None` when it is not driven.
    pub fn level(self, pin: usize) -> Option<bool> {
        let pin = pin as u32;
        bit(self.driven, pin).then(|| bit(self.high, pin))
    }
}

/// What a cycle has come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// On to the next instruction.
    Done,
    /// The instruction has set the program counter.
    Jumped,
    /// This instruction again in the next cycle.
    Retry,
    /// This instruction again, but not before something from outside has changed.
    Stalled,
}

/// A shift register, and how many bits went in or out since it was full or empty.
#[derive(Clone, Debug, Default)]
struct Shift {
    value: u32,
    count: u32,
}

#[derive(Clone, Debug)]
pub struct Machine {
    number: u32,
    pub enabled: bool,
    pub divider: Divider,
    /// The next cycle of its clock in which something may happen.
    pub next_tick: Cycle,
    pub exec_control: u32,
    shift_control: u32,
    pub pin_control: u32,
    pub tx: Fifo,
    pub rx: Fifo,
    /// FDEBUG: stalled on a full RX FIFO, on an empty TX FIFO.
    pub rx_stall: bool,
    pub tx_stall: bool,
    pc: u32,
    x: u32,
    y: u32,
    input: Shift,
    output: Shift,
    delay: u32,
    /// An instruction from SMx_INSTR, OUT EXEC or MOV EXEC instead of the program's next.
    executed: Option<u16>,
    /// An IRQ instruction has raised its flag and waits until it is lowered.
    waits_for_flag: bool,
}

impl Machine {
    /// Registers after reset: 3.7.
    pub fn new(number: u32) -> Self {
        Self {
            number,
            enabled: false,
            divider: Divider::new(),
            next_tick: NEVER,
            exec_control: 0x0001_f000,
            shift_control: 0x000c_0000,
            pin_control: 0x1400_0000,
            tx: Fifo::new(),
            rx: Fifo::new(),
            rx_stall: false,
            tx_stall: false,
            pc: 0,
            x: 0,
            y: 0,
            input: Shift::default(),
            output: Shift { value: 0, count: 32 },
            delay: 0,
            executed: None,
            waits_for_flag: false,
        }
    }

    pub fn program_counter(&self) -> u32 {
        self.pc
    }

    /// What SMx_INSTR reads as.
    pub fn instruction(&self, shared: &Shared) -> u32 {
        u32::from(self.executed.unwrap_or(shared.memory[self.pc as usize]))
    }

    pub fn is_executing_stalled(&self) -> bool {
        self.executed.is_some()
    }

    pub fn shift_control(&self) -> u32 {
        self.shift_control
    }

    /// "When this bit is changed, the FIFOs are cleared" (3.7, SHIFTCTRL.FJOIN).
    pub fn set_shift_control(&mut self, value: u32) {
        let joins = field(value, 30, 2);
        if joins != field(self.shift_control, 30, 2) {
            let (tx, rx) = [(1, 1), (2, 0), (0, 2), (0, 0)][joins as usize];
            self.tx.set_shares(tx);
            self.rx.set_shares(rx);
        }
        self.shift_control = value;
    }

    /// CTRL.SM_RESTART: program counter, X, Y and the contents of the output shift register stay (3.7).
    pub fn restart(&mut self) {
        self.input = Shift::default();
        self.output.count = 32;
        self.delay = 0;
        self.executed = None;
        self.waits_for_flag = false;
    }

    /// Something that it may wait for has changed.
    pub fn wake(&mut self, now: Cycle) {
        if self.runs() {
            self.next_tick = self.next_tick.min(self.divider.next_after(now));
        } else {
            self.next_tick = NEVER;
        }
    }

    /// An instruction from SMx_INSTR is executed by a disabled state machine, too, however long it stalls: drivers set X by
    /// OUT with autopull in a stopped one.
    fn runs(&self) -> bool {
        self.enabled || self.executed.is_some()
    }

    /// An instruction written to SMx_INSTR is executed at once, enabled or not. If it can't be, it is tried again.
    pub fn execute_at_once(&mut self, code: u16, shared: &mut Shared) {
        self.delay = 0;
        self.executed = Some(code);
        self.step(shared);
    }

    /// A cycle of its clock.
    pub fn tick(&mut self, shared: &mut Shared) {
        let now = self.next_tick;
        let outcome = if self.delay > 0 {
            self.delay -= 1;
            self.refill_output();
            Outcome::Done
        } else {
            self.step(shared)
        };
        self.next_tick = match outcome {
            Outcome::Stalled => NEVER,
            _ if !self.runs() => NEVER,
            Outcome::Done | Outcome::Jumped | Outcome::Retry => self.divider.next_after(now),
        };
    }

    fn step(&mut self, shared: &mut Shared) -> Outcome {
        let executed = self.executed.take();
        let code = executed.unwrap_or(shared.memory[self.pc as usize]);
        let fields = DelayAndSide::of(code, field(self.pin_control, 29, 3), bit(self.exec_control, 30));
        let instruction = Instruction(code);
        let outcome = self.execute(instruction, shared);
        if instruction.operation() != OUT {
            self.refill_output();
        }
        // Stalled or not; and it wins over OUT and SET at the same pin (3.5.6.1).
        if let Some((value, pins)) = fields.side {
            self.set_side(value, pins, shared);
        }
        match outcome {
            Outcome::Retry | Outcome::Stalled => self.executed = executed,
            Outcome::Done if executed.is_none() => self.go_on(),
            Outcome::Done | Outcome::Jumped => {}
        }
        let hands_over = self.executed.is_some() && matches!(outcome, Outcome::Done | Outcome::Jumped);
        if matches!(outcome, Outcome::Done | Outcome::Jumped) && !hands_over {
            self.delay = fields.delay;
        }
        outcome
    }

    /// The next cycle in which something happens that is not seen at its pins alone.
    pub fn next_event(&self, shared: &Shared) -> Cycle {
        match self.next_tick {
            NEVER => NEVER,
            next => self.divider.later_by(next, self.quiet_ticks(shared)),
        }
    }

    /// The cycles of its clock, from the next on, that reach no FIFO, no flag and no other state machine, and wait for
    /// nothing: what is left of a loop of `OUT PINS` or `IN PINS` and a decrementing `JMP` back to it, up to the transfer
    /// between shift register and FIFO.
    fn quiet_ticks(&self, shared: &Shared) -> u64 {
        if !self.enabled || self.executed.is_some() || self.delay > 0 {
            return 0;
        }
        let jump = Instruction(shared.memory[(self.pc as usize + 1) % 32]);
        let counter = match (jump.operation(), jump.middle()) {
            (JUMP, 2) if jump.low() == self.pc => self.x,
            (JUMP, 4) if jump.low() == self.pc => self.y,
            _ => return 0,
        };
        let rounds = self.rounds_to_fifo(Instruction(shared.memory[self.pc as usize]));
        // A round has two cycles at least; the last one may go on to something else.
        2 * u64::from(rounds.min(counter))
    }

    /// How often a shift instruction can be executed before it moves a word from or to a FIFO.
    fn rounds_to_fifo(&self, shift: Instruction) -> u32 {
        let bits_left = match (shift.operation(), shift.middle()) {
            (OUT, 0) => self.pull_threshold().saturating_sub(self.output.count),
            (IN, 0) => self.push_threshold().saturating_sub(self.input.count),
            _ => return 0,
        };
        (bits_left / or_32(shift.low())).saturating_sub(1)
    }

    fn go_on(&mut self) {
        let (top, bottom) = (field(self.exec_control, 12, 5), field(self.exec_control, 7, 5));
        self.pc = if self.pc == top {
            bottom
        } else {
            (self.pc + 1) % 32
        };
    }

    fn execute(&mut self, instruction: Instruction, shared: &mut Shared) -> Outcome {
        let (middle, low) = (instruction.middle(), instruction.low());
        let (bit_7, bit_6, bit_5) = (instruction.flag(7), instruction.flag(6), instruction.flag(5));
        match instruction.operation() {
            JUMP => self.jump(middle, low, shared),
            WAIT => self.wait(bit_7, middle & 0b11, low, shared),
            IN => self.shift_in(middle, or_32(low), shared),
            OUT => self.shift_out(middle, or_32(low), shared),
            PUSH_OR_PULL if bit_7 => self.pull(bit_6, bit_5),
            PUSH_OR_PULL => self.push(bit_6, bit_5),
            MOVE => self.copy(middle, low >> 3, low & 0b111, shared),
            IRQ => self.interrupt(bit_6, bit_5, low, shared),
            _ => self.set(middle, low, shared),
        }
    }

    fn jump(&mut self, condition: u32, address: u32, shared: &Shared) -> Outcome {
        let (x, y) = (self.x, self.y);
        let is_taken = match condition {
            0 => true,
            1 => x == 0,
            2 => {
                // "The decrement is not conditional on the current value" (3.4.2.2).
                self.x = x.wrapping_sub(1);
                x != 0
            }
            3 => y == 0,
            4 => {
                self.y = y.wrapping_sub(1);
                y != 0
            }
            5 => x != y,
            6 => bit(shared.inputs, field(self.exec_control, 24, 5)),
            _ => self.output.count < self.pull_threshold(),
        };
        if !is_taken {
            return Outcome::Done;
        }
        self.pc = address;
        Outcome::Jumped
    }

    fn wait(&self, polarity: bool, source: u32, index: u32, shared: &mut Shared) -> Outcome {
        let level = match source {
            0 => bit(shared.inputs, index),
            1 => bit(self.read_pins(shared), index),
            2 => bit(shared.flags, self.flag(index)),
            _ => panic!("PIO: WAIT has no source {source}"),
        };
        if level != polarity {
            return Outcome::Stalled;
        }
        if source == 2 && polarity {
            shared.flags &= !(1 << self.flag(index));
        }
        Outcome::Done
    }

    /// With the top bit the state machine's number is added to the two lowest, without a carry (3.4.9.2).
    fn flag(&self, index: u32) -> u32 {
        let own = if bit(index, 4) { self.number } else { 0 };
        index & 0b100 | (index + own) & 0b011
    }

    /// The input pins, from the first one of the state machine's on.
    fn read_pins(&self, shared: &Shared) -> u32 {
        shared.inputs.rotate_right(field(self.pin_control, 15, 5))
    }

    fn shift_in(&mut self, source: u32, bits: u32, shared: &Shared) -> Outcome {
        let pushes = bit(self.shift_control, 16) && self.input.count + bits >= self.push_threshold();
        if pushes && self.rx.is_full() {
            self.rx_stall = true;
            return Outcome::Stalled;
        }
        let value = match source {
            0 => self.read_pins(shared),
            1 => self.x,
            2 => self.y,
            3 => 0,
            6 => self.input.value,
            7 => self.output.value,
            _ => panic!("PIO: IN has no source {source}"),
        };
        let data = lowest(value, bits);
        let old = u64::from(self.input.value);
        self.input.value = if bit(self.shift_control, 18) {
            ((old | u64::from(data) << 32) >> bits) as u32
        } else {
            (old << bits) as u32 | data
        };
        self.input.count = (self.input.count + bits).min(32);
        if pushes {
            self.rx.push(std::mem::take(&mut self.input).value);
        }
        Outcome::Done
    }

    /// With autopull, in the cycles of 3.5.4.2: an empty register is filled in a cycle that shifts nothing out.
    fn shift_out(&mut self, destination: u32, bits: u32, shared: &mut Shared) -> Outcome {
        if self.pulls_by_itself() && self.output.count >= self.pull_threshold() {
            if self.refill_output() {
                return Outcome::Retry;
            }
            self.tx_stall = true;
            return Outcome::Stalled;
        }
        let value = u64::from(self.output.value);
        let data = if bit(self.shift_control, 19) {
            self.output.value = (value >> bits) as u32;
            lowest(value as u32, bits)
        } else {
            self.output.value = (value << bits) as u32;
            (value << bits >> 32) as u32
        };
        self.output.count = (self.output.count + bits).min(32);
        self.refill_output();
        self.take_out(destination, bits, data, shared)
    }

    fn take_out(&mut self, destination: u32, bits: u32, data: u32, shared: &mut Shared) -> Outcome {
        match destination {
            0 => put(&mut shared.outputs.high, self.out_pins(), data),
            1 => self.x = data,
            2 => self.y = data,
            3 => {}
            4 => put(&mut shared.outputs.driven, self.out_pins(), data),
            5 => {
                self.pc = data % 32;
                return Outcome::Jumped;
            }
            6 => {
                self.input = Shift {
                    value: data,
                    count: bits,
                }
            }
            _ => self.executed = Some(data as u16),
        }
        Outcome::Done
    }

    fn push(&mut self, if_full: bool, block: bool) -> Outcome {
        if if_full && self.input.count < self.push_threshold() {
            return Outcome::Done;
        }
        if self.rx.is_full() {
            self.rx_stall = true;
            if block {
                return Outcome::Stalled;
            }
        }
        self.rx.push(std::mem::take(&mut self.input).value);
        Outcome::Done
    }

    fn pull(&mut self, if_empty: bool, block: bool) -> Outcome {
        let is_empty = self.output.count >= self.pull_threshold();
        // With autopull it is "a no-op when the OSR is full" (3.4.7.2).
        if (if_empty || self.pulls_by_itself()) && !is_empty {
            return Outcome::Done;
        }
        let value = match self.tx.pop() {
            Some(value) => value,
            None if block => {
                self.tx_stall = true;
                return Outcome::Stalled;
            }
            None => self.x,
        };
        self.output = Shift { value, count: 0 };
        Outcome::Done
    }

    fn copy(&mut self, destination: u32, operation: u32, source: u32, shared: &mut Shared) -> Outcome {
        let value = match source {
            0 => self.read_pins(shared),
            1 => self.x,
            2 => self.y,
            3 => 0,
            5 => self.status(),
            6 => self.input.value,
            7 => self.output.value,
            _ => panic!("PIO: MOV has no source {source}"),
        };
        let value = match operation {
            0 => value,
            1 => !value,
            2 => value.reverse_bits(),
            _ => panic!("PIO: MOV has no operation {operation}"),
        };
        match destination {
            0 => put(&mut shared.outputs.high, self.out_pins(), value),
            1 => self.x = value,
            2 => self.y = value,
            4 => self.executed = Some(value as u16),
            5 => {
                self.pc = value % 32;
                return Outcome::Jumped;
            }
            6 => self.input = Shift { value, count: 0 },
            7 => self.output = Shift { value, count: 0 },
            _ => panic!("PIO: MOV has no destination {destination}"),
        }
        Outcome::Done
    }

    /// All ones while the level of a FIFO is below a number (3.7, EXECCTRL.STATUS_SEL).
    fn status(&self) -> u32 {
        let fifo = if bit(self.exec_control, 4) {
            &self.rx
        } else {
            &self.tx
        };
        if fifo.level() < field(self.exec_control, 0, 4) {
            u32::MAX
        } else {
            0
        }
    }

    fn interrupt(&mut self, clear: bool, wait: bool, index: u32, shared: &mut Shared) -> Outcome {
        let flag = 1 << self.flag(index);
        if clear {
            shared.flags &= !flag;
            return Outcome::Done;
        }
        if !self.waits_for_flag {
            shared.flags |= flag;
            self.waits_for_flag = wait;
            return if wait { Outcome::Retry } else { Outcome::Done };
        }
        self.waits_for_flag = shared.flags & flag != 0;
        if self.waits_for_flag {
            Outcome::Stalled
        } else {
            Outcome::Done
        }
    }

    fn set(&mut self, destination: u32, data: u32, shared: &mut Shared) -> Outcome {
        let pins = (field(self.pin_control, 5, 5), field(self.pin_control, 26, 3));
        match destination {
            0 => put(&mut shared.outputs.high, pins, data),
            1 => self.x = data,
            2 => self.y = data,
            4 => put(&mut shared.outputs.driven, pins, data),
            _ => panic!("PIO: SET has no destination {destination}"),
        }
        Outcome::Done
    }

    fn set_side(&self, value: u32, pins: u32, shared: &mut Shared) {
        let base = field(self.pin_control, 10, 5);
        let register = if bit(self.exec_control, 29) {
            &mut shared.outputs.driven
        } else {
            &mut shared.outputs.high
        };
        put(register, (base, pins), value);
    }

    /// The first and the number of the pins for OUT and MOV.
    fn out_pins(&self) -> (u32, u32) {
        (field(self.pin_control, 0, 5), field(self.pin_control, 20, 6))
    }

    fn pulls_by_itself(&self) -> bool {
        bit(self.shift_control, 17)
    }

    fn pull_threshold(&self) -> u32 {
        or_32(field(self.shift_control, 25, 5))
    }

    fn push_threshold(&self) -> u32 {
        or_32(field(self.shift_control, 20, 5))
    }

    /// Autopull, in any cycle: returns whether it has taken a word.
    fn refill_output(&mut self) -> bool {
        if !self.pulls_by_itself() || self.output.count < self.pull_threshold() {
            return false;
        }
        let Some(value) = self.tx.pop() else {
            return false;
        };
        self.output = Shift { value, count: 0 };
        true
    }
}

fn lowest(value: u32, bits: u32) -> u32 {
    (u64::from(value) & ((1 << bits) - 1)) as u32
}

/// Puts the lowest bits of a value to this many pins from the first on; after pin 31 comes pin 0 (3.5.6).
fn put(register: &mut u32, (first, count): (u32, u32), value: u32) {
    let mask = lowest(u32::MAX, count).rotate_left(first);
    *register = *register & !mask | value.rotate_left(first) & mask;
}
