use proptest::prelude::*;

use super::*;
use crate::parameter::{Parameters, StickChannel, StickChannels, StickParameter};
use crate::time::at_us;
use crate::vehicle::MotorDrive;

const TIMEOUT_US: u64 = 1_500_000;
const TICK_US: u64 = 20_000;

const SETTINGS: VehicleSettings = VehicleSettings {
    timeout_us: TIMEOUT_US,
    ground_station_timeout_us: TIMEOUT_US,
    channels: StickChannels {
        throttle: StickChannel::THROTTLE,
        steering: StickChannel::STEERING,
    },
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
    assert_eq!(vehicle.arm(Instant::EPOCH, Fitness::Checked), Ok(()));
    assert_eq!(vehicle.set_mode(mode), Ok(()));
    vehicle
}

/// A vehicle that its driver is about to drive, with centred sticks.
fn driven_in(mode: Mode) -> Vehicle {
    let mut vehicle = armed_in(mode);
    drive(&mut vehicle, Instant::EPOCH, 0);
    vehicle
}

/// Runs ticks and returns the events with their times.
fn run(vehicle: &mut Vehicle, from_us: u64, to_us: u64) -> Vec<(u64, VehicleEvent)> {
    (from_us..=to_us)
        .step_by(TICK_US as usize)
        .filter_map(|us| vehicle.update(at_us(us), &SETTINGS).map(|event| (us, event)))
        .collect()
}

fn steer(vehicle: &mut Vehicle, at: Instant, throttle: StickInput, steering: StickInput) {
    let result = vehicle.control(
        DriverId::default(),
        at,
        Presence::GroundStation,
        throttle,
        steering,
    );
    result.expect("no other one drives");
}

/// Moves the throttle, with the steering centred.
fn drive(vehicle: &mut Vehicle, at: Instant, throttle: i16) {
    let throttle = StickInput::Position(throttle);
    steer(vehicle, at, throttle, StickInput::Position(0));
}

fn steer_by_channels(vehicle: &mut Vehicle, at: Instant, pulses_us: &[u16]) {
    let (throttle, steering) = vehicle.stick_inputs(pulses_us);
    steer(vehicle, at, throttle, steering);
}

#[test]
fn hold_brakes_and_manual_follows_the_sticks() {
    let mut vehicle = armed_in(Mode::Hold);
    assert_eq!(vehicle.drives(), SideDrives::BRAKE);
    drive(&mut vehicle, Instant::EPOCH, 0);
    vehicle.set_mode(Mode::Manual).unwrap();
    assert_eq!(vehicle.drives(), SideDrives::COAST);
    drive(&mut vehicle, Instant::EPOCH, 1000);
    vehicle.update(Instant::EPOCH, &SETTINGS);
    vehicle.update(at_us(500_000), &SETTINGS);
    assert_eq!(vehicle.drives(), both(0.5));
    assert_eq!(vehicle.effort(), 0.5);
    run(&mut vehicle, 520_000, 1_200_000);
    assert_eq!(vehicle.drives(), both(1.0));
    vehicle.set_mode(Mode::Hold).unwrap();
    assert_eq!(vehicle.drives(), SideDrives::BRAKE);
    vehicle.set_mode(Mode::Manual).unwrap();
    assert_eq!(vehicle.drives(), SideDrives::COAST, "the limiter is reset");
}

#[test]
fn heartbeat_time_out_holds_and_control_counts_as_one() {
    let mut vehicle = armed_in(Mode::Manual);
    vehicle.ground_station_seen(Instant::EPOCH);
    for second in 0..5 {
        let from_us = second * 1_000_000;
        drive(&mut vehicle, at_us(from_us), 100);
        assert_eq!(run(&mut vehicle, from_us, from_us + 1_000_000), []);
    }
    let released = StickInput::Released;
    steer(&mut vehicle, at_us(5_000_000), released, released);
    assert_eq!(run(&mut vehicle, 5_000_000, 6_000_000), []);
    // Other channels do not.
    let unchanged = StickInput::Unchanged;
    steer(&mut vehicle, at_us(6_000_000), unchanged, unchanged);
    let events = run(&mut vehicle, 6_020_000, 9_000_000);
    assert_eq!(events, [(6_520_000, VehicleEvent::GroundStationsTimedOut)]);
    vehicle.disarm();
    assert_eq!(vehicle.status().alert, Alert::None);
}

