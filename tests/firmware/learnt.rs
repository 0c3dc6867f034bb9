//! What is learnt of a pack, in the board's flash.

use embassy_futures::block_on;
use rover_battmon::autopilot::PackIdentity;
use rover_battmon::memory::flash_map;
use rover_battmon::memory::storage::{Erase, Storage};
use rover_battmon::pack::Pack;
use rover_battmon_tools::sim::SimulatedFlash;

use emulator::LogLevel;
use support::commands::PREFLIGHT_STORAGE;
use support::frames::{STATUSTEXT, last_of, of_message, texts_of};
use support::learnt_record::learnt_words;
use support::requests::{arm, command_long, param_set, reboot};
use workbench::bench::{
    Bench, DIVIDER_CODE, LEARNT_BYTES, LEARNT_OFFSET, MILLISECOND, SAVED_US, SECOND, SECTOR_BYTES,
};

/// What the converter makes of 4.2 V: of two cells that are over-discharged, or of one that is full.
const CODE_OF_4_2_V: u16 = 1320;

/// Records that a sector takes.
pub const SLOTS: u32 = 28;

pub const FIRST: PackIdentity = PackIdentity {
    pack: Pack::First,
    serial_number: None,
};
pub const FIRST_7: PackIdentity = PackIdentity {
    pack: Pack::First,
    serial_number: Some(7),
};

/// The flash after these capacities were learnt, one after the other.
pub fn flash_with(learnt: impl IntoIterator<Item = (PackIdentity, f32)>) -> Vec<u8> {
    let flash = SimulatedFlash::blank();
    let mut storage = Storage::new(flash.clone(), flash_map::LEARNT);
    block_on(async {
        for (identity, capacity_mah) in learnt {
            let value = learnt_words(identity.serial_number, capacity_mah);
            let stored = storage
                .store_replacing(identity.key(), value, &|_| true, &Erase::always)
                .await;
            stored.expect("a sound flash");
        }
        storage.prepare(&Erase::always).await.expect("a sound flash");
    });
    flash.content(flash_map::LEARNT)
}

/// A full sector of records of two packs: the next write moves both to the next sector.
pub fn full_sector() -> impl Iterator<Item = (PackIdentity, f32)> {
    let earlier = (2..SLOTS).map(|number| (FIRST, 2900.0 + number as f32));
    earlier.chain([(FIRST, 2950.0), (FIRST_7, 1000.0)])
}

fn board_with(learnt: impl IntoIterator<Item = (PackIdentity, f32)>) -> Bench {
    let mut bench = Bench::power_up_with_flash(DIVIDER_CODE, LEARNT_OFFSET, &flash_with(learnt));
    bench.run_for(SECOND);
    bench
}

fn capacity_mah(bench: &mut Bench) -> f32 {
    bench.parameter("BATT_LRN_CAP")
}

#[test]
fn it_is_read_by_the_second_sampling_tick_and_survives_power_cycles_and_a_parameter_reset() {
    let mut bench = board_with([(FIRST, 2950.0)]);
    let loaded = bench.logged(LogLevel::Info, "battery 1: learnt data are stored: true");
    assert_eq!(loaded.len(), 1);
    // Each tick converts 16 times, as the start does to find out whether there is a radio.
    let ticks: Vec<u64> = bench
        .take_adc_record()
        .chunks(16)
        .skip(1)
        .map(|burst| burst[0].start / 125)
        .collect();
    assert!(
        loaded[0].0 < ticks[1],
        "{loaded:?}, second tick at {} us",
        ticks[1]
    );
    println!("read at {} us, first tick at {} us", loaded[0].0, ticks[0]);

    assert_eq!(capacity_mah(&mut bench), 2950.0);
    assert_eq!(bench.parameter("BATT_LRN_RES"), 40.0);
    bench.assert_untroubled();
    bench.power_cycle();
    bench.run_for(SECOND);
    assert_eq!(capacity_mah(&mut bench), 2950.0);
    bench.ask(&command_long(PREFLIGHT_STORAGE, 2.0));
    bench.run_for(SAVED_US);
    assert_eq!(capacity_mah(&mut bench), 2950.0);
    bench.reboot();
    assert_eq!(capacity_mah(&mut bench), 2950.0);
    let is_learnt = |offset| (LEARNT_OFFSET..LEARNT_OFFSET + LEARNT_BYTES as u32).contains(&offset);
    let writes = bench
        .flash_operations()
        .iter()
        .filter(|operation| is_learnt(operation.offset))
        .count();
    assert_eq!(writes, 0, "nothing was learnt");
}

