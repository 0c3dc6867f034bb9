//! The simulator's pack in stepped time: with the ready parameter files of docs/params/ whose sensors it has (others are in
//! `tests/firmware/parameter_files.rs`), and with the faults of SIM_BATT_FAULT.

use std::cell::RefCell;
use std::fs;

use embassy_futures::join::join3;
use embassy_time::{Duration, Timer};
use rover_battmon::autopilot::Start;
use rover_battmon::battery::{BatteryState, ChargeState, Chemistry, Faults, RetainedRecord};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;
use rover_battmon::sensor::Buses;
use rover_battmon::tasks::{CheckIn, Shared, read_bus, sample_batteries};
use rover_battmon_tools::sim::{
    PackModel, PackSimulation, SimulatedBus, SimulatedPack, SimulatedPackInput, SimulatedRover, clock,
};
use support::desk::id_of;
use support::repository;

/// The cells are counted, and the charge is known.
const SETTLED: Duration = Duration::from_secs(4);

/// What is drawn beside the rover's own 0.2 A, and both.
const LOAD: (&str, f32) = ("SIM_BATT_CURRENT", 4.0);
const DRAWN_A: f32 = 4.2;

fn set(parameters: &mut Parameters, name: &str, value: f32) {
    assert_eq!(parameters.set(id_of(name), value), Ok(()), "{name} {value}");
}

/// Of a ready file.
fn settings(file: &str) -> Vec<(String, f32)> {
    let path = repository().join("docs/params").join(file);
    let content = fs::read_to_string(path).expect("a ready file");
    let lines = content.lines().filter(|line| !line.starts_with('#'));
    let pairs = lines.filter_map(|line| line.split_once(','));
    pairs
        .map(|(name, value)| (name.to_string(), value.parse().expect("a number")))
        .collect()
}

/// The first three packs of a rover that started with a file and more than that.
fn packs_with(file: &str, more: &[(&str, f32)]) -> [BatteryState; 3] {
    packs_after(file, more, &[])
}

/// The packs of such a rover a while after something was set.
fn packs_after(file: &str, more: &[(&str, f32)], then: &[(&str, f32)]) -> [BatteryState; 3] {
    let mut parameters = Parameters::defaults();
    for (name, value) in settings(file) {
        set(&mut parameters, &name, value);
    }
    for (name, value) in more {
        set(&mut parameters, name, *value);
    }
    let shared = Shared::new(&Start::with_parameters(parameters));
    let check_in = CheckIn::new("", u32::MAX);
    let pack = RefCell::new(SimulatedPack::full(PackModel::LIPO_3S_2200));
    let rover = SimulatedRover::default();
    let mut memory = [RetainedRecord::BLANK; 2];
    clock::run_for(SETTLED * 2, async {
        let simulation = PackSimulation::new(&pack, &rover, &shared);
        let pins = SimulatedPackInput::new(&simulation);
        let bus = Buses::i2c(SimulatedBus::new(&simulation));
        join3(
            sample_batteries(pins, &mut memory, &shared, &check_in),
            read_bus(bus, &shared, &check_in),
            async {
                Timer::after(SETTLED).await;
                for (name, value) in then {
                    shared.with(|autopilot| set(autopilot.parameters_mut(), name, *value));
                }
            },
        )
        .await
    });
    [Pack::First, Pack::Second, Pack::Third].map(|pack| shared.with(|autopilot| *autopilot.battery(pack)))
}

#[track_caller]
pub fn assert_about(found: Option<f32>, expected: f32, tolerance: f32) {
    let is_about = found.is_some_and(|found| (found - expected).abs() <= tolerance);
    assert!(is_about, "{found:?} instead of {expected}");
}

#[test]
fn a_current_is_measured_and_counted() {
    for file in ["analog-current.param", "ina226.param", "smart-battery.param"] {
        let [pack, ..] = packs_with(file, &[LOAD]);
        println!("{file}: {pack:?}");
        assert_about(pack.readings.voltage_v, 12.05, 0.55);
        assert_about(pack.readings.current_a, DRAWN_A, 0.1);
        assert!(pack.consumed_mah().is_some_and(|mah| mah >= 0.0));
        assert!(pack.readings.remaining_pct.is_some_and(|percent| percent >= 95.0));
        assert_eq!(pack.charge_state, ChargeState::Ok);
    }
}

