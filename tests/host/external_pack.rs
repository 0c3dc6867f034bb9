//! Packs that a companion computer measures: its frames in, their states, failsafes and announcements out.

use proptest::prelude::*;
use rover_battmon::battery::{BatteryState, ChargeSource, ChargeState, FailsafeLevel, Modes, PackStatus};
use rover_battmon::mavlink::{Event, LinkKind};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, VehicleParameter};
use rover_battmon::sensor::AnalogReadings;
use rover_battmon::time::Instant;
use rover_battmon::vehicle::{Alert, ArmState, Colour, Mode};
use support::charge_states::OK;
use support::commands::{ACCEPTED, BATTERY_RESET, FAILED, REQUEST_MESSAGE};
use support::desk::{Desk, start_with};
use support::frames::{BATTERY_STATUS_V2, last_of, of_message, texts_of};
use support::pack_report::{COMPANION, EXTERNAL, OTHER_COMPANION, PackReport, health_report, report_v2};
use support::requests::{arm, arm_by_force, command_long_2, disarm, manual_mode, setup_signing};
use support::signer::{NEW_YEAR, OWNER, STRANGER, Signer};

const TICK_US: u64 = 100_000;

/// For how long a silent component keeps its pack.
const TIMEOUT_TICKS: usize = 20;

/// The first pack, of 3 cells and 2000 mAh, is measured by a companion computer.
fn desk() -> Desk {
    Desk::starting(start_with(&[
        ("BATT_MONITOR", EXTERNAL),
        ("BATT_CELLS", 3.0),
        ("BATT_CAPACITY", 2000.0),
    ]))
}

/// A tick in which these frames are received, and the state of the first pack after it.
fn tick(desk: &mut Desk, frames: &[Vec<u8>]) -> BatteryState {
    desk.now_us += TICK_US;
    for frame in frames {
        desk.receive_in_chunks(frame, 64);
    }
    desk.sample(AnalogReadings::NONE);
    desk.drive();
    *desk.autopilot.battery(Pack::First)
}

/// Ticks in each of which `frame` is received.
fn ticks(desk: &mut Desk, count: usize, frame: &[u8]) -> BatteryState {
    for _ in 1..count {
        tick(desk, &[frame.to_vec()]);
    }
    tick(desk, &[frame.to_vec()])
}

fn silence(desk: &mut Desk, count: usize) -> BatteryState {
    for _ in 1..count {
        tick(desk, &[]);
    }
    tick(desk, &[])
}

fn of_voltage(voltage_mv: u16) -> PackReport {
    PackReport::of_voltage(0, voltage_mv)
}

/// The texts that were announced since the last call.
fn announced(desk: &mut Desk) -> Vec<String> {
    desk.post_due(desk.now_us);
    texts_of(&desk.sent())
}

#[test]
// Requirement: AP-11
fn report_of_a_companion_computer_is_the_state_of_its_pack() {
    let mut desk = desk();
    let mut report = of_voltage(4000);
    report.voltages_mv[1..3].copy_from_slice(&[3900, 4100]);
    report.current_ca = 250;
    report.consumed_mah = 700;
    report.energy_hj = 360;
    report.remaining_pct = 65;
    report.temperature_cdegc = 2150;
    let state = ticks(&mut desk, 3, &report.frame());
    assert_eq!(state.status, PackStatus::Healthy);
    let readings = state.readings;
    assert_eq!((readings.voltage_v, readings.current_a), (Some(12.0), Some(2.5)));
    assert_eq!(
        (state.consumed_mah(), state.consumed_wh),
        (Some(700.0), Some(10.0))
    );
    assert_eq!(state.readings.remaining_pct.map(f32::round), Some(65.0));
    assert_eq!(state.charge_source, ChargeSource::Reported);
    assert_eq!(state.temperature_c, Some(21.5));
    assert_eq!(state.cells.millivolts(), [4000, 3900, 4100]);
}

