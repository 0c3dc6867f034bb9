//! When what a pack is has to be reported again.

use core::hash::Hash;

use hash32::{FnvHasher, Hasher};

use crate::announce::LastAnnounced;
use crate::battery::PackDetails;
use crate::pack::{MAX_PACKS, Pack, PackSet};

/// The details of each pack that were reported last on one link, by their hash: each link has one of these, and the details
/// themselves would take twenty times as much.
#[derive(Debug, Default)]
pub struct DetailsChangeDetector {
    reported: [LastAnnounced<Option<u32>>; MAX_PACKS],
    /// Packs of which a BATTERY_INFO was sent.
    described: PackSet,
    revisions: [u8; MAX_PACKS],
}

/// A change goes unnoticed with a probability of 2⁻³².
fn hash_of(details: &PackDetails) -> u32 {
    let mut hasher = FnvHasher::default();
    details.hash(&mut hasher);
    hasher.finish32()
}

impl DetailsChangeDetector {
    /// A BATTERY_INFO of `pack` is sent, which has this revision.
    pub fn describe(&mut self, pack: Pack, revision: u8) {
        if self.described.insert(pack) {
            self.revisions[pack as usize] = revision;
        }
    }

    /// Whether a BATTERY_INFO was sent of any pack. A link on which none was sent has nothing to correct.
    pub fn has_described(&self) -> bool {
        !self.described.is_empty()
    }

    /// Whether `pack` was swapped or its cells were detected since the last BATTERY_INFO; then that counts as described.
    pub fn is_outdated(&mut self, pack: Pack, revision: u8) -> bool {
        let described = &mut self.revisions[pack as usize];
        self.described.contains(pack) && core::mem::replace(described, revision) != revision
    }

    /// Whether `details` of `pack` differ from those that were reported last; then they count as reported. A pack without
    /// details has not changed, nor has one that is silent for a while and then repeats them.
    pub fn has_changed(&mut self, pack: Pack, details: &PackDetails) -> bool {
        let reported = &mut self.reported[pack as usize];
        !details.is_empty() && reported.has_changed(Some(hash_of(details)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(cycles: u16) -> PackDetails {
        PackDetails {
            cycle_count: Some(cycles),
            ..PackDetails::default()
        }
    }

    #[test]
    fn details_have_changed_once_each_time_they_differ() {
        let mut detector = DetailsChangeDetector::default();
        for (pack, details, expected) in [
            (Pack::First, PackDetails::default(), false),
            (Pack::First, after(7), true),
            (Pack::First, after(7), false),
            (Pack::Ninth, after(7), true),
            (Pack::First, PackDetails::default(), false),
            (Pack::First, after(7), false),
            (Pack::First, after(8), true),
            (Pack::First, after(7), true),
        ] {
            assert_eq!(
                detector.has_changed(pack, &details),
                expected,
                "{pack:?}: {details:?}"
            );
        }
    }
}
