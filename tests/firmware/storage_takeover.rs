//! Parameters in the layout of earlier releases, sectors of one unit of erase, after an update to this firmware.

use std::collections::BTreeMap;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
use rover_battmon::flash_map;
use rover_battmon::parameter::{Access, ParameterId, Range};
use rover_battmon::sim::SimulatedFlash;
use rover_battmon::storage::{Erase, Storage};

use crate::bench::{Bench, DIVIDER_CODE, MILLISECOND, PARAMETER_BYTES, PARAMETER_OFFSET, SECOND, value_of};
use crate::runs::flash_cuts::Leader;
use crate::support::frames::texts_of;
use crate::support::requests::{param_read_by_name, param_set};
use emulator::FlashCut;

/// What a release wrote first to its first sector: the header, its retired mark, and the capacity of 4200 mAh.
const OF_A_RELEASE: [u8; 28] = [
    b'P', b'A', b'R', b'1', 0x01, 0, 0, 0, 0xcd, 0x0d, 0xc3, 0xb7, 0xff, 0xff, 0xff, 0xff, 0x44, 0, 0, 0, 0,
    0x40, 0x83, 0x45, 0x29, 0xe0, 0x77, 0xae,
];

/// Set in the earlier release.
const SET: [(&str, f32); 4] = [
    ("BATT_CAPACITY", 4200.0),
    ("BATT_VOLT_MULT", 4.1),
    ("SR0_EXTRA1", 5.0),
    ("BATT9_LOW_VOLT", 6.5),
];

/// The parameters' flash as an earlier release left it.
fn earlier_flash() -> Vec<u8> {
    let mut flash = SimulatedFlash::open(None).expect("it needs no file");
    let mut storage = Storage::new(flash.clone(), flash_map::PARAMETERS);
    let mut image = vec![0; PARAMETER_BYTES];
    block_on(async {
        for (name, value) in SET {
            let stored = storage
                .store(id(name).key(), value.to_bits(), &Erase::always)
                .await;
            stored.expect("there is room");
        }
        let read = flash.read(flash_map::PARAMETERS.start, &mut image).await;
        read.expect("it is inside");
    });
    assert_eq!(image[..OF_A_RELEASE.len()], OF_A_RELEASE);
    image
}

fn id(name: &str) -> ParameterId {
    ParameterId::from_name(name.as_bytes()).expect("it exists")
}

fn read(bench: &mut Bench, name: &str) -> Option<f32> {
    value_of(&bench.ask(&param_read_by_name(name)), name)
}

/// What the board's flash holds, by name.
fn stored(bench: &Bench) -> BTreeMap<String, f32> {
    let mut flash = SimulatedFlash::open(None).expect("it needs no file");
    let mut values = BTreeMap::new();
    block_on(async {
        let content = bench.read_flash(PARAMETER_OFFSET, PARAMETER_BYTES);
        let written = flash.write(flash_map::PARAMETERS.start, &content).await;
        written.expect("it is inside");
        let mut storage = Storage::of_double_sectors(flash, flash_map::PARAMETERS);
        let mut found = |key, bits| {
            let id = ParameterId::from_key(key).expect("of this firmware");
            values.insert(id.name().as_str().to_owned(), f32::from_bits(bits));
        };
        storage.load(&mut found).await.expect("it is undamaged");
    });
    values
}

/// A valid value of a setting other than its default.
fn changed(id: ParameterId) -> Option<f32> {
    let row = id.row();
    let candidates: Vec<f32> = match row.range {
        Range::Between(lowest, highest) => vec![lowest, highest],
        Range::OneOf(values) => values.iter().map(|(value, _)| *value as f32).collect(),
        Range::Bits(bits) => bits.iter().map(|(bit, _)| (1 << bit) as f32).collect(),
    };
    let other = candidates.into_iter().find(|value| *value != id.default_value());
    other.filter(|_| row.access == Access::Setting)
}

