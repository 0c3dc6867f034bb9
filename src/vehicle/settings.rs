//! What the owner has set for the rover.

use crate::parameter::{Parameters, VehicleParameter};

/// What the owner has set for the rover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleSettings {
    /// Control inputs that stay away for longer have failed (`FS_TIMEOUT`), in microseconds.
    pub timeout_us: u64,
    /// Heartbeats of ground stations that stay away for longer have failed (`FS_GCS_TIMEOUT`), in microseconds.
    pub ground_station_timeout_us: u64,
    /// How fast the throttle may change (`MOT_SLEWRATE`), in full throttles a second; `None` is at once.
    pub slew_rate_per_s: Option<f32>,
}

impl VehicleSettings {
    /// What the parameters say at this moment.
    pub fn from_parameters(parameters: &Parameters) -> Self {
        let slew_rate_pct_per_s = parameters.get(VehicleParameter::MotSlewrate);
        let microseconds = |parameter: VehicleParameter| (parameters.get(parameter) * 1e6) as u64;
        Self {
            timeout_us: microseconds(VehicleParameter::FsTimeout),
            ground_station_timeout_us: microseconds(VehicleParameter::FsGcsTimeout),
            slew_rate_per_s: (slew_rate_pct_per_s > 0.0).then_some(slew_rate_pct_per_s / 100.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_default_it_is_ardupilots() {
        let mut parameters = Parameters::defaults();
        let expected = VehicleSettings {
            timeout_us: 1_500_000,
            ground_station_timeout_us: 5_000_000,
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
