//! Our end of a link, with its place in the announcements and its log.

use super::broadcast::Position;
use crate::mavlink::{Endpoint, LinkKind, LinkStatistics};

/// Minimum interval between log lines about something that may happen many times a second.
const LOG_INTERVAL_US: u64 = 1_000_000;

/// Our end of a MAVLink link, with a name for the log. [`Autopilot`](super::Autopilot) serves it.
#[derive(Debug)]
pub struct Channel {
    name: &'static str,
    pub(super) endpoint: Endpoint,
    /// How far it has sent the announcements.
    pub(super) position: Position,
    pub(super) drop_log: LogLimit,
    pub(super) refusal_log: LogLimit,
}

/// Allows one log line per [`LOG_INTERVAL_US`].
#[derive(Debug, Default)]
pub(super) struct LogLimit {
    last_us: Option<u64>,
}

impl LogLimit {
    /// Whether a line may be logged at `now_us`; then it counts as logged.
    pub fn allows(&mut self, now_us: u64) -> bool {
        let is_due = self
            .last_us
            .is_none_or(|last_us| now_us.saturating_sub(last_us) >= LOG_INTERVAL_US);
        if is_due {
            self.last_us = Some(now_us);
        }
        is_due
    }
}

impl Channel {
    /// A link of this kind that carries `bytes_per_second`; its first HEARTBEAT is due at `now_us`.
    pub fn new(name: &'static str, kind: LinkKind, bytes_per_second: u32, now_us: u64) -> Self {
        Self {
            name,
            endpoint: Endpoint::new(kind, bytes_per_second, now_us),
            position: Position::default(),
            drop_log: LogLimit::default(),
            refusal_log: LogLimit::default(),
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

    /// When [`Autopilot::post_due`](super::Autopilot::post_due) has to be called next, in µs.
    pub fn next_due_us(&self) -> u64 {
        self.endpoint.next_due_us()
    }

    /// Takes as many of the received `bytes` as there is room for, and returns how many; at least one after
    /// [`Autopilot::handle_next`](super::Autopilot::handle_next) has returned `None`.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        self.endpoint.push(bytes)
    }

    /// Received bytes were lost before they could be pushed.
    pub fn count_overrun(&mut self) {
        self.endpoint.count_overrun();
    }

    /// The sender has paused for so long that it won't complete the frame it began.
    pub fn give_up_waiting(&mut self) {
        self.endpoint.give_up_waiting();
    }

    /// Sends a text on this link alone.
    pub fn say(&mut self, severity: crate::mavlink::dialect::MavSeverity, text: &str) {
        self.endpoint.say(severity, text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_line_is_logged_per_second() {
        let mut limit = LogLimit::default();
        assert!(limit.allows(0));
        assert!(!limit.allows(999_999));
        assert!(limit.allows(1_000_000));
        assert!(!limit.allows(1_000_000));
    }
}
