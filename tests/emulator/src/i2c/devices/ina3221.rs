//! INA3221: shunt and bus voltage of three channels (SBOS576C 7.6.2). Left out: alerts.

use super::super::super::clock::Cycle;
use super::register_map::{RegisterMap, Registers};
use super::{Converter, Load, TEXAS_INSTRUMENTS, field_of, setup_of_ina226, shunt_range, signed_code};

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
/// The ADC's range; the pin must not be above 26 V.
const MOST_VOLTS: f64 = 32.76;
/// Both are 13 bits with their sign, from bit 3 on.
const CODE_BITS: u32 = 13;
const CODE_SHIFT: u32 = 3;

pub struct Ina3221 {
    shunt_ohm: f64,
    channels: [Channel; CHANNELS],
    configuration: u16,
}

#[derive(Clone, Copy, Default)]
struct Channel {
    converter: Converter,
    shunt: i64,
    bus: i64,
}

impl Ina3221 {
    /// All three shunts are the same.
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self {
            shunt_ohm,
            channels: [Channel::default(); CHANNELS],
            configuration: CONFIGURATION_RESET,
        })
    }

    /// Channels count from 1, as in the datasheet.
    pub fn set(&mut self, channel: usize, volts: f64, amperes: f64) {
        self.channels[channel - 1]
            .converter
            .set_load(Load::of(volts, amperes));
    }

    /// The current of a channel flows for this share of the time, in pulses that are much shorter than a conversion.
    pub fn set_pulses(&mut self, channel: usize, share: f64) {
        self.channels[channel - 1].converter.set_pulses(share);
    }

    fn is_enabled(&self, index: usize) -> bool {
        self.configuration >> (FIRST_CHANNEL_ENABLE - index) & 1 != 0
    }

    fn configure(&mut self, value: u16) {
        self.configuration = value;
        for channel in &mut self.channels {
            channel.converter.restart(0);
        }
    }

    fn reset(&mut self) {
        self.configure(CONFIGURATION_RESET);
        for channel in &mut self.channels {
            (channel.shunt, channel.bus) = (0, 0);
        }
    }
}

impl Registers for Ina3221 {
    fn read(&self, pointer: u8) -> u64 {
        match pointer {
            CONFIGURATION => self.configuration.into(),
            FIRST_SHUNT..=LAST_BUS => {
                let index = usize::from(pointer - FIRST_SHUNT);
                let Channel { shunt, bus, .. } = self.channels[index / 2];
                field_of([shunt, bus][index % 2] << CODE_SHIFT, 16)
            }
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
    fn note_time(&mut self, now: Cycle) {
        let amperes = shunt_range(SHUNT_LSB_V, CODE_BITS, self.shunt_ohm);
        let mut setup = setup_of_ina226(self.configuration, MOST_VOLTS, amperes);
        let of_one = setup.result;
        let enabled: [bool; CHANNELS] = std::array::from_fn(|index| self.is_enabled(index));
        let of_all = of_one * enabled.iter().filter(|is_enabled| **is_enabled).count() as Cycle;
        for (channel, is_enabled) in self.channels.iter_mut().zip(enabled) {
            setup.result = if is_enabled { of_all } else { 0 };
            for results in channel.converter.advance(now, &setup) {
                if setup.measures_current {
                    channel.shunt = signed_code(results.amperes * self.shunt_ohm, SHUNT_LSB_V, CODE_BITS);
                }
                if setup.measures_voltage {
                    channel.bus = signed_code(results.volts, BUS_LSB_V, CODE_BITS);
                }
            }
        }
    }

    /// Channel 1 is the one at the pack.
    fn set_load(&mut self, volts: f64, amperes: f64) {
        self.set(1, volts, amperes);
    }

    fn power_cycle(&mut self) {
        self.reset();
        for channel in &mut self.channels {
            channel.converter.power_cycle();
        }
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
        assert_eq!(read(&mut device, 0x04, 2), 1000 << 3);
        write(&mut device, CONFIGURATION, 0x5127);
        device.set(2, 9.6, 0.0);
        assert_eq!(read(&mut device, 0x04, 2), 1000 << 3);
        device.power_cycle();
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x7127);
        assert_eq!(read(&mut device, 0x04, 2), 1200 << 3, "it is on again");
    }
}
