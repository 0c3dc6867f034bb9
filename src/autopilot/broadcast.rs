//! The latest announcements, and parameters that have changed, until every link has sent them.

use heapless::Deque;

use crate::announce::{Announce, AnnouncementText, Severity, announced_text};
use crate::battery::{PackEvent, PackNotice};
use crate::mavlink::{BroadcastCommand, BroadcastPosition, MAX_LINKS};
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::ParameterIdSet;
use crate::vehicle::VehicleEvent;

/// Announcements kept for links that are busy: one of each pack in the same tick, and a few more.
const KEPT: usize = MAX_PACKS + 3;

/// An announcement that waits to be sent.
#[derive(Clone, Debug, PartialEq)]
pub enum Announced {
    /// As a text.
    Text(Severity, AnnouncementText),
    /// As a command.
    Command(BroadcastCommand),
}

/// The latest announcements, for links that have not sent them yet.
///
/// The latest failsafe level of each pack and the latest change of the mode have a place each, which nothing else can
/// take, and leave first. All others share a queue.
#[derive(Debug, Default)]
pub struct Broadcast {
    levels: [Slot<PackEvent>; MAX_PACKS],
    mode: Slot<VehicleEvent>,
    latest: Deque<Announced, KEPT>,
    /// Number of the oldest kept; announcements in the queue are numbered from 0, modulo 2^32.
    oldest: u32,
}

/// A place of its own.
#[derive(Debug)]
struct Slot<T> {
    latest: Option<T>,
    /// Their number so far, modulo 2^32.
    count: u32,
}

impl<T> Default for Slot<T> {
    fn default() -> Self {
        Self {
            latest: None,
            count: 0,
        }
    }
}

impl<T> Slot<T> {
    fn set(&mut self, latest: T) {
        self.latest = Some(latest);
        self.count = self.count.wrapping_add(1);
    }

    /// The latest one, unless it was sent already; now it was.
    fn unsent(&self, sent: &mut u32) -> Option<&T> {
        if core::mem::replace(sent, self.count) == self.count {
            return None;
        }
        self.latest.as_ref()
    }
}

/// The next item after a position in the broadcast.
#[derive(Debug, PartialEq)]
pub enum Next<'a> {
    /// An announcement.
    Announced(&'a Announced),
    /// The number of those that are not kept any more.
    Lost(u32),
}

impl Broadcast {
    /// Nothing was announced yet.
    // Not inlined: it is built where it stays.
    #[inline(never)]
    pub fn new() -> Self {
        Self::default()
    }

    /// A pack has reached a failsafe level.
    pub fn set_level(&mut self, pack: Pack, event: PackEvent) {
        self.levels[pack as usize].set(event);
    }

    /// A failsafe has changed the mode, or disarmed.
    pub fn set_mode(&mut self, event: VehicleEvent) {
        self.mode.set(event);
    }

    /// Adds an announcement to the queue; the oldest one goes if there is no room.
    pub fn add(&mut self, announced: Announced) {
        if self.latest.is_full() {
            self.latest.pop_front();
            self.oldest = self.oldest.wrapping_add(1);
        }
        // There is room now.
        let _ = self.latest.push_back(announced);
    }

    /// The position behind the latest announcement.
    pub fn end(&self) -> BroadcastPosition {
        BroadcastPosition {
            levels: core::array::from_fn(|pack| self.levels.get(pack).map_or(0, |level| level.count)),
            mode: self.mode.count,
            next: self.oldest.wrapping_add(self.latest.len() as u32),
        }
    }

    /// Severity and text of the next urgent announcement that was not sent yet; `position` moves behind it.
    pub fn next_urgent(&self, position: &mut BroadcastPosition) -> Option<(Severity, AnnouncementText)> {
        let said = |event: &dyn Announce| (event.severity(), announced_text(event));
        for ((pack, level), sent) in Pack::ALL.into_iter().zip(&self.levels).zip(&mut position.levels) {
            if let Some(event) = level.unsent(sent) {
                return Some(said(&PackNotice(pack, event)));
            }
        }
        let event = self.mode.unsent(&mut position.mode)?;
        Some(said(event))
    }

