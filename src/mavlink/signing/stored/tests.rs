use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;

fn key(byte: u8) -> SigningKey {
    SigningKey::new([byte; 32]).expect("not all zeros")
}

/// A flash of words, which a power cut leaves after any of them.
#[derive(Clone, Default)]
struct Words(BTreeMap<u16, u32>);

impl Words {
    fn read(&self) -> StoredSigning {
        let mut stored = StoredSigning::default();
        self.0.iter().for_each(|(key, word)| stored.found(*key, *word));
        stored
    }

    /// Writes what is to be stored, `at_most` so many words of it.
    fn write(&mut self, what: &ToStore, at_most: usize) {
        self.0.extend(self.read().words(what).take(at_most));
    }

    fn key(&self) -> Option<SigningKey> {
        self.read().key()
    }
}

#[test]
fn a_key_is_found_again_and_so_is_that_there_is_none() {
    let mut words = Words::default();
    assert!(words.key().is_none());
    for byte in [1, 2, 3, 3, 4] {
        words.write(&ToStore::Key(key(byte)), usize::MAX);
        assert_eq!(words.key(), Some(key(byte)));
        assert!(words.read().restore(Ok(())).signs());
    }
    words.write(&ToStore::NoKey, usize::MAX);
    let signing = words.read().restore(Ok(()));
    assert!(!signing.signs() && !signing.has_lost_key());
    words.write(&ToStore::Key(key(5)), usize::MAX);
    assert_eq!(words.key(), Some(key(5)));
}

#[test]
fn a_power_cut_leaves_the_old_key_or_the_new_one() {
    let mut words = Words::default();
    for byte in 1..6 {
        for cut_after in 0..=KEY_WORDS {
            let mut cut = words.clone();
            cut.write(&ToStore::Key(key(byte)), cut_after);
            assert_eq!(cut.key(), words.key(), "key {byte} cut after {cut_after} words");
            // And whatever was begun does not keep the next one from being stored.
            cut.write(&ToStore::Key(key(99)), usize::MAX);
            assert_eq!(cut.key(), Some(key(99)));
        }
        words.write(&ToStore::Key(key(byte)), usize::MAX);
    }
}

#[test]
fn a_key_that_is_damaged_is_lost_and_nobody_has_it() {
    let mut whole = Words::default();
    whole.write(&ToStore::Key(key(1)), usize::MAX);
    for (&at, &word) in &whole.0 {
        let mut changed = whole.clone();
        changed.0.insert(at, word ^ 0x100);
        let mut missing = whole.clone();
        missing.0.remove(&at);
        for damaged in [changed, missing] {
            let signing = damaged.read().restore(Err(StorageError::Corrupt));
            assert!(!signing.signs() && signing.has_lost_key(), "word {at:#x}");
        }
    }
}

#[test]
fn flash_that_signing_has_never_used_holds_no_key_and_has_lost_none() {
    for read in [Ok(()), Err(StorageError::Corrupt)] {
        let signing = StoredSigning::default().restore(read);
        assert!(!signing.signs() && !signing.has_lost_key());
    }
    // The first key was being written when the power went.
    let mut words = Words::default();
    words.write(&ToStore::Key(key(1)), 4);
    assert!(!words.read().restore(Ok(())).has_lost_key());
}

#[test]
fn the_mark_is_ahead_of_everything_signed_and_moves_twice_a_minute() {
    let mut mark = Mark::default();
    let mut moved = 0;
    // An hour from somewhere in 2026.
    let start = 37_000_000_000_000_u64;
    for second in 0..3600 {
        let now = Timestamp::default().later(start + second * Timestamp::PER_SECOND);
        if let Some(next) = next_mark(mark, now) {
            assert!(next.time() > mark.time());
            mark = next;
            moved += 1;
        }
        let ahead = mark.time().ticks() - now.ticks();
        assert!(ahead >= 30 * Timestamp::PER_SECOND, "{ahead} at {second} s");
        assert!(ahead <= 62 * Timestamp::PER_SECOND, "{ahead} at {second} s");
    }
    assert!((100..=120).contains(&moved), "{moved} times in an hour");
}

#[test]
fn after_a_restart_time_goes_on_where_nobody_has_been() {
    let mut words = Words::default();
    words.write(&ToStore::Key(key(1)), usize::MAX);
    let mut latest = Timestamp::default();
    for _ in 0..5 {
        let mut signing = words.read().restore(Ok(()));
        for second in 0..40 {
            let now_us = second * 1_000_000;
            while let Some(what) = signing.next_unsaved(now_us) {
                words.write(&what, usize::MAX);
                signing.mark_saved(&what);
            }
            let next = signing.clock.next(now_us);
            assert!(next > latest);
            latest = next;
        }
    }
}

proptest! {
    #[test]
    fn whatever_the_words_are_they_make_no_key_that_was_not_stored(
        words in prop::collection::btree_map(0x100..0x122_u16, any::<u32>(), 0..34),
    ) {
        prop_assert_eq!(Words(words).key(), None);
    }

    #[test]
    fn any_key_is_found_again(bytes in any::<[u8; 32]>(), before in any::<[u8; 32]>()) {
        let mut words = Words::default();
        for bytes in [before, bytes] {
            let what = SigningKey::new(bytes).map_or(ToStore::NoKey, ToStore::Key);
            words.write(&what, usize::MAX);
        }
        prop_assert_eq!(words.key(), SigningKey::new(bytes));
    }
}
