//! Services for ground stations, one file each.

pub mod commands;
pub mod downloads;
pub mod file_transfer;
pub(super) mod log_download;
pub mod mission;
pub mod parameters;
pub(super) mod signing;
pub mod time;
pub mod vehicle;
pub mod wifi;

use crate::announce::RateLimit;
use crate::mavlink::outbox::Outbox;
use crate::mavlink::rates::Rates;
use crate::mavlink::sender_clocks::SenderClocks;
use crate::mavlink::signing::{
    AcceptUnsigned, Access, Authenticity, Effect, LinkKind, Signing, is_permitted,
};
use crate::mavlink::stations::Stations;
use crate::parameter::Parameters;
use crate::recorder::dataflash::CommandRecord;
use crate::system::SystemState;
use crate::time::Instant;
use crate::vehicle::{Presence, Vehicle};
use crate::wifi::WifiCredentials;

/// Minimum time between two texts on a link about sticks that come too late, in µs.
const LATE_STICKS_INTERVAL_US: u64 = 5_000_000;

/// Limits the texts on a link about sticks that come too late.
pub type LateSticksTexts = RateLimit<LATE_STICKS_INTERVAL_US>;

/// Why a restart, a reset of the parameters, a signing key or a download is refused.
pub const DISARM_FIRST: &str = "Not while armed: disarm first";

/// Why a request that could set the rover in motion, or change it for good, was refused.
pub const TOO_LATE: &str = "Command waited for too long: refused";

/// State that requests may change, apart from their link.
#[derive(Debug)]
pub struct Changeable<'a> {
    /// The live parameters.
    pub parameters: &'a mut Parameters,
    /// The vehicle.
    pub vehicle: &'a mut Vehicle,
    /// The signing key.
    pub signing: &'a mut Signing,
    /// Names and passwords of Wi-Fi networks.
    pub wifi: &'a mut WifiCredentials,
    /// A command that changes something for all stations, to be recorded.
    pub command: &'a mut Option<CommandRecord>,
}

/// State that a request may use and change.
pub struct Context<'a> {
    pub now: Instant,
    /// The frame can't have been received earlier.
    pub received_at: Instant,
    /// Upper bound of the request's age, by the clock of the page that sent it, in milliseconds; `None` if it is not known.
    pub age_ms: Option<u32>,
    /// Whether the frame was sent by a holder of the key.
    pub authenticity: Authenticity,
    /// Presence of a ground station by the request.
    pub presence: Presence,
    pub state: &'a SystemState<'a>,
    pub changeable: Changeable<'a>,
    pub rates: &'a mut Rates,
    pub stations: &'a mut Stations,
    /// Clocks of the senders on the link of the vehicle's own page.
    pub clocks: &'a mut SenderClocks,
    pub link: LinkKind,
    pub access: Access,
    /// Each link that is opened has another one.
    pub link_number: u16,
    /// Messages on this link that were not signed as they would have to be.
    pub unauthorized: &'a mut u32,
    /// Limits the texts about sticks that come too late.
    pub late_sticks_texts: &'a mut LateSticksTexts,
    /// Takes the answers.
    pub outbox: &'a mut Outbox,
}

impl Context<'_> {
    /// Whether the frame may have this effect by its link and its signature.
    pub fn permits(&self, effect: Effect) -> bool {
        let accepted = AcceptUnsigned::on(self.link, self.changeable.parameters);
        is_permitted(effect, self.authenticity, accepted)
    }
}
