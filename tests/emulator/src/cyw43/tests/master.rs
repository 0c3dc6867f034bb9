//! A host that moves the pins, and as much of a driver as the tests need.

use sha2::{Digest, Sha256};

use super::super::super::clock::{Cycle, cycles};
use super::super::super::pio::{Outputs, PinDevice};
use super::super::pins::{CLOCK, DATA, POWER, SELECT, Wiring};
use super::super::program::Expected;
use super::super::{Cyw43, Network};

pub const BUS: u32 = 0;
pub const BACKPLANE: u32 = 1;
pub const WLAN: u32 = 2;

/// Half of a period of the clock.
const HALF: Cycle = 2;
const WRITE: u32 = 1 << 31;
const INCREMENT: u32 = 1 << 30;
/// 32-bit words, interrupt polarity high.
const CONTROL_32_BIT: u32 = 0x21;
const STATUS_FOLLOWS: u32 = 1 << 16;
const STATUS_PACKET_AVAILABLE: u32 = 1 << 8;

pub const PROGRAM: [u8; 100] = [0x5a; 100];
pub const RAM_BYTES: u32 = 512 * 1024;
const NVRAM_WORDS: u32 = 3;

/// What a control message has come to.
pub type Answer = Result<Vec<u8>, i32>;

pub struct Master {
    pub chip: Cyw43,
    pub now: Cycle,
    /// Looks at the line after the clock has risen, not before.
    pub looks_late: bool,
    sio: Outputs,
    is_16_bit: bool,
    sequence: u8,
    credit: u8,
    message: u16,
    events: Vec<Vec<u8>>,
    frames: Vec<Vec<u8>>,
    answers: Vec<Vec<u8>>,
}

impl Master {
    /// A chip without power.
    pub fn new() -> Self {
        let expected = Expected {
            bytes: PROGRAM.len(),
            sha_256: Sha256::digest(PROGRAM).into(),
        };
        Self {
            chip: Cyw43::expecting(expected, 1),
            now: 0,
            looks_late: false,
            sio: Outputs {
                high: 1 << SELECT,
                driven: 1 << POWER | 1 << SELECT | 1 << CLOCK,
            },
            is_16_bit: true,
            sequence: 0,
            credit: 1,
            message: 0,
            events: Vec::new(),
            frames: Vec::new(),
            answers: Vec::new(),
        }
    }

    /// A chip that answers, in words of 16 bits.
    pub fn powered() -> Self {
        let mut master = Self::new();
        master.power_up();
        master
    }

    pub fn power_up(&mut self) {
        self.is_16_bit = true;
        self.set(POWER, true);
        self.wait_us(250_000);
    }

    /// A chip with words of 32 bits and a status word after each transfer.
    pub fn set_up() -> Self {
        let mut master = Self::powered();
        master.write_register(BUS, 0, 4, CONTROL_32_BIT | STATUS_FOLLOWS);
        master.is_16_bit = false;
        master.write_register(BUS, 0x1d, 1, 4);
        master
    }

    /// A chip whose program takes packets.
    pub fn running() -> Self {
        let mut master = Self::set_up();
        master.download(&PROGRAM, NVRAM_WORDS | !NVRAM_WORDS << 16);
        master.wait_us(50_000);
        master.read_register(BUS, 8, 4);
        master.write_register(BUS, 6, 2, 1 << 5);
        master
    }

    /// A station that is up and wants all events, with these networks in range.
    pub fn station(networks: &[(&str, Option<&str>)]) -> Self {
        let mut master = Self::running();
        for &(ssid, passphrase) in networks {
            master.chip.add_network(network(ssid, passphrase));
        }
        master.set_variable("bsscfg:event_msgs", &[&[0; 4][..], &[0xff; 24]].concat());
        assert_eq!(master.control(2, &[]), Ok(Vec::new()), "UP");
        master
    }

    pub fn wait_us(&mut self, micros: u64) {
        let end = self.now + cycles(micros);
        while self.chip.next_event() <= end {
            self.now = self.chip.next_event();
            self.chip.advance(self.now);
        }
        self.now = end;
        self.chip.advance(end);
    }