/// The latest BATTERY_STATUS of the first pack.
fn status(desk: &mut Desk) -> (u8, u32, i32) {
    desk.post_due(desk.now_us);
    let frames = desk.sent();
    let status = last_of(&frames, 0);
    (
        status.charge_state(),
        status.fault_bitmask(),
        status.time_remaining_s(),
    )
}

#[test]
fn faults_charge_state_and_time_left_of_a_component_are_shown() {
    let mut desk = desk();
    let mut report = of_voltage(12_000);
    report.remaining_pct = 90;
    report.time_remaining_s = 1234;
    report.charge_state = 3;
    report.fault_bitmask = 8 | 16;
    let state = ticks(&mut desk, 40, &report.frame());
    assert_eq!(state.charge_state, ChargeState::Critical);
    assert_eq!(status(&mut desk), (3, 8 | 16, 1234));
    // A condition that it no longer reports is no longer shown.
    report.charge_state = 1;
    report.fault_bitmask = 0;
    report.time_remaining_s = 0;
    ticks(&mut desk, 40, &report.frame());
    let (charge_state, faults, time_remaining_s) = status(&mut desk);
    assert_eq!((charge_state, faults), (OK, 0));
    assert_ne!(time_remaining_s, 1234);
}

#[test]
// Requirement: AP-11
fn a_companion_that_sends_the_second_version_alone_is_a_source() {
    let mut desk = desk();
    let state = ticks(&mut desk, 3, &report_v2(0, [12.0, 2.5, 65.0], 0));
    assert_eq!(state.status, PackStatus::Healthy);
    let readings = state.readings;
    assert_eq!((readings.voltage_v, readings.current_a), (Some(12.0), Some(2.5)));
    assert_eq!(readings.remaining_pct.map(f32::round), Some(65.0));
    assert_eq!(silence(&mut desk, 26).status, PackStatus::Unhealthy);
    // With the first version beside it, that alone counts.
    let v2 = report_v2(0, [11.0, 2.5, 65.0], 0);
    for _ in 0..30 {
        let state = tick(&mut desk, &[of_voltage(12_000).frame(), v2.clone()]);
        assert_eq!(state.readings.voltage_v, Some(12.0));
    }
    assert_eq!(desk.autopilot.battery(Pack::First).status, PackStatus::Healthy);
}

#[test]
// Requirement: V2-2, AP-11
fn a_pack_that_reports_itself_not_ready_refuses_arming_and_one_that_stores_is_flagged() {
    const NOT_READY: u32 = 1;
    const STORING: u32 = 16;
    const IMBALANCE: u32 = 8;
    for (sent, accepted, shown) in [
        (0, true, 0),
        (STORING, true, STORING | NOT_READY),
        (IMBALANCE, true, IMBALANCE),
        (NOT_READY, false, NOT_READY),
    ] {
        let mut desk = desk();
        ticks(&mut desk, 40, &report_v2(0, [12.0, 0.5, 65.0], sent));
        let answers = desk.ask(&command_long_2(REQUEST_MESSAGE, 369.0, 0.0));
        let status = of_message(&answers, BATTERY_STATUS_V2)[0];
        assert_eq!(status.u32(20), shown, "{sent}");
        let result = desk.result_of(&arm());
        assert_eq!(result == ACCEPTED, accepted, "{sent}");
    }
}

#[test]
// Requirement: AP-11, L-10
fn a_state_that_a_companion_reports_while_driving_is_announced_once_with_its_cause() {
    for (state, text) in [
        (5, "Battery 1 reports: failed, over temperature"),
        (6, "Battery 1 reports: unhealthy, over temperature"),
    ] {
        let mut desk = desk();
        ticks(&mut desk, 10, &half_full(12_000));
        assert_eq!(desk.result_of(&arm()), ACCEPTED);
        announced(&mut desk);
        let mut report = of_voltage(12_000);
        report.remaining_pct = 50;
        report.charge_state = state;
        report.fault_bitmask = 16;
        let mut texts = Vec::new();
        for _ in 0..300 {
            tick(&mut desk, &[report.frame()]);
            texts.extend(announced(&mut desk));
        }
        texts.retain(|text| text.contains("reports"));
        assert_eq!(texts, [text]);
        // It says so and drives on, and its HEARTBEAT does not say CRITICAL.
        assert!(desk.autopilot.vehicle().arm_state() == ArmState::Armed);
    }
}

