//! The names and passwords in force.

use bitflags::bitflags;

use super::{Network, Password, Ssid, StoredWifi, WifiChoice, WifiRecord, WifiSetup};
use crate::memory::identity::BoardId;

/// Whether the board has a Wi-Fi radio.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Radio {
    /// It has none.
    #[default]
    Absent,
    /// It has one, which may not work.
    Present,
}

bitflags! {
    /// Data that are not in flash yet.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    struct Unsaved: u8 {
        const OWN_PASSWORD = 1;
        const NETWORK = 1 << 1;
    }
}

/// The names and passwords in force, and what of them is not in flash yet.
#[derive(Clone, Debug)]
pub struct WifiCredentials {
    radio: Radio,
    own_name: Ssid,
    in_force: StoredWifi,
    unsaved: Unsaved,
}

impl WifiCredentials {
    /// The credentials at the start of a board.
    pub fn new(radio: Radio, board_id: Option<BoardId>, stored: StoredWifi) -> Self {
        Self {
            radio,
            own_name: Ssid::of_board(board_id),
            in_force: stored,
            unsaved: Unsaved::empty(),
        }
    }

    /// Of a board without a radio.
    pub fn absent() -> Self {
        Self::new(Radio::Absent, None, StoredWifi::default())
    }

    /// Whether the board has a radio.
    pub fn radio(&self) -> Radio {
        self.radio
    }

    /// The name of the board's own network.
    pub fn own_name(&self) -> &Ssid {
        &self.own_name
    }

    /// The password of the board's own network; `None` if none was made yet.
    pub fn own_password(&self) -> Option<&Password> {
        self.in_force.own_password.as_ref()
    }

    /// The network to join; `None` if none is set.
    pub fn network(&self) -> Option<&Network> {
        self.in_force.network.as_ref()
    }

    /// Takes what flash holds, but for what was set before it was read.
    pub fn restore(&mut self, stored: StoredWifi) {
        let in_force = &mut self.in_force;
        in_force.own_password = in_force.own_password.take().or(stored.own_password);
        in_force.network = in_force.network.take().or(stored.network);
    }

    /// Sets the password of the board's own network.
    pub fn set_own_password(&mut self, password: Password) {
        self.in_force.own_password = Some(password);
        self.unsaved |= Unsaved::OWN_PASSWORD;
    }

    /// Sets the network to join.
    pub fn set_network(&mut self, network: Network) {
        self.in_force.network = Some(network);
        self.unsaved |= Unsaved::NETWORK;
    }

    /// The record to write to flash next.
    pub fn next_unsaved(&self) -> Option<WifiRecord> {
        let own_password = self
            .own_password()
            .filter(|_| self.unsaved.contains(Unsaved::OWN_PASSWORD));
        let network = self.network().filter(|_| self.unsaved.contains(Unsaved::NETWORK));
        let own_password = own_password.cloned().map(WifiRecord::OwnPassword);
        own_password.or_else(|| network.cloned().map(WifiRecord::Network))
    }

    /// `record` is in flash now. What was set meanwhile is not.
    pub fn mark_saved(&mut self, record: &WifiRecord) {
        let (is_current, saved) = match record {
            WifiRecord::OwnPassword(password) => {
                (self.own_password() == Some(password), Unsaved::OWN_PASSWORD)
            }
            WifiRecord::Network(network) => (self.network() == Some(network), Unsaved::NETWORK),
        };
        if is_current {
            self.unsaved -= saved;
        }
    }

    /// The radio's set-up; `None` without a radio, or while its own network has no password.
    pub fn setup(&self, choice: WifiChoice) -> Option<WifiSetup> {
        let own_password = self.own_password().filter(|_| self.radio == Radio::Present)?;
        Some(WifiSetup {
            mode: choice.mode,
            channel: choice.channel,
            power_save: choice.power_save,
            own_name: self.own_name.clone(),
            own_password: own_password.clone(),
            network: self.network().cloned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::Parameters;

    fn password(text: &str) -> Password {
        Password::new(text.as_bytes()).expect("valid")
    }

    #[test]
    fn what_is_set_while_it_is_written_is_written_too() {
        let mut credentials = WifiCredentials::new(Radio::Present, None, StoredWifi::default());
        assert_eq!(credentials.next_unsaved(), None);
        credentials.set_own_password(password("the first"));
        let first = credentials.next_unsaved().expect("unsaved");
        credentials.set_own_password(password("the second"));
        credentials.mark_saved(&first);
        let second = WifiRecord::OwnPassword(password("the second"));
        assert_eq!(credentials.next_unsaved(), Some(second.clone()));
        credentials.mark_saved(&second);
        assert_eq!(credentials.next_unsaved(), None);
    }

    #[test]
    fn a_radio_is_set_up_once_it_is_there_and_has_a_password() {
        let choice = WifiChoice::from_parameters(&Parameters::defaults());
        let stored = StoredWifi {
            own_password: Some(password("12345678")),
            network: None,
        };
        let of = |radio, stored: &StoredWifi| WifiCredentials::new(radio, None, stored.clone()).setup(choice);
        assert_eq!(of(Radio::Absent, &stored), None);
        assert_eq!(of(Radio::Present, &StoredWifi::default()), None);
        let setup = of(Radio::Present, &stored).expect("complete");
        assert_eq!(setup.own_password, password("12345678"));
        assert_eq!(setup.own_name.as_str(), "rover");
    }
}
