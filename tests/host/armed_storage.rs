//! An armed rover erases no flash, whatever is requested: what has no space is live, reported, and saved after disarming.

use support::signer::OWNER;

use embassy_futures::block_on;
use embassy_futures::yield_now;
use embassy_time::Timer;
use nor_flash::SmallFlash;
use rover_battmon::autopilot::Start;
use rover_battmon::crash::ParameterSource;
use rover_battmon::memory::storage::{Condition, Erase, Storage};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, ParameterId};
use rover_battmon::vehicle::ArmState;
use rover_battmon::wifi::Radio;
use support::commands::{PREFLIGHT_STORAGE, RESET};
use support::desk::LOW_VOLT;
use support::frames::texts_of;
use support::requests::{
    VEHICLE, arm_by_force, command_long, disarm, param_request_list, param_set, reboot, setup_signing,
    wifi_config,
};

use crate::regions::{Regions, Vehicle};

const NOT_SAVED: &str = "Parameters can't be saved: flash worn out?";
const NOT_WHILE_ARMED: &str = "Not while armed: disarm first";

/// A capacity that is lost if power is lost before disarming.
const CAPACITY: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::Capacity);

/// Erases of parameters, signing and learnt data.
fn erases(regions: &Regions) -> [u32; 3] {
    [&regions.parameters, &regions.signing, &regions.learnt].map(|flash| flash.chip().erases.iter().sum())
}

/// Runs a script with an armed vehicle, in which nothing is erased meanwhile.
async fn armed<T>(vehicle: &Vehicle, regions: &Regions, script: impl AsyncFnOnce() -> T) -> T {
    vehicle.ask(&arm_by_force());
    let before = erases(regions);
    let result = script().await;
    assert_eq!(erases(regions), before, "erased while armed");
    result
}

/// Starts a vehicle with this flash, and switches it off after the script.
fn run(regions: &Regions, script: impl AsyncFnOnce(&Vehicle)) {
    regions.run(Start::default(), async |vehicle| {
        vehicle.wait(2).await;
        script(vehicle).await;
    });
}

/// The parameter's value after a start with this flash, which is undamaged.
fn stored(regions: &Regions, id: ParameterId) -> f32 {
    let mut parameters: Storage<_> = Storage::new(regions.parameters.clone(), SmallFlash::REGION);
    block_on(parameters.load(&mut |_, _| {})).expect("readable");
    assert_eq!(parameters.condition(), Condition::Intact);
    regions.started(ParameterSource::Stored).parameters.get(id)
}

/// Sets two parameters in turn until each sector that was erased is full, and then `further` ones.
async fn fill(station: &Vehicle, further: usize) -> Vec<String> {
    let mut texts = Vec::new();
    for number in 0..100 {
        let name = ["BATT_LOW_VOLT", "BATT_CRT_VOLT"][number % 2];
        texts.extend(station.set(name, 6.0 + number as f32 / 100.0));
        Timer::after_millis(20).await;
    }
    for pack in Pack::ALL.iter().take(further) {
        let capacity = ParameterId::Battery(*pack, BatteryParameter::Capacity);
        texts.extend(station.set(&capacity.name(), 1234.0));
    }
    texts.extend(station.wait(8).await);
    texts
}

#[test]
fn parameters_without_space_are_live_reported_and_saved_after_disarming() {
    let regions = Regions::blank();
    run(&regions, async |station| {
        station.set("BATT_LOW_VOLT", 5.0);
        station.wait(2).await;
        let texts = armed(station, &regions, async || fill(station, 3).await).await;
        assert_eq!(texts, ["Parameters: 5 not saved until disarmed"], "once for all");
        let listed = station.ask(&param_request_list(VEHICLE));
        assert!(texts_of(&listed).contains(&texts[0]));
        station.ask(&disarm());
        assert_eq!(station.wait(2).await, ["Parameters saved"]);
        assert_eq!(station.wait(70).await, [""; 0]);
    });
    assert_eq!(stored(&regions, CAPACITY), 1234.0);
    let id = ParameterId::Battery(Pack::First, BatteryParameter::CrtVolt);
    assert_eq!(stored(&regions, id), 6.99);
}

