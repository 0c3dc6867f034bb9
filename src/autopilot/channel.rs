//! Our end of a link, with its place in the announcements and its log.

use super::broadcast::Position;
use crate::mavlink::{Endpoint, LinkKind, LinkStatistics, LogRead};
use crate::time::Instant;

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
    last: Option<Instant>,
}

impl LogLimit {
    /// Whether a line may be logged at `now`; then it counts as logged.
    pub fn allows(&mut self, now: Instant) -> bool {
        let is_due = self.last.is_none_or(|last| now.us_since(last) >= LOG_INTERVAL_US);
        if is_due {
            self.last = Some(now);
        }
        is_due
    }
}

impl Channel {
    /// A link of this kind that carries `bytes_per_second`; its first HEARTBEAT is due at `now`.
    pub fn new(name: &'static str, kind: LinkKind, bytes_per_second: u32, now: Instant) -> Self {
        Self {
            name,
            endpoint: Endpoint::new(kind, bytes_per_second, now),
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

    /// When [`Autopilot::post_due`](super::Autopilot::post_due) has to be called next.
    pub fn next_due(&self) -> Instant {
        self.endpoint.next_due()
    }

    /// Takes as many of the received `bytes` as there is room for, and returns how many; at least one after
    /// [`Autopilot::handle_next`](super::Autopilot::handle_next) has returned `None`.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        self.endpoint.push(bytes)
    }

    /// So many frames were lost on their way to the wire.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    #[test]
    fn one_line_is_logged_per_second() {
        let mut limit = LogLimit::default();
        assert!(limit.allows(Instant::EPOCH));
        assert!(!limit.allows(at_us(999_999)));
        assert!(limit.allows(at_us(1_000_000)));
        assert!(!limit.allows(at_us(1_000_000)));
    }
}
