//! Set-up of the radio.

use super::{Network, Password, Ssid};
use crate::parameter::{Parameters, VehicleParameter};

/// Mode of the radio (`WIFI_MODE`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum WifiMode {
    /// Off.
    Off,
    /// It has a network of its own.
    AccessPoint,
    /// It joins a network.
    Station,
}

impl WifiMode {
    /// The value of the parameter.
    pub fn parameter_value(self) -> f32 {
        match self {
            Self::Off => 0.0,
            Self::AccessPoint => 1.0,
            Self::Station => 2.0,
        }
    }
}

/// Whether the radio sleeps between packets (`WIFI_PWR_SAVE`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum PowerSave {
    /// It is always on.
    Off,
    /// It sleeps.
    On,
}

/// Choice of Wi-Fi by the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct WifiChoice {
    /// `WIFI_MODE`.
    pub mode: WifiMode,
    /// Channel of the access point, 1 to 11 (`WIFI_CHANNEL`).
    pub channel: u8,
    /// `WIFI_PWR_SAVE`.
    pub power_save: PowerSave,
}

impl WifiChoice {
    /// From the live parameters.
    pub fn from_parameters(parameters: &Parameters) -> Self {
        Self {
            mode: match parameters.get_whole(VehicleParameter::WifiMode) {
                1 => WifiMode::AccessPoint,
                2 => WifiMode::Station,
                // The table has no other value.
                _ => WifiMode::Off,
            },
            // The table's range is 1 to 11.
            channel: parameters.get_whole(VehicleParameter::WifiChannel) as u8,
            power_save: match parameters.get_whole(VehicleParameter::WifiPwrSave) {
                0 => PowerSave::Off,
                _ => PowerSave::On,
            },
        }
    }
}

/// Everything the radio has to know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WifiSetup {
    /// Its mode.
    pub mode: WifiMode,
    /// Channel of the access point, 1 to 11.
    pub channel: u8,
    /// Whether it sleeps between packets.
    pub power_save: PowerSave,
    /// The name of the access point.
    pub own_name: Ssid,
    /// The password of the access point.
    pub own_password: Password,
    /// The network that a station joins; `None` while none is set.
    pub network: Option<Network>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_default_it_is_an_access_point_that_does_not_sleep() {
        let choice = WifiChoice::from_parameters(&Parameters::defaults());
        let expected = WifiChoice {
            mode: WifiMode::AccessPoint,
            channel: 6,
            power_save: PowerSave::Off,
        };
        assert_eq!(choice, expected);
    }

    #[test]
    fn every_mode_is_read_as_it_is_set() {
        let mut parameters = Parameters::defaults();
        for mode in [WifiMode::Off, WifiMode::AccessPoint, WifiMode::Station] {
            parameters
                .set(VehicleParameter::WifiMode, mode.parameter_value())
                .unwrap();
            assert_eq!(WifiChoice::from_parameters(&parameters).mode, mode);
        }
        parameters.set(VehicleParameter::WifiPwrSave, 1.0).unwrap();
        parameters.set(VehicleParameter::WifiChannel, 11.0).unwrap();
        let choice = WifiChoice::from_parameters(&parameters);
        assert_eq!((choice.power_save, choice.channel), (PowerSave::On, 11));
    }
}
