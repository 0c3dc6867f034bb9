//! Simulated INA226, a high-side power monitor (Texas Instruments SBOS547).

use embedded_hal_async::i2c::ErrorKind;

use super::device::Device;
use crate::host::sim::SimulatedPack;

/// Address with both address pins at ground.
pub const ADDRESS: u8 = 0x40;

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