    /// The item after `position` in the queue, which moves behind it.
    pub fn next(&self, position: &mut BroadcastPosition) -> Option<Next<'_>> {
        let ahead = position.next.wrapping_sub(self.oldest);
        if ahead > self.latest.len() as u32 {
            let lost = ahead.wrapping_neg();
            position.next = self.oldest;
            return Some(Next::Lost(lost));
        }
        let announced = self.latest.iter().nth(ahead as usize)?;
        position.next = position.next.wrapping_add(1);
        Some(Next::Announced(announced))
    }
}

/// Changed parameters not yet taken, for each open link with its number.
#[derive(Debug, Default)]
pub struct Changes([Option<(u16, ParameterIdSet)>; MAX_LINKS]);

impl Changes {
    /// Keeps changes for the link `number` from now on, if there are not too many links.
    pub fn open(&mut self, number: u16) {
        if let Some(free) = self.0.iter_mut().find(|place| place.is_none()) {
            *free = Some((number, ParameterIdSet::default()));
        }
    }

    /// Whether changes are kept for the link `number`.
    pub fn is_open(&self, number: u16) -> bool {
        self.0.iter().flatten().any(|(open, _)| *open == number)
    }

    /// Keeps no changes for the link `number` any more.
    pub fn close(&mut self, number: u16) {
        for place in &mut self.0 {
            if matches!(place, Some((open, _)) if *open == number) {
                *place = None;
            }
        }
    }

    /// Keeps `changed` for every open link but `except`, whose station has made the change.
    pub fn add(&mut self, changed: &ParameterIdSet, except: Option<u16>) {
        for (number, unsent) in self.0.iter_mut().flatten() {
            if Some(*number) != except {
                unsent.insert_all(changed);
            }
        }
    }

    /// The parameters changed since the last call; `None` if there are none.
    pub fn take(&mut self, number: u16) -> Option<ParameterIdSet> {
        let mut open = self.0.iter_mut().flatten();
        let (_, unsent) = open.find(|(open, _)| *open == number)?;
        (!unsent.is_empty()).then(|| core::mem::take(unsent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn announce(broadcast: &mut Broadcast, number: usize) {
        let text = AnnouncementText::try_from(number.to_string().as_str()).unwrap();
        broadcast.add(Announced::Text(Severity::Info, text));
    }

    fn texts(broadcast: &Broadcast, position: &mut BroadcastPosition) -> Vec<String> {
        let mut texts = Vec::new();
        while let Some(next) = broadcast.next(position) {
            texts.push(match next {
                Next::Announced(Announced::Text(_, text)) => text.to_string(),
                Next::Announced(Announced::Command(command)) => command.number.to_string(),
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
    fn each_place_keeps_its_latest_whatever_is_in_the_queue() {
        use crate::battery::{Amount, FailsafeLevel};
        let level = |level| PackEvent::Failsafe {
            level,
            voltage_v: Some(10.0),
            consumed: Some(Amount::Mah(0.0)),
        };
        let mut broadcast = Broadcast::new();
        let mut position = broadcast.end();
        broadcast.set_level(Pack::Ninth, level(FailsafeLevel::Low));
        broadcast.set_level(Pack::First, level(FailsafeLevel::Low));
        broadcast.set_mode(VehicleEvent::ControlsTimedOut);
        broadcast.set_level(Pack::Ninth, level(FailsafeLevel::Critical));
        for number in 0..100 {
            announce(&mut broadcast, number);
        }
        let mut opened_later = broadcast.end();
        let urgent = |position: &mut BroadcastPosition| {
            let next = std::iter::from_fn(|| Some(broadcast.next_urgent(position)?.1.to_string()));
            next.collect::<Vec<_>>()
        };
        assert_eq!(
            urgent(&mut position),
            [
                "Battery 1 is low 10.00V used 0 mAh",
                "Battery 9 is critical 10.00V used 0 mAh",
                "Radio Failsafe: Hold"
            ]
        );
        assert_eq!(urgent(&mut position), [""; 0], "sent once");
        assert_eq!(urgent(&mut opened_later), [""; 0]);
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
