//! F0: the registers of the gSPI bus (CYW43439 datasheet, "gSPI registers").

use super::super::register::bit;
use super::serial::WordFormat;

const SIZE: usize = 0x20;
const CONTROL: usize = 0x00;
const STATUS_ENABLE: usize = 0x02;
const INTERRUPT: usize = 0x04;
const INTERRUPT_ENABLE: usize = 0x06;
const STATUS: usize = 0x08;
const TEST_READ_ONLY: usize = 0x14;
const TEST_READ_WRITE: usize = 0x18;
const RESPONSE_DELAY_F1: usize = 0x1d;

/// "This register contains a predefined pattern, which the host can read to determine if the gSPI interface is working".
const TEST_PATTERN: u32 = 0xfeed_bead;

const CONTROL_32_BIT: u32 = 0;
const CONTROL_BIG_ENDIAN: u32 = 1;
const CONTROL_HIGH_SPEED: u32 = 4;
const CONTROL_INTERRUPT_HIGH: u32 = 5;
const STATUS_FOLLOWS: u32 = 0;

pub const DATA_UNAVAILABLE: u16 = 1 << 0;
pub const F2_PACKET_AVAILABLE: u16 = 1 << 5;

/// What F2 has to say for the status word and the interrupts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PacketState {
    /// Packets are taken.
    pub is_ready: bool,
    /// The length of the one that waits for the host.
    pub waiting_bytes: Option<usize>,
}

#[derive(Clone, Debug)]
pub struct BusRegisters {
    bytes: [u8; SIZE],
    /// Interrupts that stay until a one is written to them.
    latched: u16,
}

impl BusRegisters {
    pub fn new() -> Self {
        let mut bytes = [0; SIZE];
        bytes[CONTROL] = 1 << CONTROL_INTERRUPT_HIGH;
        bytes[TEST_READ_ONLY..][..4].copy_from_slice(&TEST_PATTERN.to_le_bytes());
        Self { bytes, latched: 0 }
    }

    pub fn format(&self) -> WordFormat {
        WordFormat {
            is_16_bit: !bit(self.control(), CONTROL_32_BIT),
            is_big_endian: bit(self.control(), CONTROL_BIG_ENDIAN),
        }
    }

    pub fn is_high_speed(&self) -> bool {
        bit(self.control(), CONTROL_HIGH_SPEED)
    }

    fn control(&self) -> u32 {
        u32::from(self.bytes[CONTROL])
    }

    /// Whether the status word follows each transfer.
    pub fn sends_status(&self) -> bool {
        bit(u32::from(self.bytes[STATUS_ENABLE]), STATUS_FOLLOWS)
    }

    /// Words that pass before an answer of F1.
    pub fn delay_words_f1(&self) -> usize {
        usize::from(self.bytes[RESPONSE_DELAY_F1]).div_ceil(4)
    }

    pub fn latch(&mut self, interrupt: u16) {
        self.latched |= interrupt;
    }

    fn interrupts(&self, packets: PacketState) -> u16 {
        let available = packets.waiting_bytes.map_or(0, |_| F2_PACKET_AVAILABLE);
        self.latched | available
    }

    fn enabled(&self) -> u16 {
        u16::from_le_bytes([self.bytes[INTERRUPT_ENABLE], self.bytes[INTERRUPT_ENABLE + 1]])
    }

    pub fn is_interrupt_high(&self, packets: PacketState) -> bool {
        let is_raised = self.interrupts(packets) & self.enabled() != 0;
        is_raised == bit(self.control(), CONTROL_INTERRUPT_HIGH)
    }

    /// The status word: F2 ready in bit 5, a packet available in bit 8, its length from bit 9 on.
    pub fn status(packets: PacketState) -> u32 {
        let ready = u32::from(packets.is_ready) << 5;
        let waiting = packets.waiting_bytes.map(|bytes| 1 << 8 | (bytes as u32) << 9);
        ready | waiting.unwrap_or(0)
    }

    pub fn read(&self, address: u32, count: usize, packets: PacketState) -> Vec<u8> {
        let mut bytes = self.bytes;
        bytes[INTERRUPT..][..2].copy_from_slice(&self.interrupts(packets).to_le_bytes());
        bytes[STATUS..][..4].copy_from_slice(&Self::status(packets).to_le_bytes());
        let bytes = bytes.into_iter().skip(address as usize);
        bytes.chain(std::iter::repeat(0)).take(count).collect()
    }

    pub fn write(&mut self, address: u32, bytes: &[u8]) {
        for (address, &byte) in (address as usize..SIZE).zip(bytes) {
            match address {
                INTERRUPT => self.latched &= !u16::from(byte),
                CONTROL..STATUS | TEST_READ_WRITE.. => self.bytes[address] = byte,
                _ => {}
            }
        }
    }
}
