//! Tests of the board: resets and what they leave, wires at pins, faults from outside, and that
//! runs repeat exactly.

use super::adc::AdcInput;
use super::cpu::CpuState;
use super::pins::UartPins;
use super::reset::ResetCause;
use super::thumb::*;
use super::{Board, Firmware};

const RAM: u32 = 0x2000_0000;
const RESETS: u32 = 0x4000_c000;
const RESETS_SET: u32 = 0x4000_e000;
const RESETS_CLEAR: u32 = 0x4000_f000;
const UART0_RESET: u32 = 1 << 22;
const ALL_BLOCKS: u32 = 0x01ff_ffff;
const PSM_WDSEL: u32 = 0x4001_0008;
const EVERYTHING_BUT_OSCILLATORS: u32 = 0x1_fffc;
const IO_BANK0: u32 = 0x4001_4000;
const PADS_BANK0: u32 = 0x4001_c000;
const FUNCTION_UART: u32 = 2;
const FUNCTION_SIO: u32 = 5;
const UART0: u32 = 0x4003_4000;
const TIMER_RAWL: u32 = 0x4005_4028;
const WATCHDOG_CTRL: u32 = 0x4005_8000;
const WATCHDOG_LOAD: u32 = 0x4005_8004;
const WATCHDOG_REASON: u32 = 0x4005_8008;
const WATCHDOG_SCRATCH0: u32 = 0x4005_800c;
const WATCHDOG_TICK: u32 = 0x4005_802c;
const TICK_1_US: u32 = 1 << 9 | 12;
const CHIP_RESET: u32 = 0x4006_4008;
const HAD_POR: u32 = 1 << 8;
const HAD_RUN: u32 = 1 << 16;
const AIRCR: u32 = 0xe000_ed0c;
const I2C0: u32 = 0x4004_4000;

fn start_watchdog(board: &mut Board, micros: u32) {
    board.write_register(PSM_WDSEL, EVERYTHING_BUT_OSCILLATORS);
    board.write_register(WATCHDOG_TICK, TICK_1_US);
    board.write_register(WATCHDOG_LOAD, 2 * micros);
    board.write_register(WATCHDOG_CTRL, 1 << 30);
}

/// UART0 at 115200 baud, everything set up but the pins.
fn start_uart0(board: &mut Board) {
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    for (offset, value) in [(0x24, 67), (0x28, 52), (0x2c, 0x70), (0x30, 0x301)] {
        board.write_register(UART0 + offset, value);
    }
}

fn select_function(board: &mut Board, pin: u32, function: u32) {
    board.write_register(IO_BANK0 + 8 * pin + 4, function);
}

fn ram(board: &Board) -> Vec<u8> {
    board.read_memory(RAM, 0x1000)
}

// ----- Power and resets -----------------------------------------------------------------------

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
    board.set_register(0, 0x05fa_0004);
    board.set_register(1, AIRCR);
    start_watchdog(&mut board, 10_000);
    board.write_register(RESETS_CLEAR, UART0_RESET);
    board.set_register(15, MAIN + 2);
    board.run_for(10);
    assert_eq!(board.resets()[0].cause, ResetCause::ProcessorOnly);
    assert_eq!(board.read_register(WATCHDOG_REASON), 0, "it sets no flag");
    assert_eq!(board.read_register(RESETS) & UART0_RESET, 0, "still out of reset");
    assert!(board.watchdog_is_enabled());
}

