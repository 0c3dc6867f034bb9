//! The parameters, through the telemetry port and over restarts.

use std::collections::BTreeMap;

use rover_battmon::pack::Pack;
use rover_battmon::parameter::GroundStationParameter;

use support::commands::{ACCEPTED, PREFLIGHT_STORAGE};
use support::firmware_version;
use support::frames::{
    BATTERY_STATUS, BatteryStatus, COMMAND_ACK, HEARTBEAT, PARAM_VALUE, ParamValue, STATUSTEXT, SYS_STATUS,
    of_message, texts_of,
};
use support::requests::{VEHICLE, arm, command_long, param_request_list};
use workbench::bench::{
    Bench, LISTED_BY_DEFAULT, LISTED_OF_PACK, LISTED_OF_VEHICLE, MILLISECOND, SAVED_US, SECOND,
};
use workbench::runs::rates_asked_for;

/// All parameters, by a list.
pub fn list(bench: &mut Bench) -> BTreeMap<String, f32> {
    let mut answers = bench.ask(&param_request_list(VEHICLE));
    let from_us = answers.last().map_or(0, |frame| frame.at_us);
    bench.run_for(2 * SECOND);
    answers.extend(bench.frames().into_iter().filter(|frame| frame.at_us > from_us));
    let values = of_message(&answers, PARAM_VALUE);
    let count = usize::from(ParamValue(values[0]).count());
    assert_eq!(values.len(), count, "each once");
    values
        .iter()
        .map(|frame| (ParamValue(frame).name(), ParamValue(frame).value()))
        .collect()
}

#[test]
fn a_list_leaves_heartbeat_and_telemetry_flowing_and_takes_its_share() {
    let mut bench = Bench::running(2482);
    bench.set("SERIAL0_BAUD", 9.0);
    bench.reboot();
    let asked_us = bench.time_us();
    for _ in 0..10 {
        bench.ask(&param_request_list(VEHICLE));
        bench.run_for(SECOND - 200 * MILLISECOND);
    }
    let frames = bench.frames_since(asked_us);
    let bytes: usize = of_message(&frames, PARAM_VALUE)
        .iter()
        .map(|frame| frame.payload_len() + 12)
        .sum();
    // 960 bytes a second; one parameter more at the start of each list.
    assert!(
        bytes <= 10 * (288 + 37),
        "{bytes} bytes of parameters in ten seconds"
    );
    assert!(bytes > 10 * 200, "{bytes} bytes of parameters in ten seconds");
    for (message, per_second) in [(HEARTBEAT, 1), (SYS_STATUS, 2), (BATTERY_STATUS, 2)] {
        assert!(
            of_message(&frames, message).len().abs_diff(10 * per_second) <= 1,
            "message {message}"
        );
    }
}

#[test]
// Requirement: FR-16, AP-2
fn what_was_set_is_there_after_a_restart_and_after_a_power_cycle() {
    let mut bench = Bench::running(2482);
    bench.set("BATT_VOLT_MULT", 4.1);
    bench.set("SR0_EXTRA1", 5.0);
    bench.reboot();
    assert_eq!(bench.parameter("BATT_VOLT_MULT"), 4.1);
    assert_eq!(bench.parameter("SR0_EXTRA1"), 5.0);
    bench.power_cycle();
    bench.run_for(SECOND);
    assert_eq!(bench.parameter("BATT_VOLT_MULT"), 4.1);
    assert_eq!(bench.parameter("SR0_EXTRA1"), 5.0);
    assert_eq!(bench.parameter("SYSID_THISMAV"), 1.0);
}

#[test]
fn a_pack_that_is_enabled_shows_its_parameters_also_after_a_restart() {
    let mut bench = Bench::running(2482);
    let hidden = list(&mut bench);
    assert_eq!(hidden.len(), LISTED_BY_DEFAULT);
    assert!(!hidden.contains_key("BATT9_VOLT_MULT"));
    bench.set("BATT9_VOLT_MULT", 11.0);
    bench.set("BATT9_MONITOR", 3.0);
    let shown = list(&mut bench);
    assert_eq!(shown.len(), LISTED_BY_DEFAULT + LISTED_OF_PACK - 1);
    assert_eq!(shown["BATT9_VOLT_MULT"], 11.0);
    bench.run_for(SAVED_US);
    bench.reboot();
    assert_eq!(list(&mut bench), shown);
}