#[test]
fn parameters_of_an_earlier_release_are_kept_and_then_352_more() {
    let mut bench = Bench::power_up_with_parameters(DIVIDER_CODE, &earlier_flash());
    bench.run_for(SECOND);
    for (name, value) in SET {
        assert_eq!(read(&mut bench, name), Some(value), "{name}");
    }

    // Of the packs: the vehicle's would change the link.
    let mut expected: BTreeMap<_, _> = SET.map(|(name, value)| (name.to_owned(), value)).into();
    let packs = ParameterId::all().filter(|id| matches!(id, ParameterId::Battery(..)));
    for (id, value) in packs.filter_map(|id| Some((id, changed(id)?))) {
        let name = id.name().as_str().to_owned();
        bench.send(&param_set(&name, value));
        bench.run_for(20 * MILLISECOND);
        expected.insert(name, value);
    }
    assert!(expected.len() >= 352, "{}", expected.len());
    bench.run_for(2 * SECOND);
    bench.power_cycle();
    bench.forget_sent();
    bench.run_for(SECOND);
    let said = texts_of(&bench.frames());
    assert!(!said.iter().any(|text| text.contains("storage")), "{said:?}");
    assert_eq!(stored(&bench), expected);
    for name in ["BATT_CAPACITY", "SR0_EXTRA1", "BATT5_LOW_VOLT", "BATT9_CRT_VOLT"] {
        assert_eq!(read(&mut bench, name), Some(expected[name]), "{name}");
    }
}

/// Cuts the power in each operation of the takeover, from the start of the board on.
fn cut_in_every_operation(cut: FlashCut) {
    const NEW: (&str, f32) = ("BATT_LOW_VOLT", 6.5);
    let image = earlier_flash();
    let assert_kept = |mut bench: Bench, at: &str| {
        let is_cut = !bench.is_powered();
        bench.power_cycle();
        bench.forget_sent();
        bench.run_for(500 * MILLISECOND);
        let mut found = stored(&bench);
        let new = found.remove(NEW.0);
        assert_eq!(
            found,
            SET.map(|(name, value)| (name.to_owned(), value)).into(),
            "{at}"
        );
        assert!(
            new == Some(NEW.1) || is_cut && new.is_none(),
            "{at}: {} is {new:?}",
            NEW.0
        );
        assert_eq!(read(&mut bench, "BATT_VOLT_MULT"), Some(4.1), "{at}");
    };
    let after_cut = |bench, operation| assert_kept(bench, &format!("operation {operation}, {cut:?}"));
    let mut leader = Leader::new(Bench::power_up_with_parameters(DIVIDER_CODE, &image), cut, 1..);
    for _ in 0..10 {
        leader.step(|bench| bench.run_for(50 * MILLISECOND), after_cut);
    }
    let set = |bench: &mut Bench| {
        bench.send(&param_set(NEW.0, NEW.1));
        bench.run_for(300 * MILLISECOND);
    };
    leader.step(set, after_cut);
    println!("{} operations cut ({cut:?})", leader.begun());
    assert!(leader.begun() >= 10, "it was taken over");
    assert_kept(leader.bench, &format!("none, {cut:?}"));
}

#[test]
fn a_cut_before_an_operation_of_the_takeover_loses_nothing() {
    cut_in_every_operation(FlashCut::Before);
}

#[test]
fn a_cut_that_leaves_a_prefix_of_an_operation_of_the_takeover_loses_nothing() {
    cut_in_every_operation(FlashCut::Prefix);
}

#[test]
fn a_cut_that_leaves_scattered_bits_of_an_operation_of_the_takeover_loses_nothing() {
    cut_in_every_operation(FlashCut::ScatteredBits);
}

#[test]
fn a_cut_after_an_operation_of_the_takeover_loses_nothing() {
    cut_in_every_operation(FlashCut::After);
}