/// A desk that has driven in MANUAL with this action of `BATT_FS_UNH_ACT`, and its texts, after `count` ticks of a report with this
/// charge state.
fn after_reports_while_driving(action: f32, charge_state: u8, count: usize) -> (Desk, Vec<String>) {
    let mut desk = desk();
    desk.set(BatteryParameter::FsUnhAct.of(Pack::First), action);
    desk.set(BatteryParameter::LowVolt.of(Pack::First), 10.5);
    ticks(&mut desk, 10, &half_full(12_000));
    assert_eq!(desk.result_of(&arm()), ACCEPTED);
    desk.ask(&manual_mode());
    announced(&mut desk);
    let mut texts = Vec::new();
    for _ in 0..count {
        tick(&mut desk, &[reporting(12_000, charge_state)]);
        texts.extend(announced(&mut desk));
    }
    (desk, texts)
}

/// Half full, with a charge state of its own.
fn reporting(voltage_mv: u16, charge_state: u8) -> Vec<u8> {
    let mut report = of_voltage(voltage_mv);
    report.remaining_pct = 50;
    report.charge_state = charge_state;
    report.frame()
}

#[test]
// Requirement: AP-11
fn a_pack_that_reports_for_five_seconds_that_it_is_failed_or_unhealthy_acts() {
    const HOLD: f32 = 2.0;
    for (state, name) in [(5, "failed"), (6, "unhealthy")] {
        let (desk, _) = after_reports_while_driving(HOLD, state, 50);
        assert_eq!(desk.autopilot.vehicle().status().mode, Mode::Manual, "{state}");
        let (mut desk, texts) = after_reports_while_driving(HOLD, state, 52);
        assert_eq!(desk.autopilot.vehicle().status().mode, Mode::Hold, "{state}");
        assert_eq!(texts, [format!("Battery 1 reports: {name}")]);
        let unhealthy = *desk.autopilot.battery(Pack::First);
        assert_eq!(unhealthy.failsafe, FailsafeLevel::Unhealthy);
        assert_eq!(unhealthy.charge_state as u8, state);
        // Once: the driver may go on. A threshold acts as before.
        desk.ask(&manual_mode());
        ticks(&mut desk, 300, &reporting(12_000, state));
        assert_eq!(desk.autopilot.vehicle().status().mode, Mode::Manual, "{state}");
        desk.set(BatteryParameter::FsLowAct.of(Pack::First), HOLD);
        let low = ticks(&mut desk, 110, &reporting(10_000, state));
        assert_eq!(low.failsafe, FailsafeLevel::Low);
        assert_eq!(desk.autopilot.vehicle().status().mode, Mode::Hold, "{state}");
    }
}

#[test]
fn a_pack_that_reports_once_a_second_that_it_is_failed_acts_as_soon() {
    let mut desk = desk();
    desk.set(BatteryParameter::FsUnhAct.of(Pack::First), 2.0);
    ticks(&mut desk, 10, &half_full(12_000));
    assert_eq!(desk.result_of(&arm()), ACCEPTED);
    desk.ask(&manual_mode());
    for second in 0..8 {
        tick(&mut desk, &[reporting(12_000, 5)]);
        silence(&mut desk, 9);
        let mode = desk.autopilot.vehicle().status().mode;
        let expected = if second < 5 { Mode::Manual } else { Mode::Hold };
        assert_eq!(mode, expected, "{second}");
    }
}

#[test]
fn a_pack_that_reports_itself_unhealthy_only_warns_by_default() {
    let (desk, texts) = after_reports_while_driving(0.0, 6, 300);
    assert_eq!(desk.autopilot.vehicle().status().mode, Mode::Manual);
    assert_eq!(texts, ["Battery 1 reports: unhealthy"]);
    assert_eq!(
        desk.autopilot.vehicle().status().alert,
        Alert::None,
        "its HEARTBEAT"
    );
}

