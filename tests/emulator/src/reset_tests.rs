//! Tests of power-up and resets: what each of them forgets and what it leaves.

use super::bench::*;
use super::board::Board;
use super::firmware::Firmware;
use super::reset::ResetCause;
use super::thumb::{HANG, MAIN, UDF, WFI, board, idle_board, store};

#[test]
fn ram_at_power_up_is_garbage_decided_by_the_seed() {
    let firmware = || Firmware::from_flash(vec![0xff; 2 * 1024 * 1024]);
    let ram_after = |seed| ram(&Board::power_up(&firmware(), seed));
    assert_eq!(ram_after(1), ram_after(1));
    assert_ne!(ram_after(1), ram_after(2));
    assert!(ram_after(1).iter().any(|&byte| byte != ram_after(1)[0]));
}

#[test]
fn a_watchdog_timeout_resets_and_is_remembered() {
    let mut board = idle_board();
    board.write_memory(RAM, b"kept");
    board.write_register(WATCHDOG_SCRATCH0, 0xcafe);
    start_watchdog(&mut board, 1000);
    board.run_for(999);
    assert!(board.resets().is_empty());
    board.run_for(2);
    let reset = board.resets()[0];
    assert_eq!((reset.cause, reset.time_us), (ResetCause::WatchdogTimer, 1000));
    assert_eq!(board.read_register(WATCHDOG_REASON), 0b01);
    assert_eq!(board.read_register(WATCHDOG_SCRATCH0), 0xcafe);
    assert_eq!(board.read_register(CHIP_RESET), HAD_POR, "not a chip-level reset");
    assert_eq!(board.read_memory(RAM, 4), b"kept");
    assert_eq!(
        board.read_register(RESETS) & UART0_RESET,
        UART0_RESET,
        "peripherals are in reset again"
    );
    board.run_for(10_000);
    assert_eq!(board.resets().len(), 1, "the watchdog is off after a reset");
}

#[test]
fn a_watchdog_without_wdsel_resets_nothing() {
    let mut board = idle_board();
    start_watchdog(&mut board, 1000);
    board.write_register(PSM_WDSEL, 0);
    board.run_for(2000);
    assert!(board.resets().is_empty());
}

#[test]
fn the_run_pin_clears_what_the_watchdog_remembers_and_keeps_ram() {
    let mut board = idle_board();
    board.write_memory(RAM, b"kept");
    start_watchdog(&mut board, 1000);
    board.run_for(2000);
    board.write_register(WATCHDOG_SCRATCH0, 0xcafe);
    board.press_run();
    assert_eq!(board.read_register(WATCHDOG_REASON), 0);
    assert_eq!(board.read_register(WATCHDOG_SCRATCH0), 0);
    assert_eq!(board.read_register(CHIP_RESET), HAD_RUN);
    assert_eq!(board.read_memory(RAM, 4), b"kept");
    assert_eq!(board.resets()[1].cause, ResetCause::RunPin);
}

#[test]
fn a_power_cycle_forgets_everything() {
    let mut board = idle_board();
    let before = ram(&board);
    board.press_run();
    board.power_cycle();
    assert_eq!(board.read_register(CHIP_RESET), HAD_POR);
    assert_ne!(ram(&board), before);
}

#[test]
fn sysresetreq_restarts_the_processor_and_leaves_the_peripherals() {
    // Datasheet 2.4.2.9: "the NVIC only resets the Cortex-M0+ processor core".
    let mut board = board(&[WFI, store(0, 1), HANG], &[]);
    set_registers(&mut board, [(0, 0x05fa_0004), (1, AIRCR)]);
    start_watchdog(&mut board, 10_000);
    board.write_register(RESETS_CLEAR, UART0_RESET);
    pend_line_26(&mut board);
    board.set_register(15, MAIN + 2);
    board.bus.chip.nvic.enabled = 1;
    board.run_for(10);
    assert_eq!(board.resets()[0].cause, ResetCause::ProcessorOnly);
    let nvic = &board.bus.chip.nvic;
    assert_eq!(
        (nvic.enabled, nvic.pending),
        (0, 0),
        "the NVIC belongs to the processor"
    );
    assert_eq!(board.read_register(WATCHDOG_REASON), 0, "it sets no flag");
    assert_eq!(board.read_register(RESETS) & UART0_RESET, 0, "still out of reset");
    assert!(board.watchdog_is_enabled());
}

#[test]
fn aircr_without_its_key_does_nothing() {
    let mut board = board(&[store(0, 1), HANG], &[]);
    set_registers(&mut board, [(0, 0x0000_0004), (1, AIRCR)]);
    board.run_for(10);
    assert!(board.resets().is_empty());
}

#[test]
fn timer_restarts_at_zero_with_every_reset_and_the_bench_clock_goes_on() {
    let mut board = idle_board();
    board.write_register(WATCHDOG_TICK, TICK_1_US);
    board.run_for(5000);
    assert_eq!(board.read_register(TIMER_RAWL), 5000);
    board.press_run();
    board.write_register(WATCHDOG_TICK, TICK_1_US);
    board.run_for(100);
    assert_eq!(board.read_register(TIMER_RAWL), 100);
    assert_eq!(board.time_us(), 5100);
}

#[test]
fn the_timer_can_be_preset_past_32_bits() {
    let mut board = idle_board();
    board.write_register(WATCHDOG_TICK, TICK_1_US);
    board.preset_timer(0xffff_fff0);
    board.run_for(0x20);
    assert_eq!(board.read_register(TIMER_RAWL), 0x10);
}

#[test]
fn the_boot_rom_leaves_its_traces_in_the_last_256_bytes_of_ram() {
    let mut board = idle_board();
    board.write_memory(0x2004_1f00, &[0; 256]);
    board.write_memory(0x2004_1efc, &[7; 4]);
    board.press_run();
    assert_ne!(board.read_memory(0x2004_1f00, 256), [0; 256]);
    assert_eq!(board.read_memory(0x2004_1efc, 4), [7; 4]);
}

#[test]
fn a_lockup_ends_with_the_watchdog() {
    let mut board = board(&[UDF], &[(3, &[UDF])]);
    start_watchdog(&mut board, 1000);
    board.run_for(500);
    assert!(board.is_locked_up());
    board.run_for(501);
    assert_eq!(board.resets()[0].cause, ResetCause::WatchdogTimer);
}
