//! Reports of the radio's task.

use core::fmt;

use crate::announce::{Announce, Limit, Severity};

/// A change of the radio, of the access point or of the network to join.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum WifiReport {
    /// The radio does not answer.
    NoAnswer,
    /// The radio answers, and does not take its firmware.
    DownloadFailed,
    /// No radio has ever answered, and the board may have none: it is not looked for until the next power-up.
    NoRadio,
    /// The access point can be joined.
    AccessPointUp,
    /// The network was joined; an address has not been obtained yet.
    Joined,
    /// The network gave this IPv4 address, first byte first.
    AddressObtained([u8; 4]),
    /// No network of that name is in reach.
    NetworkNotFound,
    /// The network is there, and can't be joined for a reason that is not known.
    JoinFailed,
    /// The network refuses the password.
    WrongPassword,
    /// The network gives no address.
    NoAddress,
    /// The network is out of reach, or has gone.
    NetworkLost,
    /// After a minute without the network the board has one of its own.
    FallbackToAccessPoint,
    /// The radio's task was running when the board crashed, so the radio stays off until the next start.
    OffAfterCrash,
    /// There is no password, and none can be made of what the chip gives as random numbers.
    NoEntropy,
}

impl WifiReport {
    /// Whether something is wrong.
    pub fn is_fault(self) -> bool {
        !matches!(
            self,
            Self::AccessPointUp | Self::Joined | Self::AddressObtained(_)
        )
    }
}

impl Announce for WifiReport {
    fn severity(&self) -> Severity {
        Severity::of_fault(self.is_fault())
    }

    fn limit(&self) -> Limit {
        Limit::of(self)
    }
}

impl fmt::Display for WifiReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAnswer => f.write_str("Wi-Fi radio does not answer"),
            Self::DownloadFailed => f.write_str("Wi-Fi radio does not take its firmware"),
            Self::NoRadio => f.write_str("No Wi-Fi radio found: GP29 free after a restart"),
            Self::AccessPointUp => f.write_str("Wi-Fi access point on"),
            Self::Joined => f.write_str("Wi-Fi network joined"),
            Self::AddressObtained([a, b, c, d]) => write!(f, "Wi-Fi address {a}.{b}.{c}.{d}"),
            Self::NetworkNotFound => f.write_str("Wi-Fi network not found"),
            Self::JoinFailed => f.write_str("Wi-Fi network can't be joined"),
            Self::WrongPassword => f.write_str("Wi-Fi network refuses the password"),
            Self::NoAddress => f.write_str("Wi-Fi network gives no address"),
            Self::NetworkLost => f.write_str("Wi-Fi network lost"),
            Self::FallbackToAccessPoint => f.write_str("No Wi-Fi network: access point instead"),
            Self::OffAfterCrash => f.write_str("Wi-Fi off after a crash: restart the board"),
            Self::NoEntropy => f.write_str("Wi-Fi off: no random numbers for a password"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of one STATUSTEXT.
    const TEXT_BYTES: usize = 50;

    #[test]
    fn the_longest_texts_fit_one_message() {
        for report in [
            WifiReport::AddressObtained([255; 4]),
            WifiReport::FallbackToAccessPoint,
            WifiReport::DownloadFailed,
            WifiReport::NoRadio,
        ] {
            assert!(report.to_string().len() <= TEXT_BYTES, "{report}");
        }
    }
}
