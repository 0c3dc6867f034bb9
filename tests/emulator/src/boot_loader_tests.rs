//! Tests of the ways into and out of the USB boot loader, against the datasheet's sections 2.8.1.1 and 2.8.3.1.5.

use rp2040_emu::core::CoreBus;

use super::bench::*;
use super::board::Board;
use super::boot_loader::BootLoader;
use super::boot_rom;
use super::reset::ResetCause;
use super::thumb::{BX_LR, HANG, adds, board, call, idle_board};

const SCRATCH4: u32 = WATCHDOG_SCRATCH0 + 4 * 4;
const MAGIC: u32 = 0xb007_c0d3;
/// Minus [`MAGIC`], as the datasheet has it.
const MINUS_MAGIC: u32 = 0x4ff8_3f2d;
/// GP6 is an output, driven high.
const GPIO_OUT_SET: u32 = 0xd000_0014;
const GPIO_OE_SET: u32 = 0xd000_0024;
const PIN: u32 = 6;

/// A board whose program calls reset_to_usb_boot with these arguments, and drives a pin.
fn restarting(arguments: [u32; 2], handlers: &[(u32, &[u16])]) -> Board {
    let mut board = board(&[call(5), HANG], handlers);
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    select_function(&mut board, PIN, FUNCTION_SIO);
    board.bus.write32(GPIO_OUT_SET, 1 << PIN);
    board.bus.write32(GPIO_OE_SET, 1 << PIN);
    board.set_register(0, arguments[0]);
    board.set_register(1, arguments[1]);
    board.set_register(
        5,
        boot_rom::address_of(b"UB").expect("a function of the boot ROM"),
    );
    board
}

#[test]
fn the_chip_is_reset_into_the_boot_loader_after_5_ms_with_its_arguments() {
    let mut board = restarting([1 << 25, 2], &[]);
    board.run_for(4900);
    assert!(board.resets().is_empty());
    assert_eq!(board.boot_loader(), None);
    assert_eq!(board.pin_level(PIN as usize), Some(true), "still driven");
    board.run_for(200);
    assert_eq!(board.resets().len(), 1);
    assert_eq!(board.resets()[0].cause, ResetCause::WatchdogTimer);
    assert_eq!(
        board.boot_loader(),
        Some(BootLoader {
            gpio_activity_pin_mask: 1 << 25,
            disable_interface_mask: 2,
        })
    );
    assert_eq!(
        board.read_register(SCRATCH4),
        0,
        "zeroed before control is transferred"
    );
    assert_eq!(
        board.pin_level(PIN as usize),
        None,
        "pins are in their reset state"
    );
}

#[test]
fn a_watchdog_that_runs_does_not_reach_the_boot_loader() {
    let mut board = restarting([0, 0], &[]);
    start_watchdog(&mut board, 6000);
    board.run_for(10_000_000);
    assert_eq!(board.resets().len(), 1);
    assert!(board.boot_loader().is_some());
}

#[test]
fn interrupts_are_served_until_the_reset_and_not_after_it() {
    let mut board = restarting([0, 0], &[(16 + 26, &[adds(7, 1), BX_LR])]);
    board.set_register(7, 0);
    board.run_for(1000);
    pend_line_26(&mut board);
    board.run_for(1000);
    assert_eq!(board.register(7), 1);
    board.run_for(8000);
    assert!(board.boot_loader().is_some());
}

#[test]
fn flashing_run_and_power_end_the_boot_loader() {
    for end in [Board::finish_boot_loader, Board::press_run, Board::power_cycle] {
        let mut board = restarting([0, 0], &[]);
        board.run_for(10_000);
        assert!(board.boot_loader().is_some());
        // The program that starts then would enter it again.
        board.set_register(5, 0);
        end(&mut board);
        board.run_until(1_000_000, |board| board.boot_loader().is_none());
        assert_eq!(board.boot_loader(), None);
    }
}

#[test]
fn scratch_registers_start_a_program_if_both_magic_numbers_are_right() {
    // In RAM: flash can't be read yet.
    let entry = RAM | 1;
    for (magic, check, starts) in [
        (MAGIC, entry ^ MINUS_MAGIC, true),
        (MAGIC, entry ^ MAGIC, false),
        (MAGIC + 1, entry ^ MINUS_MAGIC, false),
    ] {
        let mut board = idle_board();
        board.write_memory(RAM, &HANG.to_le_bytes());
        for (number, value) in (0..).zip([magic, check, RAM + 0x100, entry]) {
            board.write_register(SCRATCH4 + 4 * number, value);
        }
        start_watchdog(&mut board, 10);
        board.run_for(20);
        assert_eq!(board.pc() == RAM, starts, "{magic:#x} {check:#x}");
        assert_eq!(board.register(13) == RAM + 0x100, starts);
    }
}
