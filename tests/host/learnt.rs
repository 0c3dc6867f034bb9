//! What is learnt of a pack outlasts restarts, power cuts and damage, belongs to one pack, and is erased when asked for.

use embassy_futures::block_on;
use embassy_time::Timer;
use nor_flash::SmallFlash;
use proptest::prelude::*;
use rover_battmon::autopilot::{FlashJob, FlashStore, PackIdentity, Start, Work};
use rover_battmon::battery::{LEARNT_WORDS, LearntPack};
use rover_battmon::memory::storage::{Erase, FlashFault, Storage, StorageError};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, Parameters};
use rover_battmon::sensor::AnalogReadings;
use support::commands::PREFLIGHT_STORAGE;
use support::desk::Desk;
use support::frames::{Frame, PARAM_VALUE, ParamValue, of_message, texts_of};
use support::learnt_record::learnt_words;
use support::requests::{command_long, param_read_by_name, param_set, reboot};

use crate::regions::{Regions, Vehicle};

type Words = [u32; LEARNT_WORDS];

const NOT_SAVED: &str = "Learnt battery data not saved: flash worn out?";

const FAILED: Result<(), StorageError> = Err(StorageError::Flash(FlashFault::NotVerified));

fn of(pack: Pack, serial_number: Option<i32>) -> PackIdentity {
    PackIdentity { pack, serial_number }
}

fn read_of(pack: Pack, serial_number: Option<i32>) -> Option<FlashJob> {
    Some(FlashJob::ReadLearnt(of(pack, serial_number)))
}

/// The write that erases what is learnt.
fn erasure_of(pack: Pack, serial_number: Option<i32>) -> Option<FlashJob> {
    Some(FlashJob::WriteLearnt(
        of(pack, serial_number),
        LearntPack::of(serial_number),
    ))
}

/// A desk where these packs are monitored.
fn desk_with(packs: &[Pack]) -> Desk {
    let mut parameters = Parameters::defaults();
    for pack in packs {
        let monitor = BatteryParameter::Monitor.of(*pack);
        parameters.restore(monitor.key(), 3.0).unwrap();
    }
    let mut desk = Desk::starting(Start::with_parameters(parameters));
    desk.autopilot.open(&mut desk.endpoint);
    desk.sent();
    desk
}

/// A desk with one pack, of which this is stored.
fn desk_after_reading(stored: Option<Words>) -> Desk {
    let mut desk = desk_with(&[Pack::First]);
    assert_eq!(job(&mut desk), read_of(Pack::First, None));
    desk.learnt_read(of(Pack::First, None), Ok(stored));
    assert_eq!(job(&mut desk), None);
    posted(&mut desk);
    desk
}

fn job(desk: &mut Desk) -> Option<FlashJob> {
    desk.next_flash_job(FlashStore::Learnt)
}

fn written(desk: &mut Desk, learnt: &LearntPack, result: Result<(), StorageError>) {
    let identity = of(Pack::First, learnt.serial_number());
    desk.flash_done(&FlashJob::WriteLearnt(identity, *learnt), result.map(|()| None));
}

/// Names and values of all PARAM_VALUE.
fn values(frames: &[Frame]) -> Vec<(String, f32)> {
    of_message(frames, PARAM_VALUE)
        .iter()
        .map(|frame| (ParamValue(frame).name(), ParamValue(frame).value()))
        .collect()
}

fn value(desk: &mut Desk, name: &str) -> f32 {
    values(&desk.ask(&param_read_by_name(name)))[0].1
}

/// What is announced and shown within half a second.
fn posted(desk: &mut Desk) -> Vec<Frame> {
    let mut sent = Vec::new();
    for _ in 0..25 {
        desk.now_us += 20_000;
        desk.post_due(desk.now_us);
        sent.extend(desk.sent());
    }
    sent
}

#[test]
fn stored_pack_is_read_at_the_start_and_shown() {
    let mut desk = desk_with(&[Pack::First, Pack::Third]);
    assert_eq!(job(&mut desk), read_of(Pack::First, None));
    let stored = learnt_words(None, 2949.7);
    desk.learnt_read(of(Pack::First, None), Ok(Some(stored)));
    assert_eq!(job(&mut desk), read_of(Pack::Third, None));
    desk.learnt_read(of(Pack::Third, None), Ok(None));
    assert_eq!(job(&mut desk), None, "nothing else, and nothing to write");
    assert!(!desk.autopilot.has_unsaved());

    let shown = [("BATT_LRN_CAP".into(), 2950.0), ("BATT_LRN_RES".into(), 40.0)];
    assert_eq!(values(&posted(&mut desk)), shown, "sent once, as it has changed");
    assert_eq!(values(&posted(&mut desk)), []);
    assert_eq!(value(&mut desk, "BATT_LRN_CAP"), 2950.0);
    assert_eq!(value(&mut desk, "BATT_LRN_RES"), 40.0);
    assert_eq!(value(&mut desk, "BATT3_LRN_CAP"), 0.0);
}