#[test]
fn it_is_written_before_a_restart() {
    let mut bench = board_with(full_sector());
    let now_us = bench.time_us();
    let resets = bench.resets().len();
    bench.uart_send(0, now_us, &param_set("BATT_LRN_ERASE", 1.0));
    bench.uart_send(0, now_us + MILLISECOND, &reboot());
    assert!(bench.run_until(4 * SECOND, |board| board.resets().len() > resets));
    bench.run_for(SECOND);
    assert_eq!(capacity_mah(&mut bench), 0.0);
}

#[test]
fn damaged_region_starts_anew_and_works_again() {
    for content in [vec![0; LEARNT_BYTES], vec![0xa5; LEARNT_BYTES]] {
        let mut bench = Bench::power_up_with_flash(DIVIDER_CODE, LEARNT_OFFSET, &content);
        bench.run_for(SECOND);
        assert_eq!(capacity_mah(&mut bench), 0.0);
        bench.set("BATT_LRN_ERASE", 1.0);
        bench.run_for(SAVED_US);
        bench.assert_untroubled();
        let written = bench.read_flash(LEARNT_OFFSET, LEARNT_BYTES);
        assert_ne!(written, content, "a record was stored");
    }
}

#[test]
fn worn_out_region_is_announced_once_and_nothing_else_suffers() {
    let mut bench = board_with(full_sector());
    for sector in 0..LEARNT_BYTES / SECTOR_BYTES {
        bench.wear_out_sector(LEARNT_OFFSET + (sector * SECTOR_BYTES) as u32);
    }
    bench.write_flash(LEARNT_OFFSET + SECTOR_BYTES as u32, &[0; 3 * SECTOR_BYTES]);
    let from_us = bench.time_us();
    bench.set("BATT_LRN_ERASE", 1.0);
    bench.set("BATT_LOW_VOLT", 6.5);
    bench.run_for(10 * SECOND);
    let frames = bench.frames_since(from_us);
    let texts = of_message(&frames, STATUSTEXT)
        .into_iter()
        .map(|frame| frame.text(1, 50));
    let announced = texts
        .filter(|text| text == "Learnt battery data not saved: flash worn out?")
        .count();
    assert_eq!(announced, 1);
    assert!(bench.resets().is_empty());
    bench.power_cycle();
    bench.run_for(SECOND);
    assert_eq!(bench.parameter("BATT_LOW_VOLT"), 6.5);
    assert_eq!(capacity_mah(&mut bench), 2950.0, "it was not erased");
}

#[test]
fn an_empty_pack_with_the_cells_in_flash_is_no_full_smaller_one() {
    let content = flash_with([(FIRST, 2950.0)]);
    let mut bench = Bench::power_up_with_flash(CODE_OF_4_2_V, LEARNT_OFFSET, &content);
    let unclear = "Arm: Battery 1 cells unclear: set BATT_CELLS";
    let remaining_pct = |bench: &mut Bench| last_of(&bench.frames(), 0).remaining_pct();
    for _ in 0..2 {
        bench.run_for(6 * SECOND);
        let texts = texts_of(&bench.frames());
        let announced = texts
            .iter()
            .any(|text| text.starts_with("Battery 1 cells unclear at 4."));
        assert!(announced, "{texts:?}");
        assert_eq!(remaining_pct(&mut bench), -1);
        assert_eq!(texts_of(&bench.ask(&arm())), [unclear]);
        bench.forget_sent();
        bench.reboot();
    }
    bench.run_for(60 * SECOND);
    let is_kept = bench.read_flash(LEARNT_OFFSET, LEARNT_BYTES) == content;
    assert!(is_kept, "nothing is overwritten");
    bench.set("BATT_CELLS", 1.0);
    bench.run_for(3 * SECOND);
    assert!(remaining_pct(&mut bench) > 90);
    assert_eq!(texts_of(&bench.ask(&arm())), [] as [&str; 0]);
}
