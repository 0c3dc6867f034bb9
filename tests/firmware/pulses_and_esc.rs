//! What comes in as pulses on GP17, and as a motor controller's telemetry on GP5.

use emulator::{LogLevel, PinWire, UartPins};
use support::charge_states::UNHEALTHY;
use support::commands::REQUEST_MESSAGE;
use support::frames::{BatteryStatus, FUEL_STATUS, last_of, of_message, texts_of};
use support::monitor_types::{ESC, FUEL_FLOW};
use support::requests::command_long_2;
use workbench::bench::{Bench, MILLISECOND, SECOND};

const FUEL_LEVEL_PWM: f32 = 12.0;

const SECOND_PACK: f32 = 1.0;

const PULSES: usize = 17;
const ESC_BAUD: u32 = 115_200;

fn status<R>(bench: &mut Bench, look: impl FnOnce(BatteryStatus<'_>) -> R) -> R {
    bench.run_for(SECOND);
    let frames = bench.frames();
    look(last_of(&frames, 1))
}

fn with_tank(kind: f32, parameters: &[(&str, f32)]) -> Bench {
    let tank = [
        ("BATT2_MONITOR", kind),
        ("BATT2_CURR_PIN", 17.0),
        ("BATT2_CAPACITY", 2000.0),
        ("SR0_EXTRA1", 10.0),
    ];
    let mut bench = Bench::configured(2482, &[&tank[..], parameters].concat());
    bench.drive_pin(PULSES, PinWire::Low);
    bench
}

#[test]
// Requirement: AP-10
fn pulses_of_a_flow_sensor_are_counted_to_the_last() {
    let mut bench = with_tank(FUEL_FLOW, &[("BATT2_AMP_PERVLT", 0.5)]);
    let from_us = bench.time_us() + 100 * MILLISECOND;
    // 50 pulses of 0.5 ml a second for 20 s.
    bench.pulses(PULSES, from_us, 5 * MILLISECOND, 20 * MILLISECOND, 1000);
    bench.run_for(10 * SECOND);
    status(&mut bench, |status| {
        // 25 ml a second are 90 l an hour.
        assert!(
            status.current_ca().abs_diff(9000) <= 100,
            "{} cA",
            status.current_ca()
        );
        assert_eq!(status.voltage_mv(0), u16::MAX, "a tank has none");
    });
    // Ten seconds after the last pulse nothing flows.
    bench.run_for(22 * SECOND);
    status(&mut bench, |status| {
        assert_eq!(status.current_ca(), 0);
        // The first pulse starts the count.
        assert!(
            (499..=500).contains(&status.consumed_mah()),
            "{} ml",
            status.consumed_mah()
        );
        assert_eq!(status.remaining_pct(), 75);
        assert_eq!(status.energy_hj(), -1);
    });
    let request = command_long_2(REQUEST_MESSAGE, FUEL_STATUS as f32, SECOND_PACK);
    let answers = bench.ask(&request);
    let fuel = of_message(&answers, FUEL_STATUS)[0];
    assert_eq!(fuel.f32(0), 2000.0);
    assert!((fuel.f32(4) - 500.0).abs() <= 1.0);
    assert!(fuel.f32(8).is_nan(), "what remains is not measured");
}

#[test]
fn fast_pulses_are_not_lost() {
    let mut bench = with_tank(FUEL_FLOW, &[("BATT2_AMP_PERVLT", 0.1)]);
    let from_us = bench.time_us() + 100 * MILLISECOND;
    // 1 kHz, with a parameter list and nine other things to do meanwhile.
    bench.pulses(PULSES, from_us, 300, MILLISECOND, 5000);
    bench.run_for(7 * SECOND);
    status(&mut bench, |status| {
        assert!(
            status.consumed_mah().abs_diff(500) <= 1,
            "{} ml",
            status.consumed_mah()
        );
    });
}

#[test]
// Requirement: AP-10
fn the_pulse_width_gives_the_level_and_a_timeout_is_announced() {
    let mut bench = with_tank(FUEL_LEVEL_PWM, &[]);
    for (width_us, pct) in [(1900, 100), (1500, 50), (1100, 0)] {
        let from_us = bench.time_us() + MILLISECOND;
        bench.pulses(PULSES, from_us, width_us, 20 * MILLISECOND, 100);
        bench.run_for(SECOND);
        let frames = bench.frames();
        assert_eq!(last_of(&frames, 1).remaining_pct(), pct, "{width_us} us");
        bench.run_for(SECOND);
    }
    bench.run_for(2 * SECOND);
    status(&mut bench, |status| assert_eq!(status.charge_state(), UNHEALTHY));
    assert!(!bench.logged(LogLevel::Warn, "battery 2: unhealthy").is_empty());
    // A width that no level has is not a level either.
    let from_us = bench.time_us() + MILLISECOND;
    bench.pulses(PULSES, from_us, 2500, 20 * MILLISECOND, 50);
    status(&mut bench, |status| assert_eq!(status.charge_state(), UNHEALTHY));
}

fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc: u8, _| {
            crc << 1 ^ if crc & 0x80 != 0 { 7 } else { 0 }
        })
    })
}

