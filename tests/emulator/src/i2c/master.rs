//! The master: takes commands from the transmit FIFO and moves bytes over the wires, in time.

use std::collections::VecDeque;

use super::super::clock::{Cycle, NEVER};
use super::super::register::bit;
use super::device::{Ack, I2cDirection};
use super::registers::Settings;
use super::wires::Wires;

pub const FIFO_DEPTH: usize = 16;

/// Bits of IC_RAW_INTR_STAT that stay until they are cleared (4.3.17).
pub const RX_UNDER: u32 = 1;
pub const RX_OVER: u32 = 1 << 1;
pub const TX_OVER: u32 = 1 << 3;
pub const TX_ABRT: u32 = 1 << 6;
pub const ACTIVITY: u32 = 1 << 8;
pub const STOP_DET: u32 = 1 << 9;
pub const START_DET: u32 = 1 << 10;

/// Bits of IC_TX_ABRT_SOURCE.
pub const ABRT_7B_ADDR_NOACK: u32 = 1;
pub const ABRT_TXDATA_NOACK: u32 = 1 << 3;
pub const ARB_LOST: u32 = 1 << 12;
const TX_FLUSH_CNT: u32 = 23;

/// IC_DATA_CMD.FIRST_DATA_BYTE.
const FIRST_DATA_BYTE: u16 = 1 << 11;

/// An entry of the transmit FIFO: the bits of IC_DATA_CMD.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command(pub u32);

impl Command {
    fn byte(self) -> u8 {
        self.0 as u8
    }

    fn direction(self) -> I2cDirection {
        match bit(self.0, 8) {
            true => I2cDirection::Read,
            false => I2cDirection::Write,
        }
    }

    fn stop(self) -> bool {
        bit(self.0, 9)
    }

    fn restart(self) -> bool {
        bit(self.0, 10)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    /// START or RESTART and the address byte that a command requires.
    Address(Command),
    Data(Command),
    Stop,
}

/// What is being done on the bus. Time counts while SCL is not held.
#[derive(Clone, Copy, Debug)]
struct Step {
    action: Action,
    start: Cycle,
    length: Cycle,
}

impl Step {
    fn end(self, wires: &Wires) -> Cycle {
        self.start.max(wires.scl_free_at()).saturating_add(self.length)
    }
}

#[derive(Clone, Default)]
pub struct Master {
    transmit: VecDeque<Command>,
    receive: VecDeque<u16>,
    pub latched: u32,
    pub abort_source: u32,
    step: Option<Step>,
    /// When [`Self::step`] is over, as far as it is known.
    step_end: Option<Cycle>,
    /// Between a START and its STOP: the way bytes go.
    owned: Option<I2cDirection>,
    first_byte: bool,
    /// The block was disabled, or the transfer aborted: a STOP comes after the byte under way.
    stopping: bool,
    bus_free_at: Cycle,
}

impl Master {
    // ----- The FIFOs ------------------------------------------------------------------------------

    pub fn transmit_level(&self) -> usize {
        self.transmit.len()
    }

    pub fn receive_level(&self) -> usize {
        self.receive.len()
    }

    /// After an abort the transmit FIFO "remains in this flushed state until the register
    /// IC_CLR_TX_ABRT is read" (IC_RAW_INTR_STAT.TX_ABRT).
    pub fn push(&mut self, command: Command) {
        if self.latched & TX_ABRT != 0 {
            return;
        }
        match self.transmit.len() {
            FIFO_DEPTH => self.latched |= TX_OVER,
            _ => self.transmit.push_back(command),
        }
    }

    pub fn pop(&mut self) -> u32 {
        let byte = self.receive.pop_front();
        if byte.is_none() {
            self.latched |= RX_UNDER;
        }
        u32::from(byte.unwrap_or(0))
    }

    // ----- State ----------------------------------------------------------------------------------

    /// The master's state machine is not idle.
    pub fn is_active(&self) -> bool {
        self.step.is_some() || self.owned.is_some()
    }

    /// A byte, or its address, is on its way.
    pub fn is_shifting(&self) -> bool {
        self.step.is_some()
    }

    /// IC_ENABLE was cleared: the FIFOs are flushed, "the current transfer" ends with the byte under
    /// way (IC_ENABLE.ENABLE). Does nothing about STOP_DET, which stays until it is read.
    pub fn disable(&mut self) {
        self.transmit.clear();
        self.receive.clear();
        self.stopping = self.is_active();
        // TX_FLUSH_CNT "is cleared whenever I2C is disabled".
        self.abort_source &= (1 << TX_FLUSH_CNT) - 1;
        if !self.is_active() {
            self.become_idle();
        }
    }

    fn become_idle(&mut self) {
        self.latched &= !(RX_UNDER | RX_OVER | TX_OVER | ACTIVITY);
    }

    /// SDA was let go by a device while SCL was high.
    pub fn note_stop_seen(&mut self) {
        self.latched |= STOP_DET;
    }

    pub fn clear(&mut self, interrupts: u32) {
        self.latched &= !interrupts;
        if interrupts & TX_ABRT != 0 {
            self.abort_source = 0;
        }
    }

    // ----- Time -----------------------------------------------------------------------------------

    /// SCL does not move from now on: what is left of the step under way comes when it is free again.
    pub fn pause(&mut self, now: Cycle) {
        if let Some(step) = &mut self.step
            && step.start < now
        {
            step.length -= (now - step.start).min(step.length);
            step.start = now;
        }
        self.step_end = self.step.map(|_| NEVER);
    }