#[test]
fn nine_packs_read_at_once_are_all_shown() {
    let mut desk = desk_with(&Pack::ALL);
    while let Some(FlashJob::ReadLearnt(identity)) = job(&mut desk) {
        desk.learnt_read(identity, Ok(Some(learnt_words(None, 2950.0))));
    }
    let shown = values(&posted(&mut desk));
    assert_eq!(shown.len(), 2 * Pack::ALL.len(), "{shown:?}");
    assert_eq!(desk.statistics().dropped, 0);
}

#[test]
fn what_does_not_fit_is_not_used() {
    let no_chemistry = [0; LEARNT_WORDS];
    for stored in [
        Ok(Some(learnt_words(Some(5), 2950.0))),
        Ok(Some(no_chemistry)),
        Ok(None),
        Err(StorageError::Flash(FlashFault::Other)),
    ] {
        let mut desk = desk_with(&[Pack::First]);
        desk.learnt_read(of(Pack::First, None), stored);
        assert_eq!(job(&mut desk), None, "it starts over");
        assert_eq!(value(&mut desk, "BATT_LRN_CAP"), 0.0);
    }
}

#[test]
fn another_serial_number_is_another_pack() {
    let mut desk = desk_after_reading(Some(learnt_words(None, 2950.0)));
    desk.autopilot.take_work();
    desk.ask(&param_set("BATT_SERIAL_NUM", 7.0));
    assert!(desk.autopilot.take_work().contains(Work::SAVE));
    assert_eq!(job(&mut desk), read_of(Pack::First, Some(7)));
    desk.learnt_read(of(Pack::First, Some(7)), Ok(None));
    assert_eq!(value(&mut desk, "BATT_LRN_CAP"), 0.0);

    desk.ask(&param_set("BATT_SERIAL_NUM", -1.0));
    assert_eq!(job(&mut desk), read_of(Pack::First, None));
    let stored = learnt_words(None, 2950.0);
    desk.learnt_read(of(Pack::First, None), Ok(Some(stored)));
    assert_eq!(value(&mut desk, "BATT_LRN_CAP"), 2950.0);
}

#[test]
fn serial_number_set_while_another_is_read() {
    let mut desk = desk_after_reading(None);
    desk.ask(&param_set("BATT_SERIAL_NUM", 7.0));
    assert_eq!(job(&mut desk), read_of(Pack::First, Some(7)));
    desk.ask(&param_set("BATT_SERIAL_NUM", 8.0));
    let stored = learnt_words(Some(7), 2950.0);
    desk.learnt_read(of(Pack::First, Some(7)), Ok(Some(stored)));
    assert_eq!(value(&mut desk, "BATT_LRN_CAP"), 0.0, "it is of another pack");
    assert_eq!(job(&mut desk), read_of(Pack::First, Some(8)));
}

#[test]
fn instances_with_the_same_serial_number_are_two_packs() {
    let mut desk = desk_with(&[Pack::First, Pack::Second]);
    for name in ["BATT_SERIAL_NUM", "BATT2_SERIAL_NUM"] {
        desk.ask(&param_set(name, 7.0));
    }
    let identities = [Pack::First, Pack::Second].map(|pack| of(pack, Some(7)));
    for (identity, capacity_mah) in identities.into_iter().zip([1000.0, 2000.0]) {
        assert_eq!(job(&mut desk), Some(FlashJob::ReadLearnt(identity)));
        let stored = learnt_words(Some(7), capacity_mah);
        desk.learnt_read(identity, Ok(Some(stored)));
    }
    assert_eq!(value(&mut desk, "BATT_LRN_CAP"), 1000.0);
    assert_eq!(value(&mut desk, "BATT2_LRN_CAP"), 2000.0);

    desk.ask(&param_set("BATT_LRN_ERASE", 1.0));
    assert_eq!(job(&mut desk), erasure_of(Pack::First, Some(7)));
    assert_eq!(value(&mut desk, "BATT_LRN_CAP"), 0.0);
    assert_eq!(value(&mut desk, "BATT2_LRN_CAP"), 2000.0);
}

