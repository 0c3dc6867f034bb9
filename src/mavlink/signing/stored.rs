//! What of signing outlasts a restart, as words under keys.
//!
//! The secret has two places. A new one is written to the place that does not count, and then one word says that this is
//! the place that counts from now on: a power cut leaves either secret whole.

use super::key::KEY_WORDS;
use super::{Protection, Signing, SigningKey, Timestamp};
use crate::crc32::crc32;
use crate::storage::StorageError;

/// Where the words are. These numbers never change.
const FIRST_PLACE: u16 = 0x100;
const SECOND_PLACE: u16 = 0x110;
const CHOICE: u16 = 0x120;
const MARK: u16 = 0x121;

/// [`CHOICE`]: no key.
const NO_KEY: u32 = 0;
/// Otherwise, its lowest byte says which place counts, and the rest is from the checksum of what is there.
const PLACE: u32 = 0xFF;

/// A mark is set so far ahead, and moved when there is half of that left: so nothing is written more than twice a minute.
const MARK_AHEAD: u64 = 60 * Timestamp::PER_SECOND;

/// A time which everything signed so far was before, in 2^17 ticks (1.3 s), so that it fits a word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark(u32);

impl Mark {
    const TICKS: u64 = 1 << 17;

    /// The first one that is not before `time`.
    fn not_before(time: Timestamp) -> Self {
        // 48 bits less 17 fit, and so does one more.
        Self(time.ticks().div_ceil(Self::TICKS) as u32)
    }

    pub(super) fn time(self) -> Timestamp {
        Timestamp::default().later(u64::from(self.0).saturating_mul(Self::TICKS))
    }
}

/// The mark that has to replace `stored` when our time is `now`, if it has to be replaced.
pub(super) fn next_mark(stored: Mark, now: Timestamp) -> Option<Mark> {
    let is_near = now.later(MARK_AHEAD / 2) > stored.time();
    let next = Mark::not_before(now.later(MARK_AHEAD));
    (is_near && next != stored).then_some(next)
}

/// Something that has to be written to flash.
#[derive(Clone, Debug, PartialEq)]
pub enum ToStore {
    /// Another key.
    Key(SigningKey),
    /// That there is no key any more.
    NoKey,
    /// A later time.
    Mark(Mark),
}

/// Which of the two places counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    First,
    Second,
}

impl Place {
    fn number(self) -> u32 {
        match self {
            Self::First => 1,
            Self::Second => 2,
        }
    }

    fn start(self) -> u16 {
        match self {
            Self::First => FIRST_PLACE,
            Self::Second => SECOND_PLACE,
        }
    }

    fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// What the flash holds of signing.
#[derive(Debug, Default)]
pub struct StoredSigning {
    first: [Option<u32>; KEY_WORDS],
    second: [Option<u32>; KEY_WORDS],
    choice: Option<u32>,
    mark: Mark,
}

impl StoredSigning {
    /// Takes a word that was found in flash.
    pub fn found(&mut self, key: u16, word: u32) {
        match key {
            CHOICE => self.choice = Some(word),
            MARK => self.mark = Mark(word),
            _ => {
                let places = [(FIRST_PLACE, &mut self.first), (SECOND_PLACE, &mut self.second)];
                for (start, words) in places {
                    let index = key.checked_sub(start).map(usize::from);
                    if let Some(place) = index.and_then(|index| words.get_mut(index)) {
                        *place = Some(word);
                    }
                }
            }
        }
    }

    /// What signing starts with, if reading went like this.
    ///
    /// Without a word of ours there was no key, whatever else stood there and could not be read.
    pub fn restore(&self, read: Result<(), StorageError>) -> Signing {
        let protection = match (self.choice, self.key()) {
            (None, _) if read.is_err() && self.has_words() => Protection::KeyLost,
            (None | Some(NO_KEY), _) => Protection::Off,
            (Some(_), Some(key)) => Protection::Key(key),
            (Some(_), None) => Protection::KeyLost,
        };
        Signing::new(protection, self.mark)
    }

    /// The words that have to be written for `what`, in this order.
    pub fn words(&self, what: &ToStore) -> impl Iterator<Item = (u16, u32)> + use<> {
        let (secret, last) = match what {
            ToStore::Mark(mark) => (None, (MARK, mark.0)),
            ToStore::NoKey => (None, (CHOICE, NO_KEY)),
            ToStore::Key(key) => {
                let place = self.place().map_or(Place::First, Place::other);
                let words = key.to_words();
                (Some((place.start(), words)), (CHOICE, choice(place, words)))
            }
        };
        let secret = secret.into_iter().flat_map(|(start, words)| (start..).zip(words));
        secret.chain([last])
    }

    fn has_words(&self) -> bool {
        let mut secrets = self.first.iter().chain(&self.second);
        secrets.any(Option::is_some) || self.mark != Mark::default()
    }

    /// Which place counts.
    fn place(&self) -> Option<Place> {
        let number = self.choice? & PLACE;
        [Place::First, Place::Second]
            .into_iter()
            .find(|place| place.number() == number)
    }

    /// The key, if it is whole.
    fn key(&self) -> Option<SigningKey> {
        let place = self.place()?;
        let stored = match place {
            Place::First => &self.first,
            Place::Second => &self.second,
        };
        let mut words = [0; KEY_WORDS];
        for (word, stored) in words.iter_mut().zip(stored) {
            *word = (*stored)?;
        }
        (self.choice == Some(choice(place, words))).then(|| SigningKey::from_words(words))?
    }
}

/// The word that puts `place` in charge, with these words in it.
fn choice(place: Place, words: [u32; KEY_WORDS]) -> u32 {
    crc32(words) & !PLACE | place.number()
}

#[cfg(test)]
mod tests;