#[test]
fn a_level_by_a_report_ends_disarmed_after_five_seconds_of_better_ones() {
    let (mut desk, _) = after_reports_while_driving(2.0, 5, 60);
    desk.ask(&disarm());
    assert_eq!(
        ticks(&mut desk, 100, &reporting(12_000, 5)).failsafe,
        FailsafeLevel::Unhealthy
    );
    assert_eq!(
        ticks(&mut desk, 45, &half_full(12_000)).failsafe,
        FailsafeLevel::Unhealthy
    );
    assert_eq!(
        ticks(&mut desk, 10, &half_full(12_000)).failsafe,
        FailsafeLevel::None
    );
    assert_eq!(desk.result_of(&arm()), ACCEPTED);
}

#[test]
fn the_weakest_cell_of_a_pack_reaches_its_threshold() {
    const WEAKEST_CELL: f32 = 2.0;
    for (source, level) in [(0.0, FailsafeLevel::None), (WEAKEST_CELL, FailsafeLevel::Low)] {
        let mut desk = desk();
        for (parameter, value) in [
            (BatteryParameter::FsVoltsrc, source),
            (BatteryParameter::LowVolt, 11.1),
            (BatteryParameter::LowTimer, 3.0),
        ] {
            desk.set(parameter.of(Pack::First), value);
        }
        let mut report = of_voltage(3900);
        report.remaining_pct = 50;
        report.voltages_mv[1..3].copy_from_slice(&[3900, 3900]);
        ticks(&mut desk, 10, &report.frame());
        assert_eq!(desk.result_of(&arm()), ACCEPTED);
        report.voltages_mv[1] = 3650;
        let state = ticks(&mut desk, 32, &report.frame());
        assert_eq!(state.failsafe, level, "{source}");
        desk.ask(&disarm());
        // Above its threshold as a whole, and refused by its cell.
        let result = if level == FailsafeLevel::None {
            ACCEPTED
        } else {
            FAILED
        };
        assert_eq!(desk.result_of(&arm()), result, "{source}");
    }
}

#[test]
fn a_pack_below_its_critical_voltage_is_forgotten_after_ten_minutes_until_a_charger_comes() {
    let shown = |desk: &Desk| {
        desk.autopilot
            .vehicle()
            .indication(Instant::from_micros(desk.now_us))
            .colour
    };
    let seconds = |desk: &mut Desk, count: usize, frame: &[u8]| {
        for _ in 0..count {
            tick(desk, &[frame.to_vec()]);
            silence(desk, 9);
        }
    };
    for (voltage_mv, is_forgotten) in [(9_800, true), (10_000, false)] {
        let mut desk = desk();
        desk.set(BatteryParameter::CrtVolt.of(Pack::First), 9.9);
        seconds(&mut desk, 590, &half_full(voltage_mv));
        assert_ne!(shown(&desk), Colour::Off);
        // Off the moment of a flash.
        seconds(&mut desk, 20, &half_full(voltage_mv));
        silence(&mut desk, 3);
        assert_eq!(shown(&desk) == Colour::Off, is_forgotten, "{voltage_mv} mV");
        let mut charging = of_voltage(voltage_mv);
        (charging.remaining_pct, charging.current_ca) = (50, -200);
        seconds(&mut desk, 5, &charging.frame());
        silence(&mut desk, 3);
        assert_ne!(shown(&desk), Colour::Off);
    }
}

#[test]
fn one_report_a_second_is_enough() {
    let mut desk = desk();
    let mut report = of_voltage(12_000);
    report.current_ca = 360;
    for second in 0..60 {
        let mut state = tick(&mut desk, &[report.frame()]);
        for _ in 0..9 {
            state = tick(&mut desk, &[]);
            assert_eq!(state.status, PackStatus::Healthy);
        }
        assert!((state.consumed_mah().unwrap() - second as f32).abs() < 0.01);
    }
    let texts = announced(&mut desk);
    assert!(
        !texts
            .iter()
            .any(|text| text.contains("unhealthy") || text.contains("not measured")),
        "{texts:?}"
    );
}

