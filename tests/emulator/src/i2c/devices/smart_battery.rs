//! A smart battery on SMBus (Smart Battery Data Specification 1.1): words, blocks, and the packet
//! error code of SMBus 1.1.

use std::collections::BTreeMap;

use super::super::super::clock::Cycle;
use super::super::device::{Ack, I2cDevice, I2cDirection};

/// Where a smart battery always is.
pub const ADDRESS: u8 = 0x0b;

const BATTERY_MODE: u8 = 0x03;
const TEMPERATURE: u8 = 0x08;
const VOLTAGE: u8 = 0x09;
const CURRENT: u8 = 0x0a;
const RELATIVE_STATE_OF_CHARGE: u8 = 0x0d;
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
    /// Bytes that no length comes before.
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
    address: u8,
    pec: Pec,
    /// Commands that are an exception to [`Self::pec`].
    pec_of: BTreeMap<u8, Pec>,
    values: BTreeMap<u8, Value>,
    command: Option<u8>,
    written: Vec<u8>,
    /// What a read is still to give.
    answer: std::vec::IntoIter<u8>,
    stretch: Cycle,
}

impl SmartBattery {
    /// A 5200 mAh pack of three cells, full.
    pub fn new(pec: Pec) -> Self {
        let mut battery = Self {
            address: ADDRESS,
            pec,
            pec_of: BTreeMap::new(),
            values: BTreeMap::new(),
            command: None,
            written: Vec::new(),
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
            (CYCLE_COUNT, 12),
            (DESIGN_CAPACITY, 5200),
            (DESIGN_VOLTAGE, 11_100),
            (SPECIFICATION_INFO, version),
            (MANUFACTURE_DATE, date(2024, 5, 17)),
            (SERIAL_NUMBER, 4711),
        ] {
            battery.set_word(command, word);
        }
        battery.set_block(MANUFACTURER_NAME, b"Emulated");
        battery.set_block(DEVICE_NAME, b"3S5200");
        battery.set_block(DEVICE_CHEMISTRY, b"LION");
        battery.set_capacity(5200, 5200);
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

    pub fn set_capacity(&mut self, remaining_mah: u16, full_mah: u16) {
        let percent = u32::from(remaining_mah) * 100 / u32::from(full_mah.max(1));
        self.set_word(REMAINING_CAPACITY, remaining_mah);
        self.set_word(FULL_CHARGE_CAPACITY, full_mah);
        self.set_word(RELATIVE_STATE_OF_CHARGE, percent as u16);
    }

    /// What follows the data from the next read on. What SpecificationInfo says of it stays.
    pub fn set_pec(&mut self, pec: Pec) {
        self.pec = pec;
    }

    /// The same for one command, whatever the others do.
    pub fn set_pec_of(&mut self, command: u8, pec: Pec) {
        self.pec_of.insert(command, pec);
    }

    /// Where it is attached, which its packet error codes cover.
    pub fn set_address(&mut self, address: u8) {
        self.address = address;
    }

    pub fn set_word(&mut self, command: u8, word: u16) {
        self.values.insert(command, Value::Word(word));
    }

    pub fn set_block(&mut self, command: u8, bytes: &[u8]) {
        self.values.insert(command, Value::Block(bytes.to_vec()));
    }

    /// Bytes that are sent without their number.
    pub fn set_bare(&mut self, command: u8, bytes: &[u8]) {
        self.values.insert(command, Value::Bare(bytes.to_vec()));
    }

    /// From now on it does not know this command.
    pub fn forget(&mut self, command: u8) {
        self.values.remove(&command);
    }

    /// Hold SCL for this many cycles after every byte, as a busy fuel gauge does.
    pub fn set_stretch(&mut self, cycles: Cycle) {
        self.stretch = cycles;
    }

    /// `None` if it does not know the command.
    fn answer(&self, command: u8) -> Option<Vec<u8>> {
        let mut bytes = self.values.get(&command)?.bytes();
        let (write, read) = (self.address << 1, self.address << 1 | 1);
        let sent = [&[write, command, read], &bytes[..]].concat();
        match self.pec_of.get(&command).unwrap_or(&self.pec) {
            Pec::Right => bytes.push(crc8(&sent)),
            Pec::Wrong => bytes.push(!crc8(&sent)),
            Pec::None => {}
        }
        Some(bytes)
    }

    /// Write Word: a low and a high byte after the command.
    fn take_written(&mut self) {
        if let (Some(command), [low, high]) = (self.command, &self.written[..]) {
            self.set_word(command, u16::from_le_bytes([*low, *high]));
        }
    }
}

impl I2cDevice for SmartBattery {
    fn start(&mut self, direction: I2cDirection, _now: Cycle) -> Ack {
        match direction {
            I2cDirection::Write => {
                self.command = None;
                self.written.clear();
            }
            I2cDirection::Read => {
                let answer = self.command.and_then(|command| self.answer(command));
                self.answer = answer.unwrap_or_default().into_iter();
            }
        }
        Ack::Ack
    }

    /// A command it does not know is refused.
    fn write(&mut self, byte: u8) -> Ack {
        if self.command.is_some() {
            self.written.push(byte);
            return Ack::Ack;
        }
        self.command = Some(byte);
        match self.values.contains_key(&byte) {
            true => Ack::Ack,
            false => Ack::Nack,
        }
    }

    fn read(&mut self) -> u8 {
        self.answer.next().unwrap_or(0xff)
    }

