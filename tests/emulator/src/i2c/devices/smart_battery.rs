//! A smart battery on SMBus (Smart Battery Data Specification 1.1, chapter 5.1): words, blocks, and the packet error code of
//! SMBus 1.1. Makers' own commands are what a test sets.

use std::collections::BTreeMap;

use super::super::super::clock::Cycle;
use super::super::device::{Ack, I2cDevice, I2cDirection};

/// Where a smart battery always is.
pub const ADDRESS: u8 = 0x0b;

const BATTERY_MODE: u8 = 0x03;
const TEMPERATURE: u8 = 0x08;
const VOLTAGE: u8 = 0x09;
const CURRENT: u8 = 0x0a;
const REMAINING_CAPACITY: u8 = 0x0f;
const FULL_CHARGE_CAPACITY: u8 = 0x10;
const BATTERY_STATUS: u8 = 0x16;
const CYCLE_COUNT: u8 = 0x17;
const DESIGN_CAPACITY: u8 = 0x18;
const DESIGN_VOLTAGE: u8 = 0x19;
const SPECIFICATION_INFO: u8 = 0x1a;
const MANUFACTURE_DATE: u8 = 0x1b;
const SERIAL_NUMBER: u8 = 0x1c;
const MANUFACTURER_NAME: u8 = 0x20;
const DEVICE_NAME: u8 = 0x21;
const DEVICE_CHEMISTRY: u8 = 0x22;
/// Cell voltages are by custom at 0x3f for the first cell, and down from there.
const FIRST_CELL_VOLTAGE: u8 = 0x3f;

/// SpecificationInfo: revision 1; version 2 is 1.1, version 3 is 1.1 with packet error codes.
const VERSION_1_1: u16 = 0x0021;
const VERSION_1_1_WITH_PEC: u16 = 0x0031;
/// BatteryMode: capacities are in mAh, not in 10 mWh.
const CAPACITY_IN_MAH: u16 = 0;
/// BatteryStatus: initialised.
const INITIALISED: u16 = 1 << 7;
const ZERO_CELSIUS_K: f64 = 273.15;

/// What follows the data of a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pec {
    Right,
    /// Another byte than the right one: something went wrong on the way.
    Wrong,
    /// The battery has none: the line stays high.
    None,
}

#[derive(Clone)]
enum Value {
    Word(u16),
    Block(Vec<u8>),
    /// As some makers send it: without a length, and without a packet error code.
    Bare(Vec<u8>),
}

impl Value {
    /// A word goes low byte first, a block after its length.
    fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Word(word) => word.to_le_bytes().to_vec(),
            Self::Block(bytes) => [&[bytes.len() as u8], &bytes[..]].concat(),
            Self::Bare(bytes) => bytes.clone(),
        }
    }
}

pub struct SmartBattery {
    pec: Pec,
    values: BTreeMap<u8, Value>,
    command: Option<u8>,
    /// What a read is still to give.
    answer: std::vec::IntoIter<u8>,
    stretch: Cycle,
}

impl SmartBattery {
    /// A 5200 mAh pack of three cells, full.
    pub fn new(pec: Pec) -> Self {
        let mut battery = Self {
            pec,
            values: BTreeMap::new(),
            command: None,
            answer: Vec::new().into_iter(),
            stretch: 0,
        };
        let version = match pec {
            Pec::None => VERSION_1_1,
            Pec::Right | Pec::Wrong => VERSION_1_1_WITH_PEC,
        };
        for (command, word) in [
            (BATTERY_MODE, CAPACITY_IN_MAH),
            (BATTERY_STATUS, INITIALISED),
            (REMAINING_CAPACITY, 5200),
            (FULL_CHARGE_CAPACITY, 5200),
            (CYCLE_COUNT, 12),
            (DESIGN_CAPACITY, 5200),
            (DESIGN_VOLTAGE, 11_100),
            (SPECIFICATION_INFO, version),
            (MANUFACTURE_DATE, date(2024, 5, 17)),
            (SERIAL_NUMBER, 4711),
        ] {
            battery.set_word(command, word);
        }
        for (command, bytes) in [
            (MANUFACTURER_NAME, &b"Emulated"[..]),
            (DEVICE_NAME, b"3S5200"),
            (DEVICE_CHEMISTRY, b"LION"),
        ] {
            battery.set_block(command, bytes);
        }
        battery.set(12.6, 0.0, 25.0);
        battery
    }

