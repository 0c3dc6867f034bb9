//! What is around the chip: networks in range, and frames that it has sent.

/// A network in range of the station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    pub ssid: String,
    /// `None`: open.
    pub passphrase: Option<String>,
    pub channel: u8,
}

#[derive(Clone, Debug, Default)]
pub struct Air {
    pub networks: Vec<Network>,
    pub sent: Vec<Vec<u8>>,
    /// Nothing passes, in either direction.
    pub is_deaf: bool,
}

impl Air {
    pub fn network(&self, ssid: &str) -> Option<&Network> {
        let mut networks = self.networks.iter().filter(|_| !self.is_deaf);
        networks.find(|network| network.ssid == ssid)
    }

    pub fn transmit(&mut self, frame: Vec<u8>) {
        if !self.is_deaf {
            self.sent.push(frame);
        }
    }
}
