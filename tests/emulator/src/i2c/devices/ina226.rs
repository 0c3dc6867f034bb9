//! INA226: 16-bit power monitor with an external shunt (SBOS547B: registers in table 7-1, the configuration in 7.1.1). An INA231
//! has no identification, and its pin must not be above 28 V (SBOS644D table 8-3, 6.3); an INA260 has a shunt of its own, and
//! CURRENT in place of the shunt's voltage (SBOS656C 8.6).
//!
//! Left out: alerts, and the calibration. Current and power read zero, as they do without one.

use super::super::super::clock::Cycle;
use super::register_map::{OneConverter, RegisterMap, Registers};
use super::{
    Converter, TEXAS_INSTRUMENTS, field_of, setup_of_ina226, shunt_range, signed_code, unsigned_code,
};

const CONFIGURATION: u8 = 0x00;
const SHUNT_VOLTAGE: u8 = 0x01;
const BUS_VOLTAGE: u8 = 0x02;
const MANUFACTURER_ID: u8 = 0xfe;
const DIE_ID: u8 = 0xff;

/// Bits 14 to 12 of an INA231's configuration read as 100.
const FIXED: u16 = 0x7000;
const FIXED_VALUE: u16 = 0x4000;

const SHUNT_LSB_V: f64 = 2.5e-6;
const BUS_LSB_V: f64 = 1.25e-3;
/// The ADC's range; the pin must not be above 36 V.
const MOST_VOLTS: f64 = 40.96;
/// An INA260's 1.25 mA are a step of the voltage over this; its shunt stands 15 A.
const OHM_OF_INA260: f64 = 0.002;

#[derive(Clone, Copy)]
enum Kind {
    Ina226,
    Ina231,
    Ina260,
}

impl Kind {
    fn configuration_at_reset(self) -> u16 {
        match self {
            Self::Ina226 | Self::Ina231 => 0x4127,
            Self::Ina260 => 0x6127,
        }
    }
}

pub struct Ina226 {
    kind: Kind,
    shunt_ohm: f64,
    converter: Converter,
    configuration: u16,
    shunt: i64,
    bus: i64,
}

impl Ina226 {
    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        Self::of(Kind::Ina226, shunt_ohm)
    }

    pub fn ina231(shunt_ohm: f64) -> RegisterMap<Self> {
        Self::of(Kind::Ina231, shunt_ohm)
    }

    pub fn ina260() -> RegisterMap<Self> {
        Self::of(Kind::Ina260, OHM_OF_INA260)
    }

    fn of(kind: Kind, shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self {
            kind,
            shunt_ohm,
            converter: Converter::default(),
            configuration: kind.configuration_at_reset(),
            shunt: 0,
            bus: 0,
        })
    }

    /// It measures no temperature.
    pub fn set(&mut self, volts: f64, amperes: f64) {
        self.set_load(volts, amperes);
    }

    /// The current flows for this share of the time, in pulses that are much shorter than a conversion.
    pub fn set_pulses(&mut self, share: f64) {
        self.converter.set_pulses(share);
    }

    pub fn configuration(&self) -> u16 {
        self.configuration
    }
}

impl OneConverter for Ina226 {
    fn converter(&mut self) -> &mut Converter {
        &mut self.converter
    }

    fn register(&self, pointer: u8) -> u64 {
        match (pointer, self.kind) {
            (CONFIGURATION, _) => self.configuration.into(),
            (SHUNT_VOLTAGE, _) => field_of(self.shunt, 16),
            (BUS_VOLTAGE, _) => field_of(self.bus, 16),
            (MANUFACTURER_ID, Kind::Ina226 | Kind::Ina260) => TEXAS_INSTRUMENTS,
            (DIE_ID, Kind::Ina226) => 0x2260,
            (DIE_ID, Kind::Ina260) => 0x2270,
            // It is not known what silicon gives where there is no register.
            _ => 0,
        }
    }

    fn configure(&mut self, configuration: u16) {
        self.configuration = match self.kind {
            Kind::Ina231 => configuration & !FIXED | FIXED_VALUE,
            Kind::Ina226 | Kind::Ina260 => configuration,
        };
        self.converter.restart(0);
    }

