use proptest::prelude::*;

use super::*;
use crate::vehicle::MotorDrive;

const TIMEOUT_US: u64 = 1_500_000;
const TICK_US: u64 = 20_000;

const SETTINGS: VehicleSettings = VehicleSettings {
    timeout_us: TIMEOUT_US,
    ground_station_timeout_us: TIMEOUT_US,
    slew_rate_per_s: Some(1.0),
};

fn both(share: f32) -> SideDrives {
    SideDrives {
        left: MotorDrive::Turn(share),
        right: MotorDrive::Turn(share),
    }
}

fn armed_in(mode: Mode) -> Vehicle {
    let mut vehicle = Vehicle::new();
    assert_eq!(vehicle.arm(0, true), Ok(()));
    assert_eq!(vehicle.set_mode(mode), Ok(()));
    vehicle
}

/// Lets ticks pass and returns what happened, and when.
fn run(vehicle: &mut Vehicle, from_us: u64, to_us: u64) -> Vec<(u64, VehicleEvent)> {
    (from_us..=to_us)
        .step_by(TICK_US as usize)
        .filter_map(|now_us| vehicle.update(now_us, &SETTINGS).map(|event| (now_us, event)))
        .collect()
}

#[test]
fn it_starts_disarmed_in_hold_and_rolls_freely() {
    let vehicle = Vehicle::new();
    assert_eq!(vehicle.status(), VehicleStatus::default());
    assert_eq!(vehicle.drives(), SideDrives::COAST);
}

#[test]
fn hold_brakes_and_manual_follows_the_levers_as_fast_as_it_may() {
    let mut vehicle = armed_in(Mode::Hold);
    assert_eq!(vehicle.drives(), SideDrives::BRAKE);
    vehicle.set_mode(Mode::Manual).unwrap();
    assert_eq!(vehicle.drives(), SideDrives::COAST);
    vehicle.control(0, Lever::At(1000), Lever::At(0));
    vehicle.update(0, &SETTINGS);
    vehicle.update(500_000, &SETTINGS);
    assert_eq!(vehicle.drives(), both(0.5));
    assert_eq!(vehicle.effort(), 0.5);
    run(&mut vehicle, 520_000, 1_200_000);
    assert_eq!(vehicle.drives(), both(1.0));
    vehicle.set_mode(Mode::Hold).unwrap();
    assert_eq!(vehicle.drives(), SideDrives::BRAKE);
    vehicle.set_mode(Mode::Manual).unwrap();
    assert_eq!(vehicle.drives(), SideDrives::COAST, "it starts anew");
}

#[test]
fn levers_that_were_pushed_long_before_arming_do_not_drive() {
    let mut vehicle = Vehicle::new();
    vehicle.control(0, Lever::At(1000), Lever::At(1000));
    run(&mut vehicle, 0, 3_000_000);
    vehicle.arm(3_000_000, true).unwrap();
    vehicle.set_mode(Mode::Manual).unwrap();
    assert_eq!(run(&mut vehicle, 3_000_000, 5_000_000), []);
    assert_eq!(vehicle.drives(), SideDrives::COAST);
}

#[test]
fn controls_that_fall_silent_hold_it_once_until_they_come_back() {
    let mut vehicle = armed_in(Mode::Manual);
    vehicle.control(0, Lever::At(1000), Lever::At(0));
    let events = run(&mut vehicle, 0, 10_000_000);
    assert_eq!(events, [(1_520_000, VehicleEvent::ControlsSilent)]);
    assert_eq!(vehicle.drives(), SideDrives::BRAKE);
    assert_eq!(vehicle.status().alert, Alert::Failsafe);
    assert_eq!(vehicle.set_mode(Mode::Manual), Err(ModeRefused));
    assert_eq!(vehicle.set_mode(Mode::Hold), Ok(()));
    vehicle.control(10_000_000, Lever::At(0), Lever::At(0));
    assert_eq!(vehicle.status().alert, Alert::None);
    assert_eq!(vehicle.status().mode, Mode::Hold);
    assert_eq!(vehicle.set_mode(Mode::Manual), Ok(()));
}

