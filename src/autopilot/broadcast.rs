//! The latest announcements, until every link has sent them.

use heapless::Deque;

use super::announcement::AnnouncementText;
use crate::mavlink::BroadcastCommand;
use crate::mavlink::dialect::MavSeverity;
use crate::pack::{MAX_PACKS, Pack};

/// Announcements kept for links that are busy: one of each pack in the same tick, and a few more.
const KEPT: usize = MAX_PACKS + 3;

/// An announcement that waits to be sent.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Announced {
    /// As a text.
    Text(MavSeverity, AnnouncementText),
    /// As a command.
    Command(BroadcastCommand),
    /// As the parameters that show what is learnt of a pack.
    Learnt(Pack),
}

/// The latest announcements, for links that have not sent them yet.
#[derive(Debug, Default)]
pub(super) struct Broadcast {
    latest: Deque<Announced, KEPT>,
    /// Number of the oldest kept; announcements are numbered from 0, modulo 2^32.
    oldest: u32,
}

/// What follows a position in the broadcast.
#[derive(Debug, PartialEq)]
pub(super) enum Next<'a> {
    /// An announcement.
    Announced(&'a Announced),
    /// So many that are not kept any more.
    Lost(u32),
}

/// How far a link has sent the broadcast: the number of its next announcement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Position(u32);

impl Broadcast {
    /// Nothing was announced yet.
    // Not inlined: it is built where it stays.
    #[inline(never)]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an announcement; the oldest one goes if there is no room.
    pub fn add(&mut self, announced: Announced) {
        if self.latest.is_full() {
            self.latest.pop_front();
            self.oldest = self.oldest.wrapping_add(1);
        }
        // There is room now.
        let _ = self.latest.push_back(announced);
    }

    /// The position behind the latest announcement.
    pub fn end(&self) -> Position {
        Position(self.oldest.wrapping_add(self.latest.len() as u32))
    }

    /// What follows `position`, which moves behind it.
    pub fn next(&self, position: &mut Position) -> Option<Next<'_>> {
        let ahead = position.0.wrapping_sub(self.oldest);
        if ahead > self.latest.len() as u32 {
            let lost = ahead.wrapping_neg();
            position.0 = self.oldest;
            return Some(Next::Lost(lost));
        }
        let announced = self.latest.iter().nth(ahead as usize)?;
        position.0 = position.0.wrapping_add(1);
        Some(Next::Announced(announced))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn announce(broadcast: &mut Broadcast, number: usize) {
        let text = AnnouncementText::try_from(number.to_string().as_str()).unwrap();
        broadcast.add(Announced::Text(MavSeverity::MAV_SEVERITY_INFO, text));
    }

    fn texts(broadcast: &Broadcast, position: &mut Position) -> Vec<String> {
        let mut texts = Vec::new();
        while let Some(next) = broadcast.next(position) {
            texts.push(match next {
                Next::Announced(Announced::Text(_, text)) => text.to_string(),
                Next::Announced(Announced::Command(command)) => command.number.to_string(),
                Next::Announced(Announced::Learnt(pack)) => pack.number().to_string(),
                Next::Lost(lost) => format!("{lost} lost"),
            });
        }
        texts
    }

    #[test]
    fn each_position_gets_every_announcement_once() {
        for oldest in [0, u32::MAX - 5] {
            let mut broadcast = Broadcast {
                oldest,
                ..Broadcast::default()
            };
            let mut from_start = broadcast.end();
            announce(&mut broadcast, 1);
            let mut later = broadcast.end();
            assert_eq!(texts(&broadcast, &mut from_start), ["1"]);
            assert_eq!(texts(&broadcast, &mut later), [""; 0]);
            for number in 2..=11 {
                announce(&mut broadcast, number);
            }
            let expected: Vec<_> = (2..=11).map(|number| number.to_string()).collect();
            assert_eq!(texts(&broadcast, &mut from_start), expected);
            assert_eq!(texts(&broadcast, &mut later), expected);
        }
    }

    #[test]
    fn lost_announcements_are_counted() {
        for oldest in [0, u32::MAX - 5] {
            let mut broadcast = Broadcast {
                oldest,
                ..Broadcast::default()
            };
            let mut position = broadcast.end();
            for number in 0..KEPT + 3 {
                announce(&mut broadcast, number);
            }
            let texts = texts(&broadcast, &mut position);
            assert_eq!(texts[..2], ["3 lost", "3"]);
            assert_eq!(texts.len(), 1 + KEPT);
        }
    }
}
