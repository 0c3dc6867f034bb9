//! Wi-Fi without its radio: names and passwords, what is set up, what of it outlasts a restart, and what the radio reports.

mod credentials;
mod entropy;
mod network;
mod packet;
mod report;
mod setup;
mod state;
mod stored;

pub use credentials::{Radio, WifiCredentials};
pub use entropy::EntropyPool;
pub use network::{Network, Password, Ssid};
pub use packet::{PacketFault, PacketKind, check_packet, hide_refusal, lower_link};
pub use report::WifiReport;
pub use setup::{PowerSave, WifiChoice, WifiMode, WifiSetup};
pub use state::{RadioAction, RadioEvent, RadioState};
pub use stored::{StoredWifi, WIFI_WORDS, WifiRecord};

/// The task that drives the radio: its name where tasks check in, and in a crash record.
pub const RADIO_TASK: &str = "Wi-Fi";
