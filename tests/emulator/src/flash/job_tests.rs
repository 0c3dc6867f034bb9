//! Tests of erase and program through the boot ROM, by the figures of the W25Q16JV and of the
//! RP2040 datasheet, and of what goes on on the chip meanwhile.

use super::super::bench::*;
use super::super::board::Board;
use super::super::clock::CYCLES_PER_US;
use super::super::reset::ResetCause;
use super::super::thumb::*;
use super::fixture::*;
use super::*;

const LINE_26: u32 = 16 + 26;
const ERASE: [u32; 4] = erase_arguments(OFFSET, SECTOR);
/// A call that returns with the chip not readable.
const UNFINISHED: [u16; 3] = [call(4), call(5), HANG];
const DMA_CHANNEL_0: u32 = 0x5000_0000;

/// `flash_exit_xip` before an operation: two loops of 2048 rounds, each of a SUB and a taken BNE, and ten bytes.
const EXIT_XIP_US: u64 = (2 * 2048 * 3 + 10 * BYTE_CYCLES) / CYCLES_PER_US;
/// The serial interface sends a bit in six cycles: the ROM sets its BAUDR to 6 (4.10.13, "Fsclk_out = Fssi_clk / SCKDV").
const BYTE_CYCLES: u64 = 8 * 6;
/// Write enable, command, address, data, and the last read of the status.
const PAGE_TRANSFER_US: u64 = (1 + 4 + 256 + 2) * BYTE_CYCLES / CYCLES_PER_US;
const PAGE_US: u64 = PAGE_TRANSFER_US + 400;

/// A little for the calls around an operation, and for the command of an erase.
const CALLS_US: u64 = 30;

/// A call takes what the ROM does before it, and `expected`.
fn assert_takes(measured: u64, expected: u64) {
    let expected = EXIT_XIP_US + expected;
    assert!(
        (expected..=expected + CALLS_US).contains(&measured),
        "{measured} us instead of {expected}"
    );
}

#[test]
// Requirement: R-5
fn a_page_takes_some_600_us_with_what_the_boot_rom_does() {
    let mut board = flash_board();
    let took = program(&mut board, OFFSET, &[0; 256]);
    // 98 µs of waits, 101 µs on the wires, 400 µs in the chip.
    assert!((600..615).contains(&took), "{took} us");
    assert_eq!(board.flash_operations()[0].duration_us, 400, "of the chip alone");
}

#[test]
fn an_erase_makes_a_sector_ones_and_leaves_its_neighbours() {
    let mut board = flash_board();
    board.write_flash(OFFSET - 1, &[0x55; SECTOR as usize + 2]);
    assert_takes(erase(&mut board, OFFSET, SECTOR), 45_000);
    let mut expected = vec![0xff; SECTOR as usize + 2];
    expected[0] = 0x55;
    expected[SECTOR as usize + 1] = 0x55;
    assert_eq!(board.read_flash(OFFSET - 1, SECTOR as usize + 2), expected);
    assert_eq!(
        board.read_memory(0x1000_0000 + OFFSET, 4),
        [0xff; 4],
        "as it is read by address"
    );
}

#[test]
fn a_program_only_clears_bits() {
    let mut board = flash_board();
    assert_takes(program(&mut board, OFFSET, &[0b1100; 256]), PAGE_US);
    assert_takes(program(&mut board, OFFSET, &[0b1010; 256]), PAGE_US);
    assert_eq!(
        board.read_flash(OFFSET, 257),
        [vec![0b1000; 256], vec![0xff]].concat()
    );
    erase(&mut board, OFFSET, SECTOR);
    assert_eq!(board.read_flash(OFFSET, 256), [0xff; 256]);
}

