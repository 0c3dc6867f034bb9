//! Power cuts, failing operations, dropped futures: the old value or the new one.

use proptest::prelude::*;

use super::*;

#[derive(Clone, Copy, Debug)]
enum Step {
    Store(u16, u32),
    Clear,
    ClearBut(u16),
    Prepare,
}

impl Step {
    fn run<F: NorFlash>(self, storage: &mut Storage<F>) -> Result<(), StorageError> {
        match self {
            Self::Store(key, value) => block_on(storage.store(key, value, &Erase::always)).map(drop),
            Self::Clear => block_on(storage.clear(&Erase::always)),
            Self::ClearBut(key) => block_on(storage.clear_but(key, &Erase::always)),
            Self::Prepare => prepare(storage, &Erase::always),
        }
    }

    fn apply(self, values: &mut Values) {
        match self {
            Self::Store(key, value) => {
                values.insert(key, value);
            }
            Self::Clear => values.clear(),
            Self::ClearBut(kept) => values.retain(|key, _| *key == kept),
            Self::Prepare => {}
        }
    }
}

/// Few keys and values, so that some stores change nothing.
fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        30 => (0..8_u16, 0..6_u8).prop_map(|(key, value)| Step::Store(key, u32::from(value))),
        3 => (any::<u16>(), any::<u32>()).prop_map(|(key, bits)| Step::Store(key % 10, bits)),
        1 => Just(Step::Clear),
        1 => (0..8_u16).prop_map(Step::ClearBut),
        4 => Just(Step::Prepare),
    ]
}

/// Runs `steps` on one `Storage` until a power cut, after which the interrupted step is either done or not, and all
/// previous ones are done.
///
/// Returns the number of steps run, including the interrupted one.
fn run_until_power_cut<const SECTOR: usize, const PAGE: usize, const SECTORS: usize>(
    flash: &mut Flash<SECTOR, PAGE, SECTORS>,
    steps: &[Step],
    values: &mut Values,
) -> usize {
    let mut storage = flash.storage();
    for (index, step) in steps.iter().enumerate() {
        let before = values.clone();
        step.apply(values);
        if step.run(&mut storage).is_ok() {
            continue;
        }
        assert!(
            storage.region.flash.is_powered_off(),
            "{step:?} failed with power on"
        );
        storage.region.flash.power_up();
        let (found, result) = flash.load();
        assert_eq!(result, Ok(()), "a power cut is not damage, in {step:?}");
        assert!(
            found == before || found == *values,
            "{step:?}: {before:?} became {found:?}"
        );
        *values = found;
        return index + 1;
    }
    steps.len()
}

/// Cuts power in every operation of `steps`, in `ways` ways each, once more soon after, and then runs the remaining
/// steps.
fn cut_everywhere<const SECTOR: usize, const PAGE: usize, const SECTORS: usize>(
    prepared: &Flash<SECTOR, PAGE, SECTORS>,
    steps: &[Step],
    ways: u64,
) {
    let mut flash = prepared.clone();
    let stored_before = flash.load().0;
    let mut values = stored_before.clone();
    run_until_power_cut(&mut flash, steps, &mut values);
    let operations = flash.operations() - prepared.operations();
    assert!(operations > 0 && !flash.is_powered_off());

    for (operation, way) in (0..operations).flat_map(|operation| (0..ways).map(move |way| (operation, way))) {
        let seed = operation * ways + way;
        let mut flash = prepared.clone();
        let mut values = stored_before.clone();
        flash.cut_power_after(operation, seed);
        let mut done = run_until_power_cut(&mut flash, steps, &mut values);
        flash.cut_power_after(seed % 17, !seed);
        done += run_until_power_cut(&mut flash, &steps[done..], &mut values);
        flash.power_up();
        done += run_until_power_cut(&mut flash, &steps[done..], &mut values);
        assert_eq!(done, steps.len());
        assert_eq!(flash.load(), (values, Ok(())));
        flash.assert_margins_are_untouched();
    }
}

/// Stores of alternating keys and a constant one, with clears among them: sector moves happen early, late and at a clear.
fn stores_and_clears(number: u16) -> Vec<Step> {
    let step = |place| match place {
        20 => Step::Clear,
        21 => Step::Store(9, u32::MAX),
        // Once with the value, and once more with nothing else.
        30 | 31 => Step::ClearBut(4),
        _ => Step::Store(place % 5, u32::from(place)),
    };
    (0..number).map(step).collect()
}

/// Cuts power everywhere, in `ways` ways each: without, and with each sector erased ahead.
fn cut_with_and_without_erasing_ahead<const SECTOR: usize, const PAGE: usize, const SECTORS: usize>(
    blank: &Flash<SECTOR, PAGE, SECTORS>,
    steps: &[Step],
    [ways, ways_ahead]: [u64; 2],
) {
    cut_everywhere(blank, steps, ways);
    let ahead: Vec<Step> = steps.iter().flat_map(|step| [*step, Step::Prepare]).collect();
    cut_everywhere(blank, &ahead, ways_ahead);
}

