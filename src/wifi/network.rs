//! A network to join.

use super::{Password, Ssid};

/// A network to join.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    /// Its name.
    pub ssid: Ssid,
    /// Its password by WPA2; `None` for an open network.
    pub password: Option<Password>,
}