#[test]
fn changed_channels_wait_for_disarming_and_a_neutral_stick() {
    let mut parameters = Parameters::defaults();
    parameters
        .set(StickParameter::Rc3Reversed, 1.0)
        .expect("in range");
    let reversed = VehicleSettings::from_parameters(&parameters);
    let mut vehicle = driven_in(Mode::Manual);
    let push = |vehicle: &mut Vehicle, us: u64, pulse_us: u16| {
        steer_by_channels(vehicle, at_us(us), &[1500, 0, pulse_us, u16::MAX, 0, 0, 0, 0]);
        vehicle.update(at_us(us), &reversed);
    };
    push(&mut vehicle, 0, 1600);
    push(&mut vehicle, 1_000_000, 1600);
    assert_eq!(vehicle.drives(), both(0.2), "armed, the channel is what it was");
    vehicle.disarm();
    vehicle.update(at_us(1_000_000), &reversed);
    assert_eq!(vehicle.deflected_stick(), Some(Stick::Throttle));
    push(&mut vehicle, 1_100_000, 1510);
    assert_eq!(vehicle.deflected_stick(), None);
    push(&mut vehicle, 1_200_000, 1600);
    assert_eq!(vehicle.deflected_stick(), Some(Stick::Throttle));
    push(&mut vehicle, 1_300_000, 1500);
    assert_eq!(vehicle.arm(at_us(1_300_000), Fitness::Checked), Ok(()));
    push(&mut vehicle, 1_400_000, 1600);
    push(&mut vehicle, 2_400_000, 1600);
    assert_eq!(vehicle.drives(), both(-0.2));
}

#[test]
fn sticks_that_are_not_in_use_do_not_prevent_arming_after_a_change_but_must_be_neutral_to_drive() {
    let mut parameters = Parameters::defaults();
    parameters.set(StickParameter::Rc3Trim, 1400.0).expect("in range");
    let settings = VehicleSettings::from_parameters(&parameters);
    let mut vehicle = Vehicle::new();
    vehicle.update(Instant::EPOCH, &settings);
    assert_eq!(vehicle.deflected_stick(), None);
    assert_eq!(vehicle.arm(Instant::EPOCH, Fitness::Checked), Ok(()));
    assert_eq!(vehicle.set_mode(Mode::Manual), Ok(()));
    for (us, pulse_us, expected) in [
        (0, 2000, SideDrives::COAST),
        (1_000_000, 2000, SideDrives::COAST),
        (2_000_000, 1400, SideDrives::COAST),
        (2_100_000, 2000, both(0.1)),
        (3_100_000, 2000, both(1.0)),
    ] {
        steer_by_channels(&mut vehicle, at_us(us), &[1500, 0, pulse_us, 0, 0, 0, 0, 0]);
        vehicle.update(at_us(us), &settings);
        assert_eq!(vehicle.drives(), expected, "{us}");
    }
}

#[test]
fn disarming_ends_a_time_out_of_the_sticks() {
    let mut vehicle = driven_in(Mode::Manual);
    let events = run(&mut vehicle, 0, 2_000_000);
    assert_eq!(events, [(1_520_000, VehicleEvent::ControlsTimedOut)]);
    assert_eq!(vehicle.status().alert, Alert::TimedOut);
    assert_eq!(vehicle.indication(at_us(2_000_000)).colour, Colour::Yellow);
    vehicle.disarm();
    assert_eq!(vehicle.status().alert, Alert::None);
}

#[test]
fn inputs_never_received_do_not_time_out() {
    let mut vehicle = armed_in(Mode::Manual);
    assert_eq!(run(&mut vehicle, 0, 60_000_000), []);
    assert_eq!(vehicle.status().mode, Mode::Manual);
}

