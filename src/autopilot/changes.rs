//! Parameters that have changed, until every open link has reported them.

use crate::mavlink::MAX_LINKS;
use crate::parameter::ParameterIdSet;

/// Changes not yet taken, for each open link with its number.
#[derive(Debug, Default)]
pub(super) struct Changes([Option<(u16, ParameterIdSet)>; MAX_LINKS]);

impl Changes {
    /// Keeps changes for the link `number` from now on, if there are not too many links.
    pub fn open(&mut self, number: u16) {
        if let Some(free) = self.0.iter_mut().find(|place| place.is_none()) {
            *free = Some((number, ParameterIdSet::default()));
        }
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
