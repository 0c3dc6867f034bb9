//! Limits of announcements of the same kind.

use heapless::Vec;

use super::announcement::Kind;
use crate::time::Instant;

/// Time in which one announcement of a kind becomes allowed again, in microseconds.
const INTERVAL_US: u64 = 10_000_000;

/// Kinds that are counted at a time. Beyond that the one that has been limited least gives way: those that flood stay.
const KINDS: usize = 8;

/// Allows several announcements of a kind at once, as many as the kind says, and then one per [`INTERVAL_US`].
#[derive(Debug, Default)]
pub(super) struct AnnouncementLimit {
    used: Vec<Used, KINDS>,
}

/// Announcements of a kind so far.
#[derive(Debug)]
struct Used {
    kind: Kind,
    /// From when on all of it is allowed again.
    restored_at: Instant,
    /// Announcements left out since the last one that was allowed (saturating).
    left_out: u16,
}

/// Whether an announcement may be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Permission {
    /// It may, after this many of its kind were left out.
    Allowed { left_out: u16 },
    /// It is left out, as were this many before it.
    LeftOut { before: u16 },
}

impl Used {
    fn allows_one(&self, now: Instant) -> bool {
        let several_us = u64::from(self.kind.at_once() - 1) * INTERVAL_US;
        self.restored_at.us_since(now) <= several_us
    }
}

impl AnnouncementLimit {
    /// Whether one of this kind would be allowed now.
    pub fn allows_one(&self, kind: Kind, now: Instant) -> bool {
        let used = self.used.iter().find(|used| used.kind == kind);
        used.is_none_or(|used| used.allows_one(now))
    }

    /// Counts one of this kind.
    pub fn count(&mut self, kind: Kind, now: Instant) -> Permission {
        let Some(used) = self.used.iter_mut().find(|used| used.kind == kind) else {
            self.add(Used {
                kind,
                restored_at: now.after_us(INTERVAL_US),
                left_out: 0,
            });
            return Permission::Allowed { left_out: 0 };
        };
        if used.allows_one(now) {
            used.restored_at = used.restored_at.max(now).after_us(INTERVAL_US);
            let left_out = core::mem::take(&mut used.left_out);
            Permission::Allowed { left_out }
        } else {
            let before = used.left_out;
            used.left_out = before.saturating_add(1);
            Permission::LeftOut { before }
        }
    }

    fn add(&mut self, used: Used) {
        let places = self.used.iter().enumerate();
        if self.used.is_full()
            && let Some((place, _)) = places.min_by_key(|(_, used)| used.restored_at)
        {
            self.used.swap_remove(place);
        }
        // There is room now.
        let _ = self.used.push(used);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::autopilot::Announcement;
    use crate::battery::PackEvent;
    use crate::pack::Pack;
    use crate::sensor::{CanNotice, CanReport, NodeId};
    use crate::time::at_us;
    use proptest::prelude::*;

    fn lost(node: u8) -> Kind {
        let node = NodeId::new(node).expect("an id");
        Announcement::CanNode(CanNotice::Lost(node)).kind()
    }

    /// Number of these that are allowed, of one every `interval_us` in a minute.
    fn allowed_in_a_minute(
        limit: &mut AnnouncementLimit,
        interval_us: usize,
        kind: impl Fn(u64) -> Kind,
    ) -> usize {
        let times = (0..60_000_000).step_by(interval_us);
        let is_allowed = |us: &u64| matches!(limit.count(kind(*us), at_us(*us)), Permission::Allowed { .. });
        times.filter(is_allowed).count()
    }

    #[test]
    fn wordings_of_a_kind_share_its_limit() {
        let kind = |us: u64| lost((us / 100_000 % 100) as u8 + 1);
        // Nine at once, and six in a minute.
        assert_eq!(
            allowed_in_a_minute(&mut AnnouncementLimit::default(), 100_000, kind),
            14
        );
    }

    #[test]
    fn packs_and_kinds_do_not_wait_for_each_other() {
        let mut limit = AnnouncementLimit::default();
        allowed_in_a_minute(&mut limit, 100_000, |_| lost(1));
        let now = at_us(59_900_000);
        for pack in Pack::ALL {
            let kind = Announcement::Pack(pack, &PackEvent::Swapped).kind();
            assert_eq!(limit.count(kind, now), Permission::Allowed { left_out: 0 });
        }
        assert!(!limit.allows_one(lost(2), now));
    }

    #[test]
    fn what_was_left_out_is_counted() {
        let mut limit = AnnouncementLimit::default();
        allowed_in_a_minute(&mut limit, 1_000_000, |_| lost(1));
        assert_eq!(
            limit.count(lost(1), at_us(59_500_000)),
            Permission::LeftOut { before: 9 }
        );
        assert_eq!(
            limit.count(lost(2), at_us(60_000_000)),
            Permission::Allowed { left_out: 10 }
        );
    }

    #[test]
    fn a_state_is_announced_every_ten_seconds_at_most() {
        let kind = |times| Announcement::Can(CanReport::BusOff(times)).kind();
        let count = allowed_in_a_minute(&mut AnnouncementLimit::default(), 100_000, |us| kind(us as u32));
        assert_eq!(count, 6);
    }

    proptest! {
        /// Whatever is announced when, no kind exceeds its share, even as others make it give way.
        #[test]
        fn no_kind_exceeds_its_share(steps in prop::collection::vec((1..=9u8, 0..5_000_000u64), 1..400)) {
            let (mut limit, mut now) = (AnnouncementLimit::default(), Instant::EPOCH);
            let mut allowed = [0u64; 10];
            for (pack, after_us) in steps {
                now = now.after_us(after_us);
                let kind = Announcement::Pack(Pack::ALL[usize::from(pack) - 1], &PackEvent::Swapped).kind();
                let expected = limit.allows_one(kind, now);
                let is_allowed = matches!(limit.count(kind, now), Permission::Allowed { .. });
                prop_assert_eq!(is_allowed, expected);
                allowed[usize::from(pack)] += u64::from(is_allowed);
                prop_assert!(allowed[usize::from(pack)] <= 9 + now.as_micros() / INTERVAL_US);
            }
        }
    }
}