    /// The lines lead to the chip again.
    pub fn resume(&mut self, now: Cycle) {
        if let Some(step) = &mut self.step {
            step.start = now;
        }
    }

    pub fn next_event(&self) -> Cycle {
        self.step_end.unwrap_or(NEVER)
    }

    pub fn advance(&mut self, now: Cycle, settings: &Settings, wires: &mut Wires) {
        self.begin(now, settings, wires);
        while let Some(step) = self.step.take_if(|step| step.end(wires) <= now) {
            let end = step.end(wires);
            self.finish(step, end, settings, wires);
            self.begin(end, settings, wires);
        }
        self.step_end = self.step.map(|step| step.end(wires));
    }

    /// Begin what comes next, if the bus has nothing to do.
    fn begin(&mut self, now: Cycle, settings: &Settings, wires: &Wires) {
        if self.step.is_some() {
            return;
        }
        if self.stopping && self.owned.is_some() {
            return self.stop_at(now, settings);
        }
        self.stopping = false;
        if settings.may_transmit()
            && let Some(command) = self.transmit.pop_front()
        {
            self.begin_command(command, now, settings, wires);
        }
    }

    fn begin_command(&mut self, command: Command, now: Cycle, settings: &Settings, wires: &Wires) {
        let goes_on = self.owned == Some(command.direction()) && !command.restart();
        let speed = settings.speed();
        let (action, before) = match (goes_on, self.owned) {
            (true, _) => (Action::Data(command), 0),
            (false, Some(_)) => (Action::Address(command), speed.restart()),
            (false, None) => (Action::Address(command), speed.start()),
        };
        let clocks = match lost_after(action, settings, wires) {
            Some(clocks) => speed.clocks(u64::from(clocks)),
            None => speed.byte(),
        };
        if matches!(action, Action::Address(_)) {
            self.latched |= START_DET | ACTIVITY;
        }
        self.step = Some(Step {
            action,
            start: now.max(self.bus_free_at),
            length: before + clocks,
        });
    }

    fn stop_at(&mut self, now: Cycle, settings: &Settings) {
        self.step = Some(Step {
            action: Action::Stop,
            start: now,
            length: settings.speed().stop(),
        });
    }

    fn finish(&mut self, step: Step, end: Cycle, settings: &Settings, wires: &mut Wires) {
        if let Some(clocks) = lost_after(step.action, settings, wires) {
            wires.lose_arbitration(settings.target(), clocks, step.start, end);
            self.abort(ARB_LOST);
            return self.leave_bus(end, settings);
        }
        match step.action {
            Action::Address(command) => self.addressed(command, step.start, end, settings, wires),
            Action::Data(command) => self.transferred(command, end, settings, wires),
            Action::Stop => {
                wires.stop(end);
                self.latched |= STOP_DET;
                self.leave_bus(end, settings);
            }
        }
    }

    fn addressed(
        &mut self,
        command: Command,
        start: Cycle,
        end: Cycle,
        settings: &Settings,
        wires: &mut Wires,
    ) {
        self.owned = Some(command.direction());
        self.first_byte = true;
        match wires.address(settings.target(), command.direction(), start, end) {
            Ack::Nack => self.abort(ABRT_7B_ADDR_NOACK),
            Ack::Ack if self.stopping => {}
            Ack::Ack => {
                self.step = Some(Step {
                    action: Action::Data(command),
                    start: end,
                    length: settings.speed().byte(),
                });
            }
        }
    }

    fn transferred(&mut self, command: Command, end: Cycle, settings: &Settings, wires: &mut Wires) {
        match command.direction() {
            I2cDirection::Read => self.receive(wires.read(end)),
            I2cDirection::Write => {
                if wires.write(command.byte(), end) == Ack::Nack {
                    return self.abort(ABRT_TXDATA_NOACK);
                }
            }
        }
        if command.stop() {
            self.stop_at(end, settings);
        }
    }

    fn receive(&mut self, byte: u8) {
        let first = if self.first_byte { FIRST_DATA_BYTE } else { 0 };
        self.first_byte = false;
        // What is read after the block was disabled is discarded.
        if self.stopping {
            return;
        }
        match self.receive.len() {
            FIFO_DEPTH => self.latched |= RX_OVER,
            _ => self.receive.push_back(first | u16::from(byte)),
        }
    }

    /// Both FIFOs are flushed, and a STOP follows if the bus is ours.
    fn abort(&mut self, source: u32) {
        self.abort_source |= source | (self.transmit.len() as u32) << TX_FLUSH_CNT;
        self.latched |= TX_ABRT;
        self.transmit.clear();
        self.receive.clear();
        self.stopping = true;
    }

    fn leave_bus(&mut self, now: Cycle, settings: &Settings) {
        self.owned = None;
        self.stopping = false;
        self.bus_free_at = now + settings.speed().idle();
        if !settings.is_enabled() {
            self.become_idle();
        }
    }
}

/// Arbitration is lost at the first one that is sent while another device holds SDA low (4.3.8):
/// after this many clocks. A STOP has to let SDA rise, too.
fn lost_after(action: Action, settings: &Settings, wires: &Wires) -> Option<u32> {
    if !wires.sda_is_held() {
        return None;
    }
    let sent = match action {
        Action::Address(command) => {
            let reads = u8::from(command.direction() == I2cDirection::Read);
            settings.target() << 1 | reads
        }
        Action::Data(command) if command.direction() == I2cDirection::Write => command.byte(),
        Action::Data(_) => 0,
        Action::Stop => return Some(1),
    };
    (sent != 0).then(|| sent.leading_zeros() + 1)
}
