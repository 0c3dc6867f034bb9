//! When a smart battery's details have to be reported again.

use crate::battery::PackDetails;
use crate::pack::{MAX_PACKS, Pack};

/// The details of each pack that were reported last on one link.
#[derive(Debug, Default)]
pub(super) struct DetailsChangeDetector {
    reported: [PackDetails; MAX_PACKS],
}

impl DetailsChangeDetector {
    /// Whether `details` of `pack` differ from those that were reported last; then they count as reported. A pack without
    /// details has not changed, nor has one that is silent for a while and then repeats them.
    pub fn has_changed(&mut self, pack: Pack, details: &PackDetails) -> bool {
        let reported = &mut self.reported[pack as usize];
        let has_changed = !details.is_empty() && details != reported;
        if has_changed {
            *reported = *details;
        }
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
