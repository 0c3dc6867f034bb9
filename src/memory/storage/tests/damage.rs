//! Damaged and foreign content is reported, and never gives a value that was not stored.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;

/// A wrapped region, its values, and all values each key ever had.
fn used_region() -> (SmallFlash, Values, BTreeSet<(u16, u32)>) {
    let mut flash = SmallFlash::blank();
    let mut latest = Values::new();
    let mut ever = BTreeSet::new();
    let mut storage = flash.storage();
    for number in 0..60_u16 {
        let (key, value) = (number % 4, u32::from(number));
        block_on(storage.store(key, value, &Erase::always)).unwrap();
        latest.insert(key, value);
        ever.insert((key, value));
    }
    (flash, latest, ever)
}

/// Stores still work, and a store or a clear ends the damage.
pub(super) fn assert_recovers<const SECTOR: usize, const PAGE: usize, const SECTORS: usize>(
    mut flash: Flash<SECTOR, PAGE, SECTORS>,
) {
    let mut cleared = flash.clone();
    let (mut found, _) = flash.load();
    assert_eq!(flash.store(5, 125), Ok(Stored::Written));
    found.insert(5, 125);
    assert_eq!(flash.load(), (found, Ok(())), "a store ends the damage");

    assert_eq!(cleared.clear(), Ok(()));
    assert_eq!(cleared.load(), (Values::new(), Ok(())));
    for number in 0..100_u16 {
        assert_eq!(cleared.store(number % 3, u32::from(number)), Ok(Stored::Written));
    }
    assert_eq!(cleared.load(), (values(&[(0, 99), (1, 97), (2, 98)]), Ok(())));
    cleared.assert_margins_are_untouched();
}

#[test]
fn single_flipped_bit_loses_at_most_one_record() {
    let (mut flash, latest, ever) = used_region();
    let mut storage = flash.storage();
    let log = block_on(storage.find_log()).unwrap().unwrap();
    assert!(
        log.used > 4 && log.used < SMALL_SLOTS - 1,
        "there are records before and blank slots after the last"
    );
    let slot_of = |byte: usize| {
        let in_sector = byte
            .checked_sub(log.sector.0 as usize * 176)
            .filter(|&offset| offset < 176)?;
        let slot = u32::try_from(in_sector.checked_sub(16)?).unwrap() / 12;
        (slot < SMALL_SLOTS).then_some(slot)
    };
    for bit in 0..176 * 3 * 8 {
        let mut spoiled = flash.clone();
        spoiled.region()[bit / 8] ^= 1 << (bit % 8);
        let (found, result) = spoiled.load();
        let differing: Vec<_> = latest
            .iter()
            .filter(|&(key, value)| found.get(key) != Some(value))
            .collect();
        assert!(
            found.iter().all(|(&key, &value)| ever.contains(&(key, value))),
            "bit {bit}: {found:?}"
        );
        match slot_of(bit / 8) {
            Some(slot) if slot + 1 < log.used => assert_eq!(result, Err(StorageError::Corrupt)),
            // The last record or the first blank slot may be an interrupted store.
            Some(slot) if slot <= log.used => assert_eq!(result, Ok(())),
            Some(_) => assert_eq!(result, Err(StorageError::Corrupt)),
            None => assert!(differing.is_empty(), "bit {bit}"),
        }
        assert!(differing.len() <= 1, "bit {bit}");
        assert_recovers(spoiled);
    }
}

#[test]
fn an_equal_value_ends_damage_too() {
    let (mut flash, latest, _) = used_region();
    let log = block_on(flash.storage().find_log()).unwrap().unwrap();
    flash.region()[log.sector.0 as usize * 176 + 16] ^= 1;
    let (found, result) = flash.load();
    assert_eq!(result, Err(StorageError::Corrupt));
    let (key, value) = latest.last_key_value().unwrap();
    assert_eq!(flash.store(*key, *value), Ok(Stored::Written));
    assert_eq!(flash.load(), (found, Ok(())));
    assert_eq!(flash.store(*key, *value), Ok(Stored::Unchanged));
}

#[test]
fn damaged_page_loses_only_its_records() {
    let (mut flash, latest, ever) = used_region();
    let log = block_on(flash.storage().find_log()).unwrap().unwrap();
    // Both ends of the sector, each with a header.
    for (page, kept) in [(0..64, 2), (112..176, 4)] {
        for fill in [0x00, 0xA5] {
            let mut spoiled = flash.clone();
            let base = log.sector.0 as usize * 176;
            spoiled.region()[base + page.start..base + page.end].fill(fill);
            let (found, result) = spoiled.load();
            assert_eq!(result, Err(StorageError::Corrupt));
            assert!(found.iter().all(|(&key, &value)| ever.contains(&(key, value))));
            assert!(
                found
                    .iter()
                    .filter(|&(key, value)| latest.get(key) == Some(value))
                    .count()
                    >= kept
            );
            assert_recovers(spoiled);
        }
    }
}

