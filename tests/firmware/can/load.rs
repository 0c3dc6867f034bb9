//! A bus without a pause: at the start of the board, and while it writes to flash.

use super::{DRONECAN, with_battery_at, with_can_at};
use emulator::{FlashOperationKind, LogLevel};
use support::frames::{statuses_of, texts_of};
use support::requests::param_set;
use workbench::bench::{Bench, MILLISECOND, SECOND, TestedVehicle, count_of};
use workbench::can::transfers::{A, A_CELLS, A_LATER, ESC_0, STATUS_A};
use workbench::can::{Peer, Transfer};

/// Of a frame of eight bytes, with its stuff bits.
const FRAME_BITS: u64 = 130;

/// Lets the board run while a peer sends these transfers without a pause.
fn run_on_full_bus(bench: &mut Bench, peer: &mut Peer, duration_us: u64, transfers: &[Transfer]) {
    const STEP_US: u64 = 5 * MILLISECOND;
    const ALWAYS_WAITING: usize = 100;
    let end_us = bench.time_us() + duration_us;
    while bench.time_us() < end_us {
        let now_us = bench.time_us();
        while peer.station.borrow().waiting() < ALWAYS_WAITING {
            transfers.iter().for_each(|transfer| peer.send(now_us, *transfer));
        }
        bench.run_until_time(end_us.min(now_us + STEP_US));
    }
}

#[test]
// Requirement
fn on_a_full_bus_the_start_loses_no_frame_and_reports_no_bus_off() {
    for bits_per_second in [125_000, 1_000_000] {
        let (mut bench, rig) = with_battery_at(bits_per_second);
        let mut battery = rig.peer();
        // It acknowledges while the controller is reset.
        let _other = rig.peer();
        let frames = 3 * bits_per_second / FRAME_BITS;
        let now_us = bench.time_us();
        for _ in 0..frames / A.0.len() as u64 {
            battery.send(now_us, A);
        }
        bench.forget_sent();
        bench.reboot();
        bench.run_for(SECOND);
        assert!(battery.station.borrow().waiting() > 0, "the bus was never idle");
        let mut texts = texts_of(&bench.frames());
        texts.retain(|text| text.starts_with("CAN "));
        assert_eq!(texts, [""; 0], "{bits_per_second} bit/s");
    }
}

/// Frames that were lost for each page that was written.
fn lost_a_page(bits_per_second: u64) -> f64 {
    const WRITES: u16 = 50;
    let (mut bench, rig) = with_can_at(bits_per_second, &[("BATT2_MONITOR", DRONECAN)]);
    let mut battery = rig.peer();
    run_on_full_bus(&mut bench, &mut battery, SECOND, &[STATUS_A, A]);
    bench.forget_sent();
    bench.take_flash_operations();
    let before = rig.chip.borrow().lost_frames();
    for write in 0..WRITES {
        bench.request(&param_set("BATT_CAPACITY", 1000.0 + f32::from(write)));
        let transfers = [A, A_CELLS, ESC_0, A_LATER];
        run_on_full_bus(&mut bench, &mut battery, 40 * MILLISECOND, &transfers);
    }
    let pages = count_of(FlashOperationKind::PageProgram, &bench.take_flash_operations());
    assert!(pages >= WRITES.into(), "{pages} pages");
    let frames = bench.frames();
    for status in statuses_of(&frames, 1) {
        let (voltage_mv, current_ca) = (status.voltage_mv(0), status.current_ca());
        // That of the first cell, once cells are known; the current is averaged.
        assert!([12_250, 12_500, 4_125].contains(&voltage_mv), "{voltage_mv} mV");
        assert!((325..=850).contains(&current_ca), "{current_ca} cA");
    }
    let lost = rig.chip.borrow().lost_frames() - before;
    let counted = bench.logged(LogLevel::Warn, "transfers incomplete");
    assert_eq!(counted.is_empty(), lost == 0, "{lost} frames, {counted:?}");
    lost as f64 / pages as f64
}

#[test]
// Requirement: R-10
fn frames_lost_while_flash_is_written_are_few_and_never_shown() {
    for (bits_per_second, at_most) in [(250_000, 0.0), (1_000_000, 3.5)] {
        let lost = lost_a_page(bits_per_second);
        println!("{bits_per_second} bit/s: {lost:.2} frames lost a page");
        assert!(
            lost <= at_most,
            "{bits_per_second} bit/s: {lost:.2} frames lost a page"
        );
    }
}
