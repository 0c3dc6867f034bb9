//! A region in sectors of one block, as earlier versions wrote it, is read as it is, and moves with the first store.

use proptest::prelude::*;

use super::damage::assert_recovers;
use super::double::{SMALL_SLOTS, SmallDoubleFlash};
use super::power_cuts::{Step, cut_everywhere, run_until_power_cut, step};
use super::*;

/// A region after so many stores by an earlier version, and its values.
fn earlier(stores: u32) -> (SmallDoubleFlash, Values) {
    let mut flash = SmallDoubleFlash::blank();
    let mut expected = Values::new();
    for number in 0..stores {
        let key = u16::try_from(number % 7).unwrap();
        assert_eq!(flash.store(key, number), Ok(Stored::Written));
        expected.insert(key, number);
    }
    flash.layout = Layout::Double;
    (flash, expected)
}

/// The layout in which the active sector is.
fn layout_of(flash: &mut SmallDoubleFlash) -> Layout {
    let log = block_on(flash.storage().find_log()).unwrap();
    log.expect("values are stored").sector.layout
}

#[test]
fn sector_of_a_release_is_read() {
    // As released: CRCs by `zlib.crc32`.
    const HEADER: [u8; 12] = [b'P', b'A', b'R', b'1', 7, 0, 0, 0, 0x11, 0x52, 0xa8, 0x92];
    const RECORD: [u8; 12] = [0x42, 0, 0, 0, 0x33, 0x33, 0x83, 0x40, 0x67, 0x9c, 0x5b, 0xac];
    for block in 0..4 {
        let mut flash = BoardFlash::blank();
        flash.layout = Layout::Double;
        let sector = &mut flash.region()[block * 4096..][..4096];
        sector[..12].copy_from_slice(&HEADER);
        sector[16..28].copy_from_slice(&RECORD);
        sector[4080..4092].copy_from_slice(&HEADER);
        let mut expected = values(&[(66, 4.1_f32.to_bits())]);
        assert_eq!(flash.load(), (expected.clone(), Ok(())));
        assert_eq!(flash.store(67, 5), Ok(Stored::Written));
        expected.insert(67, 5);
        assert_eq!(flash.load(), (expected, Ok(())), "block {block}");
        flash.assert_margins_are_untouched();
    }
}

#[test]
fn values_stay_where_they_are_until_one_changes_and_then_all_move() {
    // The active sector is in each block in turn.
    for stores in [5, 12, 20, 30, 40, 100] {
        let (mut flash, mut expected) = earlier(stores);
        let before = flash.operations();
        assert_eq!(flash.load(), (expected.clone(), Ok(())));
        let (&key, &value) = expected.first_key_value().unwrap();
        assert_eq!(flash.store(key, value), Ok(Stored::Unchanged));
        assert_eq!(
            (flash.operations(), layout_of(&mut flash)),
            (before, Layout::Single)
        );

        assert_eq!(flash.store(99, 1), Ok(Stored::Written));
        expected.insert(99, 1);
        assert_eq!(layout_of(&mut flash), Layout::Double);
        assert_eq!(flash.load(), (expected, Ok(())));
        flash.assert_margins_are_untouched();
    }
}

#[test]
fn region_that_was_full_takes_twice_the_values() {
    let mut flash = SmallDoubleFlash::blank();
    let mut expected = Values::new();
    let mut key = 0;
    while flash.store(key, 1) == Ok(Stored::Written) {
        expected.insert(key, 1);
        key += 1;
    }
    flash.layout = Layout::Double;
    for key in key..u16::try_from(SMALL_SLOTS).unwrap() {
        assert_eq!(flash.store(key, 2), Ok(Stored::Written));
        expected.insert(key, 2);
    }
    assert_eq!(flash.load(), (expected, Ok(())));
}

#[test]
fn armed_at_the_first_store_changes_nothing_unless_erased_ahead() {
    let forbidden = || Erase::Forbidden;
    let (mut flash, mut expected) = earlier(20);
    let before = flash.operations();
    let mut storage = flash.storage();
    assert_eq!(
        block_on(storage.store(99, 1, &forbidden)),
        Err(StorageError::NoErasedSpace)
    );
    assert_eq!(storage.region.flash.operations(), before);
    assert_eq!(prepare(&mut storage, &Erase::always), Ok(()));
    assert_eq!(flash.load(), (expected.clone(), Ok(())), "erased ahead");
    let mut storage = flash.storage();
    assert_eq!(block_on(storage.store(99, 1, &forbidden)), Ok(Stored::Written));
    expected.insert(99, 1);
    assert_eq!(flash.load(), (expected, Ok(())));
}

#[test]
fn power_cut_in_any_operation_of_the_takeover_keeps_every_value() {
    for stores in [5, 12, 20, 30, 40, 100] {
        let (flash, _) = earlier(stores);
        let stores = [Step::Store(3, 1000), Step::Store(99, 1), Step::Store(3, 2000)];
        cut_everywhere(&flash, &stores, 200);
        cut_everywhere(
            &flash,
            &[[Step::Prepare].as_slice(), &stores, &[Step::Prepare]].concat(),
            200,
        );
        cut_everywhere(&flash, &[Step::Prepare, Step::Clear, Step::Store(3, 1)], 100);
    }
}

#[test]
fn power_cut_in_the_takeover_of_the_boards_full_sector() {
    let mut flash = BoardFlash::blank();
    let mut storage = flash.storage();
    for key in 0..338 {
        block_on(storage.store(key, u32::from(key), &Erase::always)).unwrap();
    }
    flash.layout = Layout::Double;
    cut_everywhere(&flash, &[Step::Prepare, Step::Store(400, 1)], 2);
}

#[test]
fn damaged_region_is_reported_and_a_store_ends_the_damage() {
    for stores in [20, 30] {
        let (flash, expected) = earlier(stores);
        for bit in 0..4 * 176 * 8 {
            let mut spoiled = flash.clone();
            spoiled.region()[bit / 8] ^= 1 << (bit % 8);
            let (found, result) = spoiled.load();
            let differing = expected
                .iter()
                .filter(|&(key, value)| found.get(key) != Some(value));
            assert!(differing.count() <= 1, "bit {bit}: {result:?}");
            assert_recovers(spoiled);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn arbitrary_regions_are_taken_over_through_power_cuts(
        before in prop::collection::vec(step(), 1..60),
        mut steps in prop::collection::vec(step(), 0..20),
    ) {
        let mut flash = SmallDoubleFlash::blank();
        let mut values = Values::new();
        run_until_power_cut(&mut flash, &before, &mut values);
        flash.layout = Layout::Double;
        prop_assert_eq!(flash.load(), (values, Ok(())));
        steps.push(Step::Store(99, 1));
        cut_everywhere(&flash, &steps, 8);
    }

    #[test]
    fn damage_never_yields_a_value_that_was_not_stored(
        stores in 1..120_u32,
        damage in prop::collection::vec((0..176 * 4_usize, any::<u8>()), 1..60),
    ) {
        let (mut flash, _) = earlier(stores);
        for (byte, value) in damage {
            flash.region()[byte] = value;
        }
        let (found, _) = flash.load();
        prop_assert!(found.iter().all(|(&key, &value)| value < stores && u32::from(key) == value % 7));
        assert_recovers(flash);
    }
}