    pub fn set(&mut self, pin: usize, is_high: bool) {
        let bit = 1 << pin;
        self.sio.high = if is_high {
            self.sio.high | bit
        } else {
            self.sio.high & !bit
        };
        let wiring = Wiring {
            sio: self.sio,
            ..Wiring::default()
        };
        self.now += HALF;
        self.chip.set_wiring(wiring, self.now);
    }

    /// What is on the data line.
    pub fn data(&self) -> Option<bool> {
        self.chip.data_line()
    }

    fn send_word(&mut self, word: u32) {
        let word = if self.is_16_bit {
            word.rotate_left(16)
        } else {
            word
        };
        self.sio.driven |= 1 << DATA;
        for place in (0..32).rev() {
            self.sio.high &= !(1 << DATA);
            self.sio.high |= (word >> place & 1) << DATA;
            self.set(CLOCK, false);
            self.set(CLOCK, true);
        }
    }

    fn receive_word(&mut self) -> u32 {
        self.sio.driven &= !(1 << DATA);
        let word = (0..32).fold(0, |word, _| {
            self.set(CLOCK, false);
            let before = self.data();
            self.set(CLOCK, true);
            let bit = if self.looks_late { self.data() } else { before } == Some(true);
            word << 1 | u32::from(bit)
        });
        if self.is_16_bit {
            word.rotate_left(16)
        } else {
            word
        }
    }

    /// A transfer: what is written, then this many words of what comes back.
    pub fn transfer(&mut self, written: &[u32], read: usize) -> Vec<u32> {
        self.set(SELECT, false);
        written.iter().for_each(|&word| self.send_word(word));
        let words = (0..read).map(|_| self.receive_word()).collect();
        self.set(CLOCK, false);
        self.set(SELECT, true);
        words
    }

    pub fn read_register(&mut self, function: u32, address: u32, bytes: u32) -> u32 {
        let delay = usize::from(function == BACKPLANE);
        self.transfer(&[command(0, function, address, bytes)], 1 + delay)[delay]
    }

    pub fn write_register(&mut self, function: u32, address: u32, bytes: u32, value: u32) {
        self.transfer(&[command(WRITE, function, address, bytes), value], 1);
    }

    /// A word behind the backplane.
    pub fn read_behind(&mut self, address: u32) -> u32 {
        self.set_window(address);
        self.read_register(BACKPLANE, address & 0x7fff | 0x8000, 4)
    }

    pub fn write_behind(&mut self, address: u32, bytes: u32, value: u32) {
        self.set_window(address);
        self.write_register(BACKPLANE, address & 0x7fff, bytes, value);
    }

    fn set_window(&mut self, address: u32) {
        for (register, shift) in [(0x1_000a, 8), (0x1_000b, 16), (0x1_000c, 24)] {
            self.write_register(BACKPLANE, register, 1, (address & !0x7fff) >> shift & 0xff);
        }
    }

    /// Takes a core out of reset, with its clock.
    pub fn start_core(&mut self, wrapper: u32) {
        self.write_behind(wrapper + 0x408, 1, 3);
        self.write_behind(wrapper + 0x800, 1, 0);
        self.write_behind(wrapper + 0x408, 1, 1);
    }

    pub fn download(&mut self, program: &[u8], nvram_length: u32) {
        self.start_core(0x1810_4000);
        for (address, chunk) in (0..).step_by(4).zip(program.chunks(4)) {
            let word = u32::from_le_bytes(chunk.try_into().expect("whole words"));
            self.write_behind(address, 4, word);
        }
        self.write_behind(RAM_BYTES - 4, 4, nvram_length);
        self.start_core(0x1810_3000);
    }

    /// A packet, and what waits after it.
    pub fn send_packet(&mut self, channel: u8, content: &[u8]) {
        assert_ne!(self.sequence, self.credit, "no credit left");
        let length = 12 + content.len() as u16;
        let mut bytes = [length.to_le_bytes(), (!length).to_le_bytes()].concat();
        bytes.extend([self.sequence, channel, 0, 12, 0, 0, 0, 0]);
        bytes.extend(content);
        self.sequence = self.sequence.wrapping_add(1);
        let mut words = vec![command(WRITE, WLAN, 0, bytes.len() as u32)];
        words.extend(super::super::serial::words_of(&bytes));
        self.transfer(&words, 1);
        self.wait_us(1_000);
        self.fetch();
    }

