//! Wi-Fi: what the radio is to do, what it reports, and what of it has to be written to flash.

use heapless::String;

use super::stores::FlashStore;
use super::wifi_state::PRESENCE_US;
use super::{Autopilot, Work};
use crate::announce::Severity;
use crate::log::info;
use crate::mavlink::{Endpoint, LinkKind};
use crate::numbers::text;
use crate::time::Instant;
use crate::vehicle::ArmState;
use crate::wifi::{Password, Radio, Ssid, StoredWifi, WifiRecord, WifiReport, WifiSetup};

/// A label and the longest name or password.
const SHOWN_BYTES: usize = 80;

const _: () = assert!("Wi-Fi password: ".len() + Password::MAX_BYTES <= SHOWN_BYTES);
const _: () = assert!("Wi-Fi name: ".len() + Ssid::MAX_BYTES <= SHOWN_BYTES);

impl Autopilot {
    /// The radio's set-up; `None` on a board without one, or while the access point has no password. After
    /// [`Work::WIFI`] it may have changed; while armed it stays as it is.
    pub fn wifi_setup(&self) -> Option<WifiSetup> {
        self.wifi.setup()
    }

    /// Takes what flash holds of Wi-Fi. The radio waits for a password if there is none: [`Self::needs_entropy`].
    pub fn wifi_loaded(&mut self, stored: StoredWifi, now: Instant) {
        self.wifi.credentials.restore(stored);
        self.wifi_changed();
        if let Some(reason) = self.wifi.off {
            self.wifi_report(reason, now);
        }
    }

    /// Whether random numbers are needed for the password of a board with a radio.
    pub fn needs_entropy(&self) -> bool {
        let credentials = &self.wifi.credentials;
        credentials.radio() == Radio::Present && credentials.own_password().is_none()
    }

    /// Makes a password of random numbers; without them that is reported.
    pub fn entropy_collected(&mut self, entropy: Option<[u8; 32]>, now: Instant) {
        match entropy {
            Some(entropy) => {
                self.wifi
                    .credentials
                    .set_own_password(Password::from_entropy(&entropy));
                self.wifi_changed();
            }
            None => self.wifi_report(WifiReport::NoEntropy, now),
        }
    }

    /// Whether the rover is armed, or a ground station was heard by Wi-Fi lately.
    pub fn is_wifi_in_use(&self, now: Instant) -> bool {
        let heard_at = self.wifi.heard_at;
        self.vehicle.arm_state() == ArmState::Armed
            || heard_at.is_some_and(|heard_at| now.us_since(heard_at) < PRESENCE_US)
    }

    /// Takes a report of the radio's task, and announces it if it is news.
    pub fn wifi_report(&mut self, report: WifiReport, now: Instant) {
        info!("Wi-Fi: {:?}", report);
        if report == WifiReport::NoRadio {
            self.wifi.off = Some(report);
        }
        if self.wifi.is_news(report) {
            self.announce(&report, now);
        }
    }

    /// The name or password to write to flash next, unless a failed write waits for its retry.
    pub(super) fn next_unsaved_wifi(&self) -> Option<WifiRecord> {
        if self.waits_for_retry(FlashStore::Wifi) {
            return None;
        }
        self.wifi.credentials.next_unsaved()
    }

    /// Follows the parameters while disarmed: a radio that is set up again drops its stations, perhaps the driver.
    pub(super) fn follow_wifi_parameters(&mut self) {
        if self.vehicle.arm_state() == ArmState::Disarmed && self.wifi.follow(&self.parameters) {
            self.wifi_changed();
        }
    }

    /// A ground station has set up Wi-Fi, which it can't while armed.
    pub(super) fn wifi_set_up(&mut self) {
        self.wifi.follow(&self.parameters);
        self.wifi_changed();
    }

    /// Sends name and password of the access point on a link to a person who has the vehicle in hand, and a refusal on any
    /// other. Neither is logged.
    pub(super) fn show_wifi(&self, endpoint: &mut Endpoint) {
        let credentials = &self.wifi.credentials;
        match (endpoint.kind(), credentials.own_password()) {
            (LinkKind::Radio | LinkKind::Wifi, _) => {
                endpoint.say(Severity::Warning, "Wi-Fi password: by USB only");
            }
            (LinkKind::Direct, Some(password)) if credentials.radio() == Radio::Present => {
                let name = credentials.own_name().as_str();
                let password = password.as_str();
                for line in [
                    format_args!("Wi-Fi name: {name}"),
                    format_args!("Wi-Fi password: {password}"),
                ] {
                    let line: String<SHOWN_BYTES> = text(line);
                    endpoint.say(Severity::Info, &line);
                }
            }
            (LinkKind::Direct, _) => {
                endpoint.say(Severity::Warning, "No Wi-Fi radio on this board");
            }
        }
    }

    fn wifi_changed(&mut self) {
        self.wifi.forget_reports();
        self.retry_store(FlashStore::Wifi);
        self.work |= Work::WIFI | Work::SAVE;
    }
}
