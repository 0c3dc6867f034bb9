//! Starts after crashes and restarts: what is not the owner's refuses arming, and what an owner said a moment before holds.

use embassy_futures::block_on;
use nor_flash::SmallFlash;
use rover_battmon::autopilot::{FlashStore, SamplingProgress, Start};
use rover_battmon::battery::{RetainedMemory, RetainedRecord};
use rover_battmon::crash::ParameterSource;
use rover_battmon::memory::storage::{Erase, Storage, StorageError};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, ParameterId, Parameters, VehicleParameter};
use rover_battmon::sensor::{AnalogPin, AnalogReadings};
use rover_battmon::vehicle::ArmState;
use support::commands::{BATTERY_RESET, PREFLIGHT_STORAGE, RESET, RUN_PREARM_CHECKS};
use support::desk::{DIVIDER, Desk, conversions};
use support::frames::texts_of;
use support::requests::{arm, arm_by_force, command_long, command_long_2, disarm, param_set};

use crate::regions::Regions;

const MONITOR: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::Monitor);
const TIMEOUT: ParameterId = ParameterId::Vehicle(VehicleParameter::FsTimeout);

fn started(regions: &Regions, source: ParameterSource) -> Desk {
    let mut start = regions.started(source);
    // The check of packs has a test of its own.
    start.parameters.restore(MONITOR.key(), 0.0).unwrap();
    Desk::starting(start)
}

#[test]
fn defaults_after_quick_crashes_refuse_arming_until_a_start_reads_the_stored_values() {
    let regions = Regions::blank();
    let mut stored = Storage::new(regions.parameters.clone(), SmallFlash::REGION);
    block_on(stored.store(TIMEOUT.key(), 5.0f32.to_bits(), &Erase::always)).unwrap();

    let mut desk = started(&regions, ParameterSource::Defaults);
    assert_eq!(desk.parameters().next_unsaved(), None);
    let refused = "Arm: Stored parameters not read: restart";
    for request in [
        param_set("FS_TIMEOUT", 1.5),
        param_set("ARMING_CHECK", 0.0),
        command_long(PREFLIGHT_STORAGE, RESET),
    ] {
        assert_eq!(texts_of(&desk.ask(&arm())), [refused]);
        desk.ask(&request);
    }
    assert_eq!(texts_of(&desk.ask(&arm())), [refused]);
    desk.ask(&arm_by_force());
    assert_eq!(desk.vehicle().arm_state(), ArmState::Armed);
    desk.ask(&disarm());

    let mut desk = started(&regions, ParameterSource::Stored);
    assert_eq!(desk.parameters().get(TIMEOUT), 5.0);
    assert!(desk.ask(&arm()).iter().all(|frame| frame.text(1, 3) != "Arm"));
    assert_eq!(desk.vehicle().arm_state(), ArmState::Armed);
}

#[test]
fn a_prearm_check_names_parameters_that_a_restart_would_lose() {
    let mut desk = Desk::without_packs();
    let reported = |desk: &mut Desk| {
        let texts = texts_of(&desk.ask(&command_long(RUN_PREARM_CHECKS, 0.0)));
        texts.contains(&"PreArm: Parameters can't be saved: flash worn out?".into())
    };
    desk.ask(&param_set("FS_TIMEOUT", 3.0));
    assert!(!reported(&mut desk), "it is about to be saved");
    let job = desk.next_flash_job(FlashStore::Parameters).expect("the value");
    desk.flash_done(&job, Err(StorageError::Corrupt));
    assert!(reported(&mut desk));
    assert!(desk.ask(&arm()).iter().all(|frame| frame.text(1, 6) != "PreArm"));
    desk.flash_done(&job, Ok(None));
    assert!(!reported(&mut desk));
}

/// A rover with a 3S pack of 3 Ah, after a start that has found this memory.
fn with_pack(memory: &RetainedMemory) -> Desk {
    let mut parameters = Parameters::defaults();
    for (id, value) in [
        (BatteryParameter::Monitor, 4.0),
        (BatteryParameter::CurrPin, 28.0),
        (BatteryParameter::Cells, 3.0),
        (BatteryParameter::Capacity, 3000.0),
    ] {
        parameters.restore(id.of(Pack::First).key(), value).unwrap();
    }
    let mut desk = Desk::starting(Start::with_parameters(parameters));
    desk.autopilot.restore_packs(memory);
    desk
}

/// Samples the resting pack in `ticks`.
fn sample(desk: &mut Desk, ticks: u64, memory: &mut RetainedMemory) {
    let mut readings = AnalogReadings::NONE;
    readings.set(AnalogPin::Gp26, Ok(conversions(11.5 / DIVIDER)));
    readings.set(AnalogPin::Gp28, Ok(conversions(0.0)));
    for _ in 0..ticks {
        desk.now_us += 100_000;
        let mut sampling = desk.autopilot.begin_sampling(desk.now(), readings);
        while desk.autopilot.sample_next(&mut sampling) != SamplingProgress::Complete {}
        desk.autopilot.end_sampling(sampling, memory);
    }
}

#[test]
fn a_battery_reset_within_the_last_second_before_a_restart_holds() {
    for ticks in 20..30 {
        let mut memory = [RetainedRecord::BLANK; 2];
        let mut desk = with_pack(&memory);
        sample(&mut desk, ticks, &mut memory);
        desk.ask(&command_long_2(BATTERY_RESET, 65535.0, 60.0));
        sample(&mut desk, 1, &mut memory);

        let mut desk = with_pack(&memory);
        sample(&mut desk, 1, &mut memory);
        let readings = desk.autopilot.battery(Pack::First).readings;
        let remaining_pct = readings.remaining_pct.unwrap();
        assert!((remaining_pct - 60.0).abs() < 1.0, "{ticks}: {remaining_pct}");
    }
}
