//! Whether a link has been told what a smart battery tells of itself.

use crate::battery::{MAX_PACKS, PackDetails};

/// What one link was told of each pack.
#[derive(Debug, Default)]
pub(super) struct PackNews {
    told: [PackDetails; MAX_PACKS],
}

impl PackNews {
    /// Whether `details` of the pack `instance` differ from what was told last; then they count as told. A pack that tells
    /// nothing of itself is no news, nor is one that falls silent and says the same again.
    pub fn is_news(&mut self, instance: u8, details: &PackDetails) -> bool {
        let Some(told) = self.told.get_mut(usize::from(instance)) else {
            return false;
        };
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
        for (instance, details, expected) in [
            (0, PackDetails::default(), false),
            (0, after(7), true),
            (0, after(7), false),
            (8, after(7), true),
            (0, PackDetails::default(), false),
            (0, after(7), false),
            (0, after(8), true),
            (0, after(7), true),
            (9, after(7), false),
        ] {
            assert_eq!(
                news.is_news(instance, &details),
                expected,
                "{instance}: {details:?}"
            );
        }
    }
}