#[test]
// Requirement: AP-19
fn every_action_but_warn_holds_or_disarms() {
    use ArmState::{Armed, Disarmed};
    use Mode::{Hold, Manual};
    for (number, mode, arm_state, event) in [
        (0, Manual, Armed, None),
        (1, Hold, Armed, Some("RTL needs a position: Hold")),
        (2, Hold, Armed, None),
        (3, Hold, Armed, Some("SmartRTL needs a position: Hold")),
        (4, Hold, Armed, Some("SmartRTL needs a position: Hold")),
        (5, Manual, Disarmed, Some("Terminated by battery failsafe")),
        (6, Hold, Armed, Some("Loiter needs a position: Hold")),
    ] {
        let mut vehicle = armed_in(Mode::Manual);
        // ArduPilot never executes 6 after a warning.
        vehicle.battery_failsafe(Pack::First, FailsafeAction::Warn);
        let action = FailsafeAction::from_number(number).unwrap();
        let text = vehicle
            .battery_failsafe(Pack::First, action)
            .map(|event| event.to_string());
        assert_eq!(text.as_deref(), event, "{number}");
        let status = vehicle.status();
        assert_eq!((status.mode, status.arm_state), (mode, arm_state), "{number}");
    }
}

#[test]
fn an_action_that_ends_in_hold_holds_again_whatever_held_before() {
    let holding = [1, 2, 3, 4, 6].map(|number| FailsafeAction::from_number(number).unwrap());
    for (before, action) in holding
        .iter()
        .flat_map(|before| holding.map(|action| (*before, action)))
    {
        let mut vehicle = armed_in(Mode::Manual);
        vehicle.battery_failsafe(Pack::First, before);
        vehicle.set_mode(Mode::Manual).unwrap();
        let event = vehicle.battery_failsafe(Pack::First, action);
        assert_eq!(vehicle.status().mode, Mode::Hold, "{action:?} after {before:?}");
        assert_eq!(event.is_some(), action.needs_position());
        vehicle.set_mode(Mode::Manual).unwrap();
        vehicle.battery_failsafe(Pack::First, FailsafeAction::Warn);
        assert_eq!(vehicle.status().mode, Mode::Manual);
    }
}

#[test]
fn a_termination_ends_once_each_pack_that_caused_it_has_no_level() {
    let (first, second, third) = (Pack::First, Pack::Second, Pack::Third);
    let mut vehicle = armed_in(Mode::Manual);
    // The third pack only holds.
    vehicle.battery_failsafe(third, FailsafeAction::Hold);
    vehicle.battery_failsafe(first, FailsafeAction::Terminate);
    vehicle.battery_failsafe(second, FailsafeAction::Terminate);
    for (at_a_level, is_terminated) in [
        (PackSet::from_iter([first, second, third]), true),
        (PackSet::from_iter([second, third]), true),
        // A level of the first that is reached later terminates nothing.
        (PackSet::from_iter([first, second, third]), true),
        (PackSet::from_iter([first, third]), false),
        (PackSet::from_iter([second]), false),
    ] {
        vehicle.update_batteries(at_a_level, BatteryAlert::Urgent);
        assert_eq!(vehicle.is_terminated(), is_terminated, "{at_a_level}");
    }
    assert_eq!(vehicle.arm(Instant::EPOCH, Fitness::Checked), Ok(()));
}

/// The buzzer's output in steps of 100 ms.
fn tones(vehicle: &Vehicle, from_us: u64, steps: u64) -> String {
    (0..steps)
        .map(
            |step| match vehicle.indication(at_us(from_us + step * 100_000 + 50_000)).tone {
                Tone::Sounding => 'x',
                Tone::Silent => '.',
            },
        )
        .collect()
}

