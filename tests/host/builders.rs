//! The message builders with a mock `BatteryState`: byte for byte against golden frames, and with any input.
#![allow(
    deprecated,
    reason = "SMART_BATTERY_INFO is superseded, and sent for those who know no other"
)]

use proptest::prelude::*;
use rover_battmon::announce::Severity;
use rover_battmon::battery::{
    Amount, BatteryState, CellVoltages, ChargeSource, ChargeState, Chemistry, Consequences, Contents, Date,
    FailsafeLevel, Faults, MAX_CELLS, Modes, Name, PackDetails, PackStatus, Readings, ReportedVoltage,
    Visibility, consequences,
};
use rover_battmon::mavlink::dialect::{
    BATTERY_INFO_DATA, BATTERY_STATUS_DATA, BATTERY_STATUS_V2_DATA, FUEL_STATUS_DATA, MavBatteryChargeState,
    MavBatteryFault, MavBatteryFunction, MavBatteryMode, MavBatteryType, MavFuelType, MavModeFlag,
    MavSysStatusSensor, MavSysStatusSensorExtended, SMART_BATTERY_INFO_DATA, SYS_STATUS_DATA,
};
use rover_battmon::mavlink::{
    BroadcastCommand, Endpoint, Framer, LinkKind, Message, ToFrame, build_battery_info, build_battery_status,
    build_battery_status_v2, build_charge_deviation, build_fuel_status, build_heartbeat, build_resistance,
    build_resting_voltage, build_smart_battery_info, build_sys_status, build_usable_charge,
};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;
use rover_battmon::system::{ArmingReadiness, LinkStatistics, LogHealth, ReceiveStatistics, SystemState};
use rover_battmon::time::Instant;
use rover_battmon::vehicle::ArmState;
use rover_battmon::vehicle::VehicleStatus;

fn frame_hex(message: &impl ToFrame) -> String {
    let mut framer = Framer::new();
    let bytes = framer.frame(message, 1);
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Asserts that the frame of a message is the golden one of this row.
#[track_caller]
fn assert_golden(row: &str, message: &impl ToFrame) {
    let lines = include_str!("../data/wire_mavlink2.csv").lines();
    let mut rows = lines.map(|line| line.split(',').collect::<Vec<_>>());
    let golden = rows.find(|columns| columns[0] == row).expect("there is this row");
    assert_eq!(frame_hex(message), golden[4], "{row}");
}

fn with_packs(batteries: &[BatteryState]) -> SystemState<'_> {
    SystemState {
        batteries,
        ..SystemState::default()
    }
}

/// BATTERY_STATUS of the only pack.
fn status_of(battery: BatteryState) -> BATTERY_STATUS_DATA {
    build_battery_status(&with_packs(&[battery]), Pack::First)
}

/// BATTERY_STATUS_V2 of the only pack.
fn status_v2_of(battery: BatteryState) -> BATTERY_STATUS_V2_DATA {
    build_battery_status_v2(&with_packs(&[battery]), Pack::First)
}

/// BATTERY_INFO of the only pack.
fn info_of(battery: BatteryState) -> BATTERY_INFO_DATA {
    build_battery_info(&with_packs(&[battery]), Pack::First)
}

/// SMART_BATTERY_INFO of the only pack.
fn smart_info_of(battery: BatteryState) -> SMART_BATTERY_INFO_DATA {
    build_smart_battery_info(&with_packs(&[battery]), Pack::First)
}

/// FUEL_STATUS of the only tank.
fn fuel_of(tank: BatteryState) -> FUEL_STATUS_DATA {
    build_fuel_status(&with_packs(&[tank]), Pack::First)
}

/// SYS_STATUS with one pack.
fn system_with(battery: BatteryState) -> SYS_STATUS_DATA {
    build_sys_status(&with_packs(&[battery]))
}

pub fn healthy(voltage_v: f32) -> BatteryState {
    let mut battery = BatteryState::UNKNOWN;
    battery.status = PackStatus::Healthy;
    battery.charge_state = ChargeState::Ok;
    battery.readings.voltage_v = Some(voltage_v);
    battery
}

/// A healthy pack whose current is measured.
fn counting(voltage_v: f32, current_a: f32, consumed_mah: f32, remaining_pct: f32) -> BatteryState {
    let mut battery = healthy(voltage_v);
    battery.readings.current_a = Some(current_a);
    battery.readings.remaining_pct = Some(remaining_pct);
    battery.consumed = Some(Amount::Mah(consumed_mah));
    battery
}

/// A healthy pack whose cells are measured.
fn with_cells(voltage_v: f32, millivolts: &[u16]) -> BatteryState {
    BatteryState {
        cells: CellVoltages::from_millivolts(millivolts),
        ..healthy(voltage_v)
    }
}

/// A pack for internal use only.
pub fn on_board_only(battery: BatteryState) -> BatteryState {
    BatteryState {
        visibility: Visibility::Internal,
        ..battery
    }
}

#[test]
// Requirement: FR-10
fn battery_status_is_byte_exact_where_another_autopilot_fills_the_fields_alike() {
    let mut full = counting(11.1, 5.0, 123.0, 94.6);
    full.readings.time_remaining_s = Some(1234.0);
    full.temperature_c = Some(25.0);
    let mut emergency = counting(10.0, 5.0, 2100.0, 5.0);
    emergency.charge_state = ChargeState::Emergency;
    emergency.readings.time_remaining_s = Some(10.0);
    let mut cells = counting(45.6, 10.0, 100.0, 90.0);
    cells.cells = CellVoltages::from_millivolts(&[3800; 12]);
    for (row, battery) in [
        ("px4_voltage_only", healthy(12.345)),
        ("px4_full", full),
        ("px4_emergency", emergency),
        ("px4_cells_12s", cells),
    ] {
        assert_golden(row, &Message::BatteryStatus(status_of(battery)));
    }
}

