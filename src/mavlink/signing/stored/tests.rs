use std::vec::Vec;

use proptest::prelude::*;

use super::super::time::next_mark;
use super::super::{SigningTrouble, Timestamp};
use super::*;
use crate::time::{Instant, at_us};

fn key(byte: u8) -> SigningKey {
    SigningKey::new([byte; 32]).expect("not all zeros")
}

/// A flash of words, in the order in which they were stored. A power cut leaves it after any of them.
#[derive(Clone, Default)]
struct WordLog(Vec<(u16, u32)>);

impl WordLog {
    fn read(&self) -> StoredSigning {
        let mut stored = StoredSigning::default();
        self.0.iter().for_each(|(key, word)| stored.found(*key, *word));
        stored
    }

    fn restore(&self) -> Signing {
        self.read().restore(if self.0.is_empty() {
            Condition::Blank
        } else {
            Condition::Intact
        })
    }

    /// Writes what is to be stored, `at_most` this many words of it; returns how many that were.
    fn write(&mut self, what: &ToStore, at_most: usize) -> usize {
        if *what == ToStore::Nothing {
            // A sector without records is not a blank one.
            self.0 = vec![(0, 0)];
        }
        let before = self.0.len();
        self.0.extend(self.read().words(what).into_iter().take(at_most));
        self.0.len() - before
    }

    fn key(&self) -> Option<SigningKey> {
        self.read().key()
    }
}

fn set_up(signing: &mut Signing, key: Option<SigningKey>) {
    signing.set_up(key, Timestamp::from_ticks(1_000_000_000).unwrap(), Instant::EPOCH);
}

/// Has everything written that waits, until `at_most` this many words are; whether that was all.
fn save(signing: &mut Signing, words: &mut WordLog, mut at_most: usize) -> bool {
    while let Some(what) = signing.next_unsaved(Instant::EPOCH, 0) {
        let wanted = words.read().words(&what).len();
        if what == ToStore::Nothing && at_most == 0 {
            return false;
        }
        at_most = at_most.saturating_sub(usize::from(what == ToStore::Nothing));
        if words.write(&what, at_most) < wanted {
            return false;
        }
        at_most -= wanted;
        signing.mark_saved(&what);
    }
    true
}

/// Flash into which this was set up, one after the other.
fn flash_with(keys: &[Option<SigningKey>]) -> WordLog {
    let mut words = WordLog::default();
    let mut signing = words.restore();
    for key in keys {
        set_up(&mut signing, key.clone());
        assert!(save(&mut signing, &mut words, usize::MAX));
    }
    words
}

#[derive(Debug, PartialEq)]
enum Found {
    Key(SigningKey),
    NoKey,
    LostKey,
}

fn found(signing: Signing) -> Found {
    match signing.protection {
        Protection::Key(key) => Found::Key(key),
        Protection::Off => Found::NoKey,
        Protection::KeyLost => Found::LostKey,
    }
}

#[test]
fn a_power_cut_leaves_the_old_key_or_the_new_one() {
    for cut_after in 0..40 {
        let mut words = flash_with(&[Some(key(1))]);
        let mut signing = words.restore();
        set_up(&mut signing, Some(key(2)));
        let is_all = save(&mut signing, &mut words, cut_after);
        let found = found(words.restore());
        assert!(
            [Found::Key(key(1)), Found::Key(key(2))].contains(&found),
            "{cut_after}"
        );
        assert!(!is_all || found == Found::Key(key(2)));
        // And whatever was begun does not keep the next one from being stored.
        let mut signing = words.restore();
        set_up(&mut signing, Some(key(99)));
        assert!(save(&mut signing, &mut words, usize::MAX));
        assert_eq!(words.key(), Some(key(99)));
    }
}

/// 40 years from 2015, and a time near the end of what a signature can hold.
const BACK_TICKS: u64 = 126_144_000_000_000;
const END_TICKS: u64 = (1 << 48) - 2;

#[test]
fn no_power_cut_takes_the_time_back_for_the_key_from_before() {
    let mut seen = Vec::new();
    for cut_after in 0..20 {
        let mut words = flash_with(&[Some(key(1))]);
        // An older firmware followed every holder of the key, up to the end.
        let end = next_mark(
            Mark::default(),
            Timestamp::from_ticks(END_TICKS).expect("48 bits"),
            0,
        );
        words.write(&ToStore::Mark(end.expect("the first")), usize::MAX);
        let mut signing = words.restore();
        let back = Timestamp::from_ticks(BACK_TICKS).expect("48 bits");
        signing.set_up(Some(key(2)), back, Instant::EPOCH);
        let is_all = save(&mut signing, &mut words, cut_after);
        let restored = words.restore();
        let is_low = restored.stored_mark.time() < back.later(100 * Timestamp::PER_SECOND);
        assert!(restored.stored_mark.time() > back, "ahead of all that was signed");
        let found = found(restored);
        assert!(!is_low || found == Found::Key(key(2)), "{cut_after}");
        assert!(!is_all || is_low, "{cut_after}");
        if !seen.contains(&(found == Found::Key(key(2)), is_low)) {
            seen.push((found == Found::Key(key(2)), is_low));
        }
        assert!(
            !is_all || signing.next_unsaved(Instant::EPOCH, 0).is_none(),
            "at rest"
        );
    }
    assert_eq!(seen, [(false, false), (true, false), (true, true)]);
}

