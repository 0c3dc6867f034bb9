//! What the air needs of the board's radio chip.

use crate::Cyw43;

/// Of an Ethernet interface.
pub type MacAddress = [u8; 6];

/// What a station has to know of a network to join it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Credentials {
    pub ssid: String,
    /// `None`: the network is open.
    pub passphrase: Option<String>,
}

impl Credentials {
    pub fn new(ssid: &str, passphrase: &str) -> Self {
        Self {
            ssid: ssid.into(),
            passphrase: Some(passphrase.into()),
        }
    }
}

/// The board's radio, as seen from the air.
pub trait Radio {
    /// The board's own address.
    fn mac(&self) -> MacAddress;

    /// The network that the board itself opens.
    fn access_point(&self) -> Option<Credentials>;

    /// The name of the network that the board has joined.
    fn joined(&self) -> Option<String>;

    /// The Ethernet frames that have left the board since the last call.
    fn take_sent(&mut self) -> Vec<Vec<u8>>;

    /// Delivers an Ethernet frame. Returns whether the chip had room for it.
    fn send(&mut self, frame: &[u8]) -> bool;

    /// A station has joined the board's access point.
    fn client_joined(&mut self, mac: MacAddress);

    /// A station has left it.
    fn client_left(&mut self, mac: MacAddress);
}

impl Radio for Cyw43 {
    fn mac(&self) -> MacAddress {
        self.mac()
    }

    fn access_point(&self) -> Option<Credentials> {
        let access_point = self.access_point()?;
        Some(Credentials {
            ssid: access_point.ssid.clone(),
            passphrase: access_point.passphrase.clone(),
        })
    }

    fn joined(&self) -> Option<String> {
        self.joined().map(str::to_string)
    }

    fn take_sent(&mut self) -> Vec<Vec<u8>> {
        self.take_sent()
    }

    fn send(&mut self, frame: &[u8]) -> bool {
        self.send(frame)
    }

    fn client_joined(&mut self, mac: MacAddress) {
        self.client_joined(mac);
    }

    fn client_left(&mut self, mac: MacAddress) {
        self.client_left(mac);
    }
}

/// Whether a frame is for the station with this address: its own ones are not. Broadcast and multicast are for everyone.
pub fn is_for(mac: MacAddress, frame: &[u8]) -> bool {
    let Some((destination, rest)) = frame.split_first_chunk() else {
        return false;
    };
    let is_to_many = destination[0] & 1 == 1;
    *destination == mac || (is_to_many && !rest.starts_with(&mac))
}
