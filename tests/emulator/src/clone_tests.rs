//! A copy of a board goes on as the board itself.

use rp2040_emu::core::CoreBus;

use super::adc::AdcInput;
use super::bench::*;
use super::board::Board;
use super::flash::FlashOperation;
use super::memory::{RAM_BASE, RAM_SIZE};
use super::memory_map::BLOCKS;
use super::thumb::{BX_LR, HANG, adds, board, idle_board};
use super::uart::SentByte;

const DMA: u32 = 0x5000_0000;
const FROM: u32 = RAM + 0x8000;
const DREQ_UART0_TX: u32 = 20 << 15;
const ADC: u32 = 0x4004_c000;
const CLK_REF_CTRL: u32 = 0x4000_8030;
const PLL_SYS: u32 = 0x4002_8000;
const PLL_LOCK: u32 = 1 << 31;
const TIMER_ALARM0: u32 = 0x4005_4010;
const PWM_SLICE_1: u32 = 0x4005_0014;
/// It is not reached as other blocks are.
const PPB: u32 = 0xe000_0000;
const SIO: u32 = 0xd000_0000;
const SIO_GPIO: [u32; 2] = [SIO + 0x10, SIO + 0x20];
const SIO_SPINLOCK_ST: u32 = SIO + 0x5c;
const SIO_DIVIDEND: u32 = SIO + 0x60;
const SIO_DIVISOR: u32 = SIO + 0x64;
const SIO_RESULTS: [u32; 3] = [SIO + 0x78, SIO + 0x74, SIO + 0x70];
const SIO_SPINLOCK_7: u32 = SIO + 0x11c;

/// An alarm, DMA to UART0, bytes from outside, paced conversions with noise, a PWM, a watchdog, clocks and PLLs.
fn busy_board() -> Board {
    let mut board = counting_board();
    start_uart0(&mut board);
    select_function(&mut board, 0, FUNCTION_UART);
    select_function(&mut board, 1, FUNCTION_UART);
    select_function(&mut board, 2, FUNCTION_PWM);
    board.write_register(CLK_REF_CTRL, 2);
    for (offset, value) in [(8, 125), (0xc, 0x6_2000), (4, 0)] {
        board.write_register(PLL_SYS + offset, value);
    }
    for (offset, value) in [(0x10, 999), (0xc, 333), (0, 1)] {
        board.write_register(PWM_SLICE_1 + offset, value);
    }
    board.adc_input(0, AdcInput::Volts(1.0));
    board.adc_noise(0.01);
    board.write_register(ADC + 0x10, 4799 << 8);
    board.write_register(ADC, 1 | 1 << 3);
    board.write_memory(FROM, &(0..=255).collect::<Vec<u8>>());
    for (offset, value) in [(0, FROM), (4, UART0), (8, 200), (0xc, DREQ_UART0_TX | 1 << 4 | 1)] {
        board.write_register(DMA + offset, value);
    }
    // The DMA asks the UART for requests (UARTDMACR).
    board.write_register(UART0 + 0x48, 2);
    board.uart_send(0, 100, b"0123456789");
    board.write_register(TIMER_ALARM0, 2_000);
    board.pulses(7, 1500, 100_000, 200_000, 1);
    start_watchdog(&mut board, 9_000);
    for (address, value) in [
        (SIO_DIVIDEND, 1000),
        (SIO_DIVISOR, 7),
        (SIO_GPIO[0], 5),
        (SIO_GPIO[1], 4),
    ] {
        board.bus.write32(address, value);
    }
    board.bus.read32(SIO_SPINLOCK_7);
    board
}

