//! Events of received messages, beyond their answers.

use crate::pack::PackSet;
use crate::parameter::{ParameterId, Refused};
use crate::sensor::{ChargerPower, ExternalReport};
use crate::time::Utc;
use crate::vehicle::Restart;
use crate::wifi::WifiMode;

/// Result of handling a message.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Event {
    /// It was not for us, or nothing to act on at once.
    Ignored,
    /// A ground station gave a sign of life.
    GroundStationHeard,
    /// A ground station that is new on its link, or was silent for 30 s, gave a sign of life.
    GroundStationIntroduced,
    /// A ground station said what time it is.
    TimeHeard(Utc),
    /// It was answered.
    Answered,
    /// A ground station reads all parameters.
    ListRequested,
    /// A parameter was set by a ground station.
    ParameterSet(ParameterId),
    /// A ground station triggered what a parameter does.
    Triggered(ParameterId),
    /// A ground station tried to set a parameter and was refused.
    ParameterRefused(ParameterId, Refused),
    /// A ground station tried to set what is not a parameter.
    ParameterUnknown,
    /// The rover was armed or disarmed, its mode was set, or its driver moved a stick.
    Driven,
    /// A command, by its number, has this effect.
    Command(Action),
    /// A command of this number is not supported, or not with its parameters.
    CommandRefused(u16),
    /// A control message may have waited for longer than `FS_TIMEOUT`, and had no effect.
    ControlTooLate,
    /// Another signing key, or none any more.
    SigningSetUp(SigningChange),
    /// Signing was not set up.
    SigningRefused(SetupRefused),
    /// Wi-Fi was set up: names or passwords may have changed, and `WIFI_MODE` was set.
    WifiSetUp(WifiMode),
    /// Wi-Fi was not set up.
    WifiRefused(WifiRefused),
    /// Parameters were set by a file of them.
    ParametersSet,
    /// All log files are to be erased.
    LogsErased,
    /// Another component of the vehicle has measured a pack.
    Measured {
        /// The component's id.
        component_id: u8,
        /// Its report.
        report: ExternalReport,
    },
    /// It was not signed as it would have to be, and had no effect.
    Unauthorized {
        /// Their number on this link.
        count: u32,
    },
    /// It was signed with the key, but is too old, or not later than the latest frame of its ids, and had no effect.
    TooOld,
}

impl Event {
    /// Whether it left something to send on its link, or changed the link's rates.
    pub fn concerns_link(&self) -> bool {
        !matches!(
            self,
            Self::Ignored
                | Self::GroundStationHeard
                | Self::TimeHeard(_)
                | Self::ControlTooLate
                | Self::Measured { .. }
                | Self::Unauthorized { .. }
                | Self::TooOld
        )
    }
}

/// An action of the vehicle, beyond answering.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Action {
    /// Restart the board once what was answered and set has been sent and saved.
    Restart(Restart),
    /// Forget everything stored and go back to the defaults.
    ResetParameters,
    /// Switch all solar chargers.
    SwitchChargers(ChargerPower),
    /// The failsafe levels of these packs end, and they have this much charge now, unless they report it themselves.
    ResetBatteries {
        /// Only packs that are monitored.
        packs: PackSet,
        /// The charge in percent of a full pack, 0 to 100.
        percent: f32,
    },
}

/// A change of the signing key by a ground station.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum SigningChange {
    /// A key.
    KeySet,
    /// That there is none any more.
    KeyRemoved,
}

/// Why signing was not set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum SetupRefused {
    /// The key would have been heard by everyone near.
    NotDirect,
    /// The initial timestamp leaves less than a year of what 48 bits hold.
    BadTime,
    /// Flash may have no space for the key that is erased, and can't get any while the rover may be moving.
    Armed,
}

/// Why Wi-Fi was not set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum WifiRefused {
    /// The driver may be at the other end of the network that would be left.
    Armed,
    /// There is no radio, or no such mode.
    Mode,
    /// The name is invalid, or would be another one of the access point, whose name is fixed.
    Ssid,
    /// The password is invalid, or there is none for the access point.
    Password,
}
