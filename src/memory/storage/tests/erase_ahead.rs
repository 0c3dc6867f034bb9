//! Sectors are erased ahead of need, once, and never where that is forbidden.

use core::cell::Cell;

use proptest::prelude::*;

use super::*;

fn forbidden() -> Erase {
    Erase::Forbidden
}

fn erases(chip: &<SmallFlash as Reboot>::Chip) -> u32 {
    chip.erases.iter().sum()
}

#[test]
fn store_that_needs_a_forbidden_erase_changes_nothing_and_works_later() {
    let (mut flash, mut expected): (SmallFlash, _) = full(Layout::Single);
    let before = flash.operations();
    let mut storage = flash.storage();
    for _ in 0..3 {
        assert_eq!(
            block_on(storage.store(0, 99, &forbidden)),
            Err(StorageError::NoErasedSpace)
        );
        assert_eq!(
            block_on(storage.clear(&forbidden)),
            Err(StorageError::NoErasedSpace)
        );
        assert_eq!(
            block_on(storage.start_over(&forbidden)),
            Err(StorageError::NoErasedSpace)
        );
        assert_eq!(prepare(&mut storage, &forbidden), Ok(()));
    }
    assert_eq!(storage.region.flash.operations(), before);
    assert_eq!(
        block_on(storage.store(0, 99, &Erase::always)),
        Ok(Stored::Written)
    );
    expected.insert(0, 99);
    assert_eq!(flash.load(), (expected, Ok(())));
}

#[test]
fn prepared_sector_takes_a_move_without_an_erase_and_then_there_is_none() {
    let (mut flash, mut expected): (SmallFlash, _) = full(Layout::Single);
    flash.prepare().unwrap();
    let before = erases(&flash);
    let mut storage = flash.storage();
    // Three records are moved, one of them a second time.
    for value in 100..100 + SMALL_SLOTS - 2 {
        assert_eq!(block_on(storage.store(0, value, &forbidden)), Ok(Stored::Written));
        expected.insert(0, value);
    }
    assert_eq!(
        block_on(storage.store(0, 1, &forbidden)),
        Err(StorageError::NoErasedSpace)
    );
    assert_eq!(erases(storage.region.flash), before);
    assert_eq!(flash.load(), (expected, Ok(())));
    flash.assert_margins_are_untouched();
}

#[test]
fn prepared_sector_takes_a_clear_without_an_erase() {
    type Clear = fn(&mut Storage<&mut <SmallFlash as Reboot>::Chip>) -> Result<(), StorageError>;
    let clears: [Clear; 2] = [
        |storage| block_on(storage.clear(&forbidden)),
        |storage| block_on(storage.start_over(&forbidden)),
    ];
    for clear in clears {
        let (mut flash, _): (SmallFlash, _) = full(Layout::Single);
        flash.prepare().unwrap();
        let before = erases(&flash);
        assert_eq!(clear(&mut flash.storage()), Ok(()));
        assert_eq!(erases(&flash), before);
        assert_eq!(flash.load(), (Values::new(), Ok(())));
    }
}

#[test]
fn preparing_at_every_start_and_after_every_store_wears_no_more() {
    let mut flash = BoardFlash::blank();
    flash.prepare().unwrap();
    assert_eq!(flash.operations(), 0, "nothing was stored yet");
    let rounds = 2;
    for number in 0..rounds * 4 * BOARD_SLOTS {
        let mut storage = flash.storage();
        block_on(storage.store(1, number, &Erase::always)).unwrap();
        for _ in 0..2 {
            prepare(&mut storage, &Erase::always).unwrap();
        }
        // As after a restart.
        flash.prepare().unwrap();
    }
    // One more than without, of the sector that is erased ahead now.
    assert_eq!(flash.erases, [rounds; 4]);
}

#[test]
fn sector_that_reads_as_blank_after_an_interrupted_erase_is_erased_again() {
    let (mut flash, _): (SmallFlash, _) = full(Layout::Single);
    flash.prepare().unwrap();
    assert_eq!(flash.erases, [0, 1, 0]);
    // The erase was interrupted, and so the mark behind it was not written.
    flash.region()[2 * 176 - 4..2 * 176].fill(0xFF);
    flash.prepare().unwrap();
    assert_eq!(flash.erases, [0, 2, 0]);
    // Flipped bits of one that is marked.
    for bit in 0..8 * 176 {
        let mut spoiled = flash.clone();
        spoiled.region()[176 + bit / 8] ^= 1 << (bit % 8);
        spoiled.prepare().unwrap();
        assert_eq!(spoiled.erases, [0, 3, 0], "bit {bit}");
    }
}

