//! The message builders with a mock `BatteryState`: byte for byte against golden frames, and with any input.

use std::collections::HashMap;

use proptest::prelude::*;
use rover_battmon::battery::{BatteryState, PackStatus};
use rover_battmon::mavlink::dialect::{
    BATTERY_STATUS_DATA, MavBatteryChargeState, MavBatteryFault, MavBatteryFunction, MavBatteryMode,
    MavBatteryType, MavModeFlag, MavSysStatusSensor, MavSysStatusSensorExtended,
};
use rover_battmon::mavlink::{
    Framer, LinkStatistics, Message, ReceiveStatistics, SystemState, build_battery_status, build_heartbeat,
    build_sys_status,
};

fn golden_frames() -> HashMap<String, String> {
    let rows = include_str!("data/wire_mavlink2.csv").lines().skip(1);
    rows.map(|row| {
        let columns: Vec<&str> = row.split(',').collect();
        (columns[0].to_string(), columns[4].to_string())
    })
    .collect()
}

fn frame_hex(message: &Message) -> String {
    let mut framer = Framer::new();
    let bytes = framer.frame(message, 1);
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn with_battery(battery: BatteryState) -> SystemState {
    SystemState {
        battery,
        ..SystemState::default()
    }
}

fn healthy(voltage_v: f32) -> BatteryState {
    BatteryState {
        status: PackStatus::Healthy,
        voltage_v: Some(voltage_v),
        ..BatteryState::default()
    }
}

#[test]
fn battery_status_is_byte_exact_where_another_autopilot_fills_the_fields_alike() {
    let golden = golden_frames();
    let full = BatteryState {
        current_a: Some(5.0),
        consumed_mah: Some(123.0),
        remaining_pct: Some(94.6),
        time_remaining_s: Some(1234.0),
        temperature_c: Some(25.0),
        ..healthy(11.1)
    };
    for (row, battery) in [("px4_voltage_only", healthy(12.345)), ("px4_full", full)] {
        let message = Message::BatteryStatus(build_battery_status(&with_battery(battery), 0));
        assert_eq!(frame_hex(&message), golden[row], "{row}");
    }
}

/// ArduPilot sends function and type as unknown; with those two fields set so, its frames are ours.
#[test]
fn battery_status_is_byte_exact_with_ardupilots_function_and_type() {
    let as_ardupilot = |data: BATTERY_STATUS_DATA| BATTERY_STATUS_DATA {
        battery_function: MavBatteryFunction::MAV_BATTERY_FUNCTION_UNKNOWN,
        mavtype: MavBatteryType::MAV_BATTERY_TYPE_UNKNOWN,
        ..data
    };
    let counting = |voltage_v, current_a, consumed_mah, consumed_wh, remaining_pct| BatteryState {
        current_a: Some(current_a),
        consumed_mah: Some(consumed_mah),
        consumed_wh: Some(consumed_wh),
        remaining_pct: Some(remaining_pct),
        ..healthy(voltage_v)
    };
    let unhealthy = BatteryState {
        status: PackStatus::Unhealthy,
        remaining_pct: None,
        ..counting(11.1, 5.0, 2100.0, 838.0 / 36.0, 0.0)
    };
    let golden = golden_frames();
    for (row, battery) in [
        ("ap_voltage_only_12v345", healthy(12.345)),
        ("ap_70v", counting(70.0, 10.0, 0.0, 0.0, 100.0)),
        ("ap_140v", counting(140.0, 10.0, 0.0, 0.0, 100.0)),
        ("ap_current_clamp_pos", counting(22.2, 400.0, 10.0, 1.0, 90.0)),
        ("ap_current_clamp_neg", counting(22.2, -400.0, 10.0, 1.0, 90.0)),
        ("ap_unhealthy_state", unhealthy),
    ] {
        let data = as_ardupilot(build_battery_status(&with_battery(battery), 0));
        assert_eq!(frame_hex(&Message::BatteryStatus(data)), golden[row], "{row}");
    }
}

#[test]
fn sys_status_is_byte_exact() {
    let state = SystemState {
        battery: BatteryState {
            current_a: Some(5.0),
            remaining_pct: Some(96.0),
            ..healthy(11.1)
        },
        load_permille: 250,
        ..SystemState::default()
    };
    let message = Message::SysStatus(build_sys_status(&state));
    assert_eq!(frame_hex(&message), golden_frames()["sys_status_batt"]);
}

#[test]
fn sys_status_without_a_monitored_battery_is_byte_exact() {
    let message = Message::SysStatus(build_sys_status(&with_battery(BatteryState::disabled())));
    assert_eq!(frame_hex(&message), golden_frames()["sys_status_none"]);
}

#[test]
fn lost_bytes_are_reported_as_count_and_as_share() {
    let received = ReceiveStatistics {
        frames: 900,
        bad_checksums: 60,
        unknown_messages: 30,
        overruns: 10,
    };
    let state = SystemState {
        link: LinkStatistics {
            received,
            ..LinkStatistics::default()
        },
        ..SystemState::default()
    };
    let data = build_sys_status(&state);
    assert_eq!((data.errors_comm, data.drop_rate_comm), (100, 1000));
}

#[test]
fn heartbeat_says_a_disarmed_ardupilot_rover() {
    let heartbeat = build_heartbeat();
    // The crate's default for this bit mask is SAFETY_ARMED.
    assert_eq!(
        heartbeat.base_mode,
        MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    );
    // custom_mode 4 (HOLD), type 10, autopilot 3, base_mode 1, status 3 (standby), version 3; packed by pymavlink.
    let golden = "fd090000000101000000040000000a0301030330d6";
    assert_eq!(frame_hex(&Message::Heartbeat(heartbeat)), golden);
}

#[test]
fn unknown_is_sent_as_the_sentinel_of_each_field() {
    let state = SystemState::default();
    let data = build_battery_status(&state, 0);
    assert_eq!(data.voltages, [u16::MAX; 10]);
    assert_eq!(data.voltages_ext, [0; 4]);
    assert_eq!(data.temperature, i16::MAX);
    assert_eq!(data.current_battery, -1);
    assert_eq!(data.current_consumed, -1);
    assert_eq!(data.energy_consumed, -1);
    assert_eq!(data.battery_remaining, -1);
    assert_eq!(data.time_remaining, 0);
    assert_eq!(
        data.charge_state,
        MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_UNDEFINED
    );
    assert_eq!(data.mode, MavBatteryMode::MAV_BATTERY_MODE_UNKNOWN);
    // The crate's default is DEEP_DISCHARGE.
    assert_eq!(data.fault_bitmask, MavBatteryFault::empty());

    let data = build_sys_status(&state);
    assert_eq!(data.voltage_battery, u16::MAX);
    assert_eq!(data.current_battery, -1);
    assert_eq!(data.battery_remaining, -1);
    assert_eq!(
        data.onboard_control_sensors_present_extended,
        MavSysStatusSensorExtended::empty()
    );
}

#[test]
fn a_pack_that_does_not_exist_is_unknown_and_keeps_its_id() {
    let data = build_battery_status(&with_battery(healthy(11.1)), 3);
    assert_eq!(data.id, 3);
    assert_eq!(data.voltages, [u16::MAX; 10]);
}

#[test]
fn health_and_charge_state_follow_the_status() {
    use MavBatteryChargeState as Charge;
    let battery_sensor = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY;
    let none = MavSysStatusSensor::empty();
    for (status, sensors, charge_state) in [
        (
            PackStatus::Unknown,
            none,
            Charge::MAV_BATTERY_CHARGE_STATE_UNDEFINED,
        ),
        (
            PackStatus::NotConnected,
            none,
            Charge::MAV_BATTERY_CHARGE_STATE_UNDEFINED,
        ),
        (
            PackStatus::Healthy,
            battery_sensor,
            Charge::MAV_BATTERY_CHARGE_STATE_OK,
        ),
        (
            PackStatus::Unhealthy,
            none,
            Charge::MAV_BATTERY_CHARGE_STATE_UNHEALTHY,
        ),
    ] {
        let state = with_battery(BatteryState {
            status,
            ..BatteryState::default()
        });
        let sys_status = build_sys_status(&state);
        assert_eq!(
            sys_status.onboard_control_sensors_present, battery_sensor,
            "{status:?}"
        );
        assert_eq!(
            sys_status.onboard_control_sensors_enabled, battery_sensor,
            "{status:?}"
        );
        assert_eq!(sys_status.onboard_control_sensors_health, sensors, "{status:?}");
        assert_eq!(
            build_battery_status(&state, 0).charge_state,
            charge_state,
            "{status:?}"
        );
    }
}

#[test]
fn a_high_voltage_spills_in_battery_status_and_saturates_in_sys_status() {
    let state = with_battery(healthy(70.0));
    assert_eq!(
        build_battery_status(&state, 0).voltages[..3],
        [65534, 4466, u16::MAX]
    );
    assert_eq!(build_sys_status(&state).voltage_battery, 65534);

    let state = with_battery(healthy(65.534));
    assert_eq!(build_battery_status(&state, 0).voltages[..2], [65534, u16::MAX]);
    assert_eq!(build_sys_status(&state).voltage_battery, 65534);
}

#[test]
fn dropped_messages_are_counted_and_saturate() {
    let dropped = |dropped| SystemState {
        link: LinkStatistics {
            dropped,
            ..LinkStatistics::default()
        },
        ..SystemState::default()
    };
    assert_eq!(build_sys_status(&dropped(7)).errors_count1, 7);
    assert_eq!(build_sys_status(&dropped(70_000)).errors_count1, u16::MAX);
}

fn any_value() -> impl Strategy<Value = Option<f32>> {
    prop_oneof![
        Just(None),
        any::<f32>().prop_map(Some),
        (-100.0f32..200.0).prop_map(Some),
        prop::sample::select(vec![
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            f32::MIN,
            -0.0
        ])
        .prop_map(Some),
    ]
}

fn any_status() -> impl Strategy<Value = PackStatus> {
    prop::sample::select(vec![
        PackStatus::Disabled,
        PackStatus::Unknown,
        PackStatus::NotConnected,
        PackStatus::Healthy,
        PackStatus::Unhealthy,
    ])
}

prop_compose! {
    fn any_state()(
        status in any_status(), voltage_v in any_value(), current_a in any_value(), consumed_mah in any_value(),
        consumed_wh in any_value(), remaining_pct in any_value(), time_remaining_s in any_value(),
        temperature_c in any_value(), load_permille in any::<u16>(), sent in any::<u32>(), dropped in any::<u32>(),
        frames in any::<u32>(), bad_checksums in any::<u32>(),
    ) -> SystemState {
        SystemState {
            battery: BatteryState {
                status, voltage_v, current_a, consumed_mah, consumed_wh, remaining_pct, time_remaining_s, temperature_c,
                ..BatteryState::default()
            },
            load_permille,
            link: LinkStatistics { sent, dropped, received: ReceiveStatistics { frames, bad_checksums, ..Default::default() } },
        }
    }
}

proptest! {
    #[test]
    fn any_state_gives_a_conforming_battery_status(state in any_state(), instance in any::<u8>()) {
        let data = build_battery_status(&state, instance);
        prop_assert_eq!(data.id, instance);
        // Known cells come first, and all but the last of them are full.
        let known = data.voltages.iter().take_while(|mv| **mv != u16::MAX).count();
        prop_assert!(data.voltages[known..].iter().all(|mv| *mv == u16::MAX));
        prop_assert!(data.voltages[..known.saturating_sub(1)].iter().all(|mv| *mv == 65534));
        let voltage_v = state.battery(instance).voltage_v;
        prop_assert_eq!(known > 0, voltage_v.is_some_and(|v| v.is_finite() && v >= 0.0));
        prop_assert!(data.current_battery > i16::MIN);
        prop_assert!(data.current_consumed >= -1 && data.energy_consumed >= -1);
        prop_assert!((-1..=100).contains(&data.battery_remaining));
        prop_assert!(data.time_remaining >= 0);
        prop_assert_eq!(data.voltages_ext, [0; 4]);
    }

    #[test]
    fn any_state_gives_a_conforming_sys_status(state in any_state()) {
        let data = build_sys_status(&state);
        prop_assert!(data.load <= 1000);
        prop_assert!(data.drop_rate_comm <= 10_000);
        prop_assert!(data.current_battery > i16::MIN);
        prop_assert!((-1..=100).contains(&data.battery_remaining));
        let voltage_v = state.battery.voltage_v;
        let known = voltage_v.is_some_and(|v| v.is_finite() && v >= 0.0);
        prop_assert_eq!(data.voltage_battery != u16::MAX, known);
    }

    #[test]
    fn the_cells_add_up_to_the_pack(voltage_v in 0.0f32..650.0) {
        let data = build_battery_status(&with_battery(healthy(voltage_v)), 0);
        let sum_mv: u32 = data.voltages.iter().filter(|mv| **mv != u16::MAX).map(|mv| u32::from(*mv)).sum();
        prop_assert!((sum_mv as f32 - voltage_v * 1000.0).abs() <= 0.6);
    }
}
