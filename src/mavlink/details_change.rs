//! When what a pack is has to be reported again.

use core::hash::Hash;

use crate::battery::PackDetails;
use crate::fnv::Fnv;
use crate::pack::{MAX_PACKS, Pack};

/// The details of each pack that were reported last on one link, by their hash: each link has one of these, and the details
/// themselves would take twenty times as much.
#[derive(Debug, Default)]
pub(super) struct DetailsChangeDetector {
    reported: [Option<u32>; MAX_PACKS],
    revisions: [u8; MAX_PACKS],
}

/// One change of four thousand million is not noticed by it.
fn hash_of(details: &PackDetails) -> u32 {
    let mut hasher = Fnv::new();
    details.hash(&mut hasher);
    hasher.hash()
}

impl DetailsChangeDetector {
    /// Whether `pack` was swapped or its cells were detected since the last call.
    pub fn is_revised(&mut self, pack: Pack, revision: u8) -> bool {
        let reported = &mut self.revisions[pack as usize];
        core::mem::replace(reported, revision) != revision
    }

    /// Whether `details` of `pack` differ from those that were reported last; then they count as reported. A pack without
    /// details has not changed, nor has one that is silent for a while and then repeats them.
    pub fn has_changed(&mut self, pack: Pack, details: &PackDetails) -> bool {
        let reported = &mut self.reported[pack as usize];
        if details.is_empty() {
            return false;
        }
        let hash = Some(hash_of(details));
        let has_changed = *reported != hash;
        *reported = hash;
        has_changed
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
