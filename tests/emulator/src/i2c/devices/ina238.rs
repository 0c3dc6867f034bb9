//! INA238: 16-bit power monitor with an external shunt (SLYS025: registers in table 7-3, ranges in table 8-1).
//!
//! Left out: the conversion delay in CONFIG, power, alerts. The temperature is there at once.

use super::super::super::clock::Cycle;
use super::register_map::{RegisterMap, Registers};
use super::{
    CONFIG, CONFIG_RESET, Converter, Load, SHUNT_CAL_RESET, TEXAS_INSTRUMENTS, current_code, field_of,
    setup_of_ina228, shunt_range, shunt_step, signed_code, unsigned_code,
};

const ADC_CONFIG: u8 = 0x01;
const SHUNT_CAL: u8 = 0x02;
const VSHUNT: u8 = 0x04;
const VBUS: u8 = 0x05;
const DIETEMP: u8 = 0x06;
const CURRENT: u8 = 0x07;
const MANUFACTURER_ID: u8 = 0x3e;
const DEVICE_ID: u8 = 0x3f;

const ADC_CONFIG_RESET: u16 = 0xfb68;
const SHUNT_LSB_V: f64 = 5e-6;
const BUS_LSB_V: f64 = 3.125e-3;
/// The ADC's range; the pin must not be above 85 V.
const MOST_VOLTS: f64 = 102.4;
const TEMPERATURE_LSB_C: f64 = 125e-3;

pub struct Ina238 {
    device_id: u16,
    shunt_ohm: f64,
    converter: Converter,
    config: u16,
    adc_config: u16,
    shunt_cal: u16,
    shunt: i64,
    bus: i64,
}

impl Ina238 {
    /// Its revision is not confirmed.
    const DEVICE_ID: u16 = 0x2381;

    pub fn new(shunt_ohm: f64) -> RegisterMap<Self> {
        RegisterMap::of(Self::identified(Self::DEVICE_ID, shunt_ohm))
    }

    /// The registers of a part that calls itself something else.
    pub fn identified(device_id: u16, shunt_ohm: f64) -> Self {
        Self {
            device_id,
            shunt_ohm,
            converter: Converter::default(),
            config: 0,
            adc_config: ADC_CONFIG_RESET,
            shunt_cal: SHUNT_CAL_RESET,
            shunt: 0,
            bus: 0,
        }
    }

    pub fn set(&mut self, volts: f64, amperes: f64, celsius: f64) {
        self.converter.set_load(Load {
            volts,
            amperes,
            celsius,
        });
    }

    /// The current flows for this share of the time, in pulses that are much shorter than a conversion.
    pub fn set_pulses(&mut self, share: f64) {
        self.converter.set_pulses(share);
    }

    fn reset(&mut self) {
        self.converter.restart(0);
        *self = Self {
            converter: self.converter,
            ..Self::identified(self.device_id, self.shunt_ohm)
        };
    }
}

impl Registers for Ina238 {
    fn read(&self, pointer: u8) -> u64 {
        let celsius = self.converter.load().celsius;
        match pointer {
            CONFIG => self.config.into(),
            ADC_CONFIG => self.adc_config.into(),
            SHUNT_CAL => self.shunt_cal.into(),
            VSHUNT => field_of(self.shunt, 16),
            VBUS => field_of(self.bus, 16),
            DIETEMP => field_of(signed_code(celsius, TEMPERATURE_LSB_C, 12), 12) << 4,
            CURRENT => field_of(current_code(self.shunt, self.shunt_cal, 16), 16),
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DEVICE_ID => self.device_id.into(),
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIG if value & CONFIG_RESET != 0 => self.reset(),
            CONFIG => {
                self.config = value;
                self.converter.restart(0);
            }
            ADC_CONFIG => {
                self.adc_config = value;
                self.converter.restart(0);
            }
            SHUNT_CAL => self.shunt_cal = value & 0x7fff,
            _ => {}
        }
    }

    fn note_time(&mut self, now: Cycle) {
        let step_v = shunt_step(self.config, SHUNT_LSB_V);
        let amperes = shunt_range(step_v, 16, self.shunt_ohm);
        let setup = setup_of_ina228(self.adc_config, MOST_VOLTS, amperes);
        for results in self.converter.advance(now, &setup) {
            if setup.measures_current {
                self.shunt = signed_code(results.amperes * self.shunt_ohm, step_v, 16);
            }
            if setup.measures_voltage {
                self.bus = unsigned_code(results.volts, BUS_LSB_V, 15);
            }
        }
    }

    fn set_load(&mut self, volts: f64, amperes: f64) {
        self.set(volts, amperes, self.converter.load().celsius);
    }

    fn power_cycle(&mut self) {
        self.converter.power_cycle();
        self.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::read;
    use super::*;

    #[test]
    fn six_amperes_at_48_volts_read_as_the_equations_say() {
        let mut device = Ina238::new(0.0162);
        device.set(48.0, 6.0, 25.0);
        for (pointer, value) in [
            (ADC_CONFIG, 0xfb68),
            // 97.2 mV in 5 uV.
            (VSHUNT, 19_440),
            (VBUS, 15_360),
            (DIETEMP, 200 << 4),
            (MANUFACTURER_ID, 0x5449),
            (DEVICE_ID, 0x2381),
        ] {
            assert_eq!(read(&mut device, pointer, 2), value, "{pointer:#x}");
        }
    }

    #[test]
    fn negative_values_are_in_two_s_complement_and_out_of_range_is_held() {
        let mut device = Ina238::new(0.001);
        device.set(12.0, -10.0, -5.0);
        assert_eq!(read(&mut device, VSHUNT, 2), 0x1_0000 - 2000);
        assert_eq!(read(&mut device, DIETEMP, 2), (0x1000 - 40) << 4);
        // 163.84 mV and 102.4 V at the most.
        for (amperes, shunt) in [(200.0, 0x7fff), (-200.0, 0x8000)] {
            device.set(200.0, amperes, 25.0);
            let values = [VSHUNT, VBUS, CURRENT].map(|pointer| read(&mut device, pointer, 2));
            assert_eq!(values, [shunt, 0x7fff, shunt]);
        }
    }
}
