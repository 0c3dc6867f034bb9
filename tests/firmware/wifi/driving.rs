//! Driving over Wi-Fi, and what becomes of the rover when the driver is gone.

use super::ground::{Ground, Station};
use crate::rover::{GOOD_3S, VEHICLE_ID, is_braking};
use crate::wheels::duties;
use emulator::{Board, LogLevel};
use support::frames::result_of;
use support::motor_poles::motors;
use support::requests::{arm, manual_control, manual_mode};
use workbench::bench::{Bench, MILLISECOND, SECOND, TestedVehicle};
use workbench::rover_circuit::{THREE_CELLS_V, connect};

/// `FS_TIMEOUT` is 1.5 s; the rover looks every 20 ms, and a packet takes some.
const STOPPED_WITHIN_US: u64 = 1_600 * MILLISECOND;

/// A rover that follows sticks at once, and its network.
pub fn rover() -> Ground {
    let mut ground = Ground::of(Bench::power_up(GOOD_3S));
    ground.bench.set("BATT_CELLS", 3.0);
    ground.bench.set("MOT_SLEWRATE", 0.0);
    connect(&mut ground.bench, THREE_CELLS_V);
    ground
}

pub fn arm_by(station: &mut Station, ground: &mut Ground) {
    let answers = ground.ask(station, &arm());
    assert_eq!(result_of(&answers), 0, "{answers:?}");
    ground.ask(station, &manual_mode());
    // A stick drives once it was centred.
    ground.send(station, &manual_control(VEHICLE_ID, 0, 0));
}

pub fn is_driving(board: &Board) -> bool {
    motors().all(|motor| {
        let (positive, negative) = duties(motor, board);
        positive > negative
    })
}

#[test]
// Requirement: OWN-7
fn by_udp_the_rover_drives_and_stops_when_the_phone_is_gone() {
    let mut ground = rover();
    let mut station = ground.found_station();
    arm_by(&mut station, &mut ground);
    for _ in 0..50 {
        ground.send(&mut station, &manual_control(VEHICLE_ID, 0, 500));
        ground.run_for(SECOND / 50);
    }
    assert!(is_driving(&ground.bench));

    // The phone is out of reach, and nothing says so.
    ground.air.laptop(station.laptop).credentials = None;
    let gone_us = ground.bench.time_us();
    ground.run_for(3 * SECOND);
    assert!(is_braking(&ground.bench));
    let (acted_us, _) = ground.bench.logged(LogLevel::Info, "Radio Failsafe")[0];
    let after_us = acted_us - gone_us;
    assert!(after_us <= STOPPED_WITHIN_US, "{after_us} us");
    ground.assert_not_reset();
}

#[test]
fn a_touch_in_a_browser_reaches_the_motors_within_100_ms() {
    let mut ground = rover();
    let mut station = ground.web_station();
    arm_by(&mut station, &mut ground);
    ground.run_for(SECOND / 20);
    let touched_us = ground.bench.time_us();
    ground.send(&mut station, &manual_control(VEHICLE_ID, 0, 1000));
    let drives = ground
        .air
        .run_until(&mut ground.bench, SECOND, |_, bench| is_driving(bench));
    let took_us = ground.bench.time_us() - touched_us;
    println!("{took_us} us from a touch to the motors");
    assert!(drives && took_us <= 100 * MILLISECOND, "{took_us}");
}