/// ArduPilot sends function and type as unknown; with those two fields set so, its frames are ours.
#[test]
// Requirement: FR-1
fn battery_status_is_byte_exact_with_ardupilots_function_and_type() {
    let counting_wh = |battery, consumed_wh| BatteryState {
        consumed_wh: Some(consumed_wh),
        ..battery
    };
    let mut unhealthy = counting_wh(counting(11.1, 5.0, 2100.0, 0.0), 838.0 / 36.0);
    unhealthy.status = PackStatus::Unhealthy;
    unhealthy.charge_state = ChargeState::Unhealthy;
    unhealthy.readings.remaining_pct = None;
    let mut critical = counting_wh(counting(9.8, 5.0, 2100.0, 10.0), 838.0 / 36.0);
    critical.charge_state = ChargeState::Critical;
    let mut cells = counting_wh(counting(11.4, 5.0, 100.0, 95.0), 1.0);
    cells.temperature_c = Some(25.0);
    cells.cells = CellVoltages::from_millivolts(&[3810, 3790, 3800]);
    for (row, battery) in [
        ("ap_voltage_only_12v345", healthy(12.345)),
        ("ap_70v", counting_wh(counting(70.0, 10.0, 0.0, 100.0), 0.0)),
        ("ap_140v", counting_wh(counting(140.0, 10.0, 0.0, 100.0), 0.0)),
        (
            "ap_current_clamp_pos",
            counting_wh(counting(22.2, 400.0, 10.0, 90.0), 1.0),
        ),
        (
            "ap_current_clamp_neg",
            counting_wh(counting(22.2, -400.0, 10.0, 90.0), 1.0),
        ),
        ("ap_critical_state", critical),
        ("ap_unhealthy_state", unhealthy),
        ("ap_cells_3s", cells),
    ] {
        let mut data = BATTERY_STATUS_DATA {
            battery_function: MavBatteryFunction::MAV_BATTERY_FUNCTION_UNKNOWN,
            mavtype: MavBatteryType::MAV_BATTERY_TYPE_UNKNOWN,
            ..status_of(battery)
        };
        if row == "ap_cells_3s" {
            // ArduPilot sends unused cells of this field as 65535, which ground stations add up; ours are 0.
            assert_eq!(data.voltages_ext, [0; 4]);
            data.voltages_ext = [u16::MAX; 4];
        }
        assert_golden(row, &Message::BatteryStatus(data));
    }
}

#[test]
// Requirement: FR-7
fn sys_status_is_byte_exact_with_a_monitored_battery_and_without() {
    let measured = counting(11.1, 5.0, 0.0, 96.0);
    for (row, battery, load_permille) in [
        ("sys_status_batt", measured, 250),
        ("sys_status_none", BatteryState::disabled(), 0),
    ] {
        let mut data = build_sys_status(&SystemState {
            load_permille,
            ..with_packs(&[battery])
        });
        // The golden frames have no other sensor.
        data.onboard_control_sensors_present &= BATTERY_SENSOR;
        data.onboard_control_sensors_enabled &= BATTERY_SENSOR;
        data.onboard_control_sensors_health &= BATTERY_SENSOR;
        assert_golden(row, &Message::SysStatus(data));
    }
}

#[test]
fn what_a_link_loses_is_counted_and_saturates() {
    let received = ReceiveStatistics {
        frames: 900,
        bad_checksums: 60,
        unknown_messages: 30,
        overruns: 10,
    };
    for (dropped, sent) in [(7, 7), (70_000, u16::MAX)] {
        let link = LinkStatistics {
            dropped,
            received,
            ..LinkStatistics::default()
        };
        let data = build_sys_status(&SystemState {
            link,
            ..SystemState::default()
        });
        assert_eq!(
            (data.errors_comm, data.drop_rate_comm),
            (100, 1000),
            "count and share"
        );
        assert_eq!(data.errors_count3, sent);
    }
}

