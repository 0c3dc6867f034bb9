//! Scenarios in stepped time: what is announced, when, and in which order.

use std::cell::RefCell;
use std::collections::HashSet;

use embassy_time::Instant;
use rover_battmon::autopilot::Autopilot;
use rover_battmon::parameter::{BatteryParameter, ParameterId, VehicleParameter};
use rover_battmon::system::ArmingReadiness;

use super::super::console::Output;
use super::super::{Fleet, ready_pack};
use super::*;
use crate::sim::clock;

/// Something that was shown, and when, in seconds.
#[derive(Clone, Debug)]
struct Shown {
    at_s: u64,
    level: Level,
    text: String,
}

/// Everything that a scenario shows, to its closing sentence.
fn shown(name: &str) -> Vec<Shown> {
    shown_with(&[], name)
}

/// Everything that a scenario shows with the pack of these parameters.
fn shown_with(parameters: &[(ParameterId, f32)], name: &str) -> Vec<Shown> {
    let scenario = Scenario::named(name).expect(name);
    let alone = Role::Alone(Output::Lines, parameters);
    let shown = RefCell::new(Vec::new());
    let (flash, rover) = (SimulatedFlash::open(None).unwrap(), SimulatedRover::default());
    let pack = RefCell::new(alone.pack(Some(scenario)));
    clock::run_for(Duration::from_secs(u64::from(scenario.end_s) + 2), async {
        let (desk, storages) = start(alone, &flash, Some(scenario), &pack).await;
        let show = |level, text: &str| {
            shown.borrow_mut().push(Shown {
                at_s: Instant::now().as_secs(),
                level,
                text: text.to_owned(),
            });
        };
        join(
            desk.run_vehicle(storages, &rover, &mut [RetainedRecord::BLANK; 2]),
            desk.serve_station(Some(scenario), show),
        )
        .await;
    });
    shown.take()
}

/// What a rover of a fleet has after its start and ten seconds.
fn after_ten_seconds<R>(number: u8, look: impl FnOnce(&Autopilot) -> R) -> R {
    let (fleet, flash, rover) = (
        Fleet::of(number),
        SimulatedFlash::open(None).unwrap(),
        SimulatedRover::default(),
    );
    let role = Role::Member(&fleet, number);
    let pack = RefCell::new(role.pack(None));
    let seen = clock::run_for(Duration::from_secs(11), async {
        let (desk, storages) = start(role, &flash, None, &pack).await;
        let look = async {
            Timer::after_secs(10).await;
            desk.shared.with(|autopilot| look(autopilot))
        };
        match select(
            desk.run_vehicle(storages, &rover, &mut [RetainedRecord::BLANK; 2]),
            look,
        )
        .await
        {
            Either::First(()) => unreachable!("it runs on"),
            Either::Second(seen) => seen,
        }
    });
    seen.expect("it ends")
}

#[test]
fn each_of_twenty_rovers_can_be_armed_and_has_a_pack_of_its_own() {
    let mut seen = HashSet::new();
    for number in 1..=20 {
        let (system_id, board_id, pack) = after_ten_seconds(number, |autopilot| {
            let state = autopilot.system_state(rover_battmon::time::Instant::EPOCH);
            assert_eq!(state.readiness, ArmingReadiness::Ready, "{number}");
            let battery = autopilot.battery(Pack::First);
            (
                autopilot.parameters().get_whole(VehicleParameter::SysidThismav),
                state.identity.board_id.map(|id| id.number()),
                (battery.capacity_mah(), battery.readings.remaining_pct),
            )
        });
        assert_eq!(system_id, i32::from(number));
        // "SIM", and the number.
        assert_eq!(board_id, Some(0x5349_4D00_0000_0000 + u64::from(number)));
        let (Some(capacity_mah), Some(remaining_pct)) = pack else {
            panic!("{number}: {pack:?}");
        };
        // The estimate is some percent off.
        seen.insert((capacity_mah as u32, (remaining_pct / 5.0) as u32));
    }
    assert!(seen.len() > 10, "{seen:?}");
}

/// When each of these was shown, after asserting that they came in this order.
fn times(shown: &[Shown], beginnings: &[&str]) -> Vec<u64> {
    let mut rest = shown.iter();
    beginnings
        .iter()
        .map(|beginning| {
            let found = rest.find(|shown| shown.text.starts_with(beginning));
            found
                .unwrap_or_else(|| panic!("no {beginning:?} in its place: {shown:#?}"))
                .at_s
        })
        .collect()
}