/// Half full, by its own percentage.
fn half_full(voltage_mv: u16) -> Vec<u8> {
    let mut report = of_voltage(voltage_mv);
    report.remaining_pct = 50;
    report.frame()
}

/// A desk whose pack was lost for 8 s while armed, with this action of `BATT_FS_UNH_ACT`; disarmed then.
fn after_silence_while_armed(action: f32) -> Desk {
    let mut desk = desk();
    desk.set(BatteryParameter::FsUnhAct.of(Pack::First), action);
    ticks(&mut desk, 10, &half_full(12_000));
    assert_eq!(desk.result_of(&arm()), ACCEPTED);
    assert_eq!(silence(&mut desk, 80).failsafe, FailsafeLevel::Unhealthy);
    desk.ask(&disarm());
    announced(&mut desk);
    desk
}

#[test]
fn pack_that_was_lost_while_armed_can_be_armed_with_after_five_seconds_of_good_readings() {
    let mut desk = after_silence_while_armed(0.0);
    ticks(&mut desk, 45, &half_full(12_000));
    assert_eq!(desk.result_of(&arm()), FAILED);
    ticks(&mut desk, 10, &half_full(12_000));
    assert_eq!(desk.result_of(&arm()), ACCEPTED);
    // The next loss counts again, and as long as the rover is armed.
    assert_eq!(silence(&mut desk, 51).failsafe, FailsafeLevel::Unhealthy);
    let state = ticks(&mut desk, 600, &half_full(12_000));
    assert_eq!(state.failsafe, FailsafeLevel::Unhealthy);
}

#[test]
fn termination_by_a_lost_pack_outlasts_good_readings_until_a_battery_reset() {
    let mut desk = after_silence_while_armed(5.0);
    let state = ticks(&mut desk, 600, &half_full(12_000));
    assert_eq!(state.failsafe, FailsafeLevel::Unhealthy);
    // Nor does another action that is set now end it.
    desk.set(BatteryParameter::FsUnhAct.of(Pack::First), 0.0);
    ticks(&mut desk, 100, &half_full(12_000));
    assert_eq!(desk.result_of(&arm_by_force()), FAILED);
    // The charge can't be set, so the command fails; the level ends.
    assert_eq!(desk.result_of(&command_long_2(BATTERY_RESET, 1.0, 100.0)), FAILED);
    let state = ticks(&mut desk, 2, &half_full(12_000));
    assert_eq!(
        (state.failsafe, state.readings.remaining_pct),
        (FailsafeLevel::None, Some(50.0))
    );
    assert_eq!(desk.result_of(&arm()), ACCEPTED);
}

#[test]
fn other_senders_and_other_packs_have_no_effect() {
    let mut desk = desk();
    let before = ticks(&mut desk, 5, &of_voltage(12_000).frame());
    let strange = of_voltage(6000);
    // Another vehicle's companion and autopilot, our own frames, a ground station.
    for sender in [[2, 191], [2, 1], [0, 191], [1, 1], [255, 190]] {
        let events = desk.receive_in_chunks(&strange.frame_from(sender), 64);
        assert_eq!(events, [Event::Ignored], "{sender:?}");
    }
    // A pack that is not monitored, and ones that can't exist.
    for instance in [1, 9, 255] {
        let events = desk.receive_in_chunks(&PackReport::of_voltage(instance, 6000).frame(), 64);
        assert_eq!(events, [Event::Ignored], "{instance}");
    }
    assert_eq!(tick(&mut desk, &[]), before);
    // They don't keep it alive, either.
    assert_eq!(
        ticks(&mut desk, 30, &strange.frame_from([2, 191])).status,
        PackStatus::Unhealthy
    );
}

#[test]
fn pack_of_another_kind_is_not_fed() {
    let mut desk = Desk::with_packs(&[BatteryState::default()]);
    let events = desk.receive_in_chunks(&of_voltage(6000).frame(), 64);
    assert_eq!(events, [Event::Ignored]);
    // The kind takes effect at the next start.
    desk.set(BatteryParameter::Monitor.of(Pack::First), EXTERNAL);
    tick(&mut desk, &[of_voltage(6000).frame()]);
    assert_eq!(*desk.autopilot.battery(Pack::First), BatteryState::default());
}

