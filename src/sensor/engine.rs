//! Fuel that an engine takes, from its injectors.

use crate::battery::{Contents, Measurement, ReadError};
use crate::parameter::{Parameters, VehicleParameter};

/// Up to this speed the engine does not run, in revolutions per minute: ArduPilot's limit.
const STANDSTILL_RPM: u16 = 100;

/// Duty cycle in percent, of an injection of one millisecond in each revolution, at one revolution per minute.
const DUTY_PCT: f32 = 1.0 / 600.0;

/// Litres per hour in one cubic centimetre per minute.
const LITRES_PER_HOUR: f32 = 0.06;

/// An engine control unit's reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EngineReading {
    /// Duration of an injection, in milliseconds.
    pub injection_ms: f32,
    /// Speed, in revolutions per minute.
    pub speed_rpm: u16,
}

impl EngineReading {
    /// The flow of fuel: the injectors' duty cycle, calibrated by `EFI_COEF1` and `EFI_COEF2` as in ArduPilot. Its volume has
    /// to be integrated.
    ///
    /// # Errors
    /// The calibration is not set.
    pub fn measure(&self, parameters: &Parameters) -> Result<Measurement, ReadError> {
        let slope = parameters.get(VehicleParameter::EfiCoef1);
        if slope <= 0.0 {
            return Err(ReadError::NotSetUp);
        }
        let duty_pct = self.injection_ms * f32::from(self.speed_rpm) * DUTY_PCT;
        let calibrated = duty_pct * slope - parameters.get(VehicleParameter::EfiCoef2);
        let cm3_per_minute = match self.speed_rpm {
            ..=STANDSTILL_RPM => 0.0,
            _ => calibrated.max(0.0),
        };
        Ok(Measurement {
            contents: Contents::Fuel,
            current_a: Some(cm3_per_minute * LITRES_PER_HOUR),
            ..Measurement::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flow_l_h(injection_ms: f32, speed_rpm: u16, coefficients: [f32; 2]) -> Result<f32, ReadError> {
        let mut parameters = Parameters::defaults();
        let [slope, offset] = coefficients;
        parameters.set(VehicleParameter::EfiCoef1, slope).unwrap();
        parameters.set(VehicleParameter::EfiCoef2, offset).unwrap();
        let reading = EngineReading {
            injection_ms,
            speed_rpm,
        };
        let measurement = reading.measure(&parameters)?;
        assert_eq!(measurement.contents, Contents::Fuel);
        assert_eq!(measurement.voltage_v, None);
        Ok(measurement.current_a.expect("a flow"))
    }

    #[test]
    fn flow_is_the_calibrated_duty_cycle() {
        // 3 ms in each 20 ms are 15 %; 15 × 0.8 − 2 = 10 cm³ a minute.
        let flow = flow_l_h(3.0, 3000, [0.8, 2.0]).unwrap();
        assert!((flow - 0.6).abs() < 1e-5, "{flow}");
    }

    #[test]
    fn flow_is_never_negative_and_zero_at_standstill() {
        assert_eq!(flow_l_h(0.1, 3000, [0.1, 2.0]), Ok(0.0));
        assert_eq!(flow_l_h(50.0, 100, [1.0, 0.0]), Ok(0.0));
        assert!(flow_l_h(50.0, 101, [1.0, 0.0]).unwrap() > 0.0);
    }

    #[test]
    fn without_calibration_there_is_no_flow() {
        assert_eq!(flow_l_h(3.0, 3000, [0.0, 0.0]), Err(ReadError::NotSetUp));
    }
}