    /// The next packet that waits, as it is on the bus.
    pub fn packet(&mut self) -> Option<Vec<u8>> {
        let status = self.read_register(BUS, 8, 4);
        let length = status >> 9 & 0x7ff;
        (status & STATUS_PACKET_AVAILABLE != 0).then(|| {
            let words = self.transfer(&[command(0, WLAN, 0, length)], length.div_ceil(4) as usize);
            super::super::serial::bytes_of(&words, length as usize)
        })
    }

    /// Everything that waits.
    pub fn fetch(&mut self) {
        while let Some(packet) = self.packet() {
            let half = |index: usize| u16::from_le_bytes([packet[index], packet[index + 1]]);
            assert_eq!((usize::from(half(0)), half(2)), (packet.len(), !half(0)));
            self.credit = packet[9];
            let content = packet[usize::from(packet[7])..].to_vec();
            match packet[5] {
                0 if content.is_empty() => {}
                0 => self.answers.push(content),
                1 => self.events.push(content[4..].to_vec()),
                _ => self.frames.push(content[4..].to_vec()),
            }
        }
    }

    /// Sets by a number.
    pub fn control(&mut self, number: u32, data: &[u8]) -> Answer {
        self.message(number, 2, data)
    }

    fn message(&mut self, number: u32, flags: u16, data: &[u8]) -> Answer {
        self.message += 1;
        let mut message = [number.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        message.extend([flags.to_le_bytes(), self.message.to_le_bytes()].concat());
        message.extend([0; 4]);
        message.extend(data);
        self.send_packet(0, &message);
        let answer = self.answers.pop().expect("an answer");
        assert_eq!(answer[10..12], self.message.to_le_bytes());
        match i32::from_le_bytes(answer[12..16].try_into().expect("four bytes")) {
            0 => Ok(answer[16..].to_vec()),
            status => Err(status),
        }
    }

    pub fn set_variable(&mut self, name: &str, value: &[u8]) {
        let answer = self.control(263, &[name.as_bytes(), &[0], value].concat());
        assert_eq!(answer, Ok(Vec::new()), "{name}");
    }

    pub fn variable(&mut self, name: &str, bytes: usize) -> Answer {
        let mut data = [name.as_bytes(), &[0]].concat();
        data.resize(bytes.max(data.len()), 0);
        self.message(262, 0, &data).map(|answer| answer[..bytes].to_vec())
    }

    /// An Ethernet frame into the air.
    pub fn send_frame(&mut self, frame: &[u8]) {
        self.send_packet(2, &[&[0x20, 0, 0, 0], frame].concat());
    }

    pub fn take_frames(&mut self) -> Vec<Vec<u8>> {
        self.fetch();
        std::mem::take(&mut self.frames)
    }

    /// Kind, status, flags and reason of what came since this was called last.
    pub fn take_events(&mut self) -> Vec<(u8, u8, u8, u8)> {
        self.fetch();
        let events = std::mem::take(&mut self.events);
        events.iter().map(|event| fields(event)).collect()
    }
}

fn fields(event: &[u8]) -> (u8, u8, u8, u8) {
    assert_eq!(event[12..14], [0x88, 0x6c], "Broadcom's Ethernet type");
    assert_eq!(event[19..22], [0x00, 0x10, 0x18], "Broadcom's OUI");
    (event[31], event[35], event[27], event[39])
}

pub fn command(write: u32, function: u32, address: u32, bytes: u32) -> u32 {
    write | INCREMENT | function << 28 | address << 11 | bytes & 0x7ff
}

pub fn network(ssid: &str, passphrase: Option<&str>) -> Network {
    Network {
        ssid: ssid.to_owned(),
        passphrase: passphrase.map(str::to_owned),
    }
}
