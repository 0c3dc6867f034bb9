//! Values of 14 words, as of what is learnt of a pack, where a value may give way to another.

use proptest::prelude::*;

use super::*;
use crate::memory::flash_map;

type Words = [u32; 14];

/// Six records a sector.
type WideFlash = Flash<400, 64, 3>;

const SLOTS: u32 = Region::<<WideFlash as Reboot>::Chip>::slots_in(Layout::Single, 14);

fn storage(flash: &mut WideFlash) -> Storage<&mut <WideFlash as Reboot>::Chip, Words> {
    Storage::new(&mut flash.chip, WideFlash::REGION)
}

/// Each word differs, so that a torn record shows.
fn words(number: u32) -> Words {
    core::array::from_fn(|word| number.wrapping_mul(2_654_435_761).rotate_left(word as u32))
}

fn read(flash: &mut WideFlash, key: u32) -> Option<Words> {
    block_on(storage(flash).read(key)).expect("a sound flash")
}

fn store(flash: &mut WideFlash, key: u32, number: u32) {
    block_on(storage(flash).store_replacing(key, words(number), &|_| false, &Erase::always))
        .expect("there is room");
}

fn network_of(flash: &mut BoardFlash) -> Storage<&mut <BoardFlash as Reboot>::Chip, [u32; 25]> {
    Storage::new(&mut flash.chip, BoardFlash::REGION)
}

#[test]
fn board_sector_holds_63_wide_records() {
    assert_eq!(
        Region::<<BoardFlash as Reboot>::Chip>::slots_in(Layout::Single, 14),
        63
    );
    let mut flash = BoardFlash::blank();
    let mut storage: Storage<_, Words> = Storage::new(&mut flash.chip, BoardFlash::REGION);
    for number in 0..4 * 63 {
        assert_eq!(
            block_on(storage.store(3, words(number), &Erase::always)),
            Ok(Stored::Written)
        );
    }
    assert_eq!(block_on(storage.read(3)), Ok(Some(words(4 * 63 - 1))));
    assert_eq!(flash.erases, [0, 1, 1, 1]);
}

#[test]
fn name_and_password_of_a_network_are_read_after_a_reboot() {
    let sectors = flash_map::WIFI.len() / flash_map::SECTOR_BYTES as usize;
    assert_eq!(sectors, 2, "one takes what moves from the other");
    let credentials: [u32; 25] = core::array::from_fn(|word| word as u32 + 1);
    let mut flash = BoardFlash::blank();
    block_on(network_of(&mut flash).store(3, credentials, &Erase::always)).unwrap();
    assert_eq!(block_on(network_of(&mut flash).read(3)), Ok(Some(credentials)));
}

#[test]
fn wide_key_is_read_after_a_reboot() {
    let mut flash = WideFlash::blank();
    assert_eq!(read(&mut flash, 7), None);
    for key in [7, 7 << 4, u32::MAX] {
        store(&mut flash, key, key);
    }
    for key in [7, 7 << 4, u32::MAX] {
        assert_eq!(read(&mut flash, key), Some(words(key)));
    }
    assert_eq!(read(&mut flash, 8), None);
    flash.assert_margins_are_untouched();
}

#[test]
fn region_of_another_width_is_empty_and_is_taken_over() {
    let mut flash = WideFlash::blank();
    for number in 0..80_u16 {
        block_on(Storage::<_, u32>::new(&mut flash.chip, WideFlash::REGION).store(
            number % 5,
            9,
            &Erase::always,
        ))
        .unwrap();
    }
    for key in 0..5 {
        assert_eq!(read(&mut flash, key), None);
    }
    store(&mut flash, 3, 1);
    assert_eq!(read(&mut flash, 3), Some(words(1)));
}

#[test]
fn first_dispensable_value_gives_way_to_another() {
    let mut flash = WideFlash::blank();
    for key in 0..SLOTS {
        store(&mut flash, key, key);
    }
    let mut full = storage(&mut flash);
    assert_eq!(
        block_on(full.store(99, words(99), &Erase::always)),
        Err(StorageError::Full)
    );
    let in_use = |key: u32| key < 2;
    let stored = block_on(full.store_replacing(99, words(99), &|key| !in_use(key), &Erase::always));
    assert_eq!(stored, Ok(Stored::Written));
    for key in (0..SLOTS).chain([99]) {
        let expected = (key != 2).then(|| words(key));
        assert_eq!(read(&mut flash, key), expected, "key {key}");
    }
    assert_eq!(
        block_on(storage(&mut flash).store_replacing(100, words(100), &|_| false, &Erase::always)),
        Err(StorageError::Full)
    );
}