#[test]
fn permission_is_asked_immediately_before_each_erase() {
    let (flash, expected): (SmallFlash, _) = full(Layout::Single);
    // The vehicle is armed after the question was answered this often.
    for answers in 0..3 {
        let mut flash = flash.clone();
        let asked = Cell::new(0);
        let may_erase = || {
            asked.set(asked.get() + 1);
            if asked.get() > answers {
                Erase::Forbidden
            } else {
                Erase::Allowed
            }
        };
        assert_eq!(prepare(&mut flash.storage(), &may_erase), Ok(()));
        assert_eq!(erases(&flash), u32::from(answers >= 2), "{answers}");
        assert_eq!(flash.load(), (expected.clone(), Ok(())));
    }
}

#[test]
fn armed_after_the_turn_of_others_is_not_erased() {
    let (mut flash, _): (SmallFlash, _) = full(Layout::Single);
    let armed = Cell::new(Erase::Allowed);
    let may_erase = || armed.get();
    let mut storage = flash.storage();
    let mut store = Box::pin(storage.store(0, 99, &may_erase));
    let mut context = Context::from_waker(Waker::noop());
    let mut turns = 0;
    let result = loop {
        // Others have their turn before the erase; one of them arms.
        match store.as_mut().poll(&mut context) {
            core::task::Poll::Ready(result) => break result,
            core::task::Poll::Pending => armed.set(Erase::Forbidden),
        }
        turns += 1;
    };
    drop(store);
    assert!(turns > 0);
    assert_eq!(result, Err(StorageError::NoErasedSpace));
    assert_eq!(erases(&flash), 0);
}

#[test]
fn sector_that_can_not_be_erased_is_tried_once_ahead_and_again_when_it_is_needed() {
    let (mut flash, mut expected): (SmallFlash, _) = full(Layout::Single);
    flash.stuck = Some((2 * 176 + 40, 1));
    let mut storage = flash.storage();
    let failure = Err(StorageError::Flash(FlashFault::NotVerified));
    assert_eq!(prepare(&mut storage, &Erase::always), failure);
    for _ in 0..3 {
        assert_eq!(prepare(&mut storage, &Erase::always), Ok(()));
    }
    assert_eq!(storage.region.flash.erases, [0, 1, 0]);
    assert_eq!(block_on(storage.store(0, 99, &Erase::always)).map(drop), failure);
    storage.region.flash.stuck = None;
    assert_eq!(
        block_on(storage.store(0, 99, &Erase::always)),
        Ok(Stored::Written)
    );
    expected.insert(0, 99);
    assert_eq!(flash.load(), (expected, Ok(())));
}

#[derive(Clone, Debug)]
enum Step {
    Store(u16, u32, Erase),
    Clear(Erase),
    Prepare(Erase),
    Restart,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let erase = || prop_oneof![1 => Just(Erase::Allowed), 3 => Just(Erase::Forbidden)];
    let step = prop_oneof![
        20 => (0..6_u16, any::<u32>(), erase()).prop_map(|(key, value, erase)| Step::Store(key, value, erase)),
        1 => erase().prop_map(Step::Clear),
        3 => erase().prop_map(Step::Prepare),
        1 => Just(Step::Restart),
    ];
    prop::collection::vec(step, 0..200)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn nothing_is_erased_while_that_is_forbidden_and_no_value_is_lost(steps in steps()) {
        let mut flash = SmallFlash::blank();
        let mut expected = Values::new();
        let mut storage = flash.storage();
        for step in steps {
            let before = erases(storage.region.flash);
            let permission = match step {
                Step::Store(key, value, erase) => {
                    match block_on(storage.store(key, value, &|| erase)) {
                        Ok(_) => drop(expected.insert(key, value)),
                        Err(error) => prop_assert_eq!((error, erase), (StorageError::NoErasedSpace, Erase::Forbidden)),
                    }
                    erase
                }
                Step::Clear(erase) => {
                    match block_on(storage.clear(&|| erase)) {
                        Ok(()) => expected.clear(),
                        Err(error) => prop_assert_eq!((error, erase), (StorageError::NoErasedSpace, Erase::Forbidden)),
                    }
                    erase
                }
                Step::Prepare(erase) => {
                    prop_assert_eq!(prepare(&mut storage, &|| erase), Ok(()));
                    erase
                }
                Step::Restart => {
                    storage = Storage::new(storage.records.region.flash, SmallFlash::REGION);
                    Erase::Forbidden
                }
            };
            prop_assert!(permission == Erase::Allowed || erases(storage.region.flash) == before);
        }
        prop_assert_eq!(flash.load(), (expected, Ok(())));
    }
}
