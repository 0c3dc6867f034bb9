//! What is learnt of a pack, in the board's flash.

use embassy_futures::block_on;
use rover_battmon::autopilot::PackIdentity;
use rover_battmon::memory::flash_map;
use rover_battmon::memory::storage::{Erase, Storage};
use rover_battmon::pack::Pack;
use rover_battmon_tools::sim::SimulatedFlash;

use emulator::LogLevel;
use support::learnt_record::learnt_words;
use support::requests::param_set;
use workbench::bench::{Bench, DIVIDER_CODE, LEARNT_OFFSET, SECOND, TestedVehicle};

/// Records that a sector takes.
pub const SLOTS: u32 = 28;

pub const FIRST: PackIdentity = PackIdentity {
    pack: Pack::First,
    serial_number: None,
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

#[test]
fn it_is_read_by_the_second_sampling_tick_and_kept_until_it_is_erased() {
    let flash = flash_with([(FIRST, 2950.0)]);
    let mut bench = Bench::power_up_with_flash(DIVIDER_CODE, LEARNT_OFFSET, &flash);
    bench.run_for(SECOND);
    let loaded = bench.logged(LogLevel::Info, "battery 1: learnt data are stored: true");
    assert_eq!(loaded.len(), 1);
    let ticks = bench.take_ticks();
    assert!(loaded[0].0 < ticks[1], "{loaded:?}, ticks {ticks:?}");
    println!("read at {} us, first tick at {} us", loaded[0].0, ticks[0]);

    assert_eq!(bench.parameter("BATT_LRN_CAP"), 2950.0);
    assert_eq!(bench.parameter("BATT_LRN_RES"), 40.0);
    bench.assert_untroubled();
    bench.power_cycle();
    bench.run_for(SECOND);
    assert_eq!(bench.parameter("BATT_LRN_CAP"), 2950.0);
    bench.ask(&param_set("BATT_LRN_ERASE", 1.0));
    bench.reboot();
    assert_eq!(bench.parameter("BATT_LRN_CAP"), 0.0);
}
