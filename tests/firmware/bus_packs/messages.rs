//! The details of a smart battery, in the messages for them.

use super::{BUS, shared, with_second_pack};
use emulator::i2c_devices::{Pec, SmartBattery};
use support::commands::{BATTERY_RESET, FAILED, REQUEST_MESSAGE, SET_MESSAGE_INTERVAL};
use support::frames::{
    BATTERY_INFO, BATTERY_STATUS, BATTERY_STATUS_V2, BatteryStatus, Frame, GROUND_STATION,
    SMART_BATTERY_INFO, acknowledged, of_message, texts_of,
};
use support::monitor_types::SMART_BATTERY;
use support::requests::{GCS, command_long_2, heartbeat_from};
use workbench::bench::{Bench, SECOND};

const SECOND_PACK: f32 = 1.0;

const CYCLE_COUNT: u8 = 0x17;

/// MAV_BATTERY_STATUS_FLAGS_CAPACITY_RELATIVE_TO_FULL
const RELATIVE_TO_FULL: u32 = 262_144;

fn with_battery() -> (Bench, std::rc::Rc<std::cell::RefCell<SmartBattery>>) {
    let part = shared(SmartBattery::new(Pec::Right));
    part.borrow_mut().set(11.1, 2.5, 31.0);
    part.borrow_mut().set_capacity(2600, 4680);
    let bench = with_second_pack(SMART_BATTERY, 0x0b, &part, &[]);
    (bench, part)
}

fn count(frames: &[Frame], message_id: u32) -> usize {
    of_message(frames, message_id).len()
}

#[test]
// Requirement: V2-5
fn a_smart_battery_is_introduced_once_and_again_when_it_changes() {
    let (mut bench, part) = with_battery();
    bench.run_for(5 * SECOND);
    let frames = bench.frames();
    let last = of_message(&frames, BATTERY_INFO)
        .into_iter()
        .rfind(|frame| frame.u8(44) == 1)
        .expect("it is sent unasked of pack 2");
    assert_eq!((last.u8(46), last.u8(48)), (3, 3), "lithium ion, three cells");
    assert_eq!(last.u16(40), 12, "cycles");
    assert_eq!(last.u8(47), 90, "state of health: 4680 of 5200 mAh");
    assert!((last.f32(36) - 4.68).abs() < 1e-3 && (last.f32(32) - 5.2).abs() < 1e-3);
    assert!((last.f32(20) - 11.1).abs() < 1e-3, "nominal voltage");
    assert_eq!(
        (last.text(49, 9), last.text(58, 32)),
        ("17052024".into(), "4711".into())
    );
    assert_eq!(last.text(90, 50), "Emulated_3S5200");
    let smart = of_message(&frames, SMART_BATTERY_INFO)
        .into_iter()
        .rfind(|frame| frame.u8(18) == 1)
        .expect("so is this");
    assert_eq!((smart.i32(0), smart.i32(4)), (5200, 4680));

    let from_us = bench.time_us();
    bench.run_for(5 * SECOND);
    assert_eq!(
        count(&bench.frames_since(from_us), BATTERY_INFO),
        0,
        "nothing has changed"
    );
    let from_us = bench.time_us();
    part.borrow_mut().set_word(CYCLE_COUNT, 13);
    bench.run_for(5 * SECOND);
    let frames = bench.frames_since(from_us);
    assert_eq!(count(&frames, BATTERY_INFO), 1);
    assert_eq!(of_message(&frames, BATTERY_INFO)[0].u16(40), 13);
}