#[test]
fn lost_sector_restores_older_values_and_is_reported() {
    let (mut flash, latest, ever) = used_region();
    let log = block_on(flash.storage().find_log()).unwrap().unwrap();
    for fill in [0x00, 0xA5, 0xFF] {
        let mut spoiled = flash.clone();
        spoiled.region()[log.sector.0 as usize * 176..][..176].fill(fill);
        let (found, result) = spoiled.load();
        assert_eq!(result, Err(StorageError::Corrupt));
        assert!(found.keys().eq(latest.keys()));
        assert!(found.iter().all(|(&key, &value)| ever.contains(&(key, value))));
        assert_recovers(spoiled);
    }
}

#[test]
fn damaged_cleared_region_can_be_cleared_again() {
    let (mut flash, ..) = used_region();
    flash.clear().unwrap();
    let log = block_on(flash.storage().find_log()).unwrap().unwrap();
    // The retired mark.
    flash.region()[log.sector.0 as usize * 176 + 12] = 0xFE;
    assert_eq!(flash.load(), (Values::new(), Err(StorageError::Corrupt)));
    assert_recovers(flash);
}

#[test]
fn foreign_content_is_reported_and_empty() {
    for fill in [0x00, 0x01, 0xA5, 0xFE] {
        let mut flash = SmallFlash::blank();
        flash.region().fill(fill);
        assert_eq!(flash.load(), (Values::new(), Err(StorageError::Corrupt)));
        assert_recovers(flash);
    }
}

fn condition(flash: &mut SmallFlash) -> Condition {
    let mut storage = flash.storage();
    let _ = block_on(storage.load(&mut |_, _| {}));
    storage.condition()
}

#[test]
fn condition_counts_damaged_records() {
    assert_eq!(condition(&mut SmallFlash::blank()), Condition::Blank);
    for byte in 0..176 * 3 {
        let mut touched = SmallFlash::blank();
        touched.region()[byte] = 0xFE;
        assert_eq!(condition(&mut touched), Condition::Damaged, "byte {byte}");
    }

    let (mut flash, ..) = used_region();
    assert_eq!(condition(&mut flash), Condition::Intact);
    let log = block_on(flash.storage().find_log()).unwrap().unwrap();
    let sector = log.sector.0 as usize * 176;
    let records = sector + 16..sector + 176 - 16;
    let retired = sector + 12..sector + 16;
    for byte in 0..176 * 3 {
        let mut spoiled = flash.clone();
        spoiled.region()[byte] ^= 1;
        let expected = match byte {
            _ if records.contains(&byte) => Condition::OneRecordDamaged,
            _ if retired.contains(&byte) => Condition::Damaged,
            _ => Condition::Intact,
        };
        assert_eq!(condition(&mut spoiled), expected, "byte {byte}");
        // Another record is another twelve bytes.
        let other = records.start + (byte + 36) % records.len() / 12 * 12;
        if records.contains(&byte) && (byte - records.start) / 12 != (other - records.start) / 12 {
            spoiled.region()[other] ^= 1;
            assert_eq!(
                condition(&mut spoiled),
                Condition::Damaged,
                "bytes {byte} and {other}"
            );
        }
    }
}

#[test]
fn failed_start_over_leaves_damage() {
    let (used, ..) = used_region();
    let is_over = (1..).any(|operations| {
        let mut flash = used.clone();
        flash.refuse_after(operations);
        let result = block_on(flash.storage().start_over(&Erase::always));
        flash.power_up();
        match result {
            Ok(()) => {
                assert_eq!(flash.load(), (Values::new(), Ok(())));
                assert_eq!(condition(&mut flash), Condition::Intact);
            }
            Err(error) => {
                assert_eq!(error, StorageError::Flash(FlashFault::Other));
                let is_empty = flash.load().0.is_empty();
                assert!(
                    is_empty || condition(&mut flash) == Condition::Damaged,
                    "{operations}"
                );
                assert_recovers(flash);
            }
        }
        result.is_ok()
    });
    assert!(is_over);
    let mut blank = SmallFlash::blank();
    assert_eq!(block_on(blank.storage().start_over(&Erase::always)), Ok(()));
    assert_eq!(blank.operations(), 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_content_is_reported_and_empty(content in prop::collection::vec(any::<u8>(), 176 * 3)) {
        let mut flash = SmallFlash::blank();
        flash.region().copy_from_slice(&content);
        prop_assert_eq!(flash.load(), (Values::new(), Err(StorageError::Corrupt)));
        assert_recovers(flash);
    }

    #[test]
    fn damage_never_yields_a_value_that_was_not_stored(
        damage in prop::collection::vec((0..176 * 3_usize, any::<u8>()), 1..60),
    ) {
        let (mut flash, latest, ever) = used_region();
        for (byte, value) in damage {
            flash.region()[byte] = value;
        }
        let (found, result) = flash.load();
        prop_assert!(found.iter().all(|(&key, &value)| ever.contains(&(key, value))));
        if result.is_ok() {
            // At most the newest record, as by an interrupted store.
            prop_assert!(latest.iter().filter(|&(key, value)| found.get(key) != Some(value)).count() <= 1);
        }
        assert_recovers(flash);
    }
}
