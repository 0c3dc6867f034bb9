//! What the controller lets through.

use heapless::Vec;

use crate::sensor::Acceptance;

/// Filters of the first and of the second receive buffer, each behind a mask.
const FIRST: usize = 2;
const SECOND: usize = 4;

/// Masks and filters of both receive buffers. A frame is let through if it has an extended identifier that is equal to that of a
/// filter in every bit of the filter's mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Filters {
    /// Mask of the first buffer, then of the second.
    pub(super) masks: [u32; 2],
    pub(super) first: [u32; FIRST],
    pub(super) second: [u32; SECOND],
}

impl Filters {
    /// Every extended identifier.
    pub const ALL: Self = Self {
        masks: [0; 2],
        first: [0; FIRST],
        second: [0; SECOND],
    };

    /// Lets through what is accepted. What does not fit into six filters behind two masks has everything let through: whoever
    /// receives it has to look anyway.
    pub fn new(accepted: &[Acceptance]) -> Self {
        let masks = accepted.iter().map(|acceptance| acceptance.mask);
        let mut fitting = masks.filter_map(|mask| Self::with_first_mask(accepted, mask));
        fitting.next().unwrap_or(Self::ALL)
    }

    /// With identifiers of this mask in the first buffer; `None` if the others do not fit into the second.
    fn with_first_mask(accepted: &[Acceptance], mask: u32) -> Option<Self> {
        let mut first = Vec::<u32, FIRST>::new();
        let mut second = Vec::<u32, SECOND>::new();
        let mut second_mask = None;
        for acceptance in accepted {
            if acceptance.mask == mask && first.push(acceptance.id).is_ok() {
                continue;
            }
            if *second_mask.get_or_insert(acceptance.mask) != acceptance.mask {
                return None;
            }
            second.push(acceptance.id).ok()?;
        }
        let spare = *first.first()?;
        Some(Self {
            masks: [mask, second_mask.unwrap_or(mask)],
            first: repeated(&first, spare),
            second: repeated(&second, spare),
        })
    }
}

/// `ids` and, in the filters that are left over, the last of them again; `spare` if there is none.
fn repeated<const N: usize>(ids: &[u32], spare: u32) -> [u32; N] {
    let last = ids.last().copied().unwrap_or(spare);
    core::array::from_fn(|place| ids.get(place).copied().unwrap_or(last))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MESSAGE: u32 = 0x00ff_ff80;
    const SERVICE: u32 = 0x7f80;

    fn accepted(id: u32, mask: u32) -> Acceptance {
        Acceptance { id, mask }
    }

    impl Filters {
        /// As the data sheet has it (DS20001801, 4.5).
        fn lets_through(&self, id: u32) -> bool {
            let matches = |filters: &[u32], mask: u32| filters.iter().any(|filter| (filter ^ id) & mask == 0);
            matches(&self.first, self.masks[0]) || matches(&self.second, self.masks[1])
        }
    }

    #[test]
    fn six_filters_fit_behind_two_masks() {
        let messages = [1092, 20004, 341, 1].map(|kind| accepted(kind << 8, MESSAGE));
        let services = [0x0a80, 0x0b80].map(|id| accepted(id, SERVICE));
        let filters = Filters::new(&[messages.as_slice(), &services].concat());
        assert_eq!(filters.masks, [SERVICE, MESSAGE]);
        assert_eq!(filters.first, [0x0a80, 0x0b80]);
        assert_eq!(filters.second, [1092 << 8, 20004 << 8, 341 << 8, 1 << 8]);
        assert!(filters.lets_through(0x1804_4408) && !filters.lets_through(0x1804_4508));
    }

    #[test]
    fn one_filter_is_in_both_buffers() {
        let filters = Filters::new(&[accepted(1092 << 8, MESSAGE)]);
        assert_eq!((filters.first, filters.second), ([1092 << 8; 2], [1092 << 8; 4]));
    }

    #[test]
    fn what_does_not_fit_lets_everything_through() {
        assert_eq!(Filters::new(&[accepted(0, MESSAGE); 7]), Filters::ALL);
        let three_masks = [1, 2, 4].map(|id| accepted(id, id));
        assert_eq!(Filters::new(&three_masks), Filters::ALL);
        assert_eq!(Filters::new(&[]), Filters::ALL);
    }

    proptest! {
        /// Whatever has to be let through is, and nothing else if it fits.
        #[test]
        fn nothing_that_is_accepted_is_kept_out(
            all in prop::collection::vec((0..8u32, prop::sample::select(vec![1u32, 7])), 0..8), id in 0..8u32,
        ) {
            let all: std::vec::Vec<_> = all.into_iter().map(|(id, mask)| accepted(id, mask)).collect();
            let filters = Filters::new(&all);
            let is_accepted = all.iter().any(|other| (other.id ^ id) & other.mask == 0);
            let expected = is_accepted || filters == Filters::ALL;
            prop_assert_eq!(filters.lets_through(id), expected);
        }
    }
}