#[test]
fn ground_stations_that_fall_silent_hold_it_and_a_driver_is_one() {
    let mut vehicle = armed_in(Mode::Manual);
    vehicle.ground_station_seen(0);
    for second in 0..5 {
        vehicle.control(second * 1_000_000, Lever::At(100), Lever::At(0));
        assert_eq!(
            run(&mut vehicle, second * 1_000_000, (second + 1) * 1_000_000),
            []
        );
    }
    vehicle.control(5_000_000, Lever::Released, Lever::Released);
    assert_eq!(
        run(&mut vehicle, 5_000_000, 9_000_000),
        [(6_520_000, VehicleEvent::GroundStationsSilent)]
    );
    vehicle.disarm();
    assert_eq!(vehicle.status().alert, Alert::None);
}

#[test]
fn nobody_has_to_come_who_has_not_come_yet() {
    let mut vehicle = armed_in(Mode::Manual);
    assert_eq!(run(&mut vehicle, 0, 60_000_000), []);
    assert_eq!(vehicle.status().mode, Mode::Manual);
}

#[test]
fn every_action_but_a_warning_ends_in_hold_or_disarmed() {
    for (number, mode, arm_state, event) in [
        (0, Mode::Manual, ArmState::Armed, None),
        (1, Mode::Hold, ArmState::Armed, Some("RTL needs a position: Hold")),
        (2, Mode::Hold, ArmState::Armed, None),
        (
            3,
            Mode::Hold,
            ArmState::Armed,
            Some("SmartRTL needs a position: Hold"),
        ),
        (
            4,
            Mode::Hold,
            ArmState::Armed,
            Some("SmartRTL needs a position: Hold"),
        ),
        (
            5,
            Mode::Manual,
            ArmState::Disarmed,
            Some("Terminated by battery failsafe"),
        ),
        (
            6,
            Mode::Hold,
            ArmState::Armed,
            Some("Loiter needs a position: Hold"),
        ),
    ] {
        let mut vehicle = armed_in(Mode::Manual);
        // ArduPilot never does 6 after a warning.
        vehicle.battery_failsafe(FailsafeAction::Warn);
        let action = FailsafeAction::from_number(number).unwrap();
        let said = vehicle.battery_failsafe(action).map(|event| event.to_string());
        assert_eq!(said.as_deref(), event, "{number}");
        let status = vehicle.status();
        assert_eq!((status.mode, status.arm_state), (mode, arm_state), "{number}");
    }
}

#[test]
fn the_most_severe_action_wins_and_one_as_severe_is_done_again() {
    let mut vehicle = armed_in(Mode::Manual);
    vehicle.battery_failsafe(FailsafeAction::Hold);
    vehicle.set_mode(Mode::Manual).unwrap();
    assert_eq!(vehicle.battery_failsafe(FailsafeAction::Rtl), None);
    assert_eq!(vehicle.status().mode, Mode::Manual);
    vehicle.battery_failsafe(FailsafeAction::Hold);
    assert_eq!(vehicle.status().mode, Mode::Hold);
}

#[test]
fn a_reset_battery_ends_what_was_done_about_it() {
    let mut vehicle = armed_in(Mode::Manual);
    vehicle.battery_failsafe(FailsafeAction::Terminate);
    vehicle.follow_batteries(FailsafeLevel::Critical);
    assert_eq!(vehicle.status().alert, Alert::Terminated);
    assert_eq!(vehicle.arm(0, true), Err(ArmingRefused::Terminated));
    vehicle.follow_batteries(FailsafeLevel::None);
    assert_eq!(vehicle.status().alert, Alert::None);
    assert_eq!(vehicle.arm(0, true), Ok(()));
}

/// The buzzer in steps of 100 ms.
fn tones(vehicle: &Vehicle, from_us: u64, steps: u64) -> String {
    (0..steps)
        .map(
            |step| match vehicle.indication(from_us + step * 100_000 + 50_000).tone {
                Tone::Sounding => 'x',
                Tone::Silent => '.',
            },
        )
        .collect()
}