#[test]
fn aircr_without_its_key_does_nothing() {
    let mut board = board(&[store(0, 1), HANG], &[]);
    board.set_register(0, 0x0000_0004);
    board.set_register(1, AIRCR);
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

// ----- Pins and wires -------------------------------------------------------------------------

#[test]
fn bytes_reach_the_wire_only_through_the_right_pin_of_a_uart_out_of_reset() {
    let mut board = idle_board();
    start_uart0(&mut board);
    let send = |board: &mut Board| {
        board.write_register(UART0, u32::from(b'x'));
        board.run_for(100);
        board.uart(0).take_sent().len()
    };
    assert_eq!(send(&mut board), 0, "no pin selected");
    select_function(&mut board, 12, FUNCTION_UART);
    assert_eq!(send(&mut board), 0, "GP12 is not where the wire is");
    select_function(&mut board, 0, FUNCTION_UART);
    assert_eq!(send(&mut board), 1);
    board.write_register(PADS_BANK0 + 4, 1 << 7);
    assert_eq!(send(&mut board), 0, "the pad's output is disabled");
    board.write_register(PADS_BANK0 + 4, 1 << 6);
    board.write_register(RESETS_SET, UART0_RESET);
    assert_eq!(send(&mut board), 0, "held in reset");
    assert_eq!(board.read_register(UART0 + 0x30), 0);
    board.write_register(RESETS_CLEAR, UART0_RESET);
    assert_eq!(send(&mut board), 0, "not set up again");
    assert_eq!(board.read_register(UART0 + 0x30), 0x300);
}

#[test]
fn the_wire_can_be_soldered_to_other_pins() {
    let mut board = idle_board();
    start_uart0(&mut board);
    board.wire_uart(0, UartPins { tx: 16, rx: 17 });
    select_function(&mut board, 16, FUNCTION_UART);
    select_function(&mut board, 17, FUNCTION_UART);
    let over = board.uart_send(0, 0, b"ab");
    assert_eq!(over, 2 * 10850 / 125);
    board.write_register(UART0, u32::from(b'x'));
    board.run_for(200);
    assert_eq!(board.uart(0).sent().len(), 1);
    assert_eq!(board.read_register(UART0), u32::from(b'a'));
}

#[test]
#[should_panic(expected = "GPIO4 is not a TX pin of UART0")]
fn a_wire_to_a_pin_the_uart_cannot_use_is_refused() {
    idle_board().wire_uart(0, UartPins { tx: 4, rx: 5 });
}

#[test]
fn a_pin_level_is_known_when_the_processor_drives_it() {
    // SIO GPIO_OUT_SET is at 0xd0000014, GPIO_OE_SET at 0xd0000024 (datasheet 2.3.1.7).
    let mut board = board(&[store(0, 1), store(0, 2), HANG], &[]);
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    select_function(&mut board, 2, FUNCTION_SIO);
    assert_eq!(board.pin_level(2), None);
    board.set_register(0, 1 << 2);
    board.set_register(1, 0xd000_0014);
    board.set_register(2, 0xd000_0024);
    board.run_for(10);
    assert_eq!(board.pin_level(2), Some(true));
    assert_eq!(board.pin_level(3), None);
}

#[test]
fn blocks_that_nobody_models_read_back_and_are_recorded() {
    let mut board = idle_board();
    board.write_register(I2C0, 5);
    assert!(board.unmodelled().is_empty(), "held in reset, the write is lost");
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    board.write_register(I2C0, 5);
    board.write_register(I2C0 + 0x2000, 2);
    assert_eq!(board.read_register(I2C0), 7);
    let access = &board.unmodelled()["I2C0"];
    assert_eq!((access.reads, access.writes, access.first_address), (1, 2, I2C0));
}

// ----- Faults from outside --------------------------------------------------------------------

/// Counts interrupts of software line 26 in R7 and rounds of the main loop in R4.
fn counting_board() -> Board {
    let mut board = board(&[adds(4, 1), back(1)], &[(16 + 26, &[adds(7, 1), BX_LR])]);
    board.set_register(4, 0);
    board.set_register(7, 0);
    board
}

fn pend_line_26(board: &mut Board) {
    board.bus.store_system_control(0xe000_e100, 1 << 26);
    board.bus.store_system_control(0xe000_e200, 1 << 26);
}

#[test]
fn a_hung_program_stays_where_it_is_while_interrupts_go_on() {
    let mut board = counting_board();
    board.run_for(10);
    board.hang_program();
    board.run_for(10);
    let rounds = board.register(4);
    pend_line_26(&mut board);
    board.run_for(10);
    assert_eq!((board.register(4), board.register(7)), (rounds, 1));
    assert_eq!(board.active_exception(), 0);
    board.press_run();
    board.run_for(100);
    assert_ne!(board.register(4), rounds, "a reset ends it");
}

#[test]
fn a_sleeping_program_can_be_hung_and_one_with_interrupts_off_is_left_alone() {
    let mut board = board(&[WFE, back(1)], &[]);
    board.run_for(10);
    assert_eq!(board.cpu_state(), CpuState::WaitingForEvent);
    board.hang_program();
    board.run_for(10);
    assert_eq!(board.cpu_state(), CpuState::Running);
    let mut board = super::thumb::board(&[CPSID_I, adds(4, 1), back(1)], &[]);
    board.run_for(10);
    board.hang_program();
    let before = board.register(4);
    board.run_for(10);
    assert_ne!(board.register(4), before);
}

#[test]
fn a_derailed_program_meets_an_undefined_instruction() {
    let mut board = counting_board();
    board.run_undefined_instruction();
    board.run_for(10);
    assert_eq!(board.active_exception(), 3);
}

#[test]
fn a_cut_interrupt_is_not_delivered_until_it_is_restored() {
    let mut board = counting_board();
    board.cut_interrupt(26);
    pend_line_26(&mut board);
    board.run_for(10);
    assert_eq!(board.register(7), 0);
    board.restore_interrupt(26);
    pend_line_26(&mut board);
    board.run_for(10);
    assert_eq!(board.register(7), 1);
}

// ----- Time -------------------------------------------------------------------------------------

#[test]
fn cutting_a_run_into_pieces_changes_nothing() {
    // Timer interrupts, UART traffic in both directions and paced conversions, all at once.
    let run = |pieces: &[u64]| {
        let mut board = counting_board();
        start_uart0(&mut board);
        select_function(&mut board, 0, FUNCTION_UART);
        select_function(&mut board, 1, FUNCTION_UART);
        board.adc_input(0, AdcInput::Volts(1.0));
        board.adc_noise(0.01);
        board.write_register(0x4004_c010, 4799 << 8);
        board.write_register(0x4004_c000, 1 | 1 << 3);
        (0..32).for_each(|byte| board.write_register(UART0, byte));
        board.uart_send(0, 100, b"0123456789");
        pieces.iter().for_each(|&micros| board.run_for(micros));
        let received: Vec<u32> = (0..10).map(|_| board.read_register(UART0)).collect();
        (
            board.uart(0).take_sent(),
            received,
            board.take_adc_record(),
            board.instructions(),
        )
    };
    let whole = run(&[3000]);
    assert_eq!(whole.0.len(), 32);
    assert_eq!(whole.2.len(), 30);
    assert!(whole == run(&[1, 2, 997, 1000, 500, 499, 1]));
    assert!(whole == run(&[1; 3000]));
}

#[test]
fn run_until_stops_when_the_condition_holds_or_the_time_is_up() {
    let mut board = counting_board();
    assert!(board.run_until(1000, |board| board.register(4) > 1000));
    assert!(board.time_us() < 200, "{}", board.time_us());
    let before = board.time_us();
    assert!(!board.run_until(50, |_| false));
    assert!((board.time_us() - before).abs_diff(50) <= 1);
}

#[test]
fn run_until_time_does_nothing_for_the_past() {
    let mut board = idle_board();
    board.run_until_time(500);
    board.run_until_time(100);
    assert_eq!(board.time_us(), 500);
    board.run_for(100);
    assert_eq!(board.time_us(), 600);
}