/// The watchdog of an armed vehicle would end an erase.
#[test]
fn after_disarming_flash_waits_for_the_longer_watchdog_and_nothing_is_reported() {
    let regions = Regions::blank();
    run(&regions, async |station| {
        let watched = |state| station.shared.with(|autopilot| autopilot.watched(state));
        station.set("BATT_LOW_VOLT", 5.0);
        station.wait(2).await;
        let texts = armed(station, &regions, async || {
            watched(ArmState::Armed);
            fill(station, 3).await
        })
        .await;
        assert_eq!(texts, ["Parameters: 5 not saved until disarmed"]);
        let before = erases(&regions);
        station.ask(&disarm());
        assert_eq!(
            station.shared.with(|autopilot| autopilot.may_erase()),
            Erase::Forbidden
        );
        // Parameters that are set now have no space either.
        for pack in Pack::ALL {
            let name = ParameterId::Battery(pack, BatteryParameter::LowMah).name();
            assert_eq!(station.set(&name, 100.0), [""; 0]);
        }
        assert_eq!(station.wait(20).await, [""; 0], "nothing is tried");
        assert_eq!(erases(&regions), before);
        watched(ArmState::Disarmed);
        assert_eq!(station.wait(2).await, ["Parameters saved"]);
        assert!(erases(&regions) > before);
    });
    assert_eq!(stored(&regions, CAPACITY), 1234.0);
    let id = ParameterId::Battery(Pack::Ninth, BatteryParameter::LowMah);
    assert_eq!(stored(&regions, id), 100.0);
}

#[test]
fn a_failure_that_is_over_before_its_announcement_is_not_announced_as_over() {
    let regions = Regions::blank();
    run(&regions, async |station| {
        station.set("BATT_LOW_VOLT", 5.0);
        station.wait(2).await;
        armed(station, &regions, async || drop(fill(station, 0).await)).await;
        let texts = station.set("BATT_CAPACITY", 1234.0);
        assert_eq!(texts, [""; 0]);
        Timer::after_millis(200).await;
        station.ask(&disarm());
        assert_eq!(
            station.wait(70).await,
            ["Parameters saved"],
            "the failures before"
        );
    });
}

#[test]
fn reset_that_needs_space_twice_is_saved_after_disarming() {
    let regions = Regions::blank();
    run(&regions, async |station| {
        station.set("BATT_CAPACITY", 777.0);
        station.wait(2).await;
        for _ in 0..3 {
            station.ask(&command_long(PREFLIGHT_STORAGE, RESET));
            station.set("BATT_CAPACITY", 888.0);
            // At once, before anything could be prepared.
            armed(station, &regions, async || drop(fill(station, 0).await)).await;
            let refused = station.ask(&command_long(PREFLIGHT_STORAGE, RESET));
            assert_eq!(texts_of(&refused), [NOT_WHILE_ARMED]);
            station.ask(&disarm());
        }
        station.wait(2).await;
    });
    assert_eq!(stored(&regions, CAPACITY), 888.0);
}

#[test]
// Requirement: L-18
fn what_flash_refused_is_saved_before_a_restart() {
    let regions = Regions::blank();
    run(&regions, async |station| {
        station.set("BATT_CAPACITY", 777.0);
        station.wait(2).await;
        regions.parameters.chip().refuse_all_after(0);
        station.ask(&command_long(PREFLIGHT_STORAGE, RESET));
        station.set("BATT_LOW_VOLT", 10.5);
        assert_eq!(station.wait(8).await, [NOT_SAVED]);
        regions.parameters.chip().power_up();
        station.ask(&reboot());
        station.wait(10).await;
    });
    assert_eq!(stored(&regions, CAPACITY), CAPACITY.default_value());
    assert_eq!(stored(&regions, LOW_VOLT), 10.5);
}

#[test]
// Requirement: L-18
fn a_failed_write_is_announced_once_and_repeated_a_minute_later_in_each_region() {
    let regions = Regions {
        wifi: Some(SmallFlash::blank()),
        ..Regions::blank()
    };
    let wifi = regions.wifi.as_ref().expect("a board with a radio");
    for (chip, request, announced) in [
        (&regions.parameters, param_set("BATT_CAPACITY", 777.0), NOT_SAVED),
        (
            &regions.learnt,
            param_set("BATT_LRN_ERASE", 1.0),
            "Learnt battery data not saved: flash worn out?",
        ),
        (
            wifi,
            wifi_config("home", "at home 1", 2),
            "Wi-Fi settings not saved: flash worn out?",
        ),
    ] {
        let start = Start {
            radio: Radio::Present,
            ..Start::default()
        };
        regions.run(start, async |station| {
            station.wait(2).await;
            let before = chip.bytes();
            chip.chip().refuse_all_after(0);
            let mut texts = texts_of(&station.ask(&request));
            texts.extend(station.wait(90).await);
            let times = texts.iter().filter(|text| *text == announced).count();
            assert_eq!(times, 1, "{texts:?}");
            chip.chip().power_up();
            station.wait(25).await;
            assert!(
                chip.bytes() == before,
                "{announced}: not within the second minute"
            );
            station.wait(10).await;
            assert!(chip.bytes() != before, "{announced}");
        });
    }
}

