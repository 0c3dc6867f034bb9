//! Simulated smart battery (Smart Battery Data Specification 1.1) with packet error codes.

use embedded_hal_async::i2c::{ErrorKind, NoAcknowledgeSource};

use super::device::Device;
use crate::host::sim::SimulatedPack;

/// Address of every smart battery.
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
/// By convention the first cell's voltage is at 0x3f, the others below.
const FIRST_CELL_VOLTAGE: u8 = 0x3f;

/// BatteryMode: capacities in mAh, not in 10 mWh.
const CAPACITY_IN_MAH: u16 = 0;
/// BatteryStatus.
const INITIALISED: u16 = 1 << 7;
const DISCHARGING: u16 = 1 << 6;
/// SpecificationInfo: revision 1, version 1.1 with packet error codes.
const VERSION_1_1_WITH_PEC: u16 = 0x0031;
/// ManufactureDate: 2024-05-17.
const MADE_ON: u16 = (2024 - 1980) << 9 | 5 << 5 | 17;
const CYCLES: u16 = 12;
const SERIAL: u16 = 4711;
/// In 0.1 K: 25 °C.
const ROOM_TEMPERATURE: u16 = 2982;
const NOMINAL_CELL_MV: u16 = 3700;

/// Stateless: writes to registers are acknowledged and ignored.
pub(super) struct SmartBattery {
    command: Option<u8>,
    /// Remaining bytes of a read.
    answer: std::vec::IntoIter<u8>,
}

enum Value {
    Word(u16),
    Block(&'static [u8]),
}

impl Value {
    /// Little-endian word, or block after its length.
    fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Word(word) => word.to_le_bytes().to_vec(),
            Self::Block(bytes) => [&[bytes.len() as u8], *bytes].concat(),
        }
    }
}

impl SmartBattery {
    pub(super) fn new() -> Self {
        Self {
            command: None,
            answer: Vec::new().into_iter(),
        }
    }
}

impl Device for SmartBattery {
    fn start_write(&mut self) {
        self.command = None;
    }

    /// An unknown command is not acknowledged.
    fn write(&mut self, byte: u8, pack: &SimulatedPack) -> Result<(), ErrorKind> {
        if self.command.is_some() {
            return Ok(());
        }
        self.command = Some(byte);
        match value(byte, pack) {
            Some(_) => Ok(()),
            None => Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data)),
        }
    }

    fn start_read(&mut self, pack: &SimulatedPack) {
        let answer = self.command.and_then(|command| answer(command, pack));
        self.answer = answer.unwrap_or_default().into_iter();
    }

    /// A released line reads as ones.
    fn read(&mut self) -> u8 {
        self.answer.next().unwrap_or(0xff)
    }
}

/// Value of a command; `None` if unknown.
fn value(command: u8, pack: &SimulatedPack) -> Option<Value> {
    let capacity_ah = pack.capacity_ah();
    let word = match command {
        BATTERY_MODE => CAPACITY_IN_MAH,
        TEMPERATURE => ROOM_TEMPERATURE,
        VOLTAGE => milli(pack.voltage_v()),
        CURRENT => (-pack.current_a() * 1e3).round() as i16 as u16,
        RELATIVE_STATE_OF_CHARGE => (pack.charge() * 100.0).round() as u16,
        REMAINING_CAPACITY => milli(capacity_ah * pack.charge()),
        FULL_CHARGE_CAPACITY | DESIGN_CAPACITY => milli(capacity_ah),
        BATTERY_STATUS => status(pack),
        CYCLE_COUNT => CYCLES,
        DESIGN_VOLTAGE => NOMINAL_CELL_MV * u16::from(pack.cells()),
        SPECIFICATION_INFO => VERSION_1_1_WITH_PEC,
        MANUFACTURE_DATE => MADE_ON,
        SERIAL_NUMBER => SERIAL,
        MANUFACTURER_NAME => return Some(Value::Block(b"Simulated")),
        DEVICE_NAME => return Some(Value::Block(b"Desk pack")),
        DEVICE_CHEMISTRY => return Some(Value::Block(b"LION")),
        _ => milli(pack.cell_voltage_v(FIRST_CELL_VOLTAGE.checked_sub(command)?)?),
    };
    Some(Value::Word(word))
}

fn status(pack: &SimulatedPack) -> u16 {
    match pack.current_a() < 0.0 {
        true => INITIALISED,
        false => INITIALISED | DISCHARGING,
    }
}

/// In thousandths, saturating.
fn milli(value: f32) -> u16 {
    (value * 1e3).round() as u16
}

/// Bytes of a read: value and packet error code, which also covers addresses and command.
fn answer(command: u8, pack: &SimulatedPack) -> Option<Vec<u8>> {
    let mut bytes = value(command, pack)?.bytes();
    let message = [&[ADDRESS << 1, command, ADDRESS << 1 | 1], &bytes[..]].concat();
    bytes.push(smbus_pec::pec(&message));
    Some(bytes)
}