    /// Current is positive when it flows out of the battery, unlike in the register. Three cells share
    /// the voltage.
    pub fn set(&mut self, volts: f64, amperes: f64, celsius: f64) {
        self.set_word(VOLTAGE, (volts * 1000.0).round() as u16);
        self.set_word(CURRENT, (-amperes * 1000.0).round() as i16 as u16);
        self.set_word(TEMPERATURE, ((celsius + ZERO_CELSIUS_K) * 10.0).round() as u16);
        let cell = (volts * 1000.0 / 3.0).round() as u16;
        (0..3).for_each(|index| self.set_word(FIRST_CELL_VOLTAGE - index, cell));
    }

    /// What follows the data from the next read on. What SpecificationInfo says of it stays.
    pub fn set_pec(&mut self, pec: Pec) {
        self.pec = pec;
    }

    pub fn set_word(&mut self, command: u8, word: u16) {
        self.values.insert(command, Value::Word(word));
    }

    pub fn set_block(&mut self, command: u8, bytes: &[u8]) {
        self.values.insert(command, Value::Block(bytes.to_vec()));
    }

    /// Bytes without a length before them and a packet error code behind them.
    pub fn set_bare(&mut self, command: u8, bytes: &[u8]) {
        self.values.insert(command, Value::Bare(bytes.to_vec()));
    }

    /// From now on it refuses this command.
    pub fn refuse(&mut self, command: u8) {
        self.values.remove(&command);
    }

    /// Hold SCL for this many cycles after every byte, as a busy fuel gauge does.
    pub fn set_stretch(&mut self, cycles: Cycle) {
        self.stretch = cycles;
    }

    /// `None` if it does not know the command.
    fn answer(&self, command: u8) -> Option<Vec<u8>> {
        let value = self.values.get(&command)?;
        let mut bytes = value.bytes();
        if matches!(value, Value::Bare(_)) {
            return Some(bytes);
        }
        let sent = [&[ADDRESS << 1, command, ADDRESS << 1 | 1], &bytes[..]].concat();
        match self.pec {
            Pec::Right => bytes.push(crc8(&sent)),
            Pec::Wrong => bytes.push(!crc8(&sent)),
            Pec::None => {}
        }
        Some(bytes)
    }
}

impl I2cDevice for SmartBattery {
    fn start(&mut self, direction: I2cDirection, _now: Cycle) -> Ack {
        match direction {
            I2cDirection::Write => self.command = None,
            I2cDirection::Read => {
                let answer = self.command.and_then(|command| self.answer(command));
                self.answer = answer.unwrap_or_default().into_iter();
            }
        }
        Ack::Ack
    }

    /// A command it does not know is refused, and so is what is written to any: it is only to be read.
    fn write(&mut self, byte: u8) -> Ack {
        let is_known = self.command.is_none() && self.values.contains_key(&byte);
        self.command = Some(byte);
        match is_known {
            true => Ack::Ack,
            false => Ack::Nack,
        }
    }

    fn read(&mut self) -> u8 {
        self.answer.next().unwrap_or(0xff)
    }

    fn stop(&mut self) {
        self.command = None;
    }

    fn stretch(&mut self) -> Cycle {
        self.stretch
    }
}

/// A date as the specification packs it.
fn date(year: u16, month: u16, day: u16) -> u16 {
    (year - 1980) << 9 | month << 5 | day
}