#[test]
fn erasing_is_acknowledged_reads_0_and_is_written() {
    let mut desk = desk_after_reading(Some(learnt_words(None, 2950.0)));
    let erase = |value| ("BATT_LRN_ERASE".to_string(), value);
    // As in a parameter file: it erases nothing.
    assert_eq!(values(&desk.ask(&param_set("BATT_LRN_ERASE", 0.0))), [erase(0.0)]);
    assert_eq!(job(&mut desk), None);
    desk.autopilot.take_work();
    let answers = desk.ask(&param_set("BATT_LRN_ERASE", 1.0));
    assert_eq!(values(&answers), [erase(1.0), erase(0.0)]);
    assert!(desk.autopilot.take_work().contains(Work::SAVE));
    assert!(desk.autopilot.has_unsaved(), "a restart waits for it");
    let shown = [("BATT_LRN_CAP".into(), 0.0), ("BATT_LRN_RES".into(), 0.0)];
    assert_eq!(values(&posted(&mut desk)), shown);

    assert_eq!(job(&mut desk), erasure_of(Pack::First, None));
    written(&mut desk, &LearntPack::of(None), Ok(()));
    assert_eq!(job(&mut desk), None);
    assert!(!desk.autopilot.has_unsaved());
    assert_eq!(value(&mut desk, "BATT_LRN_ERASE"), 0.0);
}

#[test]
fn erased_while_a_write_is_under_way() {
    let mut desk = desk_after_reading(Some(learnt_words(None, 2950.0)));
    let under_way = LearntPack::from_words(&learnt_words(None, 2950.0)).unwrap();
    desk.ask(&param_set("BATT_LRN_ERASE", 1.0));
    written(&mut desk, &under_way, Ok(()));
    assert_eq!(
        job(&mut desk),
        erasure_of(Pack::First, None),
        "what was written is no longer learnt"
    );
}

#[test]
fn erased_before_it_is_read_and_while_it_is_read() {
    let mut desk = desk_with(&[Pack::First]);
    assert_eq!(job(&mut desk), read_of(Pack::First, None));
    desk.ask(&param_set("BATT_LRN_ERASE", 1.0));
    let stored = learnt_words(None, 2950.0);
    desk.learnt_read(of(Pack::First, None), Ok(Some(stored)));
    assert_eq!(value(&mut desk, "BATT_LRN_CAP"), 0.0);
    assert_eq!(job(&mut desk), erasure_of(Pack::First, None));
}

#[test]
fn erased_right_after_the_serial_number_was_set_is_the_new_pack() {
    let mut desk = desk_after_reading(Some(learnt_words(None, 2950.0)));
    desk.ask(&param_set("BATT_SERIAL_NUM", 7.0));
    desk.ask(&param_set("BATT_LRN_ERASE", 1.0));
    assert_eq!(job(&mut desk), erasure_of(Pack::First, Some(7)));
    written(&mut desk, &LearntPack::of(Some(7)), Ok(()));
    assert_eq!(job(&mut desk), None);
}

#[test]
fn pack_that_is_not_monitored_can_be_erased() {
    let mut desk = desk_after_reading(None);
    desk.ask(&param_set("BATT9_LRN_ERASE", 1.0));
    assert_eq!(job(&mut desk), erasure_of(Pack::Ninth, None));
    desk.flash_done(&erasure_of(Pack::Ninth, None).unwrap(), Ok(None));
    assert_eq!(job(&mut desk), None);
}

#[test]
fn a_parameter_reset_keeps_what_is_learnt() {
    let mut desk = desk_after_reading(Some(learnt_words(None, 2950.0)));
    desk.ask(&command_long(PREFLIGHT_STORAGE, 2.0));
    assert_eq!(value(&mut desk, "BATT_LRN_CAP"), 2950.0);
    assert_eq!(job(&mut desk), None);

    desk.ask(&param_set("BATT_SERIAL_NUM", 7.0));
    let stored = learnt_words(Some(7), 1000.0);
    desk.learnt_read(of(Pack::First, Some(7)), Ok(Some(stored)));
    desk.ask(&command_long(PREFLIGHT_STORAGE, 2.0));
    assert_eq!(
        job(&mut desk),
        read_of(Pack::First, None),
        "the serial number was reset"
    );
}

#[test]
fn what_could_not_be_written_has_a_last_chance_before_a_restart() {
    let mut desk = desk_after_reading(Some(learnt_words(None, 2950.0)));
    desk.ask(&param_set("BATT_LRN_ERASE", 1.0));
    let erased = LearntPack::of(None);
    assert_eq!(job(&mut desk), erasure_of(Pack::First, None));
    written(&mut desk, &erased, FAILED);
    assert!(
        !desk.autopilot.has_unsaved(),
        "a restart does not wait for the retry"
    );
    desk.autopilot.prepare_restart(desk.now());
    assert!(desk.autopilot.has_unsaved());
    assert_eq!(job(&mut desk), erasure_of(Pack::First, None));
    written(&mut desk, &erased, Ok(()));
    assert_eq!(job(&mut desk), None);
}

