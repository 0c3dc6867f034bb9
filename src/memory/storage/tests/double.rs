//! Sectors of two blocks: twice the values, and each block is erased on its own.

use core::cell::Cell;

use proptest::prelude::*;

use super::damage::assert_recovers;
use super::power_cuts::{Step, cut_everywhere, run_until_power_cut, step};
use super::*;
use crate::parameter::{Access, ParameterId};

/// Twenty-six records in a sector of two blocks, and two such sectors.
type SmallDoubleFlash = Flash<176, 64, 4>;

const BOARD_SLOTS: u32 = Region::<<BoardFlash as Reboot>::Chip>::slots_in(Layout::Double, 1);

const SMALL_SLOTS: u32 = Region::<<SmallDoubleFlash as Reboot>::Chip>::slots_in(Layout::Double, 1);

/// Erased, to be used in sectors of two blocks.
fn blank<const SECTOR: usize, const PAGE: usize, const SECTORS: usize>() -> Flash<SECTOR, PAGE, SECTORS> {
    Flash::in_sectors(Layout::Double)
}

/// A region whose active sector is full: its next store moves.
fn full() -> (SmallDoubleFlash, Values) {
    let mut flash = blank();
    let mut expected = Values::new();
    for number in 0..SMALL_SLOTS {
        let key = u16::try_from(number % 3).unwrap();
        assert_eq!(flash.store(key, number), Ok(Stored::Written));
        expected.insert(key, number);
    }
    (flash, expected)
}

#[test]
fn every_setting_of_nine_packs_is_kept_and_can_be_changed() {
    let mut flash: BoardFlash = blank();
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
fn sector_of_680_records_costs_an_erase_of_each_block() {
    let mut flash: BoardFlash = blank();
    assert_eq!(BOARD_SLOTS, 680);
    assert_eq!(flash.storage().slots(), BOARD_SLOTS);
    let rounds = 3;
    let mut storage = flash.storage();
    for number in 0..rounds * 2 * BOARD_SLOTS {
        block_on(storage.store(1, number, &Erase::always)).unwrap();
    }
    // The first sector was blank at its first use.
    assert_eq!(flash.erases, [rounds - 1, rounds - 1, rounds, rounds]);
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
fn power_cut_in_any_operation_leaves_old_or_new_value() {
    let steps: Vec<Step> = (0..90_u16)
        .map(|number| match number {
            40 => Step::Clear,
            41 => Step::Store(9, u32::MAX),
            _ => Step::Store(number % 5, u32::from(number)),
        })
        .collect();
    let flash: SmallDoubleFlash = blank();
    cut_everywhere(&flash, &steps, 100);
    let steps: Vec<Step> = steps.into_iter().flat_map(|step| [step, Step::Prepare]).collect();
    cut_everywhere(&flash, &steps, 60);
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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn arbitrary_stores_survive_power_cuts(
        before in prop::collection::vec(step(), 0..50),
        mut steps in prop::collection::vec(step(), 0..40),
    ) {
        let mut flash: SmallDoubleFlash = blank();
        let mut values = Values::new();
        run_until_power_cut(&mut flash, &before, &mut values);
        steps.push(Step::Store(99, 1));
        cut_everywhere(&flash, &steps, 8);
    }
}