/// Everything that can be seen of a board. Looking changes it.
#[derive(Debug, PartialEq)]
struct Seen {
    core: Vec<u32>,
    counts: [u64; 4],
    lowest_stack_pointer: u32,
    sent: Vec<SentByte>,
    conversions: usize,
    flash_operations: Vec<FlashOperation>,
    sio: Vec<u32>,
    registers: Vec<(&'static str, u32, u32)>,
    ram_and_flash: [Vec<u8>; 2],
}

fn seen(board: &mut Board) -> Seen {
    let sio = [SIO_SPINLOCK_ST, SIO_DIVIDEND, SIO_DIVISOR];
    let sio = [&SIO_GPIO[..], &sio, &SIO_RESULTS].concat();
    Seen {
        core: (0..16).map(|number| board.register(number)).collect(),
        counts: [
            board.time_cycles(),
            board.instructions(),
            board.awake_cycles(),
            board.resets().len() as u64,
        ],
        lowest_stack_pointer: board.lowest_stack_pointer(),
        sent: board.uart(0).take_sent(),
        conversions: board.take_adc_record().len(),
        flash_operations: board.flash_operations().to_vec(),
        sio: sio.into_iter().map(|address| board.bus.read32(address)).collect(),
        ram_and_flash: [
            board.read_memory(RAM_BASE, RAM_SIZE),
            board.read_flash(0x10_0000, 0x2000),
        ],
        registers: registers(board),
    }
}

fn registers(board: &mut Board) -> Vec<(&'static str, u32, u32)> {
    let mut registers = Vec::new();
    for block in BLOCKS.iter().filter(|block| block.base < PPB) {
        // Above, there are the interrupts of the PWM: looking at them is a panic.
        let end = if block.name == "PWM" { 0xa4 } else { 0x180 };
        for offset in (0..end).step_by(4) {
            registers.push((block.name, offset, board.read_register(block.base + offset)));
        }
    }
    registers
}

#[track_caller]
fn assert_alike(original: &mut Board, copy: &mut Board) {
    let (original, copy) = (seen(original), seen(copy));
    for (one, other) in original.registers.iter().zip(&copy.registers) {
        assert_eq!(one, other);
    }
    assert_eq!(
        (&original.core, original.counts, &original.sio),
        (&copy.core, copy.counts, &copy.sio)
    );
    assert!(original == copy);
}

#[test]
fn a_copy_goes_on_as_the_board_whenever_it_is_made() {
    for cycles_before in [0, 1, 1234, 70_001, 187_500, 500_123] {
        let mut board = busy_board();
        board.run_until(10_000, |board| board.time_cycles() >= cycles_before);
        let mut copies = [board.clone(), board.clone()];
        for copy in &mut copies {
            copy.run_for(8_000);
        }
        board.run_for(8_000);
        let [first, second] = &mut copies;
        assert_alike(&mut board, first);
        // A copy of a copy, and a board that was copied in between, make no difference either.
        let mut third = second.clone();
        drop(second.clone());
        second.run_for(10_000);
        third.run_for(10_000);
        assert_eq!(second.resets().len(), 1, "of the watchdog");
        assert_alike(second, &mut third);
    }
}

#[test]
fn the_board_is_as_busy_as_it_should_be() {
    let mut board = busy_board();
    board.run_for(4_000);
    assert_ne!(board.read_register(PLL_SYS) & PLL_LOCK, 0);
    assert_eq!(board.programmed_clk_sys_hz(), 12_000_000);
    assert_eq!(board.bus.read32(SIO_RESULTS[0]), 0b11, "a result waits");
    assert!(board.clone().read_register(PLL_SYS) & PLL_LOCK != 0);
    let sent = board.uart(0).take_sent().len();
    assert!((40..60).contains(&sent), "{sent}");
    assert!(board.take_adc_record().len() > 30);
}

#[test]
fn a_copy_that_is_made_while_the_flash_is_busy_has_an_operation_of_its_own() {
    use super::flash::fixture::{OFFSET, finish, flash_board, start_erase, start_program};
    let mut board = flash_board();
    board.write_flash(OFFSET, &[0; 300]);
    start_erase(&mut board, OFFSET, 4096);
    assert!(board.run_until(1_000, |board| board.flash_is_busy()));
    let mut copies = [board.clone(), board.clone()];
    copies[1].cut_power();
    finish(&mut board);
    assert_eq!(board.read_flash(OFFSET, 300), [0xff; 300]);
    assert_eq!(copies[0].read_flash(OFFSET, 300), [0; 300]);
    finish(&mut copies[0]);
    assert_alike(&mut board, &mut copies[0]);
    assert_ne!(copies[1].read_flash(OFFSET, 300), [0xff; 300], "torn");
    start_program(&mut copies[0], OFFSET, &[0x55; 256]);
    finish(&mut copies[0]);
    assert_eq!(board.read_flash(OFFSET, 256), [0xff; 256]);
}

#[test]
fn chance_is_the_same_for_a_copy() {
    let mut board = board(&[HANG], &[(16 + 26, &[adds(7, 1), BX_LR])]);
    board.run_for(10);
    let mut copy = board.clone();
    for board in [&mut board, &mut copy] {
        board.power_cycle();
        board.run_for(10);
    }
    assert_alike(&mut board, &mut copy);
}

#[test]
fn a_board_with_nothing_attached_goes_to_another_thread() {
    let mut board = busy_board();
    board.run_for(1_000);
    let mut copy = board.clone();
    let runs = std::thread::spawn(move || {
        copy.run_for(3_000);
        copy
    });
    board.run_for(3_000);
    assert_alike(&mut board, &mut runs.join().expect("it runs"));
}

#[test]
#[should_panic = "attach them to the copies"]
fn a_board_with_a_device_is_not_copied() {
    use super::i2c::devices::Ina226;
    let mut board = idle_board();
    board.i2c(0).attach(0x40, Box::new(Ina226::new(0.001)));
    drop(board.clone());
}

#[test]
#[should_panic = "set it on the copies"]
fn a_board_with_a_computed_input_is_not_copied() {
    let mut board = idle_board();
    board.adc_input(0, AdcInput::CodeAt(Box::new(|micros| micros as u16)));
    drop(board.clone());
}
