//! Limits of announcements of the same kind.

use heapless::Vec;

use crate::announce::{Limit, RateLimit};
use crate::time::Instant;

/// Time in which one announcement of a kind becomes allowed again, in microseconds.
const INTERVAL_US: u64 = 10_000_000;

/// Limits that are counted at a time. Beyond that the one that has been limited least gives way: those that flood stay.
const KINDS: usize = 8;

/// Allows several announcements of a kind at once, as many as the kind says, and then one per [`INTERVAL_US`].
#[derive(Debug, Default)]
pub struct AnnouncementLimit {
    used: Vec<Used, KINDS>,
}

/// Announcements of a kind so far.
#[derive(Debug)]
struct Used {
    kind: Limit,
    rate: RateLimit<INTERVAL_US>,
    /// Announcements left out since the last one that was allowed (saturating).
    left_out: u16,
}

impl AnnouncementLimit {
    /// Whether one of this kind would be allowed now.
    pub fn allows_one(&self, kind: Limit, now: Instant) -> bool {
        let used = self.used.iter().find(|used| used.kind == kind);
        used.is_none_or(|used| used.rate.allows(kind.at_once, now))
    }

    /// Counts one of this kind, which is allowed after this many were left out.
    ///
    /// # Errors
    /// It is left out, as were this many before it.
    pub fn count(&mut self, kind: Limit, now: Instant) -> Result<u16, u16> {
        if self.used.iter().all(|used| used.kind != kind) {
            self.add(kind);
        }
        let Some(used) = self.used.iter_mut().find(|used| used.kind == kind) else {
            return Ok(0);
        };
        let before = used.left_out;
        if used.rate.take_of(kind.at_once, now) {
            used.left_out = 0;
            Ok(before)
        } else {
            used.left_out = before.saturating_add(1);
            Err(before)
        }
    }

    fn add(&mut self, kind: Limit) {
        let places = self.used.iter().enumerate();
        if self.used.is_full()
            && let Some((place, _)) = places.min_by_key(|(_, used)| used.rate.restored_at)
        {
            self.used.swap_remove(place);
        }
        // There is room now.
        let _ = self.used.push(Used {
            kind,
            rate: RateLimit::default(),
            left_out: 0,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::announce::Announce;
    use crate::battery::{PackEvent, PackNotice};
    use crate::pack::Pack;
    use crate::sensor::{CanNotice, CanReport, NodeId};
    use crate::time::at_us;
    use proptest::prelude::*;

    fn lost(node: u8) -> Limit {
        let node = NodeId::new(node).expect("an id");
        CanNotice::Lost(node).limit()
    }

    /// Number of these that are allowed, of one every `interval_us` in a minute.
    fn allowed_in_a_minute(
        limit: &mut AnnouncementLimit,
        interval_us: usize,
        kind: impl Fn(u64) -> Limit,
    ) -> usize {
        let times = (0..60_000_000).step_by(interval_us);
        let is_allowed = |us: &u64| limit.count(kind(*us), at_us(*us)).is_ok();
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
            let kind = PackNotice(pack, &PackEvent::Swapped).limit();
            assert_eq!(limit.count(kind, now), Ok(0));
        }
        assert!(!limit.allows_one(lost(2), now));
    }

    #[test]
    fn what_was_left_out_is_counted() {
        let mut limit = AnnouncementLimit::default();
        allowed_in_a_minute(&mut limit, 1_000_000, |_| lost(1));
        assert_eq!(limit.count(lost(1), at_us(59_500_000)), Err(9));
        assert_eq!(limit.count(lost(2), at_us(60_000_000)), Ok(10));
    }

    #[test]
    fn a_state_is_announced_every_ten_seconds_at_most() {
        let kind = |times| CanReport::BusOff(times).limit();
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
                let kind = PackNotice(Pack::ALL[usize::from(pack) - 1], &PackEvent::Swapped).limit();
                let expected = limit.allows_one(kind, now);
                let is_allowed = limit.count(kind, now).is_ok();
                prop_assert_eq!(is_allowed, expected);
                allowed[usize::from(pack)] += u64::from(is_allowed);
                prop_assert!(allowed[usize::from(pack)] <= 9 + now.as_micros() / INTERVAL_US);
            }
        }
    }
}