#[test]
fn value_of_its_own_key_makes_room_first() {
    let mut flash = WideFlash::blank();
    for key in 0..SLOTS {
        store(&mut flash, key, key);
    }
    for number in 100..120 {
        block_on(storage(&mut flash).store_replacing(3, words(number), &|_| true, &Erase::always)).unwrap();
    }
    for key in 0..SLOTS {
        let expected = words(if key == 3 { 119 } else { key });
        assert_eq!(read(&mut flash, key), Some(expected), "key {key}");
    }
}

#[test]
fn flipped_bit_gives_an_earlier_value_or_none() {
    let mut flash = WideFlash::blank();
    for number in 0..22 {
        store(&mut flash, number % 4, number);
    }
    for bit in 0..400 * 3 * 8 {
        let mut spoiled = flash.clone();
        spoiled.region()[bit / 8] ^= 1 << (bit % 8);
        for key in 0..4 {
            let found = read(&mut spoiled, key);
            let is_of_key = (0..22).any(|number| number % 4 == key && found == Some(words(number)));
            assert!(is_of_key || found.is_none(), "bit {bit}, key {key}");
        }
        store(&mut spoiled, 2, 50);
        assert_eq!(read(&mut spoiled, 2), Some(words(50)), "bit {bit}");
    }
}

/// Whether sectors are erased ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ahead {
    Never,
    BeforeEachStore,
}

/// Stores until a power cut, which leaves the old value or the new one, or the value that gave way: nothing else changes.
fn cut_in_every_operation(keys: &[u32], ways: u64, ahead: Ahead) {
    let prepared = WideFlash::blank();
    for operation in 0.. {
        for way in 0..ways {
            let mut flash = prepared.clone();
            flash.cut_power_after(operation, operation * ways + way);
            let mut before: Vec<(u32, u32)> = Vec::new();
            let cut_at = keys.iter().zip(0..).find(|(key, number)| {
                let mut storage = storage(&mut flash);
                let stored = block_on(async {
                    if ahead == Ahead::BeforeEachStore {
                        storage.prepare(&Erase::always).await?;
                    }
                    storage
                        .store_replacing(**key, words(*number), &|_| true, &Erase::always)
                        .await
                });
                let is_cut = stored.is_err();
                if !is_cut {
                    before.retain(|(stored, _)| stored != *key);
                    before.push((**key, *number));
                    if before.len() > SLOTS as usize {
                        before.remove(0);
                    }
                }
                is_cut
            });
            let Some((key, number)) = cut_at else {
                return assert!(operation > 0);
            };
            flash.power_up();
            let is_full = before.len() == SLOTS as usize;
            let gives_way = (is_full && before.iter().all(|(stored, _)| stored != key)).then(|| before[0].0);
            let is_new = read(&mut flash, *key) == Some(words(number));
            for (stored, value) in &before {
                let found = read(&mut flash, *stored);
                let is_old = found == Some(words(*value));
                let is_replaced =
                    is_new && (stored == key || (found.is_none() && gives_way == Some(*stored)));
                assert!(
                    is_old || is_replaced,
                    "operation {operation}, way {way}, key {stored}: {found:?}"
                );
            }
            block_on(storage(&mut flash).store_replacing(*key, words(1000), &|_| true, &Erase::always))
                .expect("a sound flash");
            assert_eq!(read(&mut flash, *key), Some(words(1000)));
            flash.assert_margins_are_untouched();
        }
    }
}

#[test]
fn power_cut_in_any_operation_leaves_old_or_new_words() {
    let keys: Vec<u32> = (0..30).map(|number| (number % 9) << 4).collect();
    cut_in_every_operation(&keys, 12, Ahead::Never);
    cut_in_every_operation(&keys, 12, Ahead::BeforeEachStore);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn arbitrary_stores_of_words_survive_power_cuts(keys in prop::collection::vec(0..10_u32, 1..25)) {
        cut_in_every_operation(&keys, 3, Ahead::Never);
        cut_in_every_operation(&keys, 3, Ahead::BeforeEachStore);
    }
}

/// Of a later firmware, which keeps more of a pack.
type LaterWords = [u32; 25];

fn later(flash: &mut WideFlash) -> Storage<&mut <WideFlash as Reboot>::Chip, LaterWords> {
    Storage::new(&mut flash.chip, WideFlash::REGION).widening(14)
}

fn widened(number: u32) -> LaterWords {
    let mut widened = [0; 25];
    widened[..14].copy_from_slice(&words(number));
    widened
}

