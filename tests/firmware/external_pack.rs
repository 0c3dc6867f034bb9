//! A pack that a companion computer on the telemetry port measures.

use emulator::LogLevel;
use support::charge_states::UNHEALTHY;
use support::frames::{BATTERY_STATUS, BatteryStatus, last_of, of_message, texts_of};
use support::pack_report::{EXTERNAL, OTHER_COMPANION, PackReport};
use support::requests::arm;
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND};

/// LOW and UNHEALTHY of MAV_BATTERY_CHARGE_STATE.
const LOW: u8 = 2;

const TICK: u64 = 100 * MILLISECOND;

const LINE_BYTES_PER_SECOND: usize = 11_520;

fn with_external_pack() -> Bench {
    let parameters = [
        ("BATT2_MONITOR", EXTERNAL),
        ("BATT2_CELLS", 3.0),
        ("BATT2_LOW_VOLT", 10.5),
        ("BATT2_LOW_TIMER", 1.0),
        ("SR0_EXTRA1", 10.0),
    ];
    Bench::configured(DIVIDER_CODE, &parameters)
}

/// Of the second pack.
fn report(voltage_mv: u16) -> PackReport {
    let mut report = PackReport::of_voltage(1, voltage_mv);
    report.current_ca = 250;
    report.consumed_mah = 700;
    report.remaining_pct = 65;
    report
}

fn send(bench: &mut Bench, frame: &[u8]) {
    let at_us = bench.time_us();
    bench.uart_send(0, at_us, frame);
    bench.run_for(TICK);
}

fn send_for(bench: &mut Bench, ticks: usize, report: &PackReport) {
    for _ in 0..ticks {
        send(bench, &report.frame());
    }
}

fn second_pack<R>(bench: &mut Bench, look: impl FnOnce(BatteryStatus<'_>) -> R) -> R {
    let frames = bench.frames();
    look(last_of(&frames, 1))
}

#[test]
fn reports_of_a_companion_computer_are_a_pack_with_failsafe_loss_and_return() {
    let mut bench = with_external_pack();
    send_for(&mut bench, 5, &report(12_000));
    second_pack(&mut bench, |status| {
        assert_eq!((status.voltage_mv(0), status.current_ca()), (12_000, 250));
        assert_eq!((status.consumed_mah(), status.remaining_pct()), (700, 65));
    });
    let warnings = bench.logged(LogLevel::Warn, "");
    assert!(warnings.is_empty(), "{warnings:?}");

    bench.ask(&arm());
    send_for(&mut bench, 14, &report(10_400));
    second_pack(&mut bench, |status| assert_eq!(status.charge_state(), LOW));
    let texts = texts_of(&bench.frames());
    assert!(
        texts.contains(&"Battery 2 is low 10.40V used 700 mAh".into()),
        "{texts:?}"
    );

    bench.run_for(3 * SECOND);
    second_pack(&mut bench, |status| assert_eq!(status.charge_state(), UNHEALTHY));
    let texts = texts_of(&bench.frames());
    assert!(
        texts.contains(&"Battery 2 unhealthy: no reading in time".into()),
        "{texts:?}"
    );

    send_for(&mut bench, 55, &report(11_500));
    second_pack(&mut bench, |status| assert_eq!(status.voltage_mv(0), 11_500));
    let texts = texts_of(&bench.frames());
    assert!(texts.contains(&"Battery 2 healthy again".into()), "{texts:?}");
}

#[test]
fn flood_of_reports_leaves_the_other_pack_its_samples() {
    let mut bench = with_external_pack();
    send_for(&mut bench, 2, &report(12_000));
    let from_us = bench.time_us();
    let frame = [report(12_000).frame(), report(6000).frame_from(OTHER_COMPANION)].concat();
    let flood = frame.repeat(2 * LINE_BYTES_PER_SECOND / frame.len());
    bench.uart_send(0, from_us, &flood);
    bench.run_for(2 * SECOND);
    let frames = bench.frames_since(from_us);
    let statuses = of_message(&frames, BATTERY_STATUS);
    for (instance, expected_mv) in [(0, 7900), (1, 12_000)] {
        let of_pack: Vec<_> = statuses
            .iter()
            .map(|frame| BatteryStatus(frame))
            .filter(|status| status.instance() == instance)
            .collect();
        assert!(
            (19..=21).contains(&of_pack.len()),
            "{} of {instance}",
            of_pack.len()
        );
        let is_right = |status: &BatteryStatus<'_>| status.voltage_mv(0).abs_diff(expected_mv) < 50;
        assert!(of_pack.iter().all(is_right), "{instance}");
    }
    assert!(bench.resets().len() == 1, "none but the one for the parameters");
    send_for(&mut bench, 10, &report(11_000));
    second_pack(&mut bench, |status| assert_eq!(status.voltage_mv(0), 11_000));
}