#[test]
fn heartbeat_says_a_disarmed_ardupilot_rover() {
    let heartbeat = build_heartbeat(&SystemState::default());
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
// Requirement: AP-20
fn a_pack_that_powers_off_is_a_command_to_every_component() {
    // Target system and component 0, command 42000, parameter 1 the pack's number, confirmation 0; packed by pymavlink.
    for (pack, golden) in [
        (
            Pack::Second,
            "fd1e00000001014c00000000004000000000000000000000000000000000000000000000000010a4d9ca",
        ),
        (
            Pack::Ninth,
            "fd1e00000001014c00000000104100000000000000000000000000000000000000000000000010a428ef",
        ),
    ] {
        let command = BroadcastCommand::power_off_initiated(pack);
        assert_eq!(frame_hex(&Message::BroadcastCommand(command)), golden);
    }
}

#[test]
// Requirement: FR-4, FR-5
fn unknown_is_sent_as_the_sentinel_of_each_field() {
    let state = SystemState::default();
    let data = build_battery_status(&state, Pack::First);
    assert_eq!((data.voltages, data.voltages_ext), ([u16::MAX; 10], [0; 4]));
    assert_eq!((data.temperature, data.current_battery), (i16::MAX, -1));
    assert_eq!((data.current_consumed, data.energy_consumed), (-1, -1));
    assert_eq!((data.battery_remaining, data.time_remaining), (-1, 0));
    assert_eq!(
        data.charge_state,
        MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_UNDEFINED
    );
    assert_eq!(data.mode, MavBatteryMode::MAV_BATTERY_MODE_UNKNOWN);
    // The crate's default is DEEP_DISCHARGE.
    assert_eq!(data.fault_bitmask, MavBatteryFault::empty());

    let data = build_sys_status(&state);
    assert_eq!((data.voltage_battery, data.current_battery), (u16::MAX, -1));
    assert_eq!(data.battery_remaining, -1);
    assert_eq!(
        data.onboard_control_sensors_present_extended,
        MavSysStatusSensorExtended::empty()
    );
}

#[test]
fn a_pack_that_does_not_exist_is_unknown_and_keeps_its_id() {
    let data = build_battery_status(&with_packs(&[healthy(11.1)]), Pack::Fourth);
    assert_eq!((data.id, data.voltages), (3, [u16::MAX; 10]));
}

const BATTERY_SENSOR: MavSysStatusSensor = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY;
const NO_SENSOR: MavSysStatusSensor = MavSysStatusSensor::empty();

/// The battery's bits in SYS_STATUS: present, enabled, healthy.
fn sensors(batteries: &[BatteryState]) -> [MavSysStatusSensor; 3] {
    let data = build_sys_status(&with_packs(batteries));
    [
        data.onboard_control_sensors_present & BATTERY_SENSOR,
        data.onboard_control_sensors_enabled & BATTERY_SENSOR,
        data.onboard_control_sensors_health & BATTERY_SENSOR,
    ]
}

const SOUND: [MavSysStatusSensor; 3] = [BATTERY_SENSOR; 3];
const UNSOUND: [MavSysStatusSensor; 3] = [BATTERY_SENSOR, BATTERY_SENSOR, NO_SENSOR];
const ABSENT: [MavSysStatusSensor; 3] = [NO_SENSOR; 3];

#[test]
// Requirement: V2-2
fn a_pack_that_may_not_be_used_is_neither_healthy_nor_ready() {
    const NOT_READY: u32 = 1;
    const CHARGING: u32 = 2;
    let with_status = |status| BatteryState {
        status,
        ..BatteryState::default()
    };
    let at_level = |failsafe| BatteryState {
        failsafe,
        ..healthy(11.1)
    };
    for (battery, in_sys_status, flags) in [
        (with_status(PackStatus::Disabled), ABSENT, 0),
        (with_status(PackStatus::Unknown), SOUND, 0),
        (with_status(PackStatus::NotConnected), SOUND, 0),
        (with_status(PackStatus::Healthy), SOUND, 0),
        (with_status(PackStatus::Unhealthy), UNSOUND, NOT_READY),
        (at_level(FailsafeLevel::None), SOUND, 0),
        (at_level(FailsafeLevel::Unhealthy), UNSOUND, NOT_READY),
        (at_level(FailsafeLevel::Low), UNSOUND, NOT_READY),
        (at_level(FailsafeLevel::Critical), UNSOUND, NOT_READY),
        (in_state(ChargeState::Undefined), SOUND, 0),
        (in_state(ChargeState::Ok), SOUND, 0),
        (in_state(ChargeState::Low), SOUND, 0),
        (in_state(ChargeState::Critical), SOUND, NOT_READY),
        (in_state(ChargeState::Emergency), SOUND, NOT_READY),
        (in_state(ChargeState::Failed), UNSOUND, NOT_READY),
        (in_state(ChargeState::Unhealthy), UNSOUND, NOT_READY),
        (in_state(ChargeState::Charging), SOUND, CHARGING),
    ] {
        let name = format!(
            "{:?} {:?} {:?}",
            battery.status, battery.failsafe, battery.charge_state
        );
        assert_eq!(sensors(&[battery]), in_sys_status, "{name}");
        assert_eq!(status_v2_of(battery).status_flags.bits(), flags, "{name}");
    }
    let vehicle = VehicleStatus {
        arm_state: ArmState::Armed,
        ..VehicleStatus::default()
    };
    let armed = build_sys_status(&SystemState {
        vehicle,
        ..with_packs(&[with_status(PackStatus::NotConnected)])
    });
    assert!(
        !armed.onboard_control_sensors_health.contains(BATTERY_SENSOR),
        "while armed"
    );
}

fn in_state(charge_state: ChargeState) -> BatteryState {
    BatteryState {
        charge_state,
        ..healthy(11.1)
    }
}

/// Every flag of BATTERY_STATUS_V2 that goes with a fault.
const FAULT_FLAGS: u32 =
    8 | 32 | 64 | 256 | 512 | 1024 | 2048 | 4096 | 8192 | 16_384 | 32_768 | 65_536 | 131_072;

#[test]
// Requirement: AP-23, PX-8, V2-2
fn every_fault_has_mavlinks_bit_and_flag_and_its_consequences_by_its_origin() {
    let unhealthy_if_found = Faults::CELL_FAIL | Faults::CELLS_CONFIGURATION | Faults::OVER_TEMPERATURE;
    let not_ready_if_found = unhealthy_if_found | Faults::CONTRADICTED_CHARGE;
    let if_reported = Faults::CELL_FAIL | Faults::BAD_BATTERY;
    let faults = [
        (Faults::empty(), 0, 0),
        // REQUIRES_SERVICE (32) goes with those of the pack itself.
        (Faults::DEEP_DISCHARGE, 1, 1024 | 32),
        (Faults::SPIKES, 2, 512),
        (Faults::CELL_FAIL, 4, 8 | 32),
        (Faults::OVER_CURRENT, 8, 8192),
        (Faults::OVER_TEMPERATURE, 16, 2048),
        (Faults::UNDER_TEMPERATURE, 32, 4096),
        (Faults::INCOMPATIBLE_VOLTAGE, 64, 32_768),
        (Faults::INCOMPATIBLE_FIRMWARE, 128, 65_536),
        (Faults::CELLS_CONFIGURATION, 256, 131_072),
        (Faults::SHORT_CIRCUIT, 0, 16_384),
        (Faults::SWITCHED_OFF, 0, 256),
        (Faults::UNDERSTATED_CHARGE, 0, 0),
        (Faults::CELL_DIFFERS, 0, 8),
        // The bit of a failed cell.
        (Faults::BAD_BATTERY, 4, 64),
        (Faults::NEEDS_SERVICE, 0, 32),
        (Faults::CONTRADICTED_CHARGE, 0, 0),
        (Faults::all(), 511, FAULT_FLAGS),
    ];
    // Every one of them, all together and none.
    assert_eq!(faults.len(), Faults::all().iter().count() + 2);
    for (fault, bits, flags) in faults {
        let mut found = healthy(11.1);
        found.readings.faults = fault;
        for (battery, unhealthy, not_ready) in [
            (found, unhealthy_if_found, not_ready_if_found),
            (reporting(fault), if_reported, if_reported),
        ] {
            assert_eq!(status_of(battery).fault_bitmask.bits(), bits, "{fault:?}");
            let not_ready = u32::from(fault.intersects(not_ready));
            assert_eq!(
                status_v2_of(battery).status_flags.bits(),
                flags | not_ready,
                "{fault:?}"
            );
            let expected = if fault.intersects(unhealthy) {
                UNSOUND
            } else {
                SOUND
            };
            assert_eq!(sensors(&[battery]), expected, "{fault:?}");
        }
    }
    let mut charging = reporting(Faults::empty());
    charging.readings.reported.charge_state = Some(ChargeState::Charging);
    assert_eq!(status_v2_of(charging).status_flags.bits(), 2);
}

/// Mission Planner takes these bits for a safety switch and for the readiness to arm, and MAVProxy for a fence.
#[test]
fn motors_arming_checks_log_and_fence_have_their_bits() {
    use ArmingReadiness::{NotReady, Ready};
    use LogHealth::{Failed, Off, Works};
    const MOTORS: MavSysStatusSensor = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS;
    const CHECKS: MavSysStatusSensor = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
    const FENCE: MavSysStatusSensor = MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE;
    const LOG: MavSysStatusSensor = MavSysStatusSensor::MAV_SYS_STATUS_LOGGING;
    for (readiness, log, enabled, healthy) in [
        (NotReady, Works, LOG, MOTORS | FENCE | LOG),
        (Ready, Works, LOG, MOTORS | FENCE | CHECKS | LOG),
        (NotReady, Failed, LOG, MOTORS | FENCE),
        (NotReady, Off, NO_SENSOR, MOTORS | FENCE | LOG),
    ] {
        let data = build_sys_status(&SystemState {
            readiness,
            log,
            ..SystemState::default()
        });
        assert_eq!(data.onboard_control_sensors_present, MOTORS | CHECKS | LOG);
        assert_eq!(data.onboard_control_sensors_enabled, MOTORS | CHECKS | enabled);
        assert_eq!(data.onboard_control_sensors_health, healthy);
    }
}

#[test]
fn all_packs_that_are_monitored_have_to_be_healthy() {
    let (sound, disabled) = (healthy(11.1), BatteryState::disabled());
    let unsound = BatteryState {
        status: PackStatus::Unhealthy,
        ..sound
    };
    assert_eq!(sensors(&[]), ABSENT);
    assert_eq!(sensors(&[disabled; 9]), ABSENT);
    assert_eq!(sensors(&[disabled, sound, disabled]), SOUND);
    assert_eq!(sensors(&[sound; 9]), SOUND);
    assert_eq!(sensors(&[sound, sound, unsound]), UNSOUND);
    assert_eq!(sensors(&[sound, on_board_only(unsound)]), UNSOUND);
    assert_eq!(sensors(&[on_board_only(sound)]), SOUND);
}

#[test]
// Requirement: AP-23, AP-24
fn each_instance_has_its_own_values_and_the_first_is_in_sys_status() {
    let batteries: [BatteryState; 9] = std::array::from_fn(|instance| healthy(10.0 + instance as f32));
    let state = with_packs(&batteries);
    for pack in Pack::ALL {
        let data = build_battery_status(&state, pack);
        assert_eq!(data.id, pack.instance());
        assert_eq!(data.voltages[0], 10_000 + 1000 * u16::from(pack.instance()));
    }
    assert_eq!(build_sys_status(&state).voltage_battery, 10_000);
}

#[test]
fn a_text_is_byte_exact() {
    let mut endpoint = Endpoint::new("bench", LinkKind::Radio, 100_000, Instant::EPOCH);
    endpoint.say(Severity::Warning, "Battery 1 is low 10.40V used 36 mAh");
    let text = endpoint.next_message(&SystemState::default(), &Parameters::defaults());
    assert_golden("statustext_low", &text.expect("the text waits"));
}

/// A healthy pack that reports these faults itself.
fn reporting(faults: Faults) -> BatteryState {
    let mut battery = healthy(11.1);
    battery.readings.reported.faults = faults;
    battery
}

#[test]
// Requirement: AP-23
fn no_state_has_a_fault_bit_without_a_known_fault() {
    let lost = BatteryState {
        status: PackStatus::Unhealthy,
        charge_state: ChargeState::Unhealthy,
        ..healthy(11.1)
    };
    assert_eq!(status_of(lost).fault_bitmask.bits(), 0);
    for (number, charge_state) in CHARGE_STATES.into_iter().enumerate() {
        let data = status_of(in_state(charge_state));
        assert_eq!(
            (data.fault_bitmask.bits(), data.charge_state as usize),
            (0, number)
        );
        let mut hot = in_state(charge_state);
        hot.readings.faults = Faults::OVER_TEMPERATURE;
        assert_eq!(status_of(hot).fault_bitmask.bits(), 16, "{charge_state:?}");
    }
}

#[test]
fn the_resting_voltage_is_sent_where_it_is_chosen_and_known() {
    let mut resting = healthy(11.1);
    resting.reported_voltage = ReportedVoltage::Resting;
    resting.readings.resting_voltage_v = Some(11.4);
    let mut unknown = resting;
    unknown.readings.resting_voltage_v = None;
    let terminal = BatteryState {
        reported_voltage: ReportedVoltage::Terminal,
        ..resting
    };
    for (battery, voltage_mv) in [(resting, 11_400), (unknown, 11_100), (terminal, 11_100)] {
        assert_eq!(status_of(battery).voltages[0], voltage_mv);
        assert_eq!(system_with(battery).voltage_battery, voltage_mv);
    }
}

#[test]
fn cells_are_sent_as_they_are_measured_with_the_resting_voltage_too() {
    let millivolts: [u16; 14] = std::array::from_fn(|cell| 3700 + cell as u16);
    let mut battery = with_cells(51.9, &millivolts);
    battery.reported_voltage = ReportedVoltage::Resting;
    battery.readings.resting_voltage_v = Some(60.0);
    let data = status_of(battery);
    assert_eq!(data.voltages, millivolts[..10]);
    assert_eq!(data.voltages_ext, millivolts[10..]);
    assert_eq!(system_with(battery).voltage_battery, 60_000);
}

#[test]
// Requirement: FR-3
fn more_cells_than_the_message_has_are_sent_as_the_packs_voltage() {
    for (cells, voltages) in [
        (15, vec![49_500]),
        (16, vec![52_800]),
        // DroneCAN has such packs.
        (24, vec![65_534, 13_666]),
    ] {
        let data = status_of(with_cells(cells as f32 * 3.3, &vec![3300; cells]));
        let sent: Vec<u16> = data.voltages.into_iter().filter(|mv| *mv != u16::MAX).collect();
        assert_eq!((sent, data.voltages_ext), (voltages, [0; 4]), "{cells} cells");
    }
}

#[test]
fn a_cells_voltage_is_never_mistaken_for_one_that_is_not_there() {
    let data = status_of(with_cells(11.1, &[0, u16::MAX, 3700]));
    assert_eq!(data.voltages[..4], [0, 65534, 3700, u16::MAX]);
    assert_eq!(data.voltages_ext, [0; 4]);
    let data = status_of(with_cells(
        11.1,
        &[[3700; 10].as_slice(), &[0, u16::MAX]].concat(),
    ));
    assert_eq!(data.voltages_ext, [1, 65534, 0, 0]);
}

#[test]
// Requirement: FR-3
fn a_high_voltage_spills_in_battery_status_and_saturates_in_sys_status() {
    for (voltage_v, cells) in [
        (70.0, [65534, 4466, u16::MAX]),
        (65.534, [65534, u16::MAX, u16::MAX]),
    ] {
        assert_eq!(status_of(healthy(voltage_v)).voltages[..3], cells);
        assert_eq!(system_with(healthy(voltage_v)).voltage_battery, 65534);
    }
}

/// MAVLink's NaN, bit for bit.
const NAN_BITS: u32 = 0x7fc0_0000;

#[test]
// Requirement: V2-4
fn messages_that_no_autopilot_sends_yet_are_byte_exact() {
    let mut estimated = healthy(11.1);
    estimated.resistance_ohm = Some(0.04525);
    estimated.readings.resting_voltage_v = Some(11.5);
    estimated.readings.remaining_sigma_pct = Some(3.5);
    estimated.readings.usable_pct = Some(18.75);
    let batteries = [estimated; 9];
    let state = SystemState {
        now: Instant::from_micros(1_234_567_890),
        ..with_packs(&batteries)
    };
    let resistance = Message::Resistance(build_resistance(&state, Pack::First));
    let resting_voltage = Message::RestingVoltage(build_resting_voltage(&state, Pack::Ninth));
    let deviation = Message::ChargeDeviation(build_charge_deviation(&state, Pack::First));
    let usable = Message::UsableCharge(build_usable_charge(&state, Pack::First));
    for (row, message) in [
        // Only the voltage is known.
        (
            "battery_status_v2_unknown",
            Message::BatteryStatusV2(status_v2_of(healthy(11.1))),
        ),
        ("battery_info_372", Message::BatteryInfo(info_of(as_set()))),
        ("named_value_float_resistance", resistance),
        ("named_value_float_resting_voltage", resting_voltage),
        ("named_value_float_charge_deviation", deviation),
        ("named_value_float_usable_charge", usable),
    ] {
        assert_golden(row, &message);
    }
}

#[test]
// Requirement: V2-1
fn battery_status_v2_says_what_is_unknown_with_the_sentinel_of_each_field() {
    let data = build_battery_status_v2(&SystemState::default(), Pack::Fourth);
    let numbers = [
        data.voltage,
        data.current,
        data.capacity_consumed,
        data.capacity_remaining,
        data.state_of_charge,
    ];
    assert_eq!(numbers.map(f32::to_bits), [NAN_BITS; 5]);
    assert_eq!((data.temperature, data.id), (i16::MAX, 3));
    // The crate's default is NOT_READY_TO_USE.
    assert_eq!(data.status_flags.bits(), 0);
}

#[test]
// Requirement: V2-1
fn battery_status_v2_is_in_volts_amperes_ampere_hours_and_percent() {
    let mut battery = counting(70.25, -400.5, 1234.0, 37.5);
    battery.readings.resting_voltage_v = Some(71.5);
    battery.capacity = Some(Amount::Mah(2200.0));
    battery.temperature_c = Some(-12.34);
    battery.reported_voltage = ReportedVoltage::Resting;
    let data = status_v2_of(battery);
    assert_eq!((data.voltage, data.current), (71.5, -400.5));
    assert_eq!((data.capacity_consumed, data.capacity_remaining), (1.234, 0.825));
    assert_eq!((data.state_of_charge, data.temperature), (37.5, -1234));
    for (capacity, remaining_pct) in [(None, Some(50.0)), (Some(Amount::Mah(2200.0)), None)] {
        battery.capacity = capacity;
        battery.readings.remaining_pct = remaining_pct;
        let data = status_v2_of(battery);
        assert!(data.capacity_remaining.is_nan());
        assert_eq!(data.state_of_charge.is_nan(), remaining_pct.is_none());
    }
    // Net charging can be reported.
    let charged = BatteryState {
        consumed: Some(Amount::Mah(-50.0)),
        ..battery
    };
    assert_eq!(status_v2_of(charged).capacity_consumed, -0.05);
}

#[test]
// Requirement: V2-1, V2-3
fn a_gauge_counts_from_the_full_pack_and_what_remains_is_else_of_the_learnt_capacity() {
    for (charge_source, expected_ah, flags) in [
        (ChargeSource::Gauge, 1.1, 262_144),
        (ChargeSource::Estimated, 0.6, 0),
    ] {
        let mut battery = healthy(11.1);
        battery.readings.remaining_pct = Some(50.0);
        battery.capacity = Some(Amount::Mah(2200.0));
        battery.learnt_capacity_mah = Some(1200.0);
        battery.charge_source = charge_source;
        let data = status_v2_of(battery);
        assert_eq!(
            (data.capacity_remaining, data.status_flags.bits()),
            (expected_ah, flags)
        );
    }
}

#[test]
// Requirement: V2-2
fn modes_that_a_pack_reports_have_their_flags_and_leave_it_healthy() {
    for (modes, expected) in [
        (Modes::FULL, 0),
        (Modes::BALANCING, 4),
        // The dialect: a pack that discharges itself is not ready.
        (Modes::STORING, 16 | 1),
        (Modes::PROTECTED, 128),
    ] {
        let mut battery = reporting(Faults::SHORT_CIRCUIT | Faults::SWITCHED_OFF);
        battery.readings.reported.modes = modes;
        let is_healthy = !consequences(&battery).contains(Consequences::NOT_HEALTHY);
        assert!(is_healthy, "{modes:?}");
        let flags = status_v2_of(battery).status_flags;
        assert_eq!(flags.bits(), 16_384 | 256 | expected, "{modes:?}");
    }
}

/// A pack that reports nothing itself, as its owner has set it.
fn as_set() -> BatteryState {
    BatteryState {
        cell_count: Some(3),
        capacity: Some(Amount::Mah(2200.0)),
        critical_voltage_v: Some(9.9),
        ..healthy(11.1)
    }
}

/// A pack that reports all values.
fn smart() -> BatteryState {
    BatteryState {
        cell_count: Some(4),
        capacity: Some(Amount::Mah(4875.0)),
        critical_voltage_v: Some(12.0),
        serial_number: Some(48_879),
        chemistry: Chemistry::LiIon,
        charge_source: ChargeSource::Gauge,
        state_of_health_pct: Some(97),
        details: PackDetails {
            manufacturer: Name::from_ascii(b"Acme"),
            device: Name::from_ascii(b"BP 4S"),
            serial_number: Some(48_879),
            manufactured: Some(Date {
                year: 2026,
                month: 3,
                day: 9,
            }),
            chemistry: Some(Chemistry::LiIon),
            cycle_count: Some(41),
            design_capacity_mah: Some(5000.0),
            design_voltage_v: Some(14.8),
            state_of_health_pct: Some(97),
        },
        ..healthy(15.2)
    }
}

/// A tank of 2 l with 500 ml left.
pub fn tank() -> BatteryState {
    let mut battery = healthy(0.0);
    battery.contents = Contents::Fuel;
    battery.readings.voltage_v = None;
    battery.readings.remaining_pct = Some(25.0);
    battery.capacity = Some(Amount::Ml(2000.0));
    battery.consumed = Some(Amount::Ml(1500.0));
    battery
}

#[test]
fn fuel_by_a_level_sensor_is_byte_exact() {
    let level = BatteryState {
        charge_source: ChargeSource::Gauge,
        ..tank()
    };
    // 2000 ml, consumed unknown, 500 ml, flow and temperature unknown, liquid, instance 0, 25 %.
    let payload = "0000fa44 0000c07f 0000fa43 0000c07f 0000c07f 01000000 00 19".replace(' ', "");
    let hex = frame_hex(&Message::FuelStatus(fuel_of(level)));
    assert_eq!(hex[14..20], *"730100", "message 371");
    assert_eq!(hex[20..hex.len() - 4], payload);
}

#[test]
fn fuel_by_a_flow_sensor_reports_consumption_and_rate() {
    let mut flow = tank();
    (flow.readings.current_a, flow.readings.fuel_l_h) = (None, Some(3.6));
    flow.temperature_c = Some(20.0);
    let data = fuel_of(flow);
    assert_eq!((data.maximum_fuel, data.consumed_fuel), (2000.0, 1500.0));
    assert_eq!(data.remaining_fuel.to_bits(), NAN_BITS, "it is inferred");
    assert!((data.flow_rate - 1.0).abs() < 1e-6, "{} ml/s", data.flow_rate);
    assert_eq!((data.temperature, data.percent_remaining), (293.15, 25));
    assert_eq!(data.fuel_type, MavFuelType::MAV_FUEL_TYPE_LIQUID);
}

#[test]
fn what_is_not_known_of_a_tank_has_the_sentinel_of_each_field() {
    let data = build_fuel_status(&SystemState::default(), Pack::Eighth);
    let numbers = [
        data.maximum_fuel,
        data.consumed_fuel,
        data.remaining_fuel,
        data.flow_rate,
        data.temperature,
    ];
    assert_eq!(numbers.map(f32::to_bits), [NAN_BITS; 5]);
    assert_eq!((data.id, data.percent_remaining), (7, 255));
}

#[test]
fn a_tank_is_no_battery_of_any_chemistry() {
    let data = status_of(tank());
    assert_eq!(data.mavtype, MavBatteryType::MAV_BATTERY_TYPE_UNKNOWN);
    assert_eq!(
        (data.voltages[0], data.current_battery, data.energy_consumed),
        (u16::MAX, -1, -1)
    );
    assert_eq!((data.current_consumed, data.battery_remaining), (1500, 25));
    assert_eq!(info_of(tank()).mavtype, MavBatteryType::MAV_BATTERY_TYPE_UNKNOWN);
    assert_eq!(info_of(tank()).charging_maximum_voltage, 0.0);
    assert_eq!(smart_info_of(tank()).charging_maximum_voltage, 0);
}

#[test]
// Requirement: PX-1
fn the_details_of_a_smart_battery_are_in_both_infos_in_their_own_units() {
    let (info, whole) = (info_of(smart()), smart_info_of(smart()));
    assert_eq!(
        (info.discharge_minimum_voltage, info.charging_maximum_voltage),
        (3.0, 4.2)
    );
    assert_eq!(
        (whole.discharge_minimum_voltage, whole.charging_maximum_voltage),
        (3000, 4200)
    );
    assert_eq!((info.design_capacity, info.full_charge_capacity), (5.0, 4.875));
    assert_eq!(
        (whole.capacity_full_specification, whole.capacity_full),
        (5000, 4875)
    );
    assert_eq!((info.nominal_voltage, info.state_of_health), (14.8, 97));
    assert_eq!([info.cycle_count, whole.cycle_count], [41; 2]);
    assert_eq!([info.cells_in_series, whole.cells_in_series], [4; 2]);
    for mavtype in [info.mavtype, whole.mavtype] {
        assert_eq!(mavtype, MavBatteryType::MAV_BATTERY_TYPE_LION);
    }
    for function in [info.battery_function, whole.battery_function] {
        assert_eq!(function, MavBatteryFunction::MAV_BATTERY_FUNCTION_ALL);
    }
    assert_eq!(info.manufacture_date.to_str(), Ok("09032026"));
    assert_eq!(whole.manufacture_date.to_str(), Ok("09/03/2026"));
    assert_eq!(info.serial_number.to_str(), Ok("48879"));
    assert_eq!(whole.serial_number.to_str(), Ok("48879"));
    assert_eq!(info.name.to_str(), Ok("Acme_BP 4S"));
    assert_eq!(whole.device_name.to_str(), Ok("Acme_BP 4S"));
}

#[test]
fn what_a_pack_is_is_unknown_with_the_sentinel_of_each_field() {
    let state = SystemState::default();
    let data = build_battery_info(&state, Pack::Fourth);
    let not_given = [
        data.discharge_minimum_voltage,
        data.charging_minimum_voltage,
        data.resting_minimum_voltage,
        data.charging_maximum_current,
        data.nominal_voltage,
        data.discharge_maximum_current,
        data.discharge_maximum_burst_current,
        data.design_capacity,
    ];
    assert_eq!(not_given, [0.0; 8]);
    assert_eq!(data.full_charge_capacity.to_bits(), NAN_BITS);
    assert_eq!((data.cycle_count, data.weight, data.id), (u16::MAX, 0, 3));
    assert_eq!((data.state_of_health, data.cells_in_series), (255, 0));
    assert_eq!(*data.manufacture_date, [0; 9]);
    assert_eq!(*data.serial_number, [0; 32]);
    assert_eq!(*data.name, [0; 50]);

    let data = build_smart_battery_info(&state, Pack::Fourth);
    assert_eq!((data.capacity_full_specification, data.capacity_full), (-1, -1));
    assert_eq!((data.cycle_count, data.weight, data.id), (u16::MAX, 0, 3));
    let lowest = [
        data.discharge_minimum_voltage,
        data.charging_minimum_voltage,
        data.resting_minimum_voltage,
    ];
    assert_eq!(lowest, [u16::MAX; 3]);
    assert_eq!(
        (
            data.discharge_maximum_current,
            data.discharge_maximum_burst_current
        ),
        (0, 0)
    );
    assert_eq!(data.cells_in_series, 0);
    assert_eq!(*data.serial_number, [0; 16]);
    assert_eq!(*data.device_name, [0; 50]);
    assert_eq!(*data.manufacture_date, [0; 11]);
}

#[test]
// Requirement: AP-23
fn the_type_and_the_voltages_of_a_cell_follow_from_the_chemistry() {
    for (chemistry, mavtype, charged_v, charged_mv, nominal_v) in [
        (
            Chemistry::LiPo,
            MavBatteryType::MAV_BATTERY_TYPE_LIPO,
            4.2,
            4200,
            3.7,
        ),
        (
            Chemistry::LiFe,
            MavBatteryType::MAV_BATTERY_TYPE_LIFE,
            3.65,
            3650,
            3.2,
        ),
        (
            Chemistry::LiIon,
            MavBatteryType::MAV_BATTERY_TYPE_LION,
            4.2,
            4200,
            3.6,
        ),
        // It is charged until its voltage falls.
        (
            Chemistry::NiMh,
            MavBatteryType::MAV_BATTERY_TYPE_NIMH,
            0.0,
            0,
            1.2,
        ),
    ] {
        let battery = BatteryState {
            chemistry,
            cell_count: Some(1),
            ..BatteryState::default()
        };
        let (info, smart) = (info_of(battery), smart_info_of(battery));
        assert_eq!(status_of(battery).mavtype, mavtype);
        assert_eq!(smart.mavtype, mavtype);
        assert_eq!(chemistry as u32, mavtype as u32);
        assert_eq!(
            (info.charging_maximum_voltage, info.nominal_voltage),
            (charged_v, nominal_v)
        );
        assert_eq!(smart.charging_maximum_voltage, charged_mv);
    }
}

#[test]
fn a_capacity_that_was_set_is_the_design_and_never_the_present_one() {
    let gauged = BatteryState {
        charge_source: ChargeSource::Gauge,
        ..as_set()
    };
    let info = info_of(gauged);
    assert_eq!((info.design_capacity, info.full_charge_capacity), (0.0, 2.2));
    for (battery, design_mah, present_mah) in [(gauged, -1, 2200), (as_set(), 2200, -1)] {
        let smart = smart_info_of(battery);
        assert_eq!(
            (smart.capacity_full_specification, smart.capacity_full),
            (design_mah, present_mah)
        );
    }
}

fn with_details(details: PackDetails) -> BatteryState {
    BatteryState {
        details,
        ..healthy(11.1)
    }
}

#[test]
fn a_name_is_that_of_the_maker_or_of_the_product_if_the_other_is_missing() {
    for (manufacturer, device, expected) in [
        ("", "", ""),
        ("Acme", "", "Acme"),
        ("", "BP4", "BP4"),
        ("Acme", "BP4", "Acme_BP4"),
        (
            "12345678901234567890",
            "12345678901234567890",
            "12345678901234567890_12345678901234567890",
        ),
    ] {
        let battery = with_details(PackDetails {
            manufacturer: Name::from_ascii(manufacturer.as_bytes()),
            device: Name::from_ascii(device.as_bytes()),
            ..PackDetails::default()
        });
        assert_eq!(info_of(battery).name.to_str(), Ok(expected));
        assert_eq!(smart_info_of(battery).device_name.to_str(), Ok(expected));
    }
}

#[test]
fn an_invalid_date_is_not_reported() {
    for (year, month, day) in [
        (10_000, 1, 1),
        (2026, 0, 1),
        (2026, 13, 1),
        (2026, 1, 0),
        (2026, 1, 32),
    ] {
        let battery = with_details(PackDetails {
            manufactured: Some(Date { year, month, day }),
            ..PackDetails::default()
        });
        assert_eq!(*info_of(battery).manufacture_date, [0; 9]);
        assert_eq!(*smart_info_of(battery).manufacture_date, [0; 11]);
    }
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

const CHARGE_STATES: [ChargeState; 8] = [
    ChargeState::Undefined,
    ChargeState::Ok,
    ChargeState::Low,
    ChargeState::Critical,
    ChargeState::Emergency,
    ChargeState::Failed,
    ChargeState::Unhealthy,
    ChargeState::Charging,
];

fn any_amount() -> impl Strategy<Value = Option<Amount>> {
    let contents = prop::sample::select(&[Contents::Charge, Contents::Fuel][..]);
    (contents, any_value()).prop_map(|(contents, number)| Some(Amount::of(contents, number?)))
}

prop_compose! {
    /// The measurements of a sensor.
    fn any_measured()(
        voltage_v in any_value(), resting_voltage_v in any_value(), current_a in any_value(),
        consumed in any_amount(), consumed_wh in any_value(), remaining_pct in any_value(),
        time_remaining_s in any_value(), temperature_c in any_value(),
        resistance_ohm in any_value(), cells in prop::collection::vec(any::<u16>(), 0..=MAX_CELLS + 2),
    ) -> BatteryState {
        BatteryState {
            readings: Readings { voltage_v, resting_voltage_v, current_a, remaining_pct, time_remaining_s, ..Readings::NONE },
            resistance_ohm, consumed, consumed_wh, temperature_c, cells: CellVoltages::from_millivolts(&cells),
            ..BatteryState::default()
        }
    }
}

prop_compose! {
    /// The details a smart battery reports.
    fn any_details()(
        manufacturer in prop::collection::vec(any::<u8>(), 0..32), device in prop::collection::vec(any::<u8>(), 0..32),
        date in prop::option::of(any::<(u16, u8, u8)>()), cycle_count in any::<Option<u16>>(),
        design_capacity_mah in any_value(), design_voltage_v in any_value(), state_of_health_pct in any::<Option<u8>>(),
    ) -> PackDetails {
        PackDetails {
            manufacturer: Name::from_ascii(&manufacturer), device: Name::from_ascii(&device), cycle_count,
            manufactured: date.map(|(year, month, day)| Date { year, month, day }),
            design_capacity_mah, design_voltage_v, state_of_health_pct, ..PackDetails::default()
        }
    }
}

prop_compose! {
    /// The facts that are set for a pack, or reported by it.
    fn any_identity()(
        details in any_details(), cell_count in any::<Option<u8>>(), capacity in any_amount(),
        critical_voltage_v in any_value(), serial_number in any::<Option<i32>>(), gauge in any::<bool>(),
    ) -> BatteryState {
        BatteryState {
            state_of_health_pct: details.state_of_health_pct, details, cell_count, capacity, critical_voltage_v, serial_number,
            charge_source: if gauge { ChargeSource::Gauge } else { ChargeSource::Estimated },
            ..BatteryState::default()
        }
    }
}

prop_compose! {
    fn any_battery()(
        measured in any_measured(), identity in any_identity(), charge_state in prop::sample::select(&CHARGE_STATES[..]),
        status in prop::sample::select(vec![
            PackStatus::Disabled, PackStatus::Unknown, PackStatus::NotConnected, PackStatus::Healthy, PackStatus::Unhealthy,
        ]),
        chemistry in prop::sample::select(vec![Chemistry::LiPo, Chemistry::LiFe, Chemistry::LiIon, Chemistry::NiMh]),
        faults in any::<[u16; 2]>(), resting in any::<bool>(), internal in any::<bool>(), failsafe in prop::sample::select(vec![
            FailsafeLevel::None, FailsafeLevel::Unhealthy, FailsafeLevel::Low, FailsafeLevel::Critical,
        ]),
    ) -> BatteryState {
        let mut readings = measured.readings;
        readings.faults = Faults::from_bits_retain(faults[0]);
        readings.reported.faults = Faults::from_bits_retain(faults[1]);
        BatteryState {
            readings, status, charge_state, chemistry, failsafe,
            reported_voltage: if resting { ReportedVoltage::Resting } else { ReportedVoltage::Terminal },
            visibility: if internal { Visibility::Internal } else { Visibility::Reported },
            resistance_ohm: measured.resistance_ohm, consumed: measured.consumed, consumed_wh: measured.consumed_wh,
            temperature_c: measured.temperature_c, cells: measured.cells, ..identity
        }
    }
}

fn any_pack() -> impl Strategy<Value = Pack> {
    prop::sample::select(&Pack::ALL[..])
}

fn any_packs() -> impl Strategy<Value = Vec<BatteryState>> {
    prop::collection::vec(any_battery(), 0..=9)
}

/// The number of known cells: they come first, and the rest has the value of a cell that is not used.
fn used_cells(cells: &[u16], unused_mv: u16) -> usize {
    let used = cells.iter().take_while(|mv| **mv != unused_mv).count();
    assert!(cells[used..].iter().all(|mv| *mv == unused_mv), "{cells:?}");
    used
}

proptest! {
    #[test]
    // Requirement: FR-17, PX-1
    fn any_state_gives_a_conforming_battery_status(packs in any_packs(), pack in any_pack()) {
        let state = with_packs(&packs);
        let data = build_battery_status(&state, pack);
        prop_assert_eq!(data.id, pack.instance());
        let battery = state.battery(pack);
        match battery.cells.count() {
            // The pack's voltage is in as few cells as can carry it.
            0 | 15.. => {
                let used = used_cells(&data.voltages, u16::MAX);
                prop_assert!(data.voltages[..used.saturating_sub(1)].iter().all(|mv| *mv == 65534));
                let is_known = battery.voltage_to_report_v().is_some_and(|v| v.is_finite() && v >= 0.0);
                prop_assert_eq!(used > 0, is_known);
                prop_assert_eq!(data.voltages_ext, [0; 4]);
            }
            count => {
                prop_assert_eq!(used_cells(&data.voltages, u16::MAX), count.min(10));
                prop_assert_eq!(used_cells(&data.voltages_ext, 0), count.saturating_sub(10));
                prop_assert!(!data.voltages_ext.contains(&u16::MAX));
            }
        }
        prop_assert!(data.current_battery > i16::MIN);
        prop_assert!(data.current_consumed >= -1 && data.energy_consumed >= -1);
        prop_assert!((-1..=100).contains(&data.battery_remaining));
        prop_assert!(data.time_remaining >= 0);
        prop_assert_eq!(data.charge_state as u8, battery.charge_state as u8);
        // The frame itself: 54 bytes of payload at most.
        let frame = frame_hex(&Message::BatteryStatus(data));
        prop_assert!(frame.len() <= 2 * (54 + 12));
    }

    #[test]
    fn any_state_gives_a_conforming_battery_status_v2(packs in any_packs(), pack in any_pack()) {
        let state = with_packs(&packs);
        let battery = state.battery(pack);
        let data = build_battery_status_v2(&state, pack);
        prop_assert_eq!(data.id, pack.instance());
        for number in [data.voltage, data.current, data.capacity_consumed, data.capacity_remaining] {
            prop_assert!(number.is_finite() || number.to_bits() == NAN_BITS, "{number}");
        }
        prop_assert!(data.voltage.is_nan() || data.voltage >= 0.0);
        prop_assert!(data.capacity_remaining.is_nan() || data.capacity_remaining >= 0.0);
        let charge = data.state_of_charge;
        prop_assert!(charge.to_bits() == NAN_BITS || (0.0..=100.0).contains(&charge));
        // Flags of what can't be known, those that are reserved included, are never set.
        let known = 1 | 2 | FAULT_FLAGS | 262_144;
        prop_assert_eq!(data.status_flags.bits() & !known, 0);
        prop_assert_eq!(data.status_flags.bits() & 2 != 0, battery.charge_state == ChargeState::Charging);
        let message = Message::BatteryStatusV2(data);
        prop_assert!(frame_hex(&message).len() <= 2 * (27 + 12));
    }

    #[test]
    fn any_state_gives_a_conforming_fuel_status(packs in any_packs(), pack in any_pack()) {
        let data = build_fuel_status(&with_packs(&packs), pack);
        prop_assert_eq!(data.id, pack.instance());
        for number in [data.maximum_fuel, data.consumed_fuel, data.remaining_fuel, data.flow_rate, data.temperature] {
            prop_assert!(number.is_finite() || number.to_bits() == NAN_BITS, "{number}");
        }
        prop_assert!(data.consumed_fuel.is_nan() || data.remaining_fuel.is_nan());
        prop_assert!(data.percent_remaining <= 100 || data.percent_remaining == 255);
        let message = Message::FuelStatus(data);
        prop_assert!(frame_hex(&message).len() <= 2 * (26 + 12));
    }

    #[test]
    fn any_state_gives_conforming_named_values(packs in any_packs(), pack in any_pack(), now_us in any::<u64>()) {
        let state = SystemState { now: Instant::from_micros(now_us), ..with_packs(&packs) };
        let number = pack.instance() + 1;
        for (data, name, length) in [
            (build_resistance(&state, pack), format!("BAT{number}_RES"), 8),
            (build_resting_voltage(&state, pack), format!("BAT{number}_VREST"), 10),
            (build_charge_deviation(&state, pack), format!("BAT{number}_SIGMA"), 10),
            (build_usable_charge(&state, pack), format!("BAT{number}_USABL"), 10),
        ] {
            prop_assert_eq!(&data.name[..length], name.as_bytes());
            prop_assert!(data.name[length..].iter().all(|byte| *byte == 0));
            prop_assert!(data.value.is_finite() || data.value.to_bits() == NAN_BITS, "{}", data.value);
            prop_assert_eq!(u64::from(data.time_boot_ms), now_us / 1000 % (1 << 32));
        }
    }

    #[test]
    fn any_state_gives_conforming_infos(packs in any_packs(), pack in any_pack()) {
        let state = with_packs(&packs);
        let data = build_battery_info(&state, pack);
        prop_assert_eq!(data.id, pack.instance());
        for number in [data.discharge_minimum_voltage, data.nominal_voltage, data.design_capacity] {
            prop_assert!(number.is_finite() && number >= 0.0, "{number}");
        }
        let full = data.full_charge_capacity;
        prop_assert!(full.to_bits() == NAN_BITS || (full.is_finite() && full >= 0.0), "{full}");
        prop_assert!(data.state_of_health <= 100 || data.state_of_health == 255);
        prop_assert!([0, 8].contains(&data.manufacture_date.to_str().expect("ASCII").len()));
        let (date, serial, name) = (*data.manufacture_date, *data.serial_number, *data.name);
        prop_assert_eq!((date[8], serial[31], name[49]), (0, 0, 0));
        prop_assert!(date.iter().chain(&serial).chain(&name).all(|byte| *byte == 0 || byte.is_ascii_graphic() || *byte == b' '));
        let message = Message::BatteryInfo(data);
        prop_assert!(frame_hex(&message).len() <= 2 * (140 + 12));

        let smart = build_smart_battery_info(&state, pack);
        prop_assert_eq!(smart.id, pack.instance());
        prop_assert!(smart.capacity_full >= -1 && smart.capacity_full_specification >= -1);
        prop_assert_eq!(*smart.device_name, name);
        prop_assert_eq!(&smart.serial_number[..], &serial[..16]);
        prop_assert!([0, 10].contains(&smart.manufacture_date.to_str().expect("ASCII").len()));
        let message = Message::SmartBatteryInfo(smart);
        prop_assert!(frame_hex(&message).len() <= 2 * (109 + 12));
    }

    #[test]
    // Requirement: AP-24
    fn any_state_gives_a_conforming_sys_status(
        packs in any_packs(), load_permille in any::<u16>(), sent in any::<u32>(), dropped in any::<u32>(),
        unauthorized in any::<u32>(), frames in any::<u32>(), bad_checksums in any::<u32>(),
    ) {
        let received = ReceiveStatistics { frames, bad_checksums, ..Default::default() };
        let state = SystemState {
            batteries: &packs, load_permille, link: LinkStatistics { sent, sent_bytes: sent, dropped, unauthorized, received }, ..SystemState::default()
        };
        let data = build_sys_status(&state);
        prop_assert!(data.load <= 1000);
        prop_assert!(data.drop_rate_comm <= 10_000);
        prop_assert!(data.current_battery > i16::MIN);
        prop_assert!((-1..=100).contains(&data.battery_remaining));
        let voltage_v = state.battery(Pack::First).voltage_to_report_v();
        let known = voltage_v.is_some_and(|v| v.is_finite() && v >= 0.0);
        prop_assert_eq!(data.voltage_battery != u16::MAX, known);
        let monitored = packs.iter().any(|battery| battery.status != PackStatus::Disabled);
        prop_assert_eq!(data.onboard_control_sensors_present.contains(BATTERY_SENSOR), monitored);
        prop_assert_eq!(data.onboard_control_sensors_enabled, data.onboard_control_sensors_present);
        prop_assert!(monitored || !data.onboard_control_sensors_health.contains(BATTERY_SENSOR));
        // Mission Planner shows these as internal errors.
        prop_assert_eq!([data.errors_count1, data.errors_count2, data.errors_count4], [0; 3]);
    }

    #[test]
    fn the_cells_add_up_to_the_pack(voltage_v in 0.0f32..650.0) {
        let data = status_of(healthy(voltage_v));
        let sum_mv: u32 = data.voltages.iter().filter(|mv| **mv != u16::MAX).map(|mv| u32::from(*mv)).sum();
        prop_assert!((sum_mv as f32 - voltage_v * 1000.0).abs() <= 0.6);
    }
}
