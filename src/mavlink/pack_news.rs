//! Whether a link has been told what a smart battery tells of itself.

use crate::battery::{MAX_PACKS, PackDetails};
use crate::parameter::Pack;

/// What one link was told of each pack.
#[derive(Debug, Default)]
pub(super) struct PackNews {
    told: [PackDetails; MAX_PACKS],
}

impl PackNews {
    /// Whether `details` of `pack` differ from what was told last; then they count as told. A pack that tells
    /// nothing of itself is no news, nor is one that falls silent and says the same again.
    pub fn is_news(&mut self, pack: Pack, details: &PackDetails) -> bool {
        let told = &mut self.told[pack as usize];
        let is_news = !details.is_empty() && details != told;
        if is_news {
            *told = *details;
        }
        is_news
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
    fn it_is_news_once_each_time_it_differs() {
        let mut news = PackNews::default();
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
            assert_eq!(news.is_news(pack, &details), expected, "{pack:?}: {details:?}");
        }
    }
}
