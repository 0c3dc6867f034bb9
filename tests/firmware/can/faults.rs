//! A bus, a controller and wires that fail: what is announced, and that everything works afterwards.

use super::{BITS_PER_SECOND, CRYSTAL_HZ, run_with, with_battery, with_can};
use emulator::can::{CanWires, ErrorState};
use support::frames::{last_of, texts_of};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, TestedVehicle};
use workbench::can::transfers::{A, A_LATER};
use workbench::can::{CanRig, Peer, SELECT};

const OTHER_MV: u16 = 12_250;

/// The texts about the bus and about the second pack.
fn texts(bench: &mut Bench) -> Vec<String> {
    let mut texts = texts_of(&bench.frames());
    texts.retain(|text| text.starts_with("CAN ") || text.starts_with("Battery 2 "));
    texts
}

/// A battery on the bus is measured.
fn measuring() -> (Bench, CanRig, Peer) {
    let (mut bench, rig) = with_battery();
    let mut battery = rig.peer();
    run_with(&mut bench, &rig, 3 * SECOND, &mut battery, &[A]);
    assert_eq!(last_of(&bench.frames(), 1).voltage_mv(0), 12_500);
    bench.forget_sent();
    (bench, rig, battery)
}

/// Runs on and expects that what is measured now arrives.
#[track_caller]
fn assert_works_again(bench: &mut Bench, rig: &CanRig, battery: &mut Peer) {
    run_with(bench, rig, 12 * SECOND, battery, &[A_LATER]);
    assert_eq!(last_of(&bench.frames(), 1).voltage_mv(0), OTHER_MV);
    assert!(bench.resets().len() == 1, "{:?}", bench.resets());
}

#[track_caller]
fn assert_announced(bench: &mut Bench, expected: &str) {
    let texts = texts(bench);
    assert!(texts.iter().any(|text| text.starts_with(expected)), "{texts:?}");
}

#[test]
fn shorted_wires_switch_the_controller_off_until_they_are_repaired() {
    let (mut bench, rig, mut battery) = measuring();
    rig.set_wires(&mut bench, CanWires::Shorted);
    bench.run_for(8 * SECOND);
    assert_announced(&mut bench, "CAN bus off");
    assert_announced(&mut bench, "Battery 2 unhealthy");
    // Repaired while it is off, it begins without errors; else each of its few frames would take back one.
    while rig.chip.borrow().error_state() != ErrorState::BusOff {
        bench.run_for(MILLISECOND / 10);
    }
    rig.set_wires(&mut bench, CanWires::Sound);
    assert_works_again(&mut bench, &rig, &mut battery);
    assert_announced(&mut bench, "CAN bus works");
    assert_eq!(rig.chip.borrow().error_state(), ErrorState::Active);
}

#[test]
fn alone_on_the_bus_the_board_says_so_and_tries_on() {
    let (mut bench, rig, mut battery) = measuring();
    rig.set_wires(&mut bench, CanWires::Open);
    bench.run_for(8 * SECOND);
    assert_announced(&mut bench, "CAN bus has errors");
    rig.set_wires(&mut bench, CanWires::Sound);
    assert_works_again(&mut bench, &rig, &mut battery);
    assert_announced(&mut bench, "CAN bus works");
}

#[test]
fn a_controller_that_loses_its_supply_is_set_up_anew() {
    let (mut bench, rig, mut battery) = measuring();
    rig.chip.borrow_mut().set_powered(false);
    bench.run_for(3 * SECOND);
    assert_eq!(
        texts(&mut bench),
        ["CAN controller does not answer"],
        "it was not set up again"
    );
    bench.forget_sent();
    rig.chip.borrow_mut().set_powered(true);
    assert_works_again(&mut bench, &rig, &mut battery);
}

#[test]
fn a_controller_that_resets_itself_is_set_up_anew() {
    let (mut bench, rig, mut battery) = measuring();
    bench.spi1();
    rig.chip.borrow_mut().reset();
    run_with(&mut bench, &rig, 2 * SECOND, &mut battery, &[A]);
    assert_announced(&mut bench, "CAN controller was reset");
    assert_works_again(&mut bench, &rig, &mut battery);
}

#[test]
fn an_open_interrupt_line_is_announced_and_readings_go_on() {
    let (mut bench, rig, mut battery) = measuring();
    bench.spi1().attach(SELECT, Box::new(rig.chip.clone()));
    run_with(&mut bench, &rig, 2 * SECOND, &mut battery, &[A]);
    assert_announced(&mut bench, "CAN interrupt line GP17");
    run_with(&mut bench, &rig, SECOND, &mut battery, &[A_LATER]);
    assert_eq!(last_of(&bench.frames(), 1).voltage_mv(0), OTHER_MV);
}

#[test]
fn another_bit_rate_is_announced_and_leaves_the_others_alone() {
    let (mut bench, rig) = with_can(&[("CAN_P1_BITRATE", 500_000.0), ("BATT2_MONITOR", 8.0)]);
    let (mut battery, other) = (rig.peer(), rig.peer());
    run_with(&mut bench, &rig, 8 * SECOND, &mut battery, &[A]);
    assert_announced(&mut bench, "CAN bus ");
    let heard = other.station.borrow_mut().take_received().len();
    assert!(heard > 100, "of some 480 frames {heard} went through");
}

#[test]
fn without_a_controller_everything_else_works() {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.set("CAN_P1_DRIVER", 1.0);
    bench.reboot();
    bench.run_for(5 * SECOND);
    assert_announced(&mut bench, "CAN controller does not answer");
    assert_ne!(last_of(&bench.frames(), 0).voltage_mv(0), u16::MAX);
    // The line floats in all ways.
    for byte in [0x00, 0xa5] {
        bench.spi1().set_floating(byte);
        bench.run_for(3 * SECOND);
    }
    let rig = CanRig::new(&mut bench, CRYSTAL_HZ, BITS_PER_SECOND);
    bench.run_for(3 * SECOND);
    assert_eq!(rig.chip.borrow().bits_per_second(), Some(BITS_PER_SECOND));
    assert_eq!(bench.resets().len(), 1);
}