#[test]
fn lamps_and_buzzer_tell_how_it_is() {
    let mut vehicle = Vehicle::new();
    let colour = |vehicle: &Vehicle| vehicle.indication(0).colour;
    assert_eq!(colour(&vehicle), Colour::Green);
    assert_eq!(tones(&vehicle, 0, 40), "........................................");
    assert_eq!(vehicle.arm(1_000_000, false), Err(ArmingRefused::Unfit));
    assert_eq!(tones(&vehicle, 1_000_000, 10), "xxxxx.....");
    vehicle.arm(3_000_000, true).unwrap();
    assert_eq!(colour(&vehicle), Colour::Blue);
    vehicle.follow_batteries(FailsafeLevel::Low);
    assert_eq!(colour(&vehicle), Colour::Yellow);
    assert_eq!(
        tones(&vehicle, 4_000_000, 40),
        "x...................x..................."
    );
    vehicle.follow_batteries(FailsafeLevel::Critical);
    assert_eq!(colour(&vehicle), Colour::Red);
    assert_eq!(tones(&vehicle, 4_000_000, 20), "x.x.x.....x.x.x.....");
}

/// Anything that can happen to a rover.
#[derive(Clone, Debug)]
enum Happening {
    Arm(bool),
    Disarm,
    Mode(Mode),
    Control(Lever, Lever),
    GroundStation,
    Failsafe(i32),
    Batteries(FailsafeLevel),
    Wait(u64),
}

fn lever() -> impl Strategy<Value = Lever> {
    prop_oneof![
        4 => any::<i16>().prop_map(Lever::At),
        1 => Just(Lever::Released),
        1 => Just(Lever::Unchanged),
    ]
}

fn happening() -> impl Strategy<Value = Happening> {
    use FailsafeLevel::{Critical, Low, None, Unhealthy};
    prop_oneof![
        any::<bool>().prop_map(Happening::Arm),
        Just(Happening::Disarm),
        prop_oneof![Just(Mode::Manual), Just(Mode::Hold)].prop_map(Happening::Mode),
        (lever(), lever()).prop_map(|(throttle, steering)| Happening::Control(throttle, steering)),
        Just(Happening::GroundStation),
        (0..=6).prop_map(Happening::Failsafe),
        prop::sample::select(vec![None, Unhealthy, Low, Critical]).prop_map(Happening::Batteries),
        (0u64..3_000_000).prop_map(Happening::Wait),
    ]
}

fn is_in_range(drive: MotorDrive) -> bool {
    match drive {
        MotorDrive::Coast | MotorDrive::Brake => true,
        MotorDrive::Turn(share) => (0.01..=1.0).contains(&share.abs()),
    }
}

proptest! {
    #[test]
    fn whatever_happens_the_motors_are_told_something_sound(
        happenings in prop::collection::vec(happening(), 0..200),
        slew_rate_per_s in prop::option::of(0.01f32..10.0),
    ) {
        let settings = VehicleSettings { slew_rate_per_s, ..SETTINGS };
        let (mut vehicle, mut now_us) = (Vehicle::new(), 0);
        for happening in happenings {
            match happening {
                Happening::Arm(is_fit) => drop(vehicle.arm(now_us, is_fit)),
                Happening::Disarm => vehicle.disarm(),
                Happening::Mode(mode) => drop(vehicle.set_mode(mode)),
                Happening::Control(throttle, steering) => vehicle.control(now_us, throttle, steering),
                Happening::GroundStation => vehicle.ground_station_seen(now_us),
                Happening::Failsafe(number) => {
                    vehicle.battery_failsafe(FailsafeAction::from_number(number).unwrap());
                }
                Happening::Batteries(worst) => vehicle.follow_batteries(worst),
                Happening::Wait(us) => {
                    now_us += us;
                    vehicle.update(now_us, &settings);
                }
            }
            let (drives, status) = (vehicle.drives(), vehicle.status());
            prop_assert!(is_in_range(drives.left) && is_in_range(drives.right), "{drives:?}");
            prop_assert!((0.0..=1.0).contains(&vehicle.effort()));
            match (status.arm_state, status.mode) {
                (ArmState::Disarmed, _) => prop_assert_eq!(drives, SideDrives::COAST),
                (ArmState::Armed, Mode::Hold) => prop_assert_eq!(drives, SideDrives::BRAKE),
                (ArmState::Armed, Mode::Manual) => prop_assert_ne!(status.alert, Alert::Terminated),
            }
        }
    }
}
