//! Packs that motor controllers measure together: their readings in, the packs' states out.

use rover_battmon::autopilot::Start;
use rover_battmon::battery::{BatteryState, Consequences, Faults, PackStatus};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, Parameters};
use rover_battmon::sensor::{AnalogReadings, ControllerReading};
use rover_battmon::vehicle::ArmState;
use support::desk::Desk;
use support::frames::texts_of;
use support::monitor_types::ESC;
use support::requests::arm;

const TICK_US: u64 = 100_000;
const SECOND_TICKS: usize = 10;

/// The first two packs are measured by the controllers of these masks.
fn desk(masks: [u16; 2]) -> Desk {
    let mut parameters = Parameters::defaults();
    for (pack, mask) in [Pack::First, Pack::Second].into_iter().zip(masks) {
        for (parameter, value) in [
            (BatteryParameter::Monitor, ESC),
            (BatteryParameter::EscMask, f32::from(mask)),
        ] {
            parameters.set(parameter.of(pack), value).expect("in range");
        }
    }
    Desk::starting(Start::with_parameters(parameters))
}

fn reading(voltage_v: f32, current_a: f32, drawn_mah: Option<f32>) -> ControllerReading {
    ControllerReading {
        voltage_v: Some(voltage_v),
        current_a: Some(current_a),
        temperature_c: Some(40.0),
        drawn_mah,
    }
}

/// Ticks in each of which these controllers report twice, and the states of both packs after them.
fn ticks(desk: &mut Desk, count: usize, readings: &[(u8, ControllerReading)]) -> [BatteryState; 2] {
    for _ in 0..count {
        for _ in 0..2 {
            desk.now_us += TICK_US / 2;
            for (index, reading) in readings {
                desk.autopilot
                    .add_controller_reading(*index, *reading, desk.now());
            }
        }
        desk.sample(AnalogReadings::NONE);
    }
    [Pack::First, Pack::Second].map(|pack| *desk.autopilot.battery(pack))
}

#[test]
// Requirement: AP-10
fn hot_motor_controllers_are_shown_and_keep_no_rover_from_arming() {
    let mut desk = desk([0, 0b10]);
    let hot = ControllerReading {
        temperature_c: Some(70.0),
        ..reading(12.0, 3.0, None)
    };
    let [first, _] = ticks(&mut desk, 5 * SECOND_TICKS, &[(0, hot), (1, hot)]);
    assert_eq!(
        (first.temperature_c, first.readings.faults),
        (Some(70.0), Faults::empty())
    );
    assert_eq!(first.consequences(), Consequences::empty());
    let answers = desk.ask(&arm());
    assert_eq!(texts_of(&answers), [""; 0]);
    assert_eq!(desk.vehicle().arm_state(), ArmState::Armed);
}

fn consumed_mah(state: &BatteryState) -> f32 {
    state.consumed_mah().expect("counted")
}

#[test]
fn two_packs_have_different_controllers() {
    let mut desk = desk([0b0011, 0b0100]);
    let readings = [
        (0, reading(12.0, 3.0, Some(1.0))),
        (1, reading(11.0, 2.0, Some(0.5))),
        (2, reading(24.0, 7.2, None)),
    ];
    let [first, second] = ticks(&mut desk, 10 * SECOND_TICKS, &readings);
    assert_eq!(
        (first.status, second.status),
        (PackStatus::Healthy, PackStatus::Healthy)
    );
    let readings = first.readings;
    assert_eq!((readings.voltage_v, readings.current_a), (Some(11.5), Some(5.0)));
    assert_eq!(first.temperature_c, Some(40.0));
    assert_eq!(second.readings.voltage_v, Some(24.0));
    // Counted by the controllers: 1.5 mAh with each of 200 reports.
    assert!((consumed_mah(&first) - 300.0).abs() < 2.0, "{first:?}");
    // Integrated here: 7.2 A for 10 s.
    assert!((consumed_mah(&second) - 20.0).abs() < 0.5, "{second:?}");
}

#[test]
fn consumption_catches_up_after_a_controller_was_silent() {
    let mut desk = desk([0, 0b10]);
    let both = [(0, reading(12.0, 7.2, None)), (1, reading(12.0, 7.2, None))];
    let [before, _] = ticks(&mut desk, 10 * SECOND_TICKS, &both);
    let [silent, _] = ticks(&mut desk, 10 * SECOND_TICKS, &both[..1]);
    let [after, _] = ticks(&mut desk, SECOND_TICKS, &both);
    assert!((consumed_mah(&before) - 40.0).abs() < 1.0, "{before:?}");
    assert_eq!(silent.consumed_mah(), None, "unknown with the current");
    // 14.4 A for 21 s: the gap is interpolated.
    assert!((consumed_mah(&after) - 84.0).abs() < 1.0, "{after:?}");
}
