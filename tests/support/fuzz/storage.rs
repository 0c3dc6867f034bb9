//! The storage in flash: what was stored is there, and nothing that never was, through restarts, power cuts and damage.

use std::collections::{BTreeMap, BTreeSet};
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::NorFlash;
use rover_battmon::memory::flash_map;
use rover_battmon::memory::storage::{Erase, Storage};
use rover_battmon_tools::sim::SimulatedFlash;

use super::Input;

/// Few, so that they meet.
const KEYS: u16 = 24;

/// What may be in flash: after a power cut a key has one of two values, or none.
#[derive(Default)]
struct Expected {
    values: BTreeMap<u16, BTreeSet<Option<u32>>>,
    ever: BTreeSet<(u16, u32)>,
    is_damaged: bool,
}

impl Expected {
    fn now(&mut self, key: u16, value: u32) {
        self.values.insert(key, BTreeSet::from([Some(value)]));
        self.ever.insert((key, value));
    }

    fn perhaps(&mut self, key: u16, value: u32) {
        let values = self.values.entry(key).or_insert_with(|| BTreeSet::from([None]));
        values.insert(Some(value));
        self.ever.insert((key, value));
    }

    fn check(&mut self, storage: &mut Storage<SimulatedFlash>) {
        let mut found = BTreeMap::new();
        let result = block_on(storage.load(&mut |key, value| {
            assert!(found.insert(key, value).is_none(), "{key} was delivered twice");
        }));
        for (key, value) in &found {
            let was_stored = self.ever.contains(&(*key, *value));
            assert!(was_stored, "{key} = {value} was never stored");
        }
        if self.is_damaged {
            return;
        }
        assert_eq!(result, Ok(()));
        for (key, values) in &mut self.values {
            let value = found.get(key).copied();
            assert!(values.contains(&value), "{key} = {value:?} of {values:?}");
            *values = BTreeSet::from([value]);
        }
    }
}

/// Steps: a byte says what happens, the next ones how.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let mut flash = SimulatedFlash::blank();
    let mut storage = Storage::new(flash.clone(), flash_map::SIGNING);
    let mut expected = Expected::default();
    while !input.is_empty() {
        let step = input.byte();
        let key = u16::from(input.byte()) % KEYS;
        match step % 16 {
            0..=7 => {
                let value = u32::from(input.u16());
                match block_on(storage.store(key, value, &Erase::always)) {
                    Ok(_) => expected.now(key, value),
                    Err(error) => assert!(expected.is_damaged, "{error:?}"),
                }
            }
            8 => match block_on(storage.clear(&Erase::always)) {
                Ok(()) => expected
                    .values
                    .values_mut()
                    .for_each(|values| *values = [None].into()),
                Err(error) => assert!(expected.is_damaged, "{error:?}"),
            },
            9..=11 => {
                let (value, polls) = (u32::from(input.u16()), usize::from(input.byte()));
                expected.perhaps(key, value);
                let mut store = pin!(storage.store(key, value, &Erase::always));
                let mut context = Context::from_waker(Waker::noop());
                let _ = (0..polls).any(|_| matches!(store.as_mut().poll(&mut context), Poll::Ready(_)));
            }
            12..=14 => {
                storage = Storage::new(flash.clone(), flash_map::SIGNING);
                expected.check(&mut storage);
            }
            _ => {
                let range = flash_map::SIGNING;
                let at = range.start + u32::from(input.u16()) % (range.end - range.start);
                block_on(flash.write(at, &[!(1 << (key % 8))])).expect("a sound flash");
                expected.is_damaged = true;
                storage = Storage::new(flash.clone(), range);
            }
        }
    }
    expected.check(&mut storage);
}