fn read_later(flash: &mut WideFlash, key: u32) -> Option<LaterWords> {
    block_on(later(flash).read(key)).expect("a sound flash")
}

#[test]
fn values_of_older_firmware_are_read_and_widened_as_they_move() {
    let mut flash = WideFlash::blank();
    for key in 0..3 {
        store(&mut flash, key, key);
    }
    for key in 0..3 {
        assert_eq!(read_later(&mut flash, key), Some(widened(key)));
    }
    assert_eq!(read_later(&mut flash, 3), None);
    // Nothing is written for an equal value.
    let stored = block_on(later(&mut flash).store(1, widened(1), &Erase::always));
    assert_eq!(stored, Ok(Stored::Unchanged));
    let full: LaterWords = core::array::from_fn(|word| word as u32 + 100);
    let stored = block_on(later(&mut flash).store(2, full, &Erase::always));
    assert_eq!(stored, Ok(Stored::Written));
    for key in [0, 1] {
        assert_eq!(read_later(&mut flash, key), Some(widened(key)));
    }
    assert_eq!(read_later(&mut flash, 2), Some(full));
}

#[test]
fn of_more_values_than_wider_ones_fit_the_first_dispensable_ones_give_way() {
    let mut flash = WideFlash::blank();
    let slots = later(&mut flash).slots();
    assert!(slots + 1 < SLOTS, "{slots} of {SLOTS}");
    for key in 0..SLOTS {
        store(&mut flash, key, key);
    }
    let in_use = |key: u32| key == 0 || key == 99;
    let stored =
        block_on(later(&mut flash).store_replacing(99, widened(99), &|key| !in_use(key), &Erase::always));
    assert_eq!(stored, Ok(Stored::Written));
    assert_eq!(read_later(&mut flash, 0), Some(widened(0)));
    assert_eq!(read_later(&mut flash, 99), Some(widened(99)));
    let kept = (1..SLOTS)
        .filter(|key| read_later(&mut flash, *key).is_some())
        .count() as u32;
    assert_eq!(kept, slots - 2);
    for key in SLOTS - kept..SLOTS {
        assert_eq!(read_later(&mut flash, key), Some(widened(key)), "the latest");
    }
    // Nothing changes if none may give way.
    let mut flash = WideFlash::blank();
    for key in 0..SLOTS {
        store(&mut flash, key, key);
    }
    let stored = block_on(later(&mut flash).store_replacing(99, widened(99), &|_| false, &Erase::always));
    assert_eq!(stored, Err(StorageError::Full));
    assert_eq!(read_later(&mut flash, 0), Some(widened(0)));
}

#[test]
fn a_power_cut_while_values_are_widened_leaves_all_of_them() {
    let mut older = WideFlash::blank();
    for key in 0..3 {
        store(&mut older, key, key);
    }
    for operation in 0.. {
        for way in 0..12 {
            let mut flash = older.clone();
            flash.cut_power_after(operation, operation * 12 + way);
            let stored = block_on(later(&mut flash).store(2, widened(20), &Erase::always));
            if stored.is_ok() {
                return assert!(operation > 4);
            }
            flash.power_up();
            for key in [0, 1] {
                assert_eq!(
                    read_later(&mut flash, key),
                    Some(widened(key)),
                    "{operation}, way {way}"
                );
            }
            let latest = read_later(&mut flash, 2);
            assert!(
                latest == Some(widened(2)) || latest == Some(widened(20)),
                "{operation}, way {way}: {latest:?}"
            );
        }
    }
}

#[test]
fn storage_whose_move_to_wider_values_failed_reads_the_older_ones_and_moves_later() {
    let mut older = WideFlash::blank();
    for key in 0..3 {
        store(&mut older, key, key);
    }
    for operations in 0.. {
        let mut flash = older.clone();
        let mut storage = later(&mut flash);
        storage.region.flash.refuse_after(operations);
        if block_on(storage.store(2, widened(20), &Erase::always)).is_ok() {
            return assert!(operations > 4);
        }
        for key in [0, 1] {
            assert_eq!(
                block_on(storage.read(key)),
                Ok(Some(widened(key))),
                "{operations}"
            );
        }
        assert!(
            block_on(storage.store(2, widened(20), &Erase::always)).is_ok(),
            "{operations}"
        );
        for (key, number) in [(0, 0), (1, 1), (2, 20)] {
            assert_eq!(
                block_on(storage.read(key)),
                Ok(Some(widened(number))),
                "{operations}"
            );
        }
    }
}
