//! Our end of a link, with its place in the announcements and its log.

use super::broadcast::Position;
use crate::log::LogLimit;
use crate::mavlink::{Endpoint, LinkKind, LinkStatistics, LogRead};
use crate::time::Instant;

/// Minimum interval between log lines about drops, and between those about refusals.
const LOG_INTERVAL_US: u64 = 1_000_000;

/// Our end of a MAVLink link, with a name for the log. [`Autopilot`](super::Autopilot) serves it.
#[derive(Debug)]
pub struct Channel {
    name: &'static str,
    pub(super) endpoint: Endpoint,
    /// How far it has sent the announcements.
    pub(super) position: Position,
    pub(super) drop_log: LogLimit<LOG_INTERVAL_US>,
    /// The command that was refused last.
    pub(super) refused_command: Option<u16>,
    pub(super) refusal_log: LogLimit<LOG_INTERVAL_US>,
}

impl Channel {
    /// A link of this kind that carries `bytes_per_second`; its first HEARTBEAT is due at `now`.
    pub fn new(name: &'static str, kind: LinkKind, bytes_per_second: u32, now: Instant) -> Self {
        Self {
            name,
            endpoint: Endpoint::new(kind, bytes_per_second, now),
            position: Position::default(),
            drop_log: LogLimit::new(),
            refused_command: None,
            refusal_log: LogLimit::new(),
        }
    }

    /// The link's name in the log.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The kind of the link.
    pub fn kind(&self) -> LinkKind {
        self.endpoint.kind()
    }

    /// The link's counters.
    pub fn statistics(&self) -> LinkStatistics {
        self.endpoint.statistics()
    }

    /// Whether all answers have been taken by the wire.
    pub fn is_idle(&self) -> bool {
        self.endpoint.is_idle()
    }

    /// When [`Autopilot::post_due`](super::Autopilot::post_due) has to be called next.
    pub fn next_due(&self) -> Instant {
        self.endpoint.next_due()
    }

    /// Takes as many of the received `bytes` as there is room for, and returns how many; at least one after
    /// [`Autopilot::handle_next`](super::Autopilot::handle_next) has returned `None`.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        self.endpoint.push(bytes)
    }

    /// This many frames were lost on their way to the wire.
    pub fn count_lost(&mut self, frames: u32) {
        self.endpoint.count_lost(frames);
    }

    /// Received bytes were lost before they could be pushed.
    pub fn count_overrun(&mut self) {
        self.endpoint.count_overrun();
    }

    /// The sender has paused for so long that it won't complete the frame it began.
    pub fn give_up_waiting(&mut self) {
        self.endpoint.give_up_waiting();
    }

    /// Takes the bytes that were read of the log: see [`Endpoint::supply`].
    pub fn supply(&mut self, read: LogRead, bytes: &[u8]) {
        self.endpoint.supply(read, bytes);
    }

    /// Sends a text on this link alone.
    pub fn say(&mut self, severity: crate::mavlink::dialect::MavSeverity, text: &str) {
        self.endpoint.say(severity, text);
    }
}
