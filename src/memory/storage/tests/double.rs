//! Sectors of two blocks: twice the values, and each block is erased on its own.

use core::cell::Cell;

use super::damage::assert_recovers;
use super::*;
use crate::parameter::{Access, ParameterId};

/// Of two blocks a sector.
fn full() -> (SmallDoubleFlash, Values) {
    super::full(Layout::Double)
}

#[test]
fn every_setting_of_nine_packs_is_kept_and_can_be_changed() {
    let mut flash = BoardFlash::in_sectors(Layout::Double);
    let settings = || ParameterId::all().filter(|id| matches!(id.row().access, Access::Setting(_)));
    assert!(settings().count() >= 352);
    for round in 1..=3 {
        let mut storage = flash.storage();
        for id in settings() {
            let value = round * u32::from(id.key());
            assert_eq!(
                block_on(storage.store(id.key(), value, &Erase::always)),
                Ok(Stored::Written),
                "{id:?}"
            );
        }
        let expected = settings().map(|id| (id.key(), round * u32::from(id.key())));
        assert_eq!(flash.load(), (expected.collect(), Ok(())));
    }
    flash.assert_margins_are_untouched();
}

#[test]
fn block_is_erased_ahead_at_each_call_and_the_mark_is_last() {
    let (mut flash, _) = full();
    let mut storage = flash.storage();
    assert_eq!(block_on(storage.prepare(&Erase::always)), Ok(Prepared::Partly));
    assert_eq!(storage.region.flash.erases, [0, 0, 1, 0]);
    let programs = storage.region.flash.programs;
    for _ in 0..2 {
        assert_eq!(
            block_on(storage.prepare(&Erase::always)),
            Ok(Prepared::AsFarAsPossible)
        );
        assert_eq!(storage.region.flash.erases, [0, 0, 1, 1]);
        assert_eq!(storage.region.flash.programs, programs + 1);
    }
    assert_eq!(
        block_on(storage.store(0, 1, &|| Erase::Forbidden)),
        Ok(Stored::Written)
    );
}

#[test]
fn armed_between_two_blocks_erases_the_second_one_later() {
    let (mut flash, mut expected) = full();
    let mut storage = flash.storage();
    assert_eq!(block_on(storage.prepare(&Erase::always)), Ok(Prepared::Partly));
    let forbidden = || Erase::Forbidden;
    assert_eq!(
        block_on(storage.prepare(&forbidden)),
        Ok(Prepared::AsFarAsPossible)
    );
    assert_eq!(
        block_on(storage.store(0, 99, &forbidden)),
        Err(StorageError::NoErasedSpace)
    );
    assert_eq!(prepare(&mut storage, &Erase::always), Ok(()));
    assert_eq!(block_on(storage.store(0, 99, &forbidden)), Ok(Stored::Written));
    expected.insert(0, 99);
    assert_eq!(flash.load(), (expected, Ok(())));
}

#[test]
fn sector_of_a_failed_move_is_erased_from_its_first_block_on() {
    for operations in 0..6 {
        let (mut flash, _) = full();
        let mut storage = flash.storage();
        assert_eq!(block_on(storage.prepare(&Erase::always)), Ok(Prepared::Partly));
        storage.region.flash.refuse_after(operations);
        assert!(block_on(storage.store(0, 99, &Erase::always)).is_err());
        let [.., third, fourth] = storage.region.flash.erases;
        assert_eq!(prepare(&mut storage, &Erase::always), Ok(()));
        assert_eq!(
            storage.region.flash.erases,
            [0, 0, third + 1, fourth + 1],
            "{operations}"
        );
    }
}

#[test]
fn permission_is_asked_before_each_block_of_a_move() {
    for answers in 0..3 {
        let (mut flash, mut expected) = full();
        let asked = Cell::new(0);
        let may_erase = || {
            asked.set(asked.get() + 1);
            if asked.get() > answers {
                Erase::Forbidden
            } else {
                Erase::Allowed
            }
        };
        let result = block_on(flash.storage().store(0, 99, &may_erase));
        if answers < 2 {
            assert_eq!(result, Err(StorageError::NoErasedSpace));
        } else {
            assert_eq!(result, Ok(Stored::Written));
            expected.insert(0, 99);
        }
        assert_eq!(
            flash.erases,
            [0, 0, u32::from(answers > 0), u32::from(answers > 1)]
        );
        assert_eq!(flash.load(), (expected, Ok(())));
    }
}

#[test]
fn flipped_bit_loses_at_most_one_record() {
    let (flash, expected) = full();
    for bit in 0..4 * 176 * 8 {
        let mut spoiled = flash.clone();
        spoiled.region()[bit / 8] ^= 1 << (bit % 8);
        let (found, _) = spoiled.load();
        let differing = expected
            .iter()
            .filter(|&(key, value)| found.get(key) != Some(value));
        assert!(differing.count() <= 1, "bit {bit}");
        assert_recovers(spoiled);
    }
}
