//! Packs that motor controllers measure together: their readings in, the packs' states out.

use rover_battmon::battery::{BatteryState, Consequences, Faults, consequences};
use rover_battmon::pack::Pack;
use rover_battmon::sensor::{AnalogReadings, ControllerReading};
use rover_battmon::vehicle::ArmState;
use support::desk::{Desk, start_with};
use support::frames::texts_of;
use support::monitor_types::ESC;
use support::requests::arm;

const TICK_US: u64 = 100_000;
const SECOND_TICKS: usize = 10;

/// All controllers measure the first pack, and the second of them the second pack.
fn desk() -> Desk {
    Desk::starting(start_with(&[
        ("BATT_MONITOR", ESC),
        ("BATT2_MONITOR", ESC),
        ("BATT2_ESC_MASK", 2.0),
    ]))
}

fn reading(voltage_v: f32, current_a: f32) -> ControllerReading {
    ControllerReading {
        voltage_v: Some(voltage_v),
        current_a: Some(current_a),
        temperature_c: Some(40.0),
        ..ControllerReading::default()
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
    let mut desk = desk();
    let hot = ControllerReading {
        temperature_c: Some(70.0),
        ..reading(12.0, 3.0)
    };
    let [first, _] = ticks(&mut desk, 5 * SECOND_TICKS, &[(0, hot), (1, hot)]);
    assert_eq!(
        (first.temperature_c, first.readings.faults),
        (Some(70.0), Faults::empty())
    );
    assert_eq!(consequences(&first), Consequences::empty());
    let answers = desk.ask(&arm());
    assert_eq!(texts_of(&answers), [""; 0]);
    assert_eq!(desk.vehicle().arm_state(), ArmState::Armed);
}

fn consumed_mah(state: &BatteryState) -> f32 {
    state.consumed_mah().expect("counted")
}

#[test]
fn each_count_of_each_controller_is_drawn_once() {
    let mut desk = desk();
    let counted = |drawn_mah| ControllerReading {
        drawn_mah: Some(drawn_mah),
        ..reading(12.0, 3.0)
    };
    let both = [(0, counted(1.0)), (1, counted(0.5))];
    let [first, second] = ticks(&mut desk, 10 * SECOND_TICKS, &both);
    // Two hundred reports of each.
    assert!((consumed_mah(&first) - 300.0).abs() < 2.0, "{first:?}");
    assert!((consumed_mah(&second) - 100.0).abs() < 1.0, "{second:?}");
}

#[test]
fn consumption_catches_up_after_a_controller_was_silent() {
    let mut desk = desk();
    let both = [(0, reading(12.0, 7.2)), (1, reading(12.0, 7.2))];
    let [before, of_second] = ticks(&mut desk, 10 * SECOND_TICKS, &both);
    let [silent, _] = ticks(&mut desk, 10 * SECOND_TICKS, &both[..1]);
    let [after, _] = ticks(&mut desk, SECOND_TICKS, &both);
    assert!((consumed_mah(&before) - 40.0).abs() < 1.0, "{before:?}");
    assert!((consumed_mah(&of_second) - 20.0).abs() < 0.5, "{of_second:?}");
    assert_eq!(silent.consumed_mah(), None, "unknown with the current");
    // 14.4 A for 21 s: the gap is interpolated.
    assert!((consumed_mah(&after) - 84.0).abs() < 1.0, "{after:?}");
}