    fn reset(&mut self) {
        self.configure(self.kind.configuration_at_reset());
        (self.shunt, self.bus) = (0, 0);
    }

    fn convert(&mut self, now: Cycle) {
        let amperes = shunt_range(SHUNT_LSB_V, 16, self.shunt_ohm);
        let setup = setup_of_ina226(self.configuration, MOST_VOLTS, amperes);
        for results in self.converter.advance(now, &setup) {
            if setup.measures_current {
                self.shunt = signed_code(results.amperes * self.shunt_ohm, SHUNT_LSB_V, 16);
            }
            if setup.measures_voltage {
                // Of its 16 bits the highest is always 0.
                self.bus = unsigned_code(results.volts, BUS_LSB_V, 15);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::{now, read, read_at, write};
    use super::*;

    #[test]
    fn registers_are_those_of_each_datasheet() {
        // SBOS547B table 1, of both: 10 A through 2 mOhm, 11.98 V. Reset value and die id of the INA260 from memory, not confirmed.
        for (mut device, values) in [
            (Ina226::new(0.002), [0x4127, 0x1f40, 0x2570, 0x5449, 0x2260]),
            (Ina226::ina231(0.002), [0x4127, 0x1f40, 0x2570, 0, 0]),
            (Ina226::ina260(), [0x6127, 8000, 0x2570, 0x5449, 0x2270]),
        ] {
            device.set(11.98, 10.0);
            let registers = [CONFIGURATION, SHUNT_VOLTAGE, BUS_VOLTAGE, MANUFACTURER_ID, DIE_ID];
            assert_eq!(registers.map(|pointer| read(&mut device, pointer, 2)), values);
        }
    }

    #[test]
    fn three_bits_of_an_ina231s_configuration_are_fixed() {
        let mut device = Ina226::ina231(0.002);
        write(&mut device, CONFIGURATION, 0x3527);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x4527);
    }

    #[test]
    fn a_current_the_other_way_is_negative_and_out_of_range_is_held() {
        for mut device in [Ina226::new(0.002), Ina226::ina260()] {
            device.set(11.98, -10.0);
            assert_eq!(read(&mut device, SHUNT_VOLTAGE, 2), 0x1_0000 - 0x1f40);
            // 81.92 mV, which are 40.96 A, and 40.96 V at the most.
            for (amperes, shunt) in [(41.0, 0x7fff), (-41.0, 0x8000)] {
                device.set(41.0, amperes);
                let values = [SHUNT_VOLTAGE, BUS_VOLTAGE].map(|pointer| read(&mut device, pointer, 2));
                assert_eq!(values, [shunt, 0x7fff]);
            }
        }
    }

    #[test]
    fn pulses_above_the_range_read_too_low() {
        let mut device = Ina226::new(0.002);
        device.set(12.0, 80.0);
        device.set_pulses(0.25);
        // 20 A, of which 40.96 A for a quarter of the time are shown.
        assert_eq!(read(&mut device, SHUNT_VOLTAGE, 2), 0x2000);
    }

    #[test]
    fn a_new_configuration_begins_a_conversion_and_keeps_the_result_before() {
        let mut device = Ina226::new(0.002);
        device.set(12.0, 1.0);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 9600);
        device.set(10.0, 1.0);
        write(&mut device, CONFIGURATION, 0x44df);
        device.set(11.0, 1.0);
        // The load before was converted until it was written.
        let [before, after] = [18_815, 18_816].map(super::super::cycles);
        let at = now();
        assert_eq!(read_at(&mut device, BUS_VOLTAGE, 2, at + before), 8000);
        assert_eq!(read_at(&mut device, BUS_VOLTAGE, 2, at + after), 8800);
    }

    #[test]
    fn shut_down_it_keeps_its_results_and_triggered_it_converts_once() {
        let mut device = Ina226::new(0.002);
        device.set(12.0, 1.0);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 9600);
        write(&mut device, CONFIGURATION, 0x4120);
        device.set(11.0, 1.0);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 9600);
        write(&mut device, CONFIGURATION, 0x4123);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 8800);
        device.set(10.0, 1.0);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 8800);
    }
}
