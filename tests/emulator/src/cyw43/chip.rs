//! The chip while it has power: what a command reads and writes.

use super::super::clock::{Cycle, cycles};
use super::super::random::Random;
use super::air::Air;
use super::backplane::Backplane;
use super::bus_registers::{BusRegisters, DATA_UNAVAILABLE, PacketState};
use super::fault::RadioFault;
use super::program::{Expected, Program};
use super::serial::{Command, Function, Functions, WordFormat, bytes_of, words_of};
use super::wlan::Wlan;

/// "Wait at least 150 ms after VDDC and VDDIO are available before initiating SDIO accesses" (CYW43439 datasheet,
/// "Power-up sequence").
const ANSWERS_AFTER: Cycle = cycles(150_000);

#[derive(Clone)]
pub struct Chip {
    answers_from: Cycle,
    bus: BusRegisters,
    backplane: Backplane,
    pub wlan: Wlan,
    fault: Option<RadioFault>,
    /// Commands since the fault is there.
    commands: u64,
    has_refused_program: bool,
    /// F2 takes packets.
    is_ready: bool,
    random: Random,
}

impl Chip {
    pub fn new(expected: Expected, address: [u8; 6], mut random: Random, now: Cycle) -> Self {
        let program = Program::new(expected, Random::new(random.next_u64()));
        Self {
            answers_from: now + ANSWERS_AFTER,
            bus: BusRegisters::new(),
            backplane: Backplane::new(program),
            wlan: Wlan::new(address),
            fault: None,
            commands: 0,
            has_refused_program: false,
            is_ready: false,
            random,
        }
    }

    pub fn set_fault(&mut self, fault: Option<RadioFault>) {
        self.fault = fault;
        self.commands = 0;
        self.backplane.set_flips(match fault {
            Some(RadioFault::FlippedBits { one_in }) => Some(one_in),
            _ => None,
        });
        self.backplane.set_missing(match fault {
            Some(RadioFault::NotReady(part)) => Some(part),
            _ => None,
        });
        self.wlan.radio.stays_associated = fault == Some(RadioFault::StaysAssociated);
    }

    /// It does not answer, and pulls the data line low.
    pub fn is_silent(&self) -> bool {
        match self.fault {
            Some(RadioFault::Missing) => true,
            Some(RadioFault::SilentAfter(commands)) => self.commands >= commands,
            _ => false,
        }
    }

    pub fn has_refused_program(&self) -> bool {
        self.has_refused_program
    }

    /// Whether the program runs, and takes packets.
    pub fn takes_packets(&self, now: Cycle) -> bool {
        self.backplane.packets_from().is_some_and(|from| now >= from)
    }

    pub fn is_interrupt_high(&self) -> bool {
        self.bus.is_interrupt_high(self.packets())
    }

    fn packets(&self) -> PacketState {
        PacketState {
            is_ready: self.is_ready,
            waiting_bytes: self.wlan.waiting_bytes(),
        }
    }

    pub fn with_air<'a>(&'a mut self, air: &'a mut Air) -> Connected<'a> {
        Connected { chip: self, air }
    }

    /// A command has come: whether it is heard.
    fn hears(&mut self, now: Cycle) -> bool {
        let hears = now >= self.answers_from && !self.is_silent();
        self.commands += 1;
        self.is_ready = self.takes_packets(now);
        hears
    }

    fn answer(&mut self, command: Command, now: Cycle) -> Vec<u32> {
        match command.function {
            Function::Bus => words_of(&self.bus.read(command.address, command.bytes, self.packets())),
            Function::Backplane => {
                let mut words = vec![0; self.bus.delay_words_f1()];
                words.extend(words_of(&self.backplane.read(
                    command.address,
                    command.bytes,
                    now,
                )));
                words
            }
            Function::Wlan => {
                let packet = self.wlan.take_waiting().unwrap_or_else(|| {
                    self.bus.latch(DATA_UNAVAILABLE);
                    Vec::new()
                });
                let filler = std::iter::repeat(0);
                let bytes: Vec<u8> = packet.into_iter().chain(filler).take(command.bytes).collect();
                words_of(&bytes)
            }
            Function::Bluetooth => vec![0; command.words()],
        }
    }

    fn noise(&mut self, words: usize) -> Vec<u32> {
        (0..words).map(|_| self.random.next_u64() as u32).collect()
    }
}

/// The chip with the air around it.
pub struct Connected<'a> {
    chip: &'a mut Chip,
    air: &'a mut Air,
}

impl Functions for Connected<'_> {
    fn format(&self) -> WordFormat {
        self.chip.bus.format()
    }

    fn read(&mut self, command: Command, now: Cycle) -> Vec<u32> {
        if !self.chip.hears(now) {
            return vec![0; command.words()];
        }
        let words = self.chip.answer(command, now);
        match self.chip.fault {
            Some(RadioFault::Noise) => self.chip.noise(words.len()),
            _ => words,
        }
    }

    fn write(&mut self, command: Command, words: &[u32], now: Cycle) {
        if !self.chip.hears(now) {
            return;
        }
        let bytes = bytes_of(words, command.bytes);
        match command.function {
            Function::Bus => self.chip.bus.write(command.address, &bytes),
            Function::Backplane => {
                self.chip.backplane.write(command.address, &bytes, now);
                self.chip.has_refused_program |= self.chip.backplane.has_refused_program();
            }
            Function::Wlan if self.chip.is_ready => self.chip.wlan.receive(&bytes, self.air, now),
            Function::Wlan | Function::Bluetooth => {}
        }
    }

    fn status(&mut self) -> Option<u32> {
        let chip = &mut *self.chip;
        let status = match chip.fault {
            Some(RadioFault::Noise) => chip.random.next_u64() as u32,
            _ => BusRegisters::status(chip.packets()),
        };
        chip.bus.sends_status().then_some(status)
    }

    fn is_interrupt_high(&self) -> bool {
        self.chip.is_interrupt_high()
    }

    fn is_high_speed(&self) -> bool {
        self.chip.bus.is_high_speed()
    }
}
