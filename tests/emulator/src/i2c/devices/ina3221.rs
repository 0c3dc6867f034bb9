//! INA3221: shunt and bus voltage of three channels (SBOS576). Left out: alerts.

use super::super::super::clock::Cycle;
use super::register_map::{RegisterMap, Registers};
use super::{Load, TEXAS_INSTRUMENTS, conversion_of_ina226, field_of, signed_code};

pub const CHANNELS: usize = 3;

const CONFIGURATION: u8 = 0x00;
const FIRST_SHUNT: u8 = 0x01;
const LAST_BUS: u8 = 0x06;
const MANUFACTURER_ID: u8 = 0xfe;
const DIE_ID: u8 = 0xff;

const CONFIGURATION_RESET: u16 = 0x7127;
const RESET: u16 = 1 << 15;
/// Configuration: channel 1 is bit 14, channel 3 bit 12.
const FIRST_CHANNEL_ENABLE: usize = 14;
const SHUNT_LSB_V: f64 = 40e-6;
const BUS_LSB_V: f64 = 8e-3;
/// Both are 13 bits with their sign, from bit 3 on.
const CODE_BITS: u32 = 13;
const CODE_SHIFT: u32 = 3;

pub struct Ina3221 {
    shunt_ohm: f64,
    loads: [Load; CHANNELS],
    /// What was measured when the channel was enabled last.
    measured: [Load; CHANNELS],
    configuration: u16,
}

impl Ina3221 {
    /// All three shunts are the same.
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self {
            shunt_ohm,
            loads: [Load::default(); CHANNELS],
            measured: [Load::default(); CHANNELS],
            configuration: CONFIGURATION_RESET,
        })
    }

    /// Channels count from 1, as in the datasheet.
    pub fn set(&mut self, channel: usize, volts: f64, amperes: f64) {
        self.loads[channel - 1] = Load {
            volts,
            amperes,
            ..Load::default()
        };
        self.measure();
    }

    fn measure(&mut self) {
        for (index, load) in self.loads.iter().enumerate() {
            if self.configuration >> (FIRST_CHANNEL_ENABLE - index) & 1 != 0 {
                self.measured[index] = *load;
            }
        }
    }

    fn configure(&mut self, value: u16) {
        self.configuration = value;
        self.measure();
    }

    fn voltage(&self, pointer: u8) -> u64 {
        let index = usize::from(pointer - FIRST_SHUNT);
        let Load { volts, amperes, .. } = self.measured[index / 2];
        let code = match index % 2 {
            0 => signed_code(amperes * self.shunt_ohm, SHUNT_LSB_V, CODE_BITS),
            _ => signed_code(volts.max(0.0), BUS_LSB_V, CODE_BITS),
        };
        field_of(code << CODE_SHIFT, 16)
    }
}

impl Registers for Ina3221 {
    fn read(&self, pointer: u8) -> u64 {
        match pointer {
            CONFIGURATION => self.configuration.into(),
            FIRST_SHUNT..=LAST_BUS => self.voltage(pointer),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DIE_ID => 0x3220,
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match (pointer, value & RESET) {
            (CONFIGURATION, 0) => self.configure(value),
            (CONFIGURATION, _) => self.reset(),
            _ => {}
        }
    }

    /// The enabled channels take turns.
    fn conversion(&self) -> Cycle {
        let channels = ((self.configuration >> (FIRST_CHANNEL_ENABLE - 2)) & 0b111).count_ones();
        conversion_of_ina226(self.configuration) * u64::from(channels)
    }

    /// Channel 1 is the one at the pack.
    fn set_result(&mut self, volts: f64, amperes: f64) {
        self.set(1, volts, amperes);
    }

    fn reset(&mut self) {
        self.configure(CONFIGURATION_RESET);
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{read, write};
    use super::*;

    #[test]
    fn each_channel_has_its_registers_and_full_scale_and_it_says_what_it_is() {
        let mut device = Ina3221::new(0.001);
        // 8.6.2.2: -80 mV is C180h.
        device.set(1, 12.0, -80.0);
        device.set(2, 8.0, 4.0);
        device.set(3, 40.0, 500.0);
        for (pointer, value) in [
            (0x01, 0xc180),
            (0x02, 1500 << 3),
            (0x03, 100 << 3),
            (0x04, 1000 << 3),
            (0x05, 0x7ff8),
            (0x06, 0x7ff8),
            (MANUFACTURER_ID, 0x5449),
            (DIE_ID, 0x3220),
        ] {
            assert_eq!(read(&mut device, pointer, 2), value, "{pointer:#x}");
        }
    }

    #[test]
    fn a_channel_that_is_off_keeps_what_it_measured_last() {
        let mut device = Ina3221::new(0.001);
        device.set(2, 8.0, 0.0);
        write(&mut device, CONFIGURATION, 0x5127);
        device.set(2, 9.6, 0.0);
        assert_eq!(read(&mut device, 0x04, 2), 1000 << 3);
        device.power_cycle();
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x7127);
        assert_eq!(read(&mut device, 0x04, 2), 1200 << 3, "it is on again");
    }
}