#[test]
fn a_smart_battery_is_described_to_each_new_ground_station() {
    let (mut bench, _) = with_battery();
    bench.run_for(2 * SECOND);
    let from_us = bench.time_us();
    bench.ask(&heartbeat_from(GROUND_STATION, GCS));
    // With the next message of a stream at the latest.
    bench.run_for(SECOND);
    let frames = bench.frames_since(from_us);
    for (message, instance_at) in [(BATTERY_INFO, 44), (SMART_BATTERY_INFO, 18)] {
        let instances: Vec<_> = of_message(&frames, message)
            .iter()
            .map(|frame| frame.u8(instance_at))
            .collect();
        assert_eq!(instances, [1], "message {message}");
    }
    // The same one, and strangers, for some five seconds.
    let from_us = bench.time_us();
    for stranger in 0..8 {
        bench.ask(&heartbeat_from(GROUND_STATION, GCS));
        bench.ask(&heartbeat_from([stranger, 190], GCS));
        bench.run_for(SECOND / 4);
    }
    assert_eq!(count(&bench.frames_since(from_us), BATTERY_INFO), 0);
}

#[test]
// Requirement: V2-6
fn the_second_version_of_battery_status_is_for_those_who_ask() {
    let (mut bench, _) = with_battery();
    bench.run_for(SECOND);
    assert_eq!(count(&bench.frames(), BATTERY_STATUS_V2), 0);
    let answers = bench.ask(&command_long_2(
        REQUEST_MESSAGE,
        BATTERY_STATUS_V2 as f32,
        SECOND_PACK,
    ));
    let status = of_message(&answers, BATTERY_STATUS_V2)[0];
    assert!((status.f32(0) - 11.1).abs() < 1e-4 && (status.f32(4) - 2.5).abs() < 1e-4);
    assert!((status.f32(8) - 2.08).abs() < 1e-3, "consumed, in Ah");
    assert!((status.f32(12) - 2.6).abs() < 1e-3, "remaining, in Ah");
    assert!((status.f32(16) - 55.56).abs() < 0.01, "percent");
    assert_eq!(status.u32(20), RELATIVE_TO_FULL);
    assert_eq!((status.i16(24), status.u8(26)), (3105, 1));

    // As QGroundControl does: the first one that comes makes it switch the other off.
    bench.ask(&command_long_2(
        SET_MESSAGE_INTERVAL,
        BATTERY_STATUS_V2 as f32,
        200_000.0,
    ));
    bench.ask(&command_long_2(
        SET_MESSAGE_INTERVAL,
        BATTERY_INFO as f32,
        1_000_000.0,
    ));
    let from_us = bench.time_us();
    bench.run_for(10 * SECOND);
    let frames = bench.frames_since(from_us);
    assert!(
        count(&frames, BATTERY_STATUS_V2).abs_diff(2 * 50) <= 2,
        "both packs, five times a second"
    );
    assert!(count(&frames, BATTERY_INFO).abs_diff(2 * 10) <= 2);
    assert!(
        count(&frames, BATTERY_STATUS).abs_diff(2 * 100) <= 2,
        "until it is switched off"
    );
    bench.ask(&command_long_2(SET_MESSAGE_INTERVAL, BATTERY_STATUS as f32, -1.0));
    let from_us = bench.time_us();
    bench.run_for(10 * SECOND);
    let frames = bench.frames_since(from_us);
    assert_eq!(count(&frames, BATTERY_STATUS), 0);
    assert!(count(&frames, BATTERY_STATUS_V2).abs_diff(2 * 50) <= 2);
}

#[test]
fn a_battery_reset_fails_for_a_battery_with_a_gauge() {
    let (mut bench, _) = with_battery();
    bench.run_for(SECOND);
    let answers = bench.ask(&command_long_2(BATTERY_RESET, 2.0, 100.0));
    assert_eq!(acknowledged(&answers)[0], (BATTERY_RESET, FAILED));
    bench.run_for(SECOND);
    let frames = bench.frames();
    let status = of_message(&frames, BATTERY_STATUS)
        .into_iter()
        .rfind(|frame| BatteryStatus(frame).instance() == 1);
    assert_eq!(BatteryStatus(status.expect("it is reported")).remaining_pct(), 56);
    bench.i2c(BUS).detach(0x0b);
    bench.run_for(3 * SECOND);
    assert!(texts_of(&bench.frames()).contains(&"Battery 2 unhealthy: no answer".into()));
}
