//! INA238: 16-bit power monitor with an external shunt (SLYS025).
//!
//! Left out: the conversion delay in CONFIG, the calibration with current and power, alerts.

use super::super::super::clock::Cycle;
use super::register_map::{RegisterMap, Registers};
use super::{
    CONFIG, CONFIG_RESET, Load, TEXAS_INSTRUMENTS, conversion_of_ina228, field_of, shunt_step, signed_code,
    unsigned_code,
};

const ADC_CONFIG: u8 = 0x01;
const VSHUNT: u8 = 0x04;
const VBUS: u8 = 0x05;
const DIETEMP: u8 = 0x06;
const MANUFACTURER_ID: u8 = 0x3e;
const DEVICE_ID: u8 = 0x3f;

const ADC_CONFIG_RESET: u16 = 0xfb68;
const SHUNT_LSB_V: f64 = 5e-6;
const BUS_LSB_V: f64 = 3.125e-3;
const TEMPERATURE_LSB_C: f64 = 125e-3;

pub struct Ina238 {
    device_id: u16,
    shunt_ohm: f64,
    load: Load,
    config: u16,
    adc_config: u16,
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
            load: Load::default(),
            config: 0,
            adc_config: ADC_CONFIG_RESET,
        }
    }

    pub fn set(&mut self, volts: f64, amperes: f64, celsius: f64) {
        self.load = Load {
            volts,
            amperes,
            celsius,
        };
    }
}

impl Registers for Ina238 {
    fn read(&self, pointer: u8) -> u64 {
        let Load {
            volts,
            amperes,
            celsius,
        } = self.load;
        match pointer {
            CONFIG => self.config.into(),
            ADC_CONFIG => self.adc_config.into(),
            VSHUNT => {
                let step_v = shunt_step(self.config, SHUNT_LSB_V);
                field_of(signed_code(amperes * self.shunt_ohm, step_v, 16), 16)
            }
            VBUS => field_of(unsigned_code(volts, BUS_LSB_V, 15), 16),
            DIETEMP => field_of(signed_code(celsius, TEMPERATURE_LSB_C, 12), 12) << 4,
            MANUFACTURER_ID => TEXAS_INSTRUMENTS,
            DEVICE_ID => self.device_id.into(),
            _ => 0,
        }
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIG if value & CONFIG_RESET != 0 => self.reset(),
            CONFIG => self.config = value,
            ADC_CONFIG => self.adc_config = value,
            _ => {}
        }
    }

    fn conversion(&self) -> Cycle {
        conversion_of_ina228(self.adc_config)
    }

    fn set_result(&mut self, volts: f64, amperes: f64) {
        self.set(volts, amperes, self.load.celsius);
    }

    fn reset(&mut self) {
        self.config = 0;
        self.adc_config = ADC_CONFIG_RESET;
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
        device.set(200.0, 200.0, 25.0);
        let values = [VSHUNT, VBUS].map(|pointer| read(&mut device, pointer, 2));
        assert_eq!(values, [0x7fff; 2]);
    }
}
