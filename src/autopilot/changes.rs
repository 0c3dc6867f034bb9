//! Parameters that have changed, until every open link has reported them.

use crate::mavlink::MAX_LINKS;
use crate::parameter::ParameterIdSet;

/// The place of an open link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Listener(usize);

/// Changes not yet taken, for each open link.
#[derive(Debug, Default)]
pub(super) struct Changes([Option<ParameterIdSet>; MAX_LINKS]);

impl Changes {
    /// A link opens: what changes from now on is kept for it. `None` if there are too many links.
    pub fn open(&mut self) -> Option<Listener> {
        let place = self.0.iter().position(Option::is_none)?;
        *self.0.get_mut(place)? = Some(ParameterIdSet::default());
        Some(Listener(place))
    }

    /// A link was closed.
    pub fn close(&mut self, listener: Option<Listener>) {
        if let Some(place) = listener.and_then(|Listener(place)| self.0.get_mut(place)) {
            *place = None;
        }
    }

    /// Keeps `changed` for every open link but that of `except`, whose station has made the change.
    pub fn add(&mut self, changed: &ParameterIdSet, except: Option<Listener>) {
        for (place, unsent) in self.0.iter_mut().enumerate() {
            if let Some(unsent) = unsent
                && except != Some(Listener(place))
            {
                unsent.insert_all(changed);
            }
        }
    }

    /// The parameters changed since the last call; `None` if there are none.
    pub fn take(&mut self, listener: Option<Listener>) -> Option<ParameterIdSet> {
        let Listener(place) = listener?;
        let unsent = self.0.get_mut(place)?.as_mut()?;
        (!unsent.is_empty()).then(|| core::mem::take(unsent))
    }
}
