//! The radio as the program of the WLAN core runs it: an access point of its own, or a station in another
//! network, and the events that come of it.

use super::super::clock::{Cycle, cycles};
use super::air::{Air, Network};
use super::events::{
    Event, FLAG_LINK_UP, Kind, REASON_BEACONS_LOST, REASON_DISASSOCIATED, REASON_KEY_TIME_OUT,
    REASON_NOT_AUTHENTICATED, Status,
};

/// Until a network was looked for on all channels.
const SCAN: Cycle = cycles(1_200_000);
/// Until the network that was found has let the station in.
const ASSOCIATION: Cycle = cycles(300_000);
/// Until the station gives up to agree on keys (`sup_wpa_tmo` of the driver).
const KEY_TIME_OUT: Cycle = cycles(2_500_000);

/// An access point that is up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AccessPoint {
    pub ssid: String,
    /// `None`: open.
    pub passphrase: Option<String>,
    pub channel: u8,
}

/// What the driver has set up.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    pub mode: Mode,
    pub ssid: String,
    pub channel: u8,
    /// WPA with a passphrase; without it the network is open.
    pub is_secure: bool,
    pub passphrase: String,
    /// The levels of the chip's own GPIOs 0 to 2 that were set.
    pub gpios: [Option<bool>; 3],
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    #[default]
    Station,
    AccessPoint,
}

/// Attempts to join, each with the time of its next step.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Joining {
    Searching { ssid: String, until: Cycle },
    Associating { network: Network, until: Cycle },
    AgreeingOnKeys { until: Cycle },
}

#[derive(Clone, Debug, Default)]
pub struct Radio {
    pub settings: Settings,
    is_up: bool,
    access_point: Option<AccessPoint>,
    joining: Option<Joining>,
    joined: Option<String>,
    /// Without keys, and without having left.
    is_associated: bool,
    /// See [`RadioFault::StaysAssociated`](super::RadioFault).
    pub stays_associated: bool,
    events: Vec<Event>,
}

impl Radio {
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    pub fn push(&mut self, event: Event) {
        self.events.push(event);
    }

    pub fn is_up(&self) -> bool {
        self.is_up
    }

    pub fn access_point(&self) -> Option<&AccessPoint> {
        self.access_point.as_ref()
    }

    pub fn joined(&self) -> Option<&str> {
        self.joined.as_deref()
    }

    /// It is in a network, with or without keys.
    pub fn is_associated(&self) -> bool {
        let is_agreeing = matches!(self.joining, Some(Joining::AgreeingOnKeys { .. }));
        self.joined.is_some() || self.is_associated || is_agreeing
    }

    /// Frames can go both ways.
    pub fn has_network(&self) -> bool {
        self.access_point.is_some() || self.joined.is_some()
    }

    pub fn up(&mut self) {
        self.is_up = true;
    }

    pub fn down(&mut self) {
        self.stop_access_point();
        self.leave();
        self.is_up = false;
    }

    pub fn start_access_point(&mut self) {
        let settings = &self.settings;
        self.access_point = Some(AccessPoint {
            ssid: settings.ssid.clone(),
            passphrase: settings.is_secure.then(|| settings.passphrase.clone()),
            channel: settings.channel,
        });
        self.link_up();
    }

    pub fn stop_access_point(&mut self) {
        if self.access_point.take().is_some() {
            self.link_down(REASON_DISASSOCIATED);
        }
    }

    pub fn join(&mut self, ssid: String, now: Cycle) {
        self.leave();
        let until = now + SCAN;
        self.joining = Some(Joining::Searching { ssid, until });
    }

    /// The driver has asked for it.
    pub fn leave(&mut self) {
        self.joining = None;
        self.is_associated = false;
        if self.joined.take().is_some() {
            self.emit(Kind::Disassoc, Status::Success);
            self.link_down(REASON_DISASSOCIATED);
        }
    }

    /// A network is no longer in range.
    pub fn lose(&mut self, ssid: &str) {
        if self.joined.as_deref() == Some(ssid) {
            self.joined = None;
            self.link_down(REASON_BEACONS_LOST);
        }
    }

    /// The network excludes the station.
    pub fn deauthenticated(&mut self) {
        if self.joined.take().is_some() {
            self.push(Event::new(Kind::DeauthInd, Status::Success).because(REASON_NOT_AUTHENTICATED));
        }
    }

    pub fn next_event(&self) -> Option<Cycle> {
        self.joining.as_ref().map(|joining| match joining {
            Joining::Searching { until, .. }
            | Joining::Associating { until, .. }
            | Joining::AgreeingOnKeys { until } => *until,
        })
    }

    pub fn advance(&mut self, air: &Air, now: Cycle) {
        while self.next_event().is_some_and(|due| due <= now)
            && let Some(joining) = self.joining.take()
        {
            self.joining = self.next_step(joining, air);
        }
    }

    fn next_step(&mut self, joining: Joining, air: &Air) -> Option<Joining> {
        match joining {
            Joining::Searching { ssid, until } => self.found(air.network(&ssid), until),
            Joining::Associating { network, until } => self.associated(network, air, until),
            Joining::AgreeingOnKeys { .. } if self.stays_associated => {
                self.push(Event::new(Kind::PskSup, Status::Abort).because(REASON_KEY_TIME_OUT));
                self.is_associated = true;
                None
            }
            Joining::AgreeingOnKeys { .. } => {
                self.push(Event::new(Kind::PskSup, Status::Partial).because(REASON_KEY_TIME_OUT));
                self.link_down(REASON_DISASSOCIATED);
                None
            }
        }
    }

    /// A network with another kind of security does not exist for the station.
    fn found(&mut self, network: Option<&Network>, now: Cycle) -> Option<Joining> {
        let network = network.filter(|network| network.passphrase.is_some() == self.settings.is_secure);
        let Some(network) = network else {
            self.emit(Kind::SetSsid, Status::NoNetworks);
            return None;
        };
        Some(Joining::Associating {
            network: network.clone(),
            until: now + ASSOCIATION,
        })
    }

    fn associated(&mut self, network: Network, air: &Air, now: Cycle) -> Option<Joining> {
        if air.network(&network.ssid).is_none() {
            self.emit(Kind::SetSsid, Status::NoNetworks);
            return None;
        }
        self.emit(Kind::Auth, Status::Success);
        self.emit(Kind::Assoc, Status::Success);
        self.link_up();
        self.emit(Kind::Join, Status::Success);
        self.emit(Kind::SetSsid, Status::Success);
        match &network.passphrase {
            Some(passphrase) if *passphrase != self.settings.passphrase => {
                return Some(Joining::AgreeingOnKeys {
                    until: now + KEY_TIME_OUT,
                });
            }
            Some(_) => self.emit(Kind::PskSup, Status::Keyed),
            None => {}
        }
        self.joined = Some(network.ssid);
        None
    }

    fn emit(&mut self, kind: Kind, status: Status) {
        self.push(Event::new(kind, status));
    }

    fn link_up(&mut self) {
        self.push(Event::new(Kind::Link, Status::Success).with_flags(FLAG_LINK_UP));
    }

    fn link_down(&mut self, reason: u32) {
        self.push(Event::new(Kind::Link, Status::Success).because(reason));
    }
}