/// SMBus packet error code: CRC-8 with polynomial x^8 + x^2 + x + 1, highest bit first.
fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc ^ byte, |crc: u8, _| {
            crc << 1 ^ if crc & 0x80 != 0 { 0x07 } else { 0 }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(battery: &mut SmartBattery, command: u8, bytes: usize) -> Vec<u8> {
        battery.start(I2cDirection::Write, 0);
        assert_eq!(battery.write(command), Ack::Ack);
        battery.start(I2cDirection::Read, 0);
        let read = (0..bytes).map(|_| battery.read()).collect();
        battery.stop();
        read
    }

    fn read_word(battery: &mut SmartBattery, command: u8) -> u16 {
        let bytes = read(battery, command, 2);
        u16::from_le_bytes([bytes[0], bytes[1]])
    }

    #[test]
    fn the_packet_error_code_is_crc8_smbus() {
        assert_eq!(crc8(b"123456789"), 0xf4, "check value of CRC-8/SMBUS");
    }

    #[test]
    fn words_are_in_the_units_of_the_specification() {
        let mut battery = SmartBattery::new(Pec::Right);
        battery.set(11.1, 2.5, 25.0);
        for (command, word) in [
            (VOLTAGE, 11_100),
            // A discharge is negative.
            (CURRENT, -2500_i16 as u16),
            // In 0.1 K.
            (TEMPERATURE, 2982),
            (FIRST_CELL_VOLTAGE - 2, 3700),
            // It counts in mAh.
            (BATTERY_MODE, 0),
            // 2024-05-17.
            (MANUFACTURE_DATE, 44 * 512 + 5 * 32 + 17),
        ] {
            assert_eq!(read_word(&mut battery, command), word, "{command:#x}");
        }
    }

    #[test]
    fn the_packet_error_code_covers_address_command_and_data_and_can_change() {
        let right = crc8(&[0x16, VOLTAGE, 0x17, 0x38, 0x31]);
        assert_eq!(right, 0xad, "worked out apart from this code");
        let codes = [
            (Pec::Right, right, 3),
            (Pec::Wrong, !right, 3),
            (Pec::None, 0xff, 2),
        ];
        for (pec, _, version) in codes {
            let mut battery = SmartBattery::new(pec);
            for (pec, code, _) in codes {
                battery.set_pec(pec);
                let sent = read(&mut battery, VOLTAGE, 3);
                assert_eq!(sent, [0x38, 0x31, code], "12600 mV, {pec:?}");
                assert_eq!(read_word(&mut battery, SPECIFICATION_INFO) >> 4, version);
            }
        }
    }

    #[test]
    fn a_block_begins_with_its_length() {
        let mut battery = SmartBattery::new(Pec::Right);
        let sent = read(&mut battery, DEVICE_CHEMISTRY, 6);
        assert_eq!(sent[..5], *b"\x04LION");
        assert_eq!(
            sent[5],
            crc8(&[&[0x16, DEVICE_CHEMISTRY, 0x17], &sent[..5]].concat())
        );
    }

    #[test]
    fn bare_bytes_have_neither_length_nor_code() {
        let mut battery = SmartBattery::new(Pec::Right);
        battery.set_bare(0x2a, &[1, 2, 3, 4]);
        assert_eq!(read(&mut battery, 0x2a, 5), [1, 2, 3, 4, 0xff]);
        battery.refuse(0x2a);
        battery.start(I2cDirection::Write, 0);
        assert_eq!(battery.write(0x2a), Ack::Nack);
    }

    #[test]
    fn an_unknown_command_and_what_is_written_are_refused() {
        let mut battery = SmartBattery::new(Pec::Right);
        for (command, ack) in [(0x3d, Ack::Ack), (0x3c, Ack::Nack), (0x77, Ack::Nack)] {
            battery.start(I2cDirection::Write, 0);
            assert_eq!(battery.write(command), ack, "{command:#x}");
            assert_eq!(battery.write(VOLTAGE), Ack::Nack);
            battery.stop();
        }
    }
}