#[test]
fn a_drained_pack_is_low_then_critical_and_the_rover_stops() {
    let shown = shown("drain");
    let times = times(
        &shown,
        &[
            "the driver arms",
            "MANUAL, armed",
            "Battery 1 low: ",
            "Battery 1 is low ",
            "Battery 1 critical: ",
            "Battery 1 is critical ",
            "HOLD, armed",
            "the driver disarms",
            "Seen: low at ",
        ],
    );
    // 2.2 Ah at 4.2 A are 31 minutes.
    assert!((1500..1860).contains(&times[2]), "{times:?}");
    assert!(times[6] - times[5] <= 1, "{times:?}");
    assert!(!shown.iter().any(|shown| shown.text.contains("Failsafe: Hold")));
    let failsafe = shown.iter().find(|shown| shown.text.contains("is critical"));
    assert_eq!(failsafe.map(|shown| shown.level), Some(Level::Critical));
}

#[test]
fn the_pack_of_the_kit_is_drained_to_its_own_threshold_which_stops_the_rover() {
    let shown = shown_with(&ready_pack("2s-18650").unwrap(), "drain");
    let times = times(
        &shown,
        &[
            "MANUAL, armed",
            "Battery 1 is low 6.",
            "HOLD, armed",
            "the driver disarms",
            "Seen: low at ",
        ],
    );
    // 2.6 Ah at 4.2 A are 37 minutes, of which a third is left at 6.6 V under that load.
    assert!((1200..1800).contains(&times[1]), "{times:?}");
    assert!(times[2] - times[1] <= 1, "{times:?}");
}

#[test]
fn a_ready_file_with_cells_and_chemistry_is_a_full_pack_of_those_and_others_are_refused_by_name() {
    for (name, cells, full_v, capacity_ah) in [
        ("2s-18650", 2, 8.4, 2.6),
        ("3s-lipo", 3, 12.6, 2.2),
        ("3s-life", 3, 10.65, 2.3),
        ("6s-nimh", 6, 8.8, 2.0),
        ("ina226", 3, 12.6, 2.2),
    ] {
        let parameters = ready_pack(name).unwrap();
        let role = Role::Alone(Output::Lines, &parameters);
        let pack = role.pack(None);
        assert_eq!((pack.cells(), pack.capacity_ah()), (cells, capacity_ah), "{name}");
        assert!(
            (pack.voltage_v() - full_v).abs() < 0.01,
            "{name}: {} V",
            pack.voltage_v()
        );
        let mut start = Start::default();
        role.set_up(&mut start);
        let cells_set = BatteryParameter::Cells.of(Pack::First);
        assert_eq!(start.parameters.get_whole(cells_set), i32::from(cells), "{name}");
    }
    let all = "there are 2s-18650, 3s-life, 3s-lipo, 6s-nimh, analog-current, ina226, synthetic-current, two-packs-and-sum";
    for (name, why) in [
        (
            "smart-battery",
            "smart-battery.param has no cells and chemistry, or a monitor that is not simulated; ",
        ),
        (
            "dronecan",
            "dronecan.param has no cells and chemistry, or a monitor that is not simulated; ",
        ),
        ("../params/2s-18650", ""),
    ] {
        assert_eq!(ready_pack(name).unwrap_err(), format!("{why}{all}"));
    }
}

#[test]
fn a_cold_pack_is_low_ten_minutes_earlier_and_its_drive_ends_in_hold() {
    let low_at_s = |shown: &[Shown]| times(shown, &["MANUAL, armed", "Battery 1 is low "])[1];
    let cold = shown("cold");
    let (cold_s, warm_s) = (low_at_s(&cold), low_at_s(&shown("drain")));
    assert!((500..800).contains(&(warm_s - cold_s)), "{cold_s} and {warm_s}");
    times(&cold, &["Battery 1 is critical ", "HOLD, armed", "Seen: low at "]);
}

#[test]
fn a_swapped_pack_is_announced_and_estimated_anew() {
    let shown = shown("swap");
    let times = times(
        &shown,
        &[
            "the pack is unplugged",
            "a full pack is plugged in",
            "Battery 1 swapped: ",
            "Seen: the swap at ",
        ],
    );
    assert!(times[2] - times[1] <= 5, "{times:?}");
    let closing = &shown.last().unwrap().text;
    assert!(closing.contains("at the end 100 % left, 100 ±"), "{closing}");
}

#[test]
fn a_loose_wire_stops_the_rover_until_the_driver_goes_on() {
    let shown = shown("loose-wire");
    let times = times(
        &shown,
        &[
            "MANUAL, armed",
            "a wire of the power monitor comes loose",
            "Battery 1 unhealthy: no answer",
            "Battery 1 is missing, last: 11.",
            "HOLD, armed",
            "the wire is put back",
            "Battery 1 healthy again",
            "the driver goes on",
            "MANUAL, armed",
            "MANUAL, disarmed",
            "Seen: unhealthy at ",
        ],
    );
    let [loose_s, unhealthy_s, missing_s, hold_s] = times[1..5] else {
        panic!("{times:?}");
    };
    assert!(unhealthy_s - loose_s <= 1, "{times:?}");
    assert!((5..=6).contains(&(missing_s - loose_s)), "{times:?}");
    assert!(hold_s - missing_s <= 1, "{times:?}");
}