#[test]
// Requirement: L-9
fn one_component_may_measure_several_packs_and_another_one_those_that_it_has_left() {
    let monitors = ["BATT_MONITOR", "BATT3_MONITOR"].map(|name| (name, EXTERNAL));
    let mut desk = Desk::starting(start_with(&monitors));
    let third = PackReport::of_voltage(2, 7400);
    tick(&mut desk, &[of_voltage(12_000).frame()]);
    assert_eq!(desk.autopilot.battery(Pack::Third).status, PackStatus::Unknown);
    tick(&mut desk, &[of_voltage(12_000).frame(), third.frame()]);
    assert_eq!(desk.autopilot.battery(Pack::Third).readings.voltage_v, Some(7.4));
    let state = tick(&mut desk, &[of_voltage(6000).frame_from(OTHER_COMPANION)]);
    assert_eq!(state.readings.voltage_v, Some(12.0));
    silence(&mut desk, 25);
    let state = tick(
        &mut desk,
        &[of_voltage(11_000).frame(), third.frame_from(OTHER_COMPANION)],
    );
    assert_eq!(state.readings.voltage_v, Some(11.0));
    assert_eq!(desk.autopilot.battery(Pack::Third).status, PackStatus::Healthy);
}

#[test]
// Requirement: L-9
fn flood_counts_as_one_reading_a_tick() {
    let mut desk = desk();
    let mut report = of_voltage(12_000);
    report.current_ca = 3600;
    for _ in 0..11 {
        tick(&mut desk, &vec![report.frame(); 500]);
    }
    let state = *desk.autopilot.battery(Pack::First);
    assert_eq!(state.status, PackStatus::Healthy);
    assert!((state.readings.voltage_v.unwrap() - 12.0).abs() < 1e-3);
    assert!(
        (state.consumed_mah().unwrap() - 10.0).abs() < 0.01,
        "a second of 36 A"
    );
    assert_eq!(desk.autopilot.samples(), 11);
}

#[test]
fn report_that_waited_on_its_way_is_as_old_as_it_may_be() {
    let mut desk = desk();
    ticks(&mut desk, 30, &of_voltage(12_000).frame());
    desk.waited_us = 2_000_000;
    let state = ticks(&mut desk, TIMEOUT_TICKS + 5, &of_voltage(6000).frame());
    assert_eq!(
        (state.status, state.readings.voltage_v),
        (PackStatus::Unhealthy, Some(12.0))
    );
    desk.waited_us = 1_000_000;
    let state = ticks(&mut desk, 5, &of_voltage(11_000).frame());
    assert_eq!(
        (state.status, state.readings.voltage_v),
        (PackStatus::Healthy, Some(11.0))
    );
}

#[test]
fn a_reset_sets_the_charge_where_only_a_count_is_reported() {
    let mut desk = desk();
    let mut report = of_voltage(12_000);
    report.consumed_mah = 700;
    report.remaining_pct = 65;
    ticks(&mut desk, 2, &report.frame());
    report.remaining_pct = -1;
    let counted = report.frame();
    ticks(&mut desk, 2, &counted);
    assert_eq!(
        desk.result_of(&command_long_2(BATTERY_RESET, 1.0, 100.0)),
        ACCEPTED
    );
    let state = ticks(&mut desk, 2, &counted);
    assert_eq!(
        (state.readings.remaining_pct.map(f32::round), state.consumed_mah()),
        (Some(100.0), Some(0.0)),
        "what was counted before the reset is not drawn from it"
    );
}

