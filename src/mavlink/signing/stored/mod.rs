//! Signing data that outlast a restart, as words under keys.
//!
//! The secret has two places. A new one is written to the place that does not count, and then the choice says that this
//! is the place that counts from now on: a power cut leaves either secret whole.
//!
//! The choice and the mark are stored under two keys each, one record after the other. Of two choices the later one
//! counts, of two marks the higher one: so one damaged record never brings back an older choice or an older time.
//!
//! Damage is judged in favour of locking. Flash that was never written holds no key. Anything else means that there was one,
//! unless it says whole and undamaged that there is none.

use heapless::Vec;

use super::key::KEY_WORDS;
use super::time::Mark;
use super::{InFlash, Protection, Signing, SigningKey, ToStore};
use crate::memory::checksum::crc32;
use crate::memory::storage::Condition;

/// Keys of the words. These numbers never change.
const FIRST_PLACE: u16 = 0x100;
const SECOND_PLACE: u16 = 0x110;
const CHOICES: [u16; 2] = [0x120, 0x122];
const MARKS: [u16; 2] = [0x121, 0x123];

/// A choice: no key.
const NO_KEY: u32 = 0;
/// Otherwise, its lowest byte says which place counts, and the rest is from the checksum of what is there.
const PLACE: u32 = 0xFF;

/// Words with the keys they are stored under: those of a secret, and a choice or a mark twice.
pub type Words = Vec<(u16, u32), { KEY_WORDS + 2 }>;

/// Which of the two places counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum KeySlot {
    First,
    Second,
}

impl KeySlot {
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

/// Signing data in flash.
#[derive(Debug, Default)]
pub struct StoredSigning {
    first: [Option<u32>; KEY_WORDS],
    second: [Option<u32>; KEY_WORDS],
    /// The later one of the choices.
    choice: Option<u32>,
    /// Under their two keys.
    choices: [Option<u32>; 2],
    /// The latest ones under their two keys.
    marks: [Mark; 2],
}

impl StoredSigning {
    /// Takes a word that was found in flash. They have to come in the order in which they were stored.
    pub fn found(&mut self, key: u16, word: u32) {
        for (mark_key, mark) in MARKS.into_iter().zip(&mut self.marks) {
            if key == mark_key {
                *mark = Mark(word);
            }
        }
        for (choice_key, choice) in CHOICES.into_iter().zip(&mut self.choices) {
            if key == choice_key {
                *choice = Some(word);
                self.choice = Some(word);
            }
        }
        let places = [(FIRST_PLACE, &mut self.first), (SECOND_PLACE, &mut self.second)];
        for (start, words) in places {
            let index = key.checked_sub(start).map(usize::from);
            if let Some(place) = index.and_then(|index| words.get_mut(index)) {
                *place = Some(word);
            }
        }
    }

    /// The state that signing starts with, if flash is in this condition.
    pub fn restore(&self, condition: Condition) -> Signing {
        let protection = match condition {
            Condition::Blank => Protection::Off,
            Condition::Intact if self.choice == Some(NO_KEY) => Protection::Off,
            // A later set-up is there at least once, and would count.
            Condition::Intact | Condition::OneRecordDamaged => {
                self.key().map_or(Protection::KeyLost, Protection::Key)
            }
            Condition::Damaged => Protection::KeyLost,
        };
        let is_choice_twice = self.choices == [self.choice; 2];
        let in_flash = match protection {
            Protection::KeyLost => InFlash::Unreadable,
            _ if is_choice_twice => InFlash::Current,
            Protection::Off => InFlash::NoKey,
            Protection::Key(_) => InFlash::OtherKey,
        };
        Signing::new(protection, in_flash, self.mark())
    }

    fn mark(&self) -> Mark {
        let [first, second] = self.marks;
        first.max(second)
    }

    /// The words that have to be written for `what`, in this order.
    pub fn words(&self, what: &ToStore) -> Words {
        let mut words = Words::new();
        let (keys, last) = match what {
            ToStore::Nothing => return words,
            ToStore::Mark(mark) => (MARKS, mark.0),
            ToStore::NoKey => (CHOICES, NO_KEY),
            ToStore::Key(key) => {
                let (place, secret) = (self.place_for(key), key.to_words());
                for word in (place.start()..).zip(secret) {
                    // They fit.
                    let _ = words.push(word);
                }
                (CHOICES, choice(place, secret))
            }
        };
        let _ = words.extend_from_slice(&keys.map(|key| (key, last)));
        words
    }

    /// Which place counts.
    fn place(&self) -> Option<KeySlot> {
        let number = self.choice? & PLACE;
        [KeySlot::First, KeySlot::Second]
            .into_iter()
            .find(|place| place.number() == number)
    }

    /// The place to write `key`: not over another one that counts.
    fn place_for(&self, key: &SigningKey) -> KeySlot {
        match self.place() {
            Some(place) if self.key().as_ref() == Some(key) => place,
            place => place.map_or(KeySlot::First, KeySlot::other),
        }
    }

    /// The key, if it is whole.
    fn key(&self) -> Option<SigningKey> {
        let place = self.place()?;
        let stored = match place {
            KeySlot::First => &self.first,
            KeySlot::Second => &self.second,
        };
        let mut words = [0; KEY_WORDS];
        for (word, stored) in words.iter_mut().zip(stored) {
            *word = (*stored)?;
        }
        (self.choice == Some(choice(place, words))).then(|| SigningKey::from_words(words))?
    }
}

/// The word that puts `place` in charge, with these words in it.
fn choice(place: KeySlot, words: [u32; KEY_WORDS]) -> u32 {
    crc32(words) & !PLACE | place.number()
}

#[cfg(test)]
mod tests;
