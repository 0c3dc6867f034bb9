//! What is around the chip: networks in range, and frames that it has sent.

/// A network in range of the station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    pub ssid: String,
    /// `None`: open.
    pub passphrase: Option<String>,
}

#[derive(Clone, Debug, Default)]
pub struct Air {
    pub networks: Vec<Network>,
    pub sent: Vec<Vec<u8>>,
}

impl Air {
    pub fn network(&self, ssid: &str) -> Option<&Network> {
        self.networks.iter().find(|network| network.ssid == ssid)
    }
}