#[test]
fn each_page_and_each_sector_takes_its_time() {
    let mut board = flash_board();
    assert_takes(program(&mut board, OFFSET, &[0; 5 * 256]), 5 * PAGE_US);
    assert_takes(erase(&mut board, OFFSET, 17 * SECTOR), 17 * 45_003);
    board.flash_timing(FlashTiming::MAXIMUM);
    assert_takes(program(&mut board, OFFSET, &[0; 256]), PAGE_TRANSFER_US + 3_000);
    assert_takes(erase(&mut board, OFFSET, SECTOR), 400_000);
    start(&mut board, b"RE", [OFFSET, 1 << 16, 1 << 16, 0xd8]);
    assert_takes(finish(&mut board), 2_000_000);
}

#[test]
fn a_block_is_erased_at_once_where_it_is_aligned_and_fits() {
    let mut board = flash_board();
    start(&mut board, b"RE", [OFFSET - SECTOR, 18 * SECTOR, 1 << 16, 0xd8]);
    assert_takes(finish(&mut board), 150_000 + 2 * 45_000);
    let operations = board.take_flash_operations();
    let kinds: Vec<_> = operations
        .iter()
        .map(|one| (one.kind, one.offset, one.length))
        .collect();
    assert_eq!(
        kinds,
        [
            (FlashOperationKind::SectorErase, OFFSET - SECTOR, SECTOR),
            (FlashOperationKind::BlockErase, OFFSET, 1 << 16),
            (FlashOperationKind::SectorErase, OFFSET + (1 << 16), SECTOR),
        ]
    );
    assert_eq!(board.flash_erase_counts().len(), 18);
}

#[test]
fn operations_are_recorded_with_their_time_and_erases_are_counted() {
    let mut board = flash_board();
    board.run_for(1000);
    erase(&mut board, OFFSET, SECTOR);
    erase(&mut board, OFFSET, 2 * SECTOR);
    program(&mut board, OFFSET, &[0; 256]);
    let counts: Vec<_> = board.flash_erase_counts().iter().collect();
    assert_eq!(counts, [(&OFFSET, &2), (&(OFFSET + SECTOR), &1)]);
    let operations = board.flash_operations();
    assert_eq!(operations.len(), 4);
    let first = operations[0];
    assert!((1000 + EXIT_XIP_US..1000 + EXIT_XIP_US + CALLS_US).contains(&first.time_us));
    assert_eq!((first.duration_us, first.cut), (45_000, None));
    assert_eq!(operations[3].kind, FlashOperationKind::PageProgram);
}

#[test]
fn flash_outlasts_a_reset_and_a_power_cycle() {
    let mut board = flash_board();
    program(&mut board, OFFSET, &[7; 256]);
    board.press_run();
    board.power_cycle();
    assert_eq!(board.read_flash(OFFSET, 256), [7; 256]);
    assert_eq!(board.flash_operations().len(), 1);
}

#[test]
fn an_interrupt_that_comes_during_an_erase_is_served_after_it() {
    let mut board = flash_board();
    start_erase(&mut board, OFFSET, SECTOR);
    board.run_for(20_000);
    pend_line_26(&mut board);
    board.run_for(24_900);
    assert!(board.flash_is_busy());
    assert_eq!((board.register(7), board.bus.chip.nvic.pending), (0, 1 << 26));
    finish(&mut board);
    board.run_for(10);
    assert_eq!(board.register(7), 1);
}

#[test]
#[should_panic(expected = "flash is read at")]
fn an_interrupt_handler_in_flash_during_an_erase_is_a_failure() {
    let mut board = flash_board();
    start_code(&mut board, &UNFINISHED, b"RE", ERASE);
    board.run_for(20_000);
    pend_line_26(&mut board);
    board.run_for(10);
}

#[test]
fn an_interrupt_handler_in_ram_runs_during_an_erase() {
    const TABLE: u32 = RAM + 0x4000;
    const HANDLER: u32 = RAM + 0x5000;
    let mut board = flash_board();
    board.bus.chip.ppb.vtor = TABLE;
    board.write_memory(TABLE + 4 * LINE_26, &(HANDLER | 1).to_le_bytes());
    board.write_memory(
        HANDLER,
        &(u32::from(adds(7, 1)) | u32::from(BX_LR) << 16).to_le_bytes(),
    );
    let driver = [NOP, call(4), call(5), call(6), call(8), NOP, HANG];
    start_code(&mut board, &driver, b"RE", ERASE);
    board.run_for(20_000);
    pend_line_26(&mut board);
    board.run_for(10);
    assert_eq!((board.register(7), board.flash_is_busy()), (1, true));
    assert_takes(finish(&mut board), 45_000 - 20_010);
}