#[test]
fn a_choice_whose_second_record_is_missing_gets_it_after_the_start() {
    for last in [Some(key(2)), None] {
        let mut words = flash_with(&[Some(key(1)), last.clone()]);
        words.0.pop();
        let mut signing = words.restore();
        assert!(signing.is_key_unsaved());
        let records = words.0.len();
        assert!(save(&mut signing, &mut words, usize::MAX));
        let choices = words.0[records..].iter().filter(|(key, _)| CHOICES.contains(key));
        assert_eq!(choices.count(), 2);
        assert_eq!(words.key(), last);
    }
}

/// Each record is damaged by itself, and in one case each pair.
#[test]
fn damage_leaves_the_same_choice_or_a_lost_key() {
    let histories = [
        vec![Some(key(1))],
        vec![Some(key(1)), Some(key(2))],
        vec![Some(key(1)), None, Some(key(2))],
        vec![Some(key(1)), None],
    ];
    for history in histories {
        let whole = flash_with(&history);
        let expected = found(whole.restore());
        let mark = whole.read().mark();
        for first in 0..whole.0.len() {
            let mut damaged = whole.clone();
            damaged.0.remove(first);
            let signing = damaged.read().restore(Condition::OneRecordDamaged);
            assert_eq!(signing.stored_mark, mark, "the time does not go back");
            let left = found(signing);
            assert!(left == Found::LostKey || left == expected, "record {first}");
            assert!(left != Found::NoKey);
            for second in 0..damaged.0.len() {
                let mut damaged = damaged.clone();
                damaged.0.remove(second);
                let signing = damaged.read().restore(Condition::Damaged);
                assert!(signing.has_lost_key());
            }
        }
    }
}

#[test]
fn what_could_not_be_written_is_unsaved_until_it_is_written_from_the_start() {
    let mut words = flash_with(&[Some(key(1))]);
    let mut signing = words.restore();
    signing.mark_failed();
    assert!(signing.signs() && signing.is_key_unsaved());
    assert_eq!(signing.trouble(), Some(SigningTrouble::NotSaved));
    assert_eq!(signing.next_unsaved(Instant::EPOCH, 0), Some(ToStore::Nothing));
    assert!(save(&mut signing, &mut words, usize::MAX));
    assert_eq!((signing.trouble(), signing.is_key_unsaved()), (None, false));
    assert_eq!(words.key(), Some(key(1)));
}

#[test]
// Requirement: W-2
fn the_mark_is_ahead_of_everything_signed_and_moves_once_a_minute() {
    let mut mark = Mark::default();
    let mut moved = 0;
    // An hour from somewhere in 2026.
    let start = 37_000_000_000_000_u64;
    for second in 0..3600 {
        let now = Timestamp::default().later(start + second * Timestamp::PER_SECOND);
        if let Some(next) = next_mark(mark, now, 0) {
            assert!(next.time() > mark.time());
            // If the first record of the next one is damaged, the older one still has to be ahead.
            assert!(mark == Mark::default() || mark.time() > now.later(5 * Timestamp::PER_SECOND));
            mark = next;
            moved += 1;
        }
        let ahead = mark.time().ticks() - now.ticks();
        assert!(ahead >= 7 * Timestamp::PER_SECOND, "{ahead} at {second} s");
        assert!(ahead <= 72 * Timestamp::PER_SECOND, "{ahead} at {second} s");
    }
    assert!((50..=60).contains(&moved), "{moved} times in an hour");
}

/// Records of the board's sector of flash that are not the key, a choice or a mark which a move takes along.
const ROOM_FOR_MARKS: u64 = (338 - 2 * KEY_WORDS as u64 - 4) / 2;

#[test]
fn marks_of_two_months_armed_fit_an_erased_sector_and_stay_ahead() {
    let start = Timestamp::default().later(37_000_000_000_000);
    let mut mark = next_mark(Mark::default(), start, 0).expect("the first");
    let (mut second, mut moved) = (0, 0);
    while second < 60 * 24 * 3600 {
        let now = start.later(second * Timestamp::PER_SECOND);
        if let Some(next) = next_mark(mark, now, second * 1_000_000) {
            assert!(next.time() > mark.time() && mark.time() > now.later(5 * Timestamp::PER_SECOND));
            mark = next;
            moved += 1;
        }
        let ahead_s = (mark.time().ticks() - now.ticks()) / Timestamp::PER_SECOND;
        assert!(ahead_s >= 7, "{ahead_s} at {second} s");
        assert!(ahead_s <= 72.max(second / 16 + 2), "{ahead_s} at {second} s");
        // Nothing happens until it is near.
        second += ahead_s.saturating_sub(10).max(1);
    }
    assert!(moved <= ROOM_FOR_MARKS, "{moved} of {ROOM_FOR_MARKS}");
}

#[test]
fn after_a_restart_time_goes_on_after_all_that_was_signed() {
    let mut words = flash_with(&[Some(key(1))]);
    let mut latest = Timestamp::default();
    for _ in 0..5 {
        let mut signing = words.restore();
        for second in 0..40 {
            let now = at_us(second * 1_000_000);
            while let Some(what) = signing.next_unsaved(now, 0) {
                words.write(&what, usize::MAX);
                signing.mark_saved(&what);
            }
            let next = signing.clock.next(now);
            assert!(next > latest);
            latest = next;
        }
    }
}

proptest! {
    #[test]
    fn whatever_the_words_are_they_make_no_key_that_was_not_stored(
        words in prop::collection::vec((0x100..0x124_u16, any::<u32>()), 0..40),
    ) {
        prop_assert_eq!(WordLog(words).key(), None);
    }

    #[test]
    fn any_key_is_found_again(bytes in any::<[u8; 32]>(), before in any::<[u8; 32]>()) {
        let words = flash_with(&[before, bytes].map(SigningKey::new));
        prop_assert_eq!(words.key(), SigningKey::new(bytes));
    }
}