#[test]
fn lamps_and_buzzer_indicate_the_state() {
    let mut vehicle = Vehicle::new();
    let colour = |vehicle: &Vehicle| vehicle.indication(Instant::EPOCH).colour;
    assert_eq!(colour(&vehicle), Colour::Green);
    assert_eq!(tones(&vehicle, 0, 40), "........................................");
    let armed = vehicle.arm(at_us(1_000_000), Fitness::Unfit);
    assert_eq!(armed, Err(ArmingRefused::Unfit));
    assert_eq!(tones(&vehicle, 1_000_000, 10), "xxxxx.....");
    vehicle.arm(at_us(3_000_000), Fitness::Checked).unwrap();
    assert_eq!(colour(&vehicle), Colour::Blue);
    vehicle.update_batteries(PackSet::from_iter([Pack::First]), BatteryAlert::Warning);
    assert_eq!(colour(&vehicle), Colour::Yellow);
    let expected = "x...................x...................";
    assert_eq!(tones(&vehicle, 4_000_000, 40), expected);
    vehicle.update_batteries(PackSet::from_iter([Pack::First]), BatteryAlert::Urgent);
    assert_eq!(colour(&vehicle), Colour::Red);
    assert_eq!(tones(&vehicle, 4_000_000, 20), "x.x.x.....x.x.x.....");
}

#[test]
fn a_forgotten_pack_flashes_every_ten_seconds_and_sounds_each_minute_until_it_is_attended() {
    const MINUTE_US: u64 = 60_000_000;
    let mut vehicle = Vehicle::new();
    vehicle.update_below_critical(Pack::First, true);
    let at = |vehicle: &mut Vehicle, now_us: u64| {
        vehicle.update(at_us(now_us), &SETTINGS);
        vehicle.indication(at_us(now_us))
    };
    assert_eq!(at(&mut vehicle, 10 * MINUTE_US - 1).colour, Colour::Green);
    let shown: Vec<_> = (0..600)
        .map(|step| at(&mut vehicle, 10 * MINUTE_US + step * 100_000 + 50_000))
        .collect();
    let flashes: Vec<_> = (0..600)
        .filter(|step| shown[*step].colour != Colour::Off)
        .collect();
    assert_eq!(flashes, [0, 100, 200, 300, 400, 500]);
    assert!(flashes.iter().all(|step| shown[*step].colour == Colour::Red));
    let tones: Vec<_> = (0..600)
        .filter(|step| shown[*step].tone == Tone::Sounding)
        .collect();
    assert_eq!(tones, [0, 2, 4]);
    let now_us = 12 * MINUTE_US + 1_000_000;
    let station = |vehicle: &mut Vehicle| vehicle.ground_station_seen(at_us(now_us));
    let stick = |vehicle: &mut Vehicle| drive(vehicle, at_us(now_us), 0);
    let charger = |vehicle: &mut Vehicle| vehicle.update_below_critical(Pack::First, false);
    let arm = |vehicle: &mut Vehicle| vehicle.arm(at_us(now_us), Fitness::Forced).unwrap();
    let ways: [&dyn Fn(&mut Vehicle); 4] = [&station, &stick, &charger, &arm];
    for comes in ways {
        let mut vehicle = vehicle.clone();
        assert_eq!(at(&mut vehicle, now_us).colour, Colour::Off);
        comes(&mut vehicle);
        assert_ne!(at(&mut vehicle, now_us).colour, Colour::Off);
        assert_ne!(at(&mut vehicle, now_us + 9 * MINUTE_US).colour, Colour::Off);
    }
}

#[test]
fn a_charge_state_is_indicated_without_a_failsafe() {
    let mut vehicle = Vehicle::new();
    for (alert, colour, expected_tones) in [
        (BatteryAlert::Charging, Colour::White, "...................."),
        (BatteryAlert::Warning, Colour::Yellow, "x..................."),
        (BatteryAlert::Urgent, Colour::Red, "x.x.x.....x.x.x....."),
        (BatteryAlert::None, Colour::Green, "...................."),
    ] {
        vehicle.update_batteries(PackSet::NONE, alert);
        assert_eq!(vehicle.indication(Instant::EPOCH).colour, colour);
        assert_eq!(tones(&vehicle, 4_000_000, 20), expected_tones);
        assert_eq!(vehicle.status().alert, Alert::None, "{alert:?} is not a failsafe");
    }
}