    fn stop(&mut self) {
        self.take_written();
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
pub fn crc8(bytes: &[u8]) -> u8 {
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
        battery.set_capacity(2600, 5200);
        assert_eq!(read_word(&mut battery, VOLTAGE), 11_100);
        assert_eq!(
            read_word(&mut battery, CURRENT) as i16,
            -2500,
            "discharge is negative"
        );
        assert_eq!(read_word(&mut battery, TEMPERATURE), 2982, "0.1 K");
        assert_eq!(read_word(&mut battery, RELATIVE_STATE_OF_CHARGE), 50);
        assert_eq!(read_word(&mut battery, FIRST_CELL_VOLTAGE - 2), 3700);
    }

    #[test]
    fn the_packet_error_code_covers_both_addresses_command_and_data() {
        let right = crc8(&[0x16, VOLTAGE, 0x17, 0x38, 0x31]);
        for (pec, byte) in [(Pec::Right, right), (Pec::Wrong, !right), (Pec::None, 0xff)] {
            let mut battery = SmartBattery::new(pec);
            assert_eq!(
                read(&mut battery, VOLTAGE, 3),
                [0x38, 0x31, byte],
                "12600 mV, {pec:?}"
            );
        }
    }

    #[test]
    fn the_packet_error_code_can_go_wrong_and_right_again() {
        let mut battery = SmartBattery::new(Pec::Right);
        let right = read(&mut battery, VOLTAGE, 3);
        for (pec, byte) in [(Pec::Wrong, !right[2]), (Pec::None, 0xff), (Pec::Right, right[2])] {
            battery.set_pec(pec);
            assert_eq!(
                read(&mut battery, VOLTAGE, 3),
                [right[0], right[1], byte],
                "{pec:?}"
            );
            assert_eq!(read_word(&mut battery, SPECIFICATION_INFO), 0x31, "{pec:?}");
        }
    }

    #[test]
    fn it_counts_in_mah_and_knows_when_it_was_made() {
        let mut battery = SmartBattery::new(Pec::Right);
        assert_eq!(read_word(&mut battery, BATTERY_MODE), 0);
        let date = 44 * 512 + 5 * 32 + 17;
        assert_eq!(read_word(&mut battery, MANUFACTURE_DATE), date, "2024-05-17");
    }

    #[test]
    fn a_fourth_cell_is_refused() {
        let mut battery = SmartBattery::new(Pec::Right);
        for (command, ack) in [(0x3d, Ack::Ack), (0x3c, Ack::Nack), (0x3b, Ack::Nack)] {
            battery.start(I2cDirection::Write, 0);
            assert_eq!(battery.write(command), ack, "{command:#x}");
            battery.stop();
        }
    }

    #[test]
    fn the_specification_says_whether_there_are_packet_error_codes() {
        assert_eq!(
            read_word(&mut SmartBattery::new(Pec::Right), SPECIFICATION_INFO) >> 4,
            3
        );
        assert_eq!(
            read_word(&mut SmartBattery::new(Pec::None), SPECIFICATION_INFO) >> 4,
            2
        );
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

    /// Four cells of 4.100 V to 4.103 V.
    const CELLS: [u8; 8] = [0x04, 0x10, 0x05, 0x10, 0x06, 0x10, 0x07, 0x10];

    #[test]
    fn a_sui_pack_has_codes_after_blocks_only_and_sends_its_current_bare() {
        let mut battery = SmartBattery::new(Pec::None);
        battery.set_block(0x28, &CELLS);
        battery.set_pec_of(0x28, Pec::Right);
        battery.set_bare(0x2a, &(-2500i32).to_le_bytes());
        let block = [&[8], &CELLS[..], &[0xb2]].concat();
        assert_eq!(read(&mut battery, 0x28, 10), block);
        assert_eq!(
            read(&mut battery, 0x2a, 5),
            [0x3c, 0xf6, 0xff, 0xff, 0xff],
            "no length, no code"
        );
        assert_eq!(read(&mut battery, VOLTAGE, 3), [0x38, 0x31, 0xff]);
    }

    #[test]
    fn the_code_covers_the_address_it_is_attached_to() {
        let mut battery = SmartBattery::new(Pec::Right);
        assert_eq!(
            read(&mut battery, VOLTAGE, 3)[2],
            0xad,
            "at 0x0b, worked out apart from this code"
        );
        battery.set_address(0x0c);
        let right = crc8(&[0x18, VOLTAGE, 0x19, 0x38, 0x31]);
        assert_ne!(right, 0xad);
        assert_eq!(read(&mut battery, VOLTAGE, 3)[2], right);
    }

    #[test]
    fn a_code_that_is_wrong_for_one_command_is_right_for_the_others() {
        let mut battery = SmartBattery::new(Pec::Right);
        battery.set_pec_of(CURRENT, Pec::Wrong);
        let codes = |battery: &mut SmartBattery, command| {
            let read = read(battery, command, 3);
            (read[2], crc8(&[0x16, command, 0x17, read[0], read[1]]))
        };
        let (sent, right) = codes(&mut battery, CURRENT);
        assert_eq!(sent, !right);
        let (sent, right) = codes(&mut battery, VOLTAGE);
        assert_eq!(sent, right);
    }

    #[test]
    fn a_word_can_be_written_and_an_unknown_command_is_refused() {
        let mut battery = SmartBattery::new(Pec::Right);
        battery.start(I2cDirection::Write, 0);
        for byte in [DESIGN_CAPACITY, 0x10, 0x27] {
            battery.write(byte);
        }
        battery.stop();
        assert_eq!(read_word(&mut battery, DESIGN_CAPACITY), 10_000);
        battery.start(I2cDirection::Write, 0);
        assert_eq!(battery.write(0x77), Ack::Nack);
    }
}