#[test]
fn failure_is_announced_to_a_ground_station_that_connects_while_it_lasts() {
    let mut desk = desk_after_reading(None);
    desk.ask(&param_set("BATT_LRN_ERASE", 1.0));
    let notices = |desk: &mut Desk| {
        desk.autopilot.open(&mut desk.endpoint);
        texts_of(&desk.sent())
            .iter()
            .filter(|text| *text == NOT_SAVED)
            .count()
    };
    written(&mut desk, &LearntPack::of(None), FAILED);
    assert_eq!(notices(&mut desk), 1);
    written(&mut desk, &LearntPack::of(None), Ok(()));
    assert_eq!(notices(&mut desk), 0);
}

#[test]
fn only_monitored_packs_are_in_use() {
    let mut desk = desk_with(&[Pack::First, Pack::Third]);
    desk.ask(&param_set("BATT3_SERIAL_NUM", 7.0));
    for (identity, is_in_use) in [
        (of(Pack::First, None), true),
        (of(Pack::First, Some(7)), false),
        (of(Pack::Second, None), false),
        (of(Pack::Third, Some(7)), true),
        (of(Pack::Third, None), false),
    ] {
        assert_eq!(
            desk.autopilot.is_learnt_in_use(identity.key()),
            is_in_use,
            "{identity:?}"
        );
    }
}

#[test]
fn sampling_writes_nothing_while_nothing_is_learnt() {
    let mut desk = desk_after_reading(Some(learnt_words(None, 2950.0)));
    for _ in 0..20 {
        desk.now_us += 100_000;
        desk.sample(AnalogReadings::NONE);
    }
    assert_eq!(job(&mut desk), None);
}

fn storage(flash: &SmallFlash) -> Storage<SmallFlash, Words> {
    Storage::new(flash.clone(), SmallFlash::REGION)
}

fn store(flash: &SmallFlash, identity: PackIdentity, capacity_mah: f32) {
    let value = learnt_words(identity.serial_number, capacity_mah);
    block_on(storage(flash).store_replacing(identity.key(), value, &|_| true, &Erase::always))
        .expect("a sound flash");
}

fn stored(flash: &SmallFlash, identity: PackIdentity) -> Option<Words> {
    block_on(storage(flash).read(identity.key())).expect("a sound flash")
}

/// Runs the task with this flash while `script` changes things; returns the capacity shown at the end.
fn run_task(flash: &SmallFlash, script: impl AsyncFnOnce(&Vehicle)) -> f32 {
    let regions = Regions {
        learnt: flash.clone(),
        ..Regions::blank()
    };
    let vehicle = regions.run(Start::default(), async |vehicle| {
        script(vehicle).await;
        Timer::after_millis(500).await;
    });
    let capacity = BatteryParameter::LrnCap.of(Pack::First);
    vehicle
        .shared
        .with(|autopilot| autopilot.parameters().get(capacity))
}

#[test]
fn the_task_reads_at_once_and_erases_before_a_restart() {
    let flash = SmallFlash::blank();
    store(&flash, of(Pack::First, None), 2950.0);
    store(&flash, of(Pack::First, Some(7)), 1000.0);
    assert_eq!(run_task(&flash, async |_| {}), 2950.0);
    let set_serial_number = async |vehicle: &Vehicle| drop(vehicle.set("BATT_SERIAL_NUM", 7.0));
    assert_eq!(run_task(&flash, set_serial_number), 1000.0);

    let erase_and_restart = async |vehicle: &Vehicle| {
        Timer::after_millis(100).await;
        vehicle.ask(&param_set("BATT_LRN_ERASE", 1.0));
        vehicle.ask(&reboot());
        Timer::after_secs(5).await;
    };
    assert_eq!(run_task(&flash, erase_and_restart), 0.0);
    assert_eq!(
        stored(&flash, of(Pack::First, None)),
        Some(LearntPack::of(None).to_words())
    );
    assert_eq!(run_task(&flash, async |_| {}), 0.0);
    assert_eq!(run_task(&flash, set_serial_number), 1000.0, "another pack");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn arbitrary_words_in_flash_show_plausible_values(mut stored in prop::array::uniform::<_, LEARNT_WORDS>(any::<u32>()), is_known: bool) {
        if is_known {
            // A chemistry, and no serial number.
            stored[0] = stored[0] & !0xFF | 1;
            stored[1] = u32::MAX;
        }
        let mut desk = desk_with(&[Pack::First]);
        desk.learnt_read(of(Pack::First, None), Ok(Some(stored)));
        let capacity_mah = value(&mut desk, "BATT_LRN_CAP");
        let resistance_mohm = value(&mut desk, "BATT_LRN_RES");
        prop_assert!((0.0..=1e7).contains(&capacity_mah) && (0.0..=1e8).contains(&resistance_mohm));
        prop_assert_eq!(job(&mut desk), None);
    }
}
