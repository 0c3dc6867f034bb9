use core::iter;
use core::ops::{Deref, DerefMut, Range};
use core::pin::pin;
use core::task::{Context, Waker};
use std::collections::BTreeMap;

use embassy_futures::block_on;
use nor_flash::FlashModel;

use super::*;

mod damage;
mod double;
mod erase_ahead;
mod power_cuts;
mod wide;

/// A flash chip, and the sectors in which a storage uses it.
#[derive(Clone)]
struct Flash<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> {
    chip: FlashModel<SECTOR, PAGE, SECTORS>,
    layout: Layout,
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> Flash<SECTOR, PAGE, SECTORS> {
    const REGION: Range<u32> = FlashModel::<SECTOR, PAGE, SECTORS>::REGION;

    fn blank() -> Self {
        Self::in_sectors(Layout::Single)
    }

    fn in_sectors(layout: Layout) -> Self {
        Self {
            chip: FlashModel::blank(),
            layout,
        }
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> Deref for Flash<SECTOR, PAGE, SECTORS> {
    type Target = FlashModel<SECTOR, PAGE, SECTORS>;

    fn deref(&self) -> &Self::Target {
        &self.chip
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> DerefMut for Flash<SECTOR, PAGE, SECTORS> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.chip
    }
}

/// As on the board.
type BoardFlash = Flash<4096, 256, 4>;
/// Twelve records per sector, so that a few stores wrap around the ring.
type SmallFlash = Flash<176, 64, 3>;
/// Twenty-six records in a sector of two blocks, and two such sectors.
type SmallDoubleFlash = Flash<176, 64, 4>;

const BOARD_SLOTS: u32 = Region::<<BoardFlash as Reboot>::Chip>::slots_in(Layout::Single, 1);

const SMALL_SLOTS: u32 = Region::<<SmallFlash as Reboot>::Chip>::slots_in(Layout::Single, 1);

type Values = BTreeMap<u16, u32>;

/// Calls with a new `Storage`, as after a reboot.
trait Reboot {
    type Chip: NorFlash;

    fn storage(&mut self) -> Storage<&mut Self::Chip>;

    fn store(&mut self, key: u16, value: u32) -> Result<Stored, StorageError> {
        block_on(self.storage().store(key, value, &Erase::always))
    }

    fn clear(&mut self) -> Result<(), StorageError> {
        block_on(self.storage().clear(&Erase::always))
    }

    fn prepare(&mut self) -> Result<(), StorageError> {
        prepare(&mut self.storage(), &Erase::always)
    }

    fn load(&mut self) -> (Values, Result<(), StorageError>) {
        let mut values = Values::new();
        let result = block_on(self.storage().load(&mut |key, value| {
            assert_eq!(values.insert(key, value), None, "key {key} was delivered twice");
        }));
        (values, result)
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> Reboot for Flash<SECTOR, PAGE, SECTORS> {
    type Chip = FlashModel<SECTOR, PAGE, SECTORS>;

    fn storage(&mut self) -> Storage<&mut Self::Chip> {
        Storage::with_layout(&mut self.chip, Self::REGION, self.layout)
    }
}

/// Erases ahead whatever can be.
fn prepare<F: NorFlash>(storage: &mut Storage<F>, may_erase: MayErase<'_>) -> Result<(), StorageError> {
    while block_on(storage.prepare(may_erase))? == Prepared::Partly {}
    Ok(())
}

/// A region whose active sector is full: its next store moves.
fn full<const SECTOR: usize, const PAGE: usize, const SECTORS: usize>(
    layout: Layout,
) -> (Flash<SECTOR, PAGE, SECTORS>, Values) {
    let mut flash = Flash::in_sectors(layout);
    let mut expected = Values::new();
    for number in 0..flash.storage().slots() {
        let key = u16::try_from(number % 3).unwrap();
        assert_eq!(flash.store(key, number), Ok(Stored::Written));
        expected.insert(key, number);
    }
    (flash, expected)
}

fn values(pairs: &[(u16, u32)]) -> Values {
    pairs.iter().copied().collect()
}

#[test]
fn every_value_is_loaded_after_a_reboot() {
    let mut flash = BoardFlash::blank();
    let stored = [
        (0, 0),
        (1, 1),
        (2, 1 << 31),
        (258, 0x1234_5678),
        (u16::MAX, u32::MAX),
    ];
    for (key, value) in stored {
        assert_eq!(flash.store(key, value), Ok(Stored::Written));
    }
    assert_eq!(flash.load(), (values(&stored), Ok(())));
    flash.assert_margins_are_untouched();
}

#[test]
fn values_are_loaded_in_the_order_of_their_stores() {
    let mut flash = SmallFlash::blank();
    // The ring has wrapped, and the latest record of each key was copied.
    for number in 0..200_u16 {
        let key = u16::from(number % 7 < 3) + u16::from(number % 5 == 0);
        flash.store(key, u32::from(number)).unwrap();
    }
    let mut order = Vec::new();
    block_on(flash.storage().load(&mut |_, value| order.push(value))).unwrap();
    assert!(order.len() == 3 && order.is_sorted(), "{order:?}");
}

#[test]
fn blank_flash_is_empty_and_undamaged() {
    let mut flash = BoardFlash::blank();
    assert_eq!(flash.load(), (Values::new(), Ok(())));
    assert_eq!(flash.clear(), Ok(()));
    assert_eq!(flash.operations(), 0, "nothing to write");
}

#[test]
fn unchanged_value_is_not_written() {
    let mut flash = BoardFlash::blank();
    for value in [2, u32::MAX, 1 << 31, 0] {
        assert_eq!(flash.store(7, value), Ok(Stored::Written));
        let operations = flash.operations();
        assert_eq!(flash.store(7, value), Ok(Stored::Unchanged));
        let mut storage = flash.storage();
        assert_eq!(
            block_on(storage.store(7, value, &Erase::always)),
            Ok(Stored::Unchanged)
        );
        assert_eq!(
            block_on(storage.store(7, value, &Erase::always)),
            Ok(Stored::Unchanged)
        );
        assert_eq!(flash.operations(), operations);
    }
}

#[test]
fn clear_erases_all_values_and_later_ones_are_kept() {
    let mut flash = SmallFlash::blank();
    for round in 1..20_u16 {
        flash.store(1, u32::from(round)).unwrap();
        flash.store(round, 5).unwrap();
        assert_eq!(flash.clear(), Ok(()));
        assert_eq!(flash.load(), (Values::new(), Ok(())));
        let operations = flash.operations();
        assert_eq!(flash.clear(), Ok(()));
        assert_eq!(flash.operations(), operations, "already clear");
    }
}

#[test]
fn unknown_keys_are_kept_when_the_ring_wraps() {
    let mut flash = SmallFlash::blank();
    for key in [40_000, 3, 2] {
        flash.store(key, u32::from(key)).unwrap();
    }
    // The next firmware version has key 2 and a new one.
    for round in 0..300_u16 {
        flash.store(2 + round % 2 * 5, u32::from(round)).unwrap();
    }
    assert!(flash.erases.iter().all(|&count| count > 5));
    assert_eq!(
        flash.load(),
        (values(&[(2, 298), (3, 3), (7, 299), (40_000, 40_000)]), Ok(()))
    );
}

#[test]
fn record_with_a_wider_key_is_skipped_and_kept() {
    let mut flash = SmallFlash::blank();
    let mut storage = flash.storage();
    let log = block_on(storage.start_sector(NextSector::First, &Erase::always)).unwrap();
    let foreign = StoredRecord::new(0x1_0002, &[9]);
    block_on(storage.region.write_record(log.sector, 0, &foreign)).unwrap();
    for round in 0..50_u16 {
        flash.store(2, u32::from(round)).unwrap();
    }
    assert_eq!(flash.load(), (values(&[(2, 49)]), Ok(())));
    assert_eq!(block_on(flash.storage().read(0x1_0002)), Ok(Some(9)));
}

#[test]
fn one_erase_of_each_block_per_338_or_680_stores_and_even_wear() {
    let rounds = 4;
    for (layout, slots, sectors) in [(Layout::Single, 338, 4), (Layout::Double, 680, 2)] {
        let mut flash = BoardFlash::in_sectors(layout);
        let mut storage = flash.storage();
        assert_eq!(storage.slots(), slots);
        let stores = rounds * sectors * slots;
        for number in 0..stores {
            assert_eq!(
                block_on(storage.store(1, number, &Erase::always)),
                Ok(Stored::Written)
            );
        }
        assert_eq!(flash.load(), (Values::from([(1, stores - 1)]), Ok(())));
        // The first sector was blank at its first use; the others are erased in any case.
        let blocks_of_first = 4 / sectors as usize;
        let expected = core::array::from_fn(|block| rounds - u32::from(block < blocks_of_first));
        assert_eq!(flash.erases, expected);
    }
}

#[test]
fn reads_of_a_store_and_of_a_sector_move_are_bounded() {
    let mut flash = BoardFlash::blank();
    let mut storage = flash.storage();
    for key in 0..250 {
        block_on(storage.store(key, 1, &Erase::always)).unwrap();
    }
    for value in 0..88_u16 {
        block_on(storage.store(249 - value, 2, &Erase::always)).unwrap();
    }
    let reads = storage.region.flash.reads;
    block_on(storage.store(0, 1, &Erase::always)).unwrap();
    assert_eq!(
        storage.region.flash.reads - reads,
        22,
        "one read for sixteen records"
    );

    let (reads, programs) = (storage.region.flash.reads, storage.region.flash.programs);
    assert_eq!(block_on(storage.store(0, 3, &Erase::always)), Ok(Stored::Written));
    let (reads, programs) = (
        storage.region.flash.reads - reads,
        storage.region.flash.programs - programs,
    );
    assert_eq!(
        storage.region.flash.erases.iter().sum::<u32>(),
        1,
        "this store moved to the next sector"
    );
    assert!(reads < 10_000, "{reads} reads");
    // One per record, one more if it crosses a page, two headers, and the retired mark of the old sector.
    assert!(programs < 250 + 11 + 4, "{programs} programs");

    let reads = flash.reads;
    assert_eq!(flash.load().0.len(), 250);
    assert!(flash.reads - reads < 10_000, "{} reads", flash.reads - reads);
}

#[test]
fn full_storage_keeps_its_values_and_can_change_them() {
    let mut flash = SmallFlash::blank();
    let slots = u16::try_from(SMALL_SLOTS).unwrap();
    let mut expected = Values::new();
    for key in 0..slots {
        assert_eq!(flash.store(key, 1), Ok(Stored::Written));
        expected.insert(key, 1);
    }
    let operations = flash.operations();
    assert_eq!(flash.store(slots, 1), Err(StorageError::Full));
    assert_eq!(
        flash.operations(),
        operations,
        "repeated attempts must not wear the flash"
    );
    assert_eq!(flash.load(), (expected.clone(), Ok(())));
    for key in 0..slots {
        assert_eq!(flash.store(key, 2), Ok(Stored::Written));
        expected.insert(key, 2);
    }
    assert_eq!(flash.load(), (expected, Ok(())));
}

#[test]
fn region_of_less_than_two_sectors_is_full() {
    let start = SmallFlash::REGION.start;
    for range in [
        0..0,
        start + 1..start + 2 * 176,
        start..start + 2 * 176 - 1,
        Range { start: 352, end: 176 },
    ] {
        let mut flash = SmallFlash::blank();
        let mut storage = Storage::new(&mut flash.chip, range);
        assert_eq!(
            block_on(storage.load(&mut |_, _| panic!("found a value"))),
            Ok(())
        );
        assert_eq!(
            block_on(storage.store(1, 1, &Erase::always)),
            Err(StorageError::Full)
        );
        assert_eq!(flash.operations(), 0);
    }
}

#[test]
fn yields_between_flash_operations_and_records() {
    fn polls(future: impl Future<Output = Result<(), StorageError>>) -> u64 {
        let mut future = pin!(future);
        let mut context = Context::from_waker(Waker::noop());
        let waits = iter::from_fn(|| future.as_mut().poll(&mut context).is_pending().then_some(()));
        waits.count() as u64 + 1
    }
    let mut flash = BoardFlash::blank();
    let mut storage = flash.storage();
    for number in 0..BOARD_SLOTS {
        block_on(storage.store(u16::try_from(number % 30).unwrap(), number, &Erase::always)).unwrap();
    }
    let records = u64::from(BOARD_SLOTS);
    assert!(polls(storage.load(&mut |_, _| {})) > records);

    let operations = storage.region.flash.operations();
    let turns = polls(async { storage.store(0, 25, &Erase::always).await.map(drop) });
    let operations_of_move = storage.region.flash.operations() - operations;
    assert!(operations_of_move > 30 && turns > records + 30, "{turns} turns");

    let operations = storage.region.flash.operations();
    let turns = polls(storage.clear(&Erase::always));
    assert!(
        turns > storage.region.flash.operations() - operations,
        "{turns} turns"
    );
}
