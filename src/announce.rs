//! Texts for ground stations: their severity, and the limits that keep them from repeating.

use core::any::TypeId;
use core::fmt;
use core::hash::Hash;
use core::mem::{discriminant, replace};

use hash32::{FnvHasher, Hasher};
use heapless::String;

use crate::numbers::text;
use crate::pack::{MAX_PACKS, Pack};
use crate::time::Instant;

/// Maximum length of an announcement, in bytes: two STATUSTEXT. The rest is cut off.
pub const ANNOUNCEMENT_BYTES: usize = 96;

/// The text of an announcement.
pub type AnnouncementText = String<ANNOUNCEMENT_BYTES>;

/// Severity of a text for ground stations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Nothing is wrong, or it can wait.
    Info,
    /// Worth attention, and nothing is wrong.
    Notice,
    /// Something is wrong.
    Warning,
    /// A request can't be met.
    Error,
    /// Ground stations show it in a box.
    Critical,
}

impl Severity {
    /// Of an event that may be a fault.
    pub(crate) fn of_fault(is_fault: bool) -> Self {
        if is_fault { Self::Warning } else { Self::Info }
    }
}

/// An event that ground stations are informed of: its text is how it is displayed.
pub trait Announce: fmt::Display {
    /// Its severity.
    fn severity(&self) -> Severity;

    /// The limit that it shares with others.
    fn limit(&self) -> Limit {
        Limit::BOARD
    }

    /// The text, cut off if it is too long.
    fn text(&self) -> AnnouncementText
    where
        Self: Sized,
    {
        announced_text(self)
    }
}

/// The text, cut off if it is too long.
// Inlined, it would be repeated for each kind of event.
#[inline(never)]
pub(crate) fn announced_text(event: &dyn Announce) -> AnnouncementText {
    text(format_args!("{event}"))
}

/// A limit, shared by the events of one kind, whose wording may differ by a node, a count or an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    /// Hash of the kind. Two kinds have the same with a probability of one in a million, and would share a limit.
    kind: u32,
    pack: Option<Pack>,
    /// Most events at once, at least 1.
    pub(crate) at_once: u8,
}

impl Limit {
    /// Of reports of the board itself.
    pub(crate) const BOARD: Self = Self {
        kind: 0,
        pack: None,
        at_once: MAX_PACKS as u8,
    };

    /// Of the events that are the same variant: one of each pack, or of as many nodes, may come at once.
    pub(crate) fn of<T: 'static>(event: &T) -> Self {
        let mut hasher = FnvHasher::default();
        TypeId::of::<T>().hash(&mut hasher);
        discriminant(event).hash(&mut hasher);
        Self {
            kind: hasher.finish32(),
            ..Self::BOARD
        }
    }

    /// Limits the events of each pack by itself.
    pub(crate) fn of_pack(self, pack: Option<Pack>) -> Self {
        Self { pack, ..self }
    }

    /// Limits a state that comes and goes: its latest text replaces all before.
    pub(crate) fn one_at_once(self) -> Self {
        Self { at_once: 1, ..self }
    }
}

/// Allows some events at once, and then one per `INTERVAL_US`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RateLimit<const INTERVAL_US: u64> {
    /// From when on as many are allowed as at the start.
    pub restored_at: Instant,
}

impl<const INTERVAL_US: u64> RateLimit<INTERVAL_US> {
    /// Whether an event is allowed at `now`, of `at_once` at the start.
    pub fn allows(&self, at_once: u8, now: Instant) -> bool {
        self.restored_at.us_since(now) <= u64::from(at_once.saturating_sub(1)) * INTERVAL_US
    }

    /// Whether an event is allowed at `now`, of `at_once` at the start. One that is allowed counts.
    pub fn take_of(&mut self, at_once: u8, now: Instant) -> bool {
        let is_allowed = self.allows(at_once, now);
        if is_allowed {
            self.restored_at = self.restored_at.max(now).after_us(INTERVAL_US);
        }
        is_allowed
    }

    /// Whether the only event of an interval is allowed at `now`; then it counts.
    pub fn take(&mut self, now: Instant) -> bool {
        self.take_of(1, now)
    }
}

/// A value that is announced when it has changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LastAnnounced<T>(T);

impl<T: PartialEq> LastAnnounced<T> {
    /// Known from the start.
    pub const fn new(value: T) -> Self {
        Self(value)
    }

    /// Whether `value` differs from the one before; then it counts as announced.
    pub fn has_changed(&mut self, value: T) -> bool
    where
        T: Copy,
    {
        replace(&mut self.0, value) != value
    }

    /// Whether `value` was announced.
    pub fn is(&self, value: &T) -> bool {
        self.0 == *value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    #[test]
    fn one_event_is_allowed_per_interval() {
        let mut limit = RateLimit::<1_000_000>::default();
        assert!(limit.take(Instant::EPOCH));
        assert!(!limit.take(at_us(999_999)));
        assert!(limit.take(at_us(1_000_000)));
        assert!(!limit.take(at_us(1_000_000)));
    }

    #[test]
    fn several_events_at_once_are_restored_one_by_one() {
        let mut limit = RateLimit::<1_000_000>::default();
        let mut allowed = |us| (0..10).filter(|_| limit.take_of(3, at_us(us))).count();
        assert_eq!([allowed(0), allowed(999_999), allowed(1_000_000)], [3, 0, 1]);
        assert_eq!(allowed(3_000_000), 2);
        assert_eq!(allowed(10_000_000), 3);
    }
}
