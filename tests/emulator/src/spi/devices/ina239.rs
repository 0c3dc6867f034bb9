//! INA239: an INA238 behind SPI (SLYS027, 7.5.1). A frame is a command, register number and direction, and the
//! bytes of the register after it, the highest first.

use std::ops::{Deref, DerefMut};

use super::super::super::clock::Cycle;
use super::super::super::i2c::devices::{Ina228, Registers};
use super::super::device::{SpiClock, SpiDevice, SpiMode};

/// Its revision is not confirmed.
const DEVICE_ID: u16 = 0x2391;
const MAX_HZ: u64 = 10_000_000;
const READ: u8 = 1;
const ALWAYS_ZERO: u8 = 1 << 1;

pub struct Ina239 {
    registers: Ina228,
    /// Bytes since it was selected.
    received: Vec<u8>,
    /// What the register held when the command was over: bytes to be sent, the last first.
    answer: Vec<u8>,
}

impl Ina239 {
    pub fn new(shunt_ohm: f64) -> Self {
        Self {
            registers: Ina228::identified(DEVICE_ID, shunt_ohm),
            received: Vec::new(),
            answer: Vec::new(),
        }
    }

    /// The supply is gone, and back when it is selected next.
    pub fn power_cycle(&mut self) {
        self.registers.power_cycle();
        self.deselect();
    }

    /// A write is answered with what the register held before.
    fn prepare(&mut self, command: u8) {
        let register = command >> 2;
        let value = self.registers.read(register).to_le_bytes();
        self.answer = value[..self.registers.size(register)].to_vec();
    }

    fn obey(&mut self) {
        match self.received[..] {
            [command] => self.prepare(command),
            [command, high, low] if command & (READ | ALWAYS_ZERO) == 0 => {
                self.registers
                    .write(command >> 2, u16::from_be_bytes([high, low]));
            }
            _ => {}
        }
    }
}

impl Deref for Ina239 {
    type Target = Ina228;

    fn deref(&self) -> &Ina228 {
        &self.registers
    }
}

impl DerefMut for Ina239 {
    fn deref_mut(&mut self) -> &mut Ina228 {
        &mut self.registers
    }
}

impl SpiDevice for Ina239 {
    fn select(&mut self) {
        self.deselect();
    }

    fn deselect(&mut self) {
        self.received.clear();
        self.answer.clear();
    }

    fn advance(&mut self, now: Cycle) {
        self.registers.note_time(now);
    }

    /// With a clock it does not understand it neither takes nor sends anything; silicon shifts bits by
    /// one instead.
    fn exchange(&mut self, byte: u8, clock: SpiClock) -> Option<u8> {
        if clock.mode != SpiMode::Mode1 || clock.hz > MAX_HZ {
            return None;
        }
        let sent = self.answer.pop().unwrap_or(0);
        self.received.push(byte);
        self.obey();
        Some(sent)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::super::clock::CLK_SYS_HZ;
    use super::*;

    const ADC_CONFIG: u8 = 0x01;
    const CLOCK: SpiClock = SpiClock {
        mode: SpiMode::Mode1,
        hz: 1_000_000,
    };

    fn frame_at(device: &mut Ina239, bytes: &[u8], clock: SpiClock) -> Vec<Option<u8>> {
        device.select();
        let answer = bytes.iter().map(|&byte| device.exchange(byte, clock)).collect();
        device.deselect();
        answer
    }

    fn frame(device: &mut Ina239, bytes: &[u8]) -> Vec<u8> {
        let answer = frame_at(device, bytes, CLOCK);
        answer.into_iter().map(|byte| byte.expect("driven")).collect()
    }

    fn example() -> Ina239 {
        let mut device = Ina239::new(0.0162);
        device.set(48.0, 6.0, 25.0);
        device.advance(CLK_SYS_HZ);
        device
    }

    #[test]
    fn registers_follow_their_command_with_the_highest_byte_first() {
        let mut device = example();
        for (command, bytes) in [
            (0xf9, [0, 0x54, 0x49]),
            (0xfd, [0, 0x23, 0x91]),
            // ADC_CONFIG, VSHUNT 19440, VBUS 15360.
            (0x05, [0, 0xfb, 0x68]),
            (0x11, [0, 0x4b, 0xf0]),
            (0x15, [0, 0x3c, 0x00]),
        ] {
            assert_eq!(frame(&mut device, &[command, 0, 0]), bytes, "{command:#x}");
        }
    }

    #[test]
    fn a_write_takes_sixteen_bits_and_answers_what_was_there() {
        let mut device = example();
        assert_eq!(frame(&mut device, &[0x04, 0x01, 0xc2]), [0, 0xfb, 0x68]);
        // Half a write, an ill-formed one, a read.
        for ignored in [&[0x04, 0x02][..], &[0x06, 0x02, 0x00], &[0x05, 0x02, 0x00]] {
            frame(&mut device, ignored);
            assert_eq!(device.read(ADC_CONFIG), 450, "{ignored:?}");
        }
    }

    #[test]
    fn it_understands_mode_1_up_to_10_mhz_only() {
        for (mode, hz, answers) in [
            (SpiMode::Mode0, 1_000_000, false),
            (SpiMode::Mode1, 10_000_000, true),
            (SpiMode::Mode1, 10_000_001, false),
            (SpiMode::Mode2, 1_000_000, false),
            (SpiMode::Mode3, 1_000_000, false),
        ] {
            let mut device = example();
            let clock = SpiClock { mode, hz };
            let read = frame_at(&mut device, &[0xf9, 0, 0], clock);
            assert_eq!(read[1] == Some(0x54), answers, "{clock:?}");
            frame_at(&mut device, &[0x04, 0x01, 0xc2], clock);
            assert_eq!(device.read(ADC_CONFIG) == 450, answers, "{clock:?}");
        }
    }
}
