//! gSPI: bits at the pins to words, and words to what a function of the chip reads or writes.
//!
//! Both sides send from the highest bit on. The chip takes a bit at each rising edge of the clock. It changes its own at
//! each falling one, in its high-speed mode at each rising one: a host that stops the clock while it is high, before it has
//! looked at the line, misses a bit.

use std::collections::VecDeque;

use super::super::clock::Cycle;
use super::super::register::{bit, field};

const WORD_BITS: u32 = 32;
/// A length of 0 in its 11 bits.
const LONGEST_BYTES: usize = 2048;

/// Which part of the chip a command is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// F0: the registers of the bus.
    Bus,
    /// F1: the backplane, and all that is behind it.
    Backplane,
    /// F2: packets to and from the program of the WLAN core.
    Wlan,
    /// F3: Bluetooth.
    Bluetooth,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    Read,
    Write,
}

/// The word that each transfer begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    pub direction: Direction,
    pub function: Function,
    pub address: u32,
    pub bytes: usize,
}

impl Command {
    pub fn of(word: u32) -> Self {
        let functions = [
            Function::Bus,
            Function::Backplane,
            Function::Wlan,
            Function::Bluetooth,
        ];
        Self {
            direction: if bit(word, 31) {
                Direction::Write
            } else {
                Direction::Read
            },
            function: functions[field(word, 28, 2) as usize],
            address: field(word, 11, 17),
            bytes: match field(word, 0, 11) as usize {
                0 => LONGEST_BYTES,
                bytes => bytes,
            },
        }
    }

    /// Transfers are padded to whole words.
    pub fn words(self) -> usize {
        self.bytes.div_ceil(4)
    }
}

/// The order of a word's bits on the wire, as SPI_BUS_CONTROL has it: its own inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WordFormat {
    /// Two words of 16 bits, the lower half first.
    pub is_16_bit: bool,
    pub is_big_endian: bool,
}

impl WordFormat {
    pub fn convert(self, word: u32) -> u32 {
        let word = if self.is_16_bit {
            word.rotate_left(16)
        } else {
            word
        };
        if self.is_big_endian {
            word.swap_bytes()
        } else {
            word
        }
    }
}

/// What is behind the wires.
pub trait Functions {
    fn format(&self) -> WordFormat;
    /// The words of the answer, those that pass before it is ready included.
    fn read(&mut self, command: Command, now: Cycle) -> Vec<u32>;
    fn write(&mut self, command: Command, words: &[u32], now: Cycle);
    /// The word that follows each transfer, if it is enabled.
    fn status(&mut self) -> Option<u32>;
    /// The level of the data line while there is nothing else on it.
    fn is_interrupt_high(&self) -> bool;
    /// Whether bits of the chip change at the clock's rising edges.
    fn is_high_speed(&self) -> bool;
}

#[derive(Clone, Debug)]
enum Phase {
    Command,
    Data { command: Command, words: Vec<u32> },
    Answer { words: VecDeque<u32> },
}

/// One transfer after the other.
#[derive(Clone, Debug)]
pub struct Serial {
    phase: Phase,
    received: u32,
    received_bits: u32,
    sent_bits: u32,
    /// What the chip puts on the data line; `None`: it listens.
    line: Option<bool>,
}

impl Default for Serial {
    fn default() -> Self {
        Self {
            phase: Phase::Command,
            received: 0,
            received_bits: 0,
            sent_bits: 0,
            line: None,
        }
    }
}

impl Serial {
    /// What the chip puts on the data line while it is selected.
    pub fn line(&self) -> Option<bool> {
        self.line
    }

    pub fn rising_edge(&mut self, data: bool, functions: &mut impl Functions, now: Cycle) {
        if !matches!(self.phase, Phase::Answer { .. }) {
            self.receive(data, functions, now);
        }
        if functions.is_high_speed() {
            self.send(functions);
        }
    }

    pub fn falling_edge(&mut self, functions: &impl Functions) {
        if !functions.is_high_speed() {
            self.send(functions);
        }
    }

    fn receive(&mut self, data: bool, functions: &mut impl Functions, now: Cycle) {
        self.received = self.received << 1 | u32::from(data);
        self.received_bits += 1;
        if self.received_bits == WORD_BITS {
            self.received_bits = 0;
            let word = functions.format().convert(self.received);
            self.take(word, functions, now);
        }
    }

    /// Puts the next bit on the line.
    fn send(&mut self, functions: &impl Functions) {
        let Phase::Answer { words } = &mut self.phase else {
            return;
        };
        let Some(&word) = words.front() else {
            self.line = Some(functions.is_interrupt_high());
            return;
        };
        self.line = Some(bit(word, WORD_BITS - 1 - self.sent_bits));
        self.sent_bits += 1;
        if self.sent_bits == WORD_BITS {
            self.sent_bits = 0;
            words.pop_front();
        }
    }

    fn take(&mut self, word: u32, functions: &mut impl Functions, now: Cycle) {
        match &mut self.phase {
            Phase::Command => self.begin(Command::of(word), functions, now),
            Phase::Data { command, words } => {
                words.push(word);
                if words.len() == command.words() {
                    functions.write(*command, words, now);
                    self.answer(Vec::new(), functions);
                }
            }
            Phase::Answer { .. } => {}
        }
    }

    fn begin(&mut self, command: Command, functions: &mut impl Functions, now: Cycle) {
        match command.direction {
            Direction::Read => {
                let words = functions.read(command, now);
                self.answer(words, functions);
            }
            Direction::Write => {
                let words = Vec::with_capacity(command.words());
                self.phase = Phase::Data { command, words };
            }
        }
    }

    fn answer(&mut self, words: Vec<u32>, functions: &mut impl Functions) {
        let format = functions.format();
        let words = words.into_iter().chain(functions.status());
        self.phase = Phase::Answer {
            words: words.map(|word| format.convert(word)).collect(),
        };
    }
}

/// Bytes as words of the bus, the last one filled up with zeros.
pub fn words_of(bytes: &[u8]) -> Vec<u32> {
    let word = |chunk: &[u8]| {
        let mut word = [0; 4];
        word[..chunk.len()].copy_from_slice(chunk);
        u32::from_le_bytes(word)
    };
    bytes.chunks(4).map(word).collect()
}

/// The first bytes of words of the bus.
pub fn bytes_of(words: &[u32], count: usize) -> Vec<u8> {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes());
    bytes.take(count).collect()
}
