//! INA219: 12-bit power monitor with an external shunt (SBOS448G: registers in 8.6, times in table 5).
//!
//! Left out: the calibration. Current and power read zero, as they do without one. CNVR is set with each result and is not
//! cleared.

use super::super::super::clock::{Cycle, cycles};
use super::converter::{Converter, Setup};
use super::field_of;
use super::register_map::{OneConverter, RegisterMap, Registers};

const CONFIGURATION: u8 = 0x00;
const SHUNT_VOLTAGE: u8 = 0x01;
const BUS_VOLTAGE: u8 = 0x02;

const CONFIGURATION_RESET: u16 = 0x399f;
/// BRNG: 32 V, else 16 V.
const WIDE_BUS: u16 = 1 << 13;
const SHUNT_LSB_V: f64 = 10e-6;
const BUS_LSB_V: f64 = 4e-3;
const CONVERTED: u64 = 1 << 1;

pub struct Ina219 {
    shunt_ohm: f64,
    converter: Converter,
    configuration: u16,
    shunt: i64,
    bus: i64,
    has_converted: bool,
}

impl Ina219 {
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self {
            shunt_ohm,
            converter: Converter::default(),
            configuration: CONFIGURATION_RESET,
            shunt: 0,
            bus: 0,
            has_converted: false,
        })
    }

    /// It measures no temperature.
    pub fn set(&mut self, volts: f64, amperes: f64) {
        self.set_load(volts, amperes);
    }

    pub fn configuration(&self) -> u16 {
        self.configuration
    }

    /// The most of the shunt's voltage, by the gain: 40 to 320 mV.
    fn most_shunt_v(&self) -> f64 {
        0.04 * f64::from(1 << (self.configuration >> 11 & 3))
    }

    fn setup(&self) -> Setup {
        let has = |bit: u32| self.configuration >> bit & 1 != 0;
        let most_amperes = self.most_shunt_v() / self.shunt_ohm;
        let (measures_current, measures_voltage) = (has(0), has(1));
        let time_us = |at: u32, is_on: bool| match is_on {
            true => conversion_us(self.configuration >> at & 15),
            false => 0,
        };
        Setup {
            // One after the other.
            result: cycles(time_us(7, measures_voltage) + time_us(3, measures_current)),
            measures_voltage,
            measures_current,
            is_continuous: has(2),
            most_volts: if self.configuration & WIDE_BUS != 0 {
                32.0
            } else {
                16.0
            },
            amperes: [-most_amperes, most_amperes],
        }
    }
}

/// Time of a result: of fewer bits, or of up to 128 samples of 12.
fn conversion_us(adc: u16) -> u64 {
    const BITS_9_TO_12: [u64; 4] = [84, 148, 276, 532];
    match adc {
        0..8 => BITS_9_TO_12[usize::from(adc & 3)],
        _ => 532 << (adc & 7),
    }
}

impl OneConverter for Ina219 {
    fn converter(&mut self) -> &mut Converter {
        &mut self.converter
    }

    fn register(&self, pointer: u8) -> u64 {
        match pointer {
            CONFIGURATION => self.configuration.into(),
            SHUNT_VOLTAGE => field_of(self.shunt, 16),
            BUS_VOLTAGE => field_of(self.bus, 13) << 3 | if self.has_converted { CONVERTED } else { 0 },
            // It is not known what silicon gives where there is no register.
            _ => 0,
        }
    }

    fn configure(&mut self, configuration: u16) {
        self.configuration = configuration;
        self.has_converted = false;
        self.converter.restart(0);
    }

    fn reset(&mut self) {
        self.configure(CONFIGURATION_RESET);
        (self.shunt, self.bus) = (0, 0);
    }

    fn convert(&mut self, now: Cycle) {
        let setup = self.setup();
        let most = self.most_shunt_v();
        for results in self.converter.advance(now, &setup) {
            if setup.measures_current {
                let shunt_v = (results.amperes * self.shunt_ohm).clamp(-most, most);
                self.shunt = (shunt_v / SHUNT_LSB_V).round() as i64;
            }
            if setup.measures_voltage {
                self.bus = (results.volts.clamp(0.0, setup.most_volts) / BUS_LSB_V).round() as i64;
            }
            self.has_converted = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{now, read, read_at, write};
    use super::*;

    #[test]
    fn codes_are_those_of_the_datasheet() {
        // Table 8: 10 A through 2 mOhm give 20 mV, 07D0h, and 11.98 V 5D98h, here with the flag of a conversion.
        let mut device = Ina219::new(0.002);
        device.set(11.98, 10.0);
        let values = [0, 1, 2, 0xfe, 0xff].map(|pointer| read(&mut device, pointer, 2));
        assert_eq!(values, [0x399f, 0x07d0, 0x5d9a, 0, 0]);
    }

    #[test]
    fn both_ranges_end_as_they_are_set() {
        // Table 7: the codes at the ends of each gain.
        for (gain, code) in [(0, 0x0fa0), (1, 0x1f40), (2, 0x3e80), (3, 0x7d00)] {
            let mut device = Ina219::new(0.1);
            write(
                &mut device,
                CONFIGURATION,
                CONFIGURATION_RESET & !0x1800 | gain << 11,
            );
            for (amperes, code) in [(10.0, code), (-10.0, 0x1_0000 - code)] {
                device.set(12.0, amperes);
                assert_eq!(read(&mut device, SHUNT_VOLTAGE, 2), code);
            }
        }
        for (range, code) in [(WIDE_BUS, 8000), (0, 4000)] {
            let mut device = Ina219::new(0.1);
            write(
                &mut device,
                CONFIGURATION,
                CONFIGURATION_RESET & !WIDE_BUS | range,
            );
            device.set(40.0, 0.0);
            assert_eq!(read(&mut device, BUS_VOLTAGE, 2) >> 3, code);
        }
    }

    #[test]
    fn sixteen_samples_of_each_take_seventeen_milliseconds() {
        let mut device = Ina219::new(0.1);
        device.set(12.0, 1.0);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2) >> 3, 3000);
        write(&mut device, CONFIGURATION, 0x3e67);
        device.set(11.0, 1.0);
        let [before, after] = [17_023, 17_024].map(cycles);
        let at = now();
        assert_eq!(read_at(&mut device, BUS_VOLTAGE, 2, at + before) >> 3, 3000);
        assert_eq!(read_at(&mut device, BUS_VOLTAGE, 2, at + after) >> 3, 2750);
    }
}
