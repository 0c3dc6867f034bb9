//! Which values the parameters may have: what was set last and has had its time to be saved, or what was set since.

use std::collections::BTreeMap;

use crate::bench::SAVED_US;

#[derive(Debug)]
struct Setting {
    value: f32,
    sent_us: u64,
    /// The board has said that it has it.
    reported_us: Option<u64>,
}

#[derive(Debug)]
struct Entry {
    saved: f32,
    /// Later ones last, no value twice.
    since: Vec<Setting>,
}

/// The parameters that are set, by name.
#[derive(Default)]
pub struct Ledger {
    entries: BTreeMap<String, Entry>,
    /// When the board started last.
    pub started_us: u64,
    /// When one was sent last.
    pub sent_us: u64,
}

impl Ledger {
    /// A parameter that has had this value for long.
    pub fn add(&mut self, name: &str, saved: f32) {
        let since = Vec::new();
        self.entries.insert(name.to_owned(), Entry { saved, since });
    }

    pub fn names(&self) -> impl Iterator<Item = &String> {
        self.entries.keys()
    }

    /// A value that the parameter has never had is sent.
    pub fn sent(&mut self, name: &str, value: f32, at_us: u64) {
        self.sent_us = at_us;
        let entry = self.entries.get_mut(name).expect("it is set");
        entry.since.push(Setting {
            value,
            sent_us: at_us,
            reported_us: None,
        });
    }

    /// The board restarts: what was not saved is gone.
    pub fn restart(&mut self, at_us: u64) {
        self.started_us = at_us;
        let settings = self.entries.values_mut().flat_map(|entry| &mut entry.since);
        settings.for_each(|setting| setting.reported_us = None);
    }

    /// The board reports a parameter's value. Panics if that value is impossible.
    pub fn reported(&mut self, name: &str, value: f32, at_us: u64) {
        let started_us = self.started_us;
        let Some(entry) = self.entries.get_mut(name) else {
            return;
        };
        entry.settle(at_us);
        let place = entry.since.iter().position(|setting| setting.value == value);
        assert!(
            place.is_some() || entry.saved == value,
            "{name} is {value}: {entry:?}"
        );
        if let Some(place) = place {
            entry.since[place].reported_us.get_or_insert(at_us);
        }
        // After a start it is what was saved, and nothing else that was set before is left.
        if place.is_none_or(|place| entry.since[place].sent_us < started_us) {
            let count = entry.since.len();
            entry.since.retain(|setting| setting.sent_us >= started_us);
            if entry.since.len() < count {
                entry.saved = value;
            }
        }
    }
}

impl Entry {
    /// What the board has said long ago is saved.
    fn settle(&mut self, now_us: u64) {
        let is_saved = |setting: &Setting| {
            setting
                .reported_us
                .is_some_and(|at_us| at_us + SAVED_US <= now_us)
        };
        if let Some(place) = self.since.iter().rposition(is_saved) {
            self.saved = self.since[place].value;
            self.since.drain(..=place);
        }
    }
}