/// Temperature, voltage, current, consumption and speed, as KISS controllers send them.
pub fn telemetry(celsius: u8, centivolts: u16, centiamperes: u16, mah: u16) -> Vec<u8> {
    let mut frame = vec![celsius];
    for word in [centivolts, centiamperes, mah, 100] {
        frame.extend(word.to_be_bytes());
    }
    frame.push(crc8(&frame));
    frame
}

fn with_esc() -> Bench {
    let mut bench = Bench::running(2482);
    bench.wire_uart(1, UartPins { tx: 4, rx: 5 });
    bench.set("BATT2_MONITOR", ESC);
    bench.set("SR0_EXTRA1", 10.0);
    bench.reboot();
    bench
}

fn send(bench: &mut Bench, bytes: &[u8]) {
    let at_us = bench.time_us();
    bench.uart_send_at_baud(1, at_us, bytes, ESC_BAUD);
}

#[test]
fn the_frame_of_the_facts_is_the_one_the_tests_make() {
    let frame = [0x19, 0x06, 0x90, 0x04, 0xd2, 0x01, 0x2c, 0x00, 0x64, 0x97];
    assert_eq!(telemetry(25, 1680, 1234, 300), frame);
}

#[test]
// Requirement: AP-10
fn an_esc_reports_voltage_current_temperature_and_charge() {
    let mut bench = with_esc();
    for tick in 0..50u16 {
        send(&mut bench, &telemetry(40, 1680, 1234, 300 + tick));
        bench.run_for(50 * MILLISECOND);
    }
    let frames = bench.frames();
    let status = last_of(&frames, 1);
    assert_eq!((status.voltage_mv(0), status.current_ca()), (16_800, 1234));
    assert_eq!(status.temperature_cdegc(), 4000);
    assert!(
        (45..=49).contains(&status.consumed_mah()),
        "{} mAh since the start",
        status.consumed_mah()
    );
}

#[test]
fn noise_between_the_frames_of_a_controller_costs_none_of_the_later_ones() {
    let mut bench = with_esc();
    let unhealthy = |bench: &Bench| bench.logged(LogLevel::Warn, "battery 2: unhealthy").len();
    let before = unhealthy(&bench);
    for tick in 0..40u8 {
        send(&mut bench, &[tick, 0xff, 0x19]);
        bench.run_for(5 * MILLISECOND);
        send(&mut bench, &telemetry(30, 1200, 500, 0));
        bench.run_for(45 * MILLISECOND);
    }
    let frames = bench.frames();
    assert_eq!(last_of(&frames, 1).voltage_mv(0), 12_000);
    assert_eq!(unhealthy(&bench), before);
}

#[test]
fn an_esc_timeout_is_announced_and_the_pack_recovers() {
    let mut bench = with_esc();
    for _ in 0..20 {
        send(&mut bench, &telemetry(30, 1200, 500, 0));
        bench.run_for(50 * MILLISECOND);
    }
    bench.run_for(3 * SECOND);
    let frames = bench.frames();
    assert_eq!(last_of(&frames, 1).charge_state(), UNHEALTHY);
    assert!(!bench.logged(LogLevel::Warn, "battery 2: unhealthy").is_empty());
    for _ in 0..160 {
        send(&mut bench, &telemetry(30, 1100, 500, 0));
        bench.run_for(50 * MILLISECOND);
    }
    assert!(texts_of(&bench.frames()).contains(&"Battery 2 healthy again".into()));
    let frames = bench.frames();
    assert_eq!(last_of(&frames, 1).voltage_mv(0), 11_000);
}
