//! A link as the autopilot serves it.

use super::broadcast::Position;
use super::changes::Listener;
use crate::log::LogLimit;
use crate::mavlink::{Endpoint, LinkKind};
use crate::time::Instant;

/// Minimum interval between log lines about drops, and between those about refusals.
const LOG_INTERVAL_US: u64 = 1_000_000;

/// A link as the [`Autopilot`](super::Autopilot) serves it: what MAVLink knows of it, which of the announcements it has sent, and its
/// name in the log.
#[derive(Debug)]
pub struct Channel {
    name: &'static str,
    /// What is received and sent.
    pub endpoint: Endpoint,
    /// How far it has sent the announcements.
    pub(super) position: Position,
    /// When latched failsafe levels were reported last; at the start, when it was opened.
    pub(super) levels_reported_at: Instant,
    /// Its place among those that report changed parameters; `None` while it is closed.
    pub(super) listener: Option<Listener>,
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
            levels_reported_at: now,
            listener: None,
            drop_log: LogLimit::new(),
            refused_command: None,
            refusal_log: LogLimit::new(),
        }
    }

    /// The link's name in the log.
    pub fn name(&self) -> &'static str {
        self.name
    }
}