#[test]
fn a_receiver_overruns_during_an_erase() {
    let mut board = flash_board();
    start_uart0(&mut board);
    select_function(&mut board, 0, FUNCTION_UART);
    select_function(&mut board, 1, FUNCTION_UART);
    start_erase(&mut board, OFFSET, SECTOR);
    // 8.68 ms on the wire, for a FIFO of 32.
    let bytes: Vec<u8> = (0..100).collect();
    board.uart_send(0, 1000, &bytes);
    board.run_for(9_700);
    assert!(board.flash_is_busy());
    assert_eq!(board.uart(0).overruns(), 68);
    finish(&mut board);
    let received: Vec<u8> = (0..32).map(|_| board.read_register(UART0) as u8).collect();
    assert_eq!(received, bytes[..32]);
}

fn start_dma(board: &mut Board, registers: [u32; 4]) {
    for (index, value) in (0..).zip(registers) {
        board.write_register(DMA_CHANNEL_0 + 4 * index, value);
    }
}

#[test]
fn dma_receives_into_a_ring_during_an_erase() {
    /// UARTDMACR.RXDMAE.
    const RECEIVE: u32 = 1;
    /// Bytes, into a ring of 64, at the pace of DREQ_UART0_RX (2.5.3.1).
    const RECEIVE_INTO_RING: u32 = 21 << 15 | 1 << 10 | 6 << 6 | 1 << 5 | 1;
    let mut board = flash_board();
    start_uart0(&mut board);
    board.write_register(UART0 + 0x48, RECEIVE);
    select_function(&mut board, 1, FUNCTION_UART);
    start_dma(&mut board, [UART0, DATA, 1 << 20, RECEIVE_INTO_RING]);
    start_erase(&mut board, OFFSET, SECTOR);
    let bytes: Vec<u8> = (0..100).collect();
    board.uart_send(0, 1000, &bytes);
    board.run_for(9_800);
    assert!(board.flash_is_busy());
    assert_eq!(board.uart(0).overruns(), 0);
    assert_eq!(board.read_register(DMA_CHANNEL_0 + 8), (1 << 20) - 100);
    assert_eq!(
        board.read_memory(DATA, 64),
        [&bytes[64..], &bytes[36..64]].concat()
    );
}

#[test]
fn the_timer_counts_and_dma_goes_on_during_an_erase() {
    const COPY_WORDS: u32 = 0x3f << 15 | 1 << 5 | 1 << 4 | 2 << 2 | 1;
    let mut board = flash_board();
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    board.write_register(WATCHDOG_TICK, TICK_1_US);
    board.write_memory(DATA, &[9; 400]);
    start_erase(&mut board, OFFSET, SECTOR);
    board.run_for(1000);
    start_dma(&mut board, [DATA, DATA + 400, 100, COPY_WORDS]);
    board.run_for(20_000);
    assert!(board.flash_is_busy());
    assert_eq!(board.read_memory(DATA + 400, 400), [9; 400]);
    assert_eq!(board.read_register(TIMER_RAWL), 21_000);
}

#[test]
fn the_watchdog_bites_during_an_erase_and_the_chip_starts_when_it_is_over() {
    let mut board = flash_board();
    board.write_flash(OFFSET, &[0; 2 * SECTOR as usize]);
    start_watchdog(&mut board, 20_000);
    start_erase(&mut board, OFFSET, 2 * SECTOR);
    board.run_for(EXIT_XIP_US + 44_000);
    assert_eq!(board.resets()[0].cause, ResetCause::WatchdogTimer);
    assert_eq!(board.resets()[0].time_us, 20_000);
    let before = board.instructions();
    board.run_for(900);
    assert_eq!(board.instructions(), before, "the boot ROM waits");
    board.run_for(200);
    assert_ne!(board.instructions(), before);
    assert_eq!((board.register(13), board.pc()), (STACK_TOP, MAIN));
    board.run_for(100_000);
    assert_eq!(board.read_flash(OFFSET, SECTOR as usize), [0xff; SECTOR as usize]);
    assert_eq!(
        board.read_flash(OFFSET + SECTOR, 1),
        [0],
        "the next sector was never begun"
    );
}