#[test]
fn every_parameter_there_can_be_is_listed_without_holding_anything_up() {
    let all = LISTED_OF_VEHICLE + Pack::ALL.len() * LISTED_OF_PACK + GroundStationParameter::COUNT;
    // A list has 30 % of 11520 bytes a second, and a PARAM_VALUE at most 37 of them.
    let seconds = all * 37 / 3456 + 1;
    let mut bench = Bench::running(2482);
    for pack in 2..=9 {
        bench.set(&format!("BATT{pack}_MONITOR"), 3.0);
    }
    bench.run_for(SAVED_US);
    let from_us = bench.time_us();
    bench.ask(&param_request_list(VEHICLE));
    bench.run_for(seconds as u64 * SECOND);
    let frames = bench.frames_since(from_us);
    let values = of_message(&frames, PARAM_VALUE);
    assert_eq!(usize::from(ParamValue(values[0]).count()), all);
    let indices: Vec<_> = values.iter().map(|frame| ParamValue(frame).index()).collect();
    assert_eq!(indices, (0..all as u16).collect::<Vec<_>>());
    for (message, count) in [(HEARTBEAT, seconds), (SYS_STATUS, 2 * seconds)] {
        assert!(
            of_message(&frames, message).len().abs_diff(count) <= 1,
            "{message}"
        );
    }
    bench.assert_untroubled();
}

#[test]
fn a_reset_to_defaults_is_live_and_stays() {
    let mut bench = Bench::running(2482);
    bench.set("SR0_EXTRA1", 5.0);
    bench.run_for(SAVED_US);
    let answers = bench.ask(&command_long(PREFLIGHT_STORAGE, 2.0));
    assert_eq!((answers[0].message_id, answers[0].u8(2)), (COMMAND_ACK, ACCEPTED));
    bench.run_for(SAVED_US);
    assert_eq!(bench.parameter("SR0_EXTRA1"), 2.0);
    bench.reboot();
    assert_eq!(bench.parameter("SR0_EXTRA1"), 2.0);
}

#[test]
fn channels_that_do_not_fit_refuse_arming_over_a_restart_and_are_kept() {
    let mut bench = Bench::running(2482);
    bench.set("RCMAP_ROLL", 3.0);
    bench.set("RC4_MIN", 1900.0);
    bench.run_for(SAVED_US);
    let expected = "Arm: RCMAP_THROTTLE does not fit RCMAP_ROLL";
    assert!(texts_of(&bench.ask(&arm())).contains(&expected.into()));
    bench.reboot();
    assert!(texts_of(&bench.ask(&arm())).contains(&expected.into()));
    assert_eq!(bench.parameter("RCMAP_ROLL"), 3.0);
    bench.set("RCMAP_THROTTLE", 1.0);
    bench.reboot();
    assert_eq!(bench.result_of(&arm()), ACCEPTED);
    for (name, value) in [("RCMAP_ROLL", 3.0), ("RCMAP_THROTTLE", 1.0), ("RC4_MIN", 1900.0)] {
        assert_eq!(bench.parameter(name), value, "{name}");
    }
}

#[test]
// Requirement: FR-2
fn the_rate_follows_sr0_extra1() {
    rates_asked_for::by_parameter(10 * SECOND);
}

#[test]
// Requirement: AP-2
fn the_multiplier_changes_the_voltage_of_the_next_frame() {
    let mut bench = Bench::running(2482);
    bench.run_until_time(3_150 * MILLISECOND);
    bench.set("BATT_VOLT_MULT", 7.9);
    let set_us = bench.time_us();
    bench.run_for(SECOND);
    let frames = bench.frames();
    let battery = of_message(&frames, BATTERY_STATUS);
    let next = battery
        .iter()
        .find(|frame| frame.at_us > set_us)
        .expect("telemetry goes on");
    assert_eq!(BatteryStatus(next).voltage_mv(0), 15_801);
}

#[test]
fn the_offset_and_the_pin_take_effect_at_once() {
    let mut bench = Bench::running(2482);
    bench.adc_input(1, emulator::AdcInput::Code(3000));
    bench.set("BATT_VLT_OFFSET", 0.1);
    bench.set("BATT_VOLT_PIN", 27.0);
    bench.run_for(SECOND);
    let frames = bench.frames();
    let battery = of_message(&frames, BATTERY_STATUS);
    let expected_mv = (3000.0 / 4095.0 * 3.3 - 0.1) * 3950.0;
    let reported_mv = f64::from(BatteryStatus(battery[battery.len() - 1]).voltage_mv(0));
    assert!(
        (reported_mv - expected_mv).abs() <= 1.0,
        "{reported_mv} mV, not {expected_mv} mV"
    );
}

#[test]
fn a_new_system_id_is_used_at_once() {
    let mut bench = Bench::running(2482);
    bench.set("SYSID_THISMAV", 42.0);
    let from_us = bench.time_us();
    bench.run_for(SECOND);
    let frames = bench.frames();
    assert!(
        frames
            .iter()
            .filter(|frame| frame.at_us > from_us)
            .all(|frame| frame.system_id == 42)
    );
}

#[test]
fn a_list_is_announced_by_a_banner() {
    let mut bench = Bench::running(2482);
    let answers = bench.ask(&param_request_list(VEHICLE));
    let texts = of_message(&answers, STATUSTEXT);
    assert_eq!(
        texts[0].text(1, 50),
        format!("rover-battmon {}", firmware_version())
    );
}
