//! A bus, a controller and wires that fail: what is announced, and that everything works afterwards.

use super::{BITS_PER_SECOND, CRYSTAL_HZ, run_with, with_battery, with_can};
use emulator::AdcInput;
use emulator::can::{CanWires, ErrorState};
use support::frames::{STATUSTEXT, last_of, of_message, texts_of};
use support::requests::arm_by_force;
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, PACK, SECOND};
use workbench::can::transfers::{A, A_LATER};
use workbench::can::{CanRig, Peer, SELECT, Transfer};

const OTHER_MV: u16 = 12_250;

/// 6.37 V.
const LOW_CODE: u16 = 2000;

/// The texts about the bus and about the second pack.
fn texts(bench: &mut Bench) -> Vec<String> {
    let texts = texts_of(&bench.frames());
    texts
        .into_iter()
        .filter(|text| text.starts_with("CAN ") || text.starts_with("Battery 2 "))
        .collect()
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
fn noise_that_corrupts_a_frame_in_ten_loses_no_reading() {
    let (mut bench, rig, mut battery) = measuring();
    rig.bus(&mut bench).set_noise(0.1);
    run_with(&mut bench, &rig, 10 * SECOND, &mut battery, &[A, A_LATER]);
    assert!(battery.station.borrow().waiting() < 20, "the bus keeps up");
    // The board itself sends little: each frame of it that is destroyed counts as much as eight that are not.
    let lost = |text: &String| text != "CAN bus has errors: check wires and bit rate";
    assert!(!texts(&mut bench).iter().any(lost));
    assert_works_again(&mut bench, &rig, &mut battery);
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
fn a_wire_that_is_stuck_is_announced() {
    let (mut bench, rig, mut battery) = measuring();
    rig.set_wires(&mut bench, CanWires::StuckDominant);
    bench.run_for(8 * SECOND);
    assert_announced(&mut bench, "CAN bus has errors");
    assert_announced(&mut bench, "Battery 2 unhealthy");
    rig.set_wires(&mut bench, CanWires::Sound);
    assert_works_again(&mut bench, &rig, &mut battery);
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
fn a_controller_that_is_unplugged_is_announced_and_found_again() {
    let (mut bench, rig, mut battery) = measuring();
    rig.unplug(&mut bench);
    bench.run_for(8 * SECOND);
    assert_announced(&mut bench, "CAN controller does not answer");
    rig.plug(&mut bench);
    assert_works_again(&mut bench, &rig, &mut battery);
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
    run_with(&mut bench, &rig, 3 * SECOND, &mut battery, &[A]);
    assert_announced(&mut bench, "CAN interrupt line GP17");
    assert_works_again(&mut bench, &rig, &mut battery);
    rig.plug(&mut bench);
    assert_works_again(&mut bench, &rig, &mut battery);
}

/// NodeStatus of battery A that was up for 1000 s, and for one.
const RESTART: [Transfer; 2] = [
    Transfer(&[(0x1801_552a, &[0xe8, 0x03, 0, 0, 0, 0, 0, 0xc0])]),
    Transfer(&[(0x1801_552a, &[0x01, 0, 0, 0, 0, 0, 0, 0xc0])]),
];

#[test]
fn a_node_that_restarts_again_and_again_displaces_no_failsafe_level_on_a_slow_link() {
    let (mut bench, rig) = with_can(&[
        ("BATT_LOW_VOLT", 7.0),
        ("BATT_LOW_TIMER", 1.0),
        ("SERIAL0_BAUD", 9.0),
        ("SR0_EXTRA1", 2.0),
    ]);
    bench.run_until_silent();
    bench.forget_sent();
    let mut node = rig.peer();
    // Fifty texts a second, twice what the link carries.
    let mut run = |bench: &mut Bench, duration_us| {
        rig.run_with(bench, duration_us, 20 * MILLISECOND, &mut [(&mut node, &RESTART)]);
    };
    bench.send(&arm_by_force());
    run(&mut bench, 5 * SECOND);
    bench.adc_input(PACK, AdcInput::Code(LOW_CODE));
    let from_us = bench.time_us();
    run(&mut bench, 4 * SECOND);
    let frames = bench.frames();
    let restarts = texts_of(&frames);
    assert!(
        restarts.iter().any(|text| text == "CAN node 42 restarted"),
        "{restarts:?}"
    );
    let texts = of_message(&frames, STATUSTEXT);
    let low = texts
        .iter()
        .find(|frame| frame.text(1, 50).starts_with("Battery 1 is low 6."));
    let delay_us = low.expect("the level arrives").at_us - from_us;
    println!("the level arrived {delay_us} us after the voltage fell");
    // A second of the timer, what is on its way, HEARTBEAT, and the text.
    assert!(delay_us < 1_500 * MILLISECOND, "{delay_us}");
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