#[test]
fn code_that_was_erased_and_programmed_runs_as_written_last() {
    let page = |instruction: u16| {
        let mut page = vec![0xff; 256];
        page[..2].copy_from_slice(&instruction.to_le_bytes());
        page[2..4].copy_from_slice(&BX_LR.to_le_bytes());
        page
    };
    let run = |board: &mut Board| {
        board.set_register(9, 0x1000_0000 + OFFSET + 1);
        start_code(board, &[call(9), HANG], b"RE", [0; 4]);
        board.run_for(5);
    };
    let mut board = flash_board();
    program(&mut board, OFFSET, &page(adds(7, 1)));
    run(&mut board);
    erase(&mut board, OFFSET, SECTOR);
    program(&mut board, OFFSET, &page(adds(7, 16)));
    run(&mut board);
    assert_eq!(board.register(7), 17);
    board.write_flash(OFFSET, &page(adds(7, 32)));
    run(&mut board);
    assert_eq!(board.register(7), 49);
}

#[test]
fn a_worn_sector_keeps_its_bits_and_says_nothing() {
    let mut board = flash_board();
    board.write_flash(OFFSET, &[0x5a; 2 * SECTOR as usize]);
    board.wear_out_sector(OFFSET + 100);
    assert_takes(erase(&mut board, OFFSET, 2 * SECTOR), 2 * 45_000);
    program(&mut board, OFFSET, &[0; 256]);
    assert_eq!(board.read_flash(OFFSET, SECTOR as usize), [0x5a; SECTOR as usize]);
    assert_eq!(
        board.read_flash(OFFSET + SECTOR, 256),
        [0xff; 256],
        "its neighbour is fine"
    );
    board.power_cycle();
    erase(&mut board, OFFSET, SECTOR);
    assert_eq!(board.read_flash(OFFSET, 1), [0x5a], "permanently");
}

fn run_code(code: &[u16], function: &[u8; 2], arguments: [u32; 4]) {
    let mut board = flash_board();
    start_code(&mut board, code, function, arguments);
    board.run_for(100_000);
}

#[test]
#[should_panic(expected = "must be multiples of 4096")]
fn an_erase_that_is_not_aligned_is_a_failure() {
    run_code(&UNFINISHED, b"RE", erase_arguments(OFFSET + 256, SECTOR));
}

#[test]
#[should_panic(expected = "must be multiples of 256")]
fn a_program_of_a_part_of_a_page_is_a_failure() {
    run_code(&UNFINISHED, b"RP", [OFFSET, DATA, 100, 0]);
}

#[test]
#[should_panic(expected = "addresses start at 0")]
fn an_address_that_is_no_offset_is_a_failure() {
    run_code(&UNFINISHED, b"RE", erase_arguments(0x1000_0000, SECTOR));
}

#[test]
#[should_panic(expected = "without flash_exit_xip")]
fn a_chip_that_is_not_in_command_mode_is_a_failure() {
    run_code(&[call(5), HANG], b"RE", ERASE);
}

#[test]
#[should_panic(expected = "interface set up for reads: false")]
fn reading_flash_after_flash_exit_xip_is_a_failure() {
    run_code(&[call(4), load(0, 1), HANG], b"RE", [0, 0x1000_0000, 0, 0]);
}

#[test]
#[should_panic(expected = "not flushed after a change: true")]
fn reading_flash_without_a_flush_is_a_failure() {
    let code = [call(4), call(5), call(8), load(0, 3), HANG];
    run_code(&code, b"RP", [OFFSET, DATA, 256, 0x1000_0000]);
}