#[test]
// Requirement: AP-11
fn health_and_mode_of_a_pack_are_those_that_its_own_component_reports() {
    let mut desk = desk();
    let mut report = of_voltage(12_000);
    let details = |state: &BatteryState| (state.details.cycle_count, state.details.state_of_health_pct);
    // Before the component measures the pack, and of others.
    tick(&mut desk, &[health_report(COMPANION, 0, 12, 90)]);
    assert_eq!(details(&ticks(&mut desk, 3, &report.frame())), (None, None));
    for frame in [
        health_report(OTHER_COMPANION, 0, 13, 80),
        health_report([2, 191], 0, 14, 70),
        health_report(COMPANION, 1, 15, 60),
        health_report(COMPANION, 9, 16, 50),
    ] {
        let state = tick(&mut desk, &[frame, report.frame()]);
        assert_eq!(details(&state), (None, None));
    }
    let state = tick(&mut desk, &[health_report(COMPANION, 0, 123, 91), report.frame()]);
    assert_eq!(details(&state), (Some(123), Some(91)));
    let state = tick(
        &mut desk,
        &[health_report(COMPANION, 0, 0xffff, 255), report.frame()],
    );
    assert_eq!(details(&state), (None, None), "not known any more");
    assert_eq!(state.readings.reported.modes, Modes::empty());
    for (mode, modes) in [(1, Modes::STORING), (2, Modes::empty())] {
        report.mode = mode;
        assert_eq!(
            ticks(&mut desk, 3, &report.frame()).readings.reported.modes,
            modes
        );
    }
}

#[test]
fn another_component_that_takes_over_has_not_reported_a_health_yet() {
    let mut desk = desk();
    let report = of_voltage(12_000);
    ticks(&mut desk, 3, &report.frame());
    let state = tick(&mut desk, &[health_report(COMPANION, 0, 123, 91), report.frame()]);
    assert_eq!(state.details.state_of_health_pct, Some(91));
    silence(&mut desk, TIMEOUT_TICKS);
    let state = ticks(&mut desk, 3, &report.frame_from(OTHER_COMPANION));
    assert_eq!(state.status, PackStatus::Healthy);
    assert_eq!(state.details.state_of_health_pct, None);
}

#[test]
fn what_another_component_has_counted_was_not_drawn_from_the_pack() {
    let mut desk = desk();
    let mut report = of_voltage(12_000);
    report.consumed_mah = 500;
    ticks(&mut desk, 20, &report.frame());
    silence(&mut desk, TIMEOUT_TICKS);
    announced(&mut desk);
    report.consumed_mah = 1_900;
    let state = ticks(&mut desk, 3, &report.frame_from(OTHER_COMPANION));
    assert_eq!(state.consumed_mah(), Some(500.0));
    let by_other = "Battery 1 measured by component 192".to_owned();
    assert!(announced(&mut desk).contains(&by_other));
    report.consumed_mah = 1_902;
    let state = ticks(&mut desk, 3, &report.frame_from(OTHER_COMPANION));
    assert_eq!(state.consumed_mah(), Some(502.0));
}

#[test]
// Requirement: S-8
fn a_companion_that_loses_its_current_is_announced_and_keeps_its_pack() {
    let mut desk = desk();
    let mut report = of_voltage(12_000);
    report.current_ca = 300;
    ticks(&mut desk, 50, &report.frame());
    announced(&mut desk);
    report.current_ca = -1;
    ticks(&mut desk, 120, &report.frame());
    assert_eq!(announced(&mut desk), [""; 0], "it may come back");
    let state = ticks(&mut desk, 10, &report.frame());
    let lost = "Battery 1 current lost: charge by voltage alone".to_owned();
    assert_eq!(announced(&mut desk), [lost]);
    assert_eq!(state.status, PackStatus::Healthy, "no threshold needs it");
    assert!(state.readings.remaining_pct.is_some() && state.consumed.is_none());
}

/// A desk with a key, at a radio.
fn protected() -> Desk {
    let mut desk = desk();
    desk.connect(LinkKind::Direct);
    desk.receive_in_chunks(&setup_signing([OWNER; 32], NEW_YEAR), 64);
    desk.connect(LinkKind::Radio);
    desk
}

fn is_refused_report(desk: &mut Desk, frame: &[u8]) -> bool {
    match desk.receive_in_chunks(frame, 64)[..] {
        [Event::Unauthorized { .. } | Event::Ignored] => true,
        [Event::Measured { .. }] => false,
        ref other => panic!("{other:?}"),
    }
}

