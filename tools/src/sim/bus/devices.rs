//! Simulated devices: a power monitor and a smart battery.

use embedded_hal_async::i2c::{ErrorKind, NoAcknowledgeSource};

use crate::sim::SimulatedPack;

/// A device on the bus.
pub(super) trait Device {
    /// It was addressed for writing.
    fn start_write(&mut self);

    /// Receives a byte.
    ///
    /// # Errors
    /// The byte is not acknowledged.
    fn write(&mut self, byte: u8, pack: &SimulatedPack) -> Result<(), ErrorKind>;

    /// It was addressed for reading, with the present state of the pack.
    fn start_read(&mut self, pack: &SimulatedPack);

    /// Sends a byte.
    fn read(&mut self) -> u8;
}

/// Address with both address pins at ground.
pub const POWER_MONITOR_ADDRESS: u8 = 0x40;

/// Shunt, in ohms: full scale is 41 A.
pub const SHUNT_OHM: f32 = 0.002;

const CONFIGURATION: u8 = 0x00;
const SHUNT_VOLTAGE: u8 = 0x01;
const BUS_VOLTAGE: u8 = 0x02;
const MANUFACTURER_ID: u8 = 0xfe;
const DIE_ID: u8 = 0xff;

const CONFIGURATION_AT_RESET: u16 = 0x4127;
const RESET: u16 = 1 << 15;
const SHUNT_LSB_V: f32 = 2.5e-6;
const BUS_LSB_V: f32 = 1.25e-3;
const MAX_BUS_CODE: f32 = 32_767.0;
const TEXAS_INSTRUMENTS: u16 = 0x5449;
const INA226: u16 = 0x2260;

/// An INA226, a high-side power monitor (Texas Instruments SBOS547).
///
/// Converts immediately, whatever the configured conversion time. Without calibration: current and power stay 0.
pub(super) struct PowerMonitor {
    configuration: u16,
    /// Register pointer.
    pointer: u8,
    /// Bytes written since the START: pointer and value.
    written: Vec<u8>,
    /// The register latched at the start of the read.
    latched: [u8; 2],
    bytes_read: usize,
}

impl PowerMonitor {
    pub(super) fn new() -> Self {
        Self {
            configuration: CONFIGURATION_AT_RESET,
            pointer: 0,
            written: Vec::new(),
            latched: [0; 2],
            bytes_read: 0,
        }
    }

    fn register(&self, pack: &SimulatedPack) -> u16 {
        match self.pointer {
            CONFIGURATION => self.configuration,
            SHUNT_VOLTAGE => shunt_code(pack.current_a()) as u16,
            BUS_VOLTAGE => bus_code(pack.voltage_v()),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DIE_ID => INA226,
            _ => 0,
        }
    }

    fn configure(&mut self, configuration: u16) {
        self.configuration = match configuration & RESET {
            0 => configuration,
            _ => CONFIGURATION_AT_RESET,
        };
    }
}

/// Positive during discharge. The cast saturates, as the part does.
fn shunt_code(current_a: f32) -> i16 {
    (current_a * SHUNT_OHM / SHUNT_LSB_V).round() as i16
}

fn bus_code(voltage_v: f32) -> u16 {
    (voltage_v / BUS_LSB_V).round().min(MAX_BUS_CODE) as u16
}

impl Device for PowerMonitor {
    fn start_write(&mut self) {
        self.written.clear();
    }

    fn write(&mut self, byte: u8, _: &SimulatedPack) -> Result<(), ErrorKind> {
        self.written.push(byte);
        match self.written[..] {
            [pointer] => self.pointer = pointer,
            [CONFIGURATION, high, low] => self.configure(u16::from_be_bytes([high, low])),
            _ => {}
        }
        Ok(())
    }

    fn start_read(&mut self, pack: &SimulatedPack) {
        self.latched = self.register(pack).to_be_bytes();
        self.bytes_read = 0;
    }

    fn read(&mut self) -> u8 {
        let byte = self.latched[self.bytes_read % self.latched.len()];
        self.bytes_read += 1;
        byte
    }
}

/// Address of every smart battery.
pub const SMART_BATTERY_ADDRESS: u8 = 0x0b;

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

/// A smart battery (Smart Battery Data Specification 1.1) with packet error codes.
///
/// Stateless: writes to registers are acknowledged and ignored.
pub(super) struct SmartBattery {
    command: Option<u8>,
    /// Remaining bytes of a read.
    answer: std::vec::IntoIter<u8>,
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

/// Bytes of a command's value, little-endian, a text after its length; `None` if the command is unknown.
fn value(command: u8, pack: &SimulatedPack) -> Option<Vec<u8>> {
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
        MANUFACTURER_NAME => return Some(block(b"Simulated")),
        DEVICE_NAME => return Some(block(b"Desk pack")),
        DEVICE_CHEMISTRY => return Some(block(b"LION")),
        _ => milli(pack.cell_voltage_v(FIRST_CELL_VOLTAGE.checked_sub(command)?)?),
    };
    Some(word.to_le_bytes().to_vec())
}

fn block(bytes: &[u8]) -> Vec<u8> {
    [&[bytes.len() as u8], bytes].concat()
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
    let mut bytes = value(command, pack)?;
    let message = [
        &[
            SMART_BATTERY_ADDRESS << 1,
            command,
            SMART_BATTERY_ADDRESS << 1 | 1,
        ],
        &bytes[..],
    ]
    .concat();
    bytes.push(smbus_pec::pec(&message));
    Some(bytes)
}
