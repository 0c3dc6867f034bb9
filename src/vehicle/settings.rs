//! Settings of the vehicle.

use crate::parameter::{Parameters, StickChannels, VehicleParameter};

/// Settings of the vehicle, from its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleSettings {
    /// Time-out of control inputs, in microseconds: [`control_timeout_us`].
    pub timeout_us: u64,
    /// Time-out of ground stations' heartbeats (`FS_GCS_TIMEOUT`), in microseconds.
    pub ground_station_timeout_us: u64,
    /// Channels of the sticks (`RCMAP_ROLL`, `RCMAP_THROTTLE`, `RC1_MIN` and its like).
    pub channels: StickChannels,
    /// Slew rate of the throttle (`MOT_SLEWRATE`), in full throttles per second; `None` is unlimited.
    pub slew_rate_per_s: Option<f32>,
}

impl VehicleSettings {
    /// From the live parameters.
    pub fn from_parameters(parameters: &Parameters) -> Self {
        let slew_rate_pct_per_s = parameters.get(VehicleParameter::MotSlewrate);
        Self {
            timeout_us: control_timeout_us(parameters),
            ground_station_timeout_us: microseconds(parameters, VehicleParameter::FsGcsTimeout),
            channels: parameters.stick_channels(),
            slew_rate_per_s: (slew_rate_pct_per_s > 0.0).then_some(slew_rate_pct_per_s / 100.0),
        }
    }
}

/// Time-out of control inputs (`FS_TIMEOUT`), in microseconds.
pub fn control_timeout_us(parameters: &Parameters) -> u64 {
    microseconds(parameters, VehicleParameter::FsTimeout)
}

/// A time that is set in seconds.
fn microseconds(parameters: &Parameters, seconds: VehicleParameter) -> u64 {
    (parameters.get(seconds) * 1e6) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_ardupilots() {
        let mut parameters = Parameters::defaults();
        let expected = VehicleSettings {
            timeout_us: 1_500_000,
            ground_station_timeout_us: 5_000_000,
            channels: StickChannels::default(),
            slew_rate_per_s: Some(1.0),
        };
        assert_eq!(VehicleSettings::from_parameters(&parameters), expected);
        parameters
            .set(VehicleParameter::MotSlewrate, 0.0)
            .expect("in range");
        assert_eq!(
            VehicleSettings::from_parameters(&parameters).slew_rate_per_s,
            None
        );
    }
}