/// Any input of the state machine.
#[derive(Clone, Debug)]
enum Input {
    Arm(Fitness),
    Disarm,
    Mode(Mode),
    Control(StickInput, StickInput),
    GroundStation,
    Failsafe(i32),
    /// Packs at a failsafe level.
    Batteries(PackSet),
    Wait(u64),
}

fn stick_input() -> impl Strategy<Value = StickInput> {
    prop_oneof![
        4 => (-1000i16..=1000).prop_map(StickInput::Position),
        1 => Just(StickInput::Released),
        1 => Just(StickInput::Unchanged),
    ]
}

fn input() -> impl Strategy<Value = Input> {
    prop_oneof![
        prop::sample::select(vec![Fitness::Unfit, Fitness::Checked, Fitness::Forced]).prop_map(Input::Arm),
        Just(Input::Disarm),
        prop_oneof![Just(Mode::Manual), Just(Mode::Hold)].prop_map(Input::Mode),
        (stick_input(), stick_input()).prop_map(|(throttle, steering)| Input::Control(throttle, steering)),
        Just(Input::GroundStation),
        (0..=6).prop_map(Input::Failsafe),
        (0u16..4).prop_map(|bits| Input::Batteries(PackSet::from_bits(bits))),
        (0u64..3_000_000).prop_map(Input::Wait),
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
    fn outputs_are_valid_for_any_sequence_of_inputs(
        inputs in prop::collection::vec(input(), 0..200),
        slew_rate_per_s in prop::option::of(0.01f32..10.0),
    ) {
        let settings = VehicleSettings { slew_rate_per_s, ..SETTINGS };
        let (mut vehicle, mut now) = (Vehicle::new(), Instant::EPOCH);
        for input in inputs {
            match input {
                Input::Arm(fitness) => drop(vehicle.arm(now, fitness)),
                Input::Disarm => vehicle.disarm(),
                Input::Mode(mode) => drop(vehicle.set_mode(mode)),
                Input::Control(throttle, steering) => {
                    let _ = vehicle.control(DriverId::default(), now, Presence::GroundStation, throttle, steering);
                }
                Input::GroundStation => vehicle.ground_station_seen(now),
                Input::Failsafe(number) => {
                    vehicle.battery_failsafe(Pack::First, FailsafeAction::from_number(number).unwrap());
                }
                Input::Batteries(at_a_level) => vehicle.update_batteries(at_a_level, BatteryAlert::None),
                Input::Wait(us) => {
                    now = now.after_us(us);
                    vehicle.update(now, &settings);
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

#[test]
fn lamps_and_buzzer_are_off_before_the_boot_loader_alone() {
    let mut vehicle = Vehicle::new();
    vehicle.update_batteries(PackSet::from_iter([Pack::First]), BatteryAlert::Urgent);
    vehicle.prepare_restart(Restart::Firmware);
    assert_eq!(vehicle.indication(Instant::EPOCH).colour, Colour::Red);
    vehicle.prepare_restart(Restart::BootLoader);
    assert_eq!(vehicle.indication(Instant::EPOCH), Indication::default());
}

#[test]
// Requirement: L-4
fn a_requested_boot_loader_is_not_revoked_by_a_restart() {
    use Restart::{BootLoader, Fault, Firmware};
    for (requests, pending) in [
        (vec![], None),
        (vec![Firmware, Firmware], Some(Firmware)),
        (vec![Firmware, BootLoader], Some(BootLoader)),
        (vec![BootLoader, BootLoader, Firmware, Firmware], Some(BootLoader)),
        (vec![Firmware, Fault, Firmware], Some(Fault)),
        (vec![BootLoader, Fault], Some(BootLoader)),
    ] {
        let mut vehicle = Vehicle::new();
        for restart in requests {
            vehicle.prepare_restart(restart);
        }
        assert_eq!(vehicle.pending_restart(), pending);
    }
}