/// The 0.2 A of BATT_AMP_OFFSET: the simulator's load is not seen.
#[test]
fn a_synthetic_current_is_what_the_rover_takes_at_rest() {
    let [pack, ..] = packs_with("synthetic-current.param", &[LOAD]);
    assert_about(pack.readings.current_a, 0.2, 0.001);
}

#[test]
fn of_a_voltage_alone_no_current_is_made_up() {
    for (file, full_v, at_least_pct, chemistry) in [
        ("3s-lipo.param", 12.6, 90.0, Chemistry::LiPo),
        ("2s-18650.param", 8.4, 90.0, Chemistry::LiIon),
        ("3s-life.param", 10.6, 90.0, Chemistry::LiFe),
        ("6s-nimh.param", 8.4, 85.0, Chemistry::NiMh),
    ] {
        let [pack, ..] = packs_with(file, &[("SIM_BATT_VOLTAGE", full_v)]);
        println!("{file}: {pack:?}");
        assert_eq!((pack.readings.current_a, pack.consumed_mah()), (None, None));
        let percent = pack.readings.remaining_pct.expect("it is known");
        assert!((at_least_pct..=100.0).contains(&percent), "{percent}");
        assert_eq!((pack.charge_state, pack.chemistry), (ChargeState::Ok, chemistry));
        assert!(pack.readings.faults.is_empty());
    }
}

#[test]
fn two_packs_and_their_sum() {
    let [divider, monitor, both] = packs_with("two-packs-and-sum.param", &[LOAD]);
    for pack in [divider, monitor, both] {
        assert_eq!(pack.charge_state, ChargeState::Ok);
    }
    let mean_v = divider
        .readings
        .voltage_v
        .zip(monitor.readings.voltage_v)
        .map(|(one, other)| (one + other) / 2.0);
    assert_about(both.readings.voltage_v, mean_v.expect("both are measured"), 0.05);
    assert_eq!(
        (divider.readings.current_a, both.readings.current_a),
        (None, None),
        "of one of them it is not known"
    );
    assert_about(monitor.readings.current_a, DRAWN_A, 0.1);
}

/// The simulator has no tank. Its current sensor's pin has 0.25 V at 4.2 A: a level for other ends than the file's.
#[test]
fn a_tank_is_measured_in_millilitres() {
    let other_ends = [
        LOAD,
        ("BATT2_FL_PIN", 27.0),
        ("BATT2_FL_VLT_MIN", 0.01),
        ("BATT2_FL_V_MULT", 2.0),
    ];
    let [_, tank, _] = packs_with("fuel-level.param", &other_ends);
    assert_eq!((tank.readings.voltage_v, tank.readings.current_a), (None, None));
    assert_about(tank.readings.remaining_pct, 49.0, 3.0);
    assert_about(tank.consumed_ml(), 1500.0 * 0.51, 50.0);
}

const STALLED: f32 = 1.0;
const WIRE_OFF: f32 = 2.0;
const WEAK_CELL: f32 = 4.0;

#[test]
fn a_converter_that_stalls_leaves_the_last_voltage() {
    let [pack, ..] = packs_after("3s-lipo.param", &[], &[("SIM_BATT_FAULT", STALLED)]);
    assert_eq!(pack.charge_state, ChargeState::Unhealthy);
    assert_about(pack.readings.voltage_v, 12.5, 0.1);
}

#[test]
fn behind_a_wire_that_is_off_there_is_no_voltage() {
    let [pack, ..] = packs_after("3s-lipo.param", &[], &[("SIM_BATT_FAULT", WIRE_OFF)]);
    assert_eq!(
        (pack.charge_state, pack.readings.voltage_v),
        (ChargeState::Undefined, None)
    );
}

#[test]
fn a_weak_cell_is_a_failed_pack() {
    let [pack, ..] = packs_after("smart-battery.param", &[], &[("SIM_BATT_FAULT", WEAK_CELL)]);
    assert_eq!(pack.charge_state, ChargeState::Failed);
    assert!(pack.readings.faults.contains(Faults::CELL_FAIL));
}
