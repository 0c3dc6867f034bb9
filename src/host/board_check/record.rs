//! What was heard of the board, each with its time.

use std::collections::BTreeSet;

use crate::mavlink::dialect::{MavMessage, MavSeverity, STATUSTEXT_DATA};
use crate::time::Instant;

/// A restart is noticed this long after the board fell silent, at the latest: boot, and the next answer.
const RESTART_NOTICED_US: u64 = 6_000_000;

/// A message of the board.
#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    /// When it was received.
    pub at: Instant,
    /// Its content.
    pub message: MavMessage,
}

/// A break between two frames of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// When the frame behind it was received.
    pub at: Instant,
    /// Frames that are missing by the sequence numbers, at most 255.
    pub missing: u8,
    /// Whether bytes came in it that are not part of a frame.
    pub is_damage: bool,
}

/// An answered or unanswered request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RoundTrip {
    /// When it was asked.
    pub asked_at: Instant,
    /// How long the answer took, in µs; `None` if none came until the next request.
    pub took_us: Option<u64>,
}

/// Why the board restarted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartCause {
    /// It was asked to restart.
    Requested,
    /// It was not.
    Unrequested,
}

/// A start of the board, noticed by its time since boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardStart {
    /// When it was noticed.
    pub at: Instant,
    /// Why.
    pub cause: StartCause,
}

/// A text of the board.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    /// When it was complete.
    pub at: Instant,
    /// How urgent it is.
    pub severity: MavSeverity,
    /// The text.
    pub text: String,
}

/// What was heard of the board.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Its messages.
    pub received: Vec<Received>,
    /// System and component ids of other autopilots on the link.
    pub others: BTreeSet<(u8, u8)>,
    /// Breaks in its frames.
    pub gaps: Vec<Gap>,
    /// How fast it answers.
    pub round_trips: Vec<RoundTrip>,
    /// Its starts.
    pub starts: Vec<BoardStart>,
    /// When the port was lost without a restart that was asked for.
    pub port_losses: Vec<Instant>,
}

impl Record {
    /// Its texts; those sent in parts are put together.
    pub fn texts(&self) -> Vec<Text> {
        let mut texts: Vec<Text> = Vec::new();
        let mut open_id = 0;
        for received in &self.received {
            let MavMessage::STATUSTEXT(part) = &received.message else {
                continue;
            };
            match texts.last_mut() {
                Some(text) if part.chunk_seq > 0 && part.id == open_id => text.text += part_text(part),
                _ => texts.push(Text {
                    at: received.at,
                    severity: part.severity,
                    text: part_text(part).into(),
                }),
            }
            open_id = part.id;
        }
        texts
    }

    /// The breaks that no start of the board explains.
    pub fn unexplained_gaps(&self) -> impl Iterator<Item = &Gap> {
        self.gaps.iter().filter(|gap| !self.is_broken_by_start(gap.at))
    }

    /// Whether the board may have started just before `at`.
    pub fn is_broken_by_start(&self, at: Instant) -> bool {
        let mut starts = self.starts.iter();
        starts.any(|start| at <= start.at && start.at.us_since(at) < RESTART_NOTICED_US)
    }
}

fn part_text(part: &STATUSTEXT_DATA) -> &str {
    part.text.to_str().unwrap_or_default()
}