#[test]
fn a_list_is_preceded_by_a_failure_to_save_while_it_lasts() {
    let regions = Regions::blank();
    run(&regions, async |station| {
        let failures_in_a_list = || {
            let texts = texts_of(&station.ask(&param_request_list(VEHICLE)));
            texts.iter().filter(|text| *text == NOT_SAVED).count()
        };
        assert_eq!(failures_in_a_list(), 0);
        regions.parameters.chip().refuse_all_after(0);
        station.set("BATT_CAPACITY", 777.0);
        station.wait(8).await;
        assert_eq!(failures_in_a_list(), 1);
        regions.parameters.chip().power_up();
        station.wait(65).await;
        assert_eq!(failures_in_a_list(), 0);
    });
    assert_eq!(stored(&regions, CAPACITY), 777.0);
}

#[test]
fn marks_of_the_signing_time_and_learnt_data_erase_nothing() {
    let regions = Regions::blank();
    run(&regions, async |station| {
        let texts = |request: &[u8]| texts_of(&station.ask(request));
        assert_eq!(texts(&setup_signing([OWNER; 32], 1 << 40)), [""; 0]);
        assert_eq!(station.wait(2).await, ["Signing key set"]);
        let armed = armed(station, &regions, async || {
            let mut armed = Vec::new();
            for minute in 0..20 {
                station.set("BATT_SERIAL_NUM", minute as f32);
                station.ask(&param_set("BATT_LRN_ERASE", 1.0));
                armed.extend(station.wait(60).await);
            }
            for key in [OWNER + 1, 0] {
                assert_eq!(texts(&setup_signing([key; 32], 1 << 41)), [NOT_WHILE_ARMED]);
            }
            armed
        })
        .await;
        assert_eq!(armed, ["Learnt battery data not saved until disarmed"]);
        station.ask(&disarm());
        station.wait(2).await;
        assert!(!station.shared.with(|autopilot| autopilot.has_unsaved()));
    });
    // The key is there, and what was learnt last.
    let start = regions.started(ParameterSource::Stored);
    assert!(!start.signing.has_lost_key() && !start.signing.is_key_unsaved());
}

#[test]
fn parameters_that_are_set_without_a_pause_leave_signing_its_turn() {
    let regions = Regions::blank();
    run(&regions, async |station| {
        let mut texts = texts_of(&station.ask(&setup_signing([OWNER; 32], 0)));
        for number in 0..1000 {
            texts.extend(station.set("BATT_CAPACITY", 1000.0 + number as f32));
            yield_now().await;
        }
        assert!(texts.contains(&"Signing key set".into()), "{texts:?}");
    });
}

#[test]
fn each_region_is_prepared_once_and_stays_so_over_restarts() {
    let regions = Regions::blank();
    run(&regions, async |station| {
        station.set("BATT_CAPACITY", 777.0);
        station.ask(&setup_signing([OWNER; 32], 1 << 40));
        station.ask(&param_set("BATT_LRN_ERASE", 1.0));
        station.wait(2).await;
    });
    assert_eq!(erases(&regions), [1, 1, 1]);
    for _ in 0..5 {
        run(&regions, async |station| drop(station.wait(5).await));
    }
    assert_eq!(erases(&regions), [1, 1, 1]);
    // None is erased twice for a move, either.
    let mut parameters: Storage<_> = Storage::new(regions.parameters.clone(), SmallFlash::REGION);
    for value in 0..50 {
        block_on(parameters.store(999, value, &|| Erase::Forbidden)).expect("two sectors have room");
    }
}

#[test]
fn learnt_data_alone_are_unsaved_until_they_are_written() {
    run(&Regions::blank(), async |station| {
        let has_unsaved = || station.shared.with(|autopilot| autopilot.has_unsaved());
        station.wait(2).await;
        assert!(!has_unsaved());
        station.ask(&param_set("BATT_LRN_ERASE", 1.0));
        assert!(has_unsaved());
        station.wait(2).await;
        assert!(!has_unsaved());
    });
}