#[test]
fn power_cut_in_any_operation_leaves_old_or_new_value() {
    cut_with_and_without_erasing_ahead(&SmallFlash::blank(), &stores_and_clears(45), [200, 100]);
    let double = SmallDoubleFlash::in_sectors(Layout::Double);
    cut_with_and_without_erasing_ahead(&double, &stores_and_clears(90), [100, 60]);
}

#[test]
fn power_cut_during_a_move_of_the_boards_sectors() {
    let mut flash = BoardFlash::blank();
    let mut storage = flash.storage();
    for number in 0..BOARD_SLOTS - 3 {
        block_on(storage.store(u16::try_from(number % 30).unwrap(), number, &Erase::always)).unwrap();
    }
    let stores = (0..6).map(|key| Step::Store(key, 25));
    cut_everywhere(&flash, &stores.clone().collect::<Vec<_>>(), 20);
    let prepared: Vec<_> = iter::once(Step::Prepare)
        .chain(stores)
        .chain([Step::Prepare])
        .collect();
    cut_everywhere(&flash, &prepared, 20);
}

#[test]
fn failed_operation_or_one_without_effect_is_an_error_and_leaves_old_or_new_value() {
    let faults = [FlashFault::Other, FlashFault::NotVerified];
    for (operation, fault) in (0..60).flat_map(|operation| faults.map(|fault| (operation, fault))) {
        let mut flash = SmallFlash::blank();
        let mut expected = Values::new();
        match fault {
            FlashFault::NotVerified => flash.slip_after(operation),
            _ => flash.refuse_after(operation),
        }
        let mut storage = flash.storage();
        let mut failures = 0;
        for number in 0..60_u16 {
            let step = Step::Store(number % 4, u32::from(number));
            if let Err(error) = step.run(&mut storage) {
                assert_eq!(error, StorageError::Flash(fault));
                failures += 1;
                step.run(&mut storage).unwrap();
            }
            step.apply(&mut expected);
            let mut copy = Flash {
                chip: storage.region.flash.clone(),
                layout: Layout::Single,
            };
            let found = copy.load();
            assert_eq!(
                found,
                (expected.clone(), Ok(())),
                "{fault:?} of {operation}, {step:?}"
            );
        }
        assert!(
            failures == 1 || fault == FlashFault::NotVerified,
            "{failures} of {operation}"
        );
    }
}

#[test]
fn stuck_bit_is_an_error_without_loss() {
    for bit in 0..176 * 8 {
        let mut flash = SmallFlash::blank();
        flash.stuck = Some((2 * 176 + bit / 8, 1 << (bit % 8)));
        let mut expected = Values::new();
        let mut failures = 0;
        let mut storage = flash.storage();
        for number in 0..30_u16 {
            let step = Step::Store(number % 3, u32::from(number));
            match step.run(&mut storage) {
                Ok(()) => step.apply(&mut expected),
                Err(error) => {
                    assert_eq!(error, StorageError::Flash(FlashFault::NotVerified));
                    failures += 1;
                }
            }
        }
        assert!(failures > 0, "the second sector is unusable");
        assert_eq!(flash.load(), (expected, Ok(())));
    }
}

#[test]
fn dropped_store_leaves_old_or_new_value() {
    let mut flash = SmallFlash::blank();
    let mut expected = Values::new();
    let mut storage = flash.storage();
    let mut dropped = 0;
    for number in 0..800_u16 {
        let (key, value) = (number % 4, u32::from(number));
        let mut context = Context::from_waker(Waker::noop());
        let finished = {
            let mut future = pin!(storage.store(key, value, &Erase::always));
            (0..number % 37).any(|_| future.as_mut().poll(&mut context).is_ready())
        };
        let mut stored = None;
        block_on(storage.load(&mut |found, value| {
            if found == key {
                stored = Some(value);
            }
        }))
        .unwrap();
        assert!(stored == Some(value) || (!finished && stored == expected.get(&key).copied()));
        expected.extend(stored.map(|bits| (key, bits)));
        dropped += u32::from(!finished);
    }
    assert!(dropped > 50 && flash.erases.iter().all(|&count| count > 1));
    assert_eq!(flash.load(), (expected, Ok(())));
}

/// Cuts power everywhere in `steps`, behind the ones before.
fn cut_behind<const SECTOR: usize, const PAGE: usize, const SECTORS: usize>(
    mut flash: Flash<SECTOR, PAGE, SECTORS>,
    before: &[Step],
    steps: &[Step],
) {
    run_until_power_cut(&mut flash, before, &mut Values::new());
    cut_everywhere(&flash, steps, 8);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn arbitrary_stores_survive_power_cuts(
        before in prop::collection::vec(step(), 0..50),
        mut steps in prop::collection::vec(step(), 0..40),
    ) {
        // All stores may be of unchanged values.
        steps.push(Step::Store(99, 1));
        cut_behind(SmallFlash::blank(), &before, &steps);
        cut_behind(SmallDoubleFlash::in_sectors(Layout::Double), &before, &steps);
    }
}