#[test]
fn with_a_key_only_signed_reports_count_and_each_once() {
    let mut desk = protected();
    let report = of_voltage(12_000).frame();
    assert!(is_refused_report(&mut desk, &report));
    assert!(is_refused_report(&mut desk, &health_report(COMPANION, 0, 1, 99)));
    assert!(is_refused_report(&mut desk, &Signer::new(STRANGER).sign(&report)));
    let mut owner = Signer::new(OWNER);
    let signed = owner.sign(&report);
    assert!(!is_refused_report(&mut desk, &signed));
    assert_eq!(tick(&mut desk, &[]).readings.voltage_v, Some(12.0));
    // A recording keeps no pack alive.
    assert!(is_refused_report(&mut desk, &signed));
    assert_eq!(ticks(&mut desk, 30, &signed).status, PackStatus::Unhealthy);
    assert!(!is_refused_report(&mut desk, &owner.sign(&report)));
    for (allowed, is_refused) in [(1.0, true), (2.0, false)] {
        desk.set(VehicleParameter::SignUartAllow, allowed);
        assert_eq!(is_refused_report(&mut desk, &report), is_refused, "{allowed}");
    }
}

#[test]
fn unsigned_batteries_of_others_are_no_intruders() {
    let mut desk = protected();
    for frame in [
        of_voltage(12_000).frame_from([2, 191]),
        // Of a pack that is measured here, not by the companion.
        PackReport::of_voltage(1, 12_000).frame(),
    ] {
        assert_eq!(desk.receive_in_chunks(&frame, 64), [Event::Ignored]);
    }
}

/// A frame that can come: a payload of any length, of a sender that may be the companion.
fn any_frame() -> impl Strategy<Value = Vec<u8>> {
    let sender = prop_oneof![
        4 => Just(COMPANION),
        1 => Just(OTHER_COMPANION),
        1 => any::<[u8; 2]>(),
    ];
    let report = (
        any::<[u16; 10]>(),
        any::<[i32; 2]>(),
        any::<[i16; 2]>(),
        any::<i8>(),
        0..10u8,
        any::<(i32, u8, u8, u32, bool)>(),
    );
    let lowest_mv = prop_oneof![Just(0u16), Just(3000), Just(u16::MAX)];
    (sender, report, lowest_mv).prop_map(
        |(sender, (voltages, amounts, small, remaining_pct, instance, condition), lowest_mv)| {
            let (time_remaining_s, charge_state, mode, fault_bitmask, is_health) = condition;
            if is_health {
                return health_report(sender, instance, voltages[0], mode);
            }
            let report = PackReport {
                instance,
                voltages_mv: voltages.map(|mv| mv.max(lowest_mv)),
                current_ca: small[0],
                consumed_mah: amounts[0],
                energy_hj: amounts[1],
                remaining_pct,
                temperature_cdegc: small[1],
                time_remaining_s,
                charge_state,
                mode,
                fault_bitmask,
            };
            report.frame_from(sender)
        },
    )
}

proptest! {
    /// Whatever is received, states stay in range, and honest reports bring the pack back.
    #[test]
    fn any_reports_leave_finite_states_and_no_harm(
        steps in prop::collection::vec(prop::collection::vec(any_frame(), 0..4), 1..40)
    ) {
        let mut desk = desk();
        for frames in steps {
            let state = tick(&mut desk, &frames);
            let values = [state.readings.voltage_v, state.readings.current_a, state.temperature_c, state.consumed_mah(), state.consumed_wh];
            prop_assert!(values.into_iter().flatten().all(f32::is_finite), "{state:?}");
            prop_assert!(state.readings.remaining_pct.is_none_or(|pct| (0.0..=100.0).contains(&pct)), "{state:?}");
        }
        silence(&mut desk, TIMEOUT_TICKS);
        let state = ticks(&mut desk, 2, &of_voltage(12_000).frame());
        prop_assert_eq!((state.status, state.readings.voltage_v), (PackStatus::Healthy, Some(12.0)));
    }
}
