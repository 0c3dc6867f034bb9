//! Tests of the DMA against datasheet 2.5, moving real data over the bus of a board.

use super::super::adc::AdcInput;
use super::super::bench::{ALL_BLOCKS, FUNCTION_UART, RESETS_CLEAR, UART1, select_function, set_up_uart};
use super::super::board::Board;
use super::super::peripheral::Peripheral;
use super::super::register::RegisterWrite;
use super::super::thumb::idle_board;
use super::{CHANNEL_MASK as ALL, Dma};

const DMA: u32 = 0x5000_0000;
const FROM: u32 = 0x2000_1000;
const TO: u32 = 0x2000_2000;
const UNMAPPED: u32 = 0x3000_0000;

const READ_ADDR: u32 = 0x0;
const WRITE_ADDR: u32 = 0x4;
const TRANS_COUNT: u32 = 0x8;
const CTRL_TRIG: u32 = 0xc;
const AL1_CTRL: u32 = 0x10;
const INTR: u32 = 0x400;
const INTE0: u32 = 0x404;
const INTS0: u32 = 0x40c;
const CHAN_ABORT: u32 = 0x444;

const EN: u32 = 1;
const HALF: u32 = 1 << 2;
const WORD: u32 = 2 << 2;
const INCR_READ: u32 = 1 << 4;
const INCR_WRITE: u32 = 1 << 5;
const RING_WRITE_8_BYTES: u32 = 3 << 6 | 1 << 10;
const PERMANENT: u32 = 63 << 15;
const IRQ_QUIET: u32 = 1 << 21;
const BUSY: u32 = 1 << 24;
/// As fast as it can, in sequence.
const COPY: u32 = EN | INCR_READ | INCR_WRITE | PERMANENT;
const UARTDMACR: u32 = UART1 + 0x48;

const fn chain_to(channel: u32) -> u32 {
    channel << 11
}

/// The source holds 0, 1, 2, ...
fn board() -> Board {
    let mut board = idle_board();
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    board.write_memory(FROM, &(0..=255).collect::<Vec<u8>>());
    board.write_memory(TO, &[0xee; 256]);
    board
}

fn write(board: &mut Board, channel: u32, register: u32, value: u32) {
    board.write_register(DMA + 0x40 * channel + register, value);
}

fn read(board: &mut Board, channel: u32, register: u32) -> u32 {
    board.read_register(DMA + 0x40 * channel + register)
}

fn set_up(board: &mut Board, channel: u32, count: u32) {
    write(board, channel, READ_ADDR, FROM);
    write(board, channel, WRITE_ADDR, TO);
    write(board, channel, TRANS_COUNT, count);
}

#[test]
fn copies_bytes_one_a_cycle_and_raises_its_interrupt() {
    let mut board = board();
    board.write_register(DMA + INTE0, 1);
    set_up(&mut board, 0, 100);
    write(&mut board, 0, CTRL_TRIG, COPY);
    assert_ne!(read(&mut board, 0, CTRL_TRIG) & BUSY, 0);
    assert_eq!(read(&mut board, 0, TRANS_COUNT), 100);
    board.run_for(2);
    assert_eq!(read(&mut board, 0, CTRL_TRIG) & BUSY, 0);
    assert_eq!(
        board.read_memory(TO, 101),
        [(0..100).collect::<Vec<u8>>(), vec![0xee]].concat()
    );
    assert_eq!(
        (read(&mut board, 0, READ_ADDR), read(&mut board, 0, WRITE_ADDR)),
        (FROM + 100, TO + 100)
    );
    assert_eq!(board.read_register(DMA + INTS0), 1);
    assert_ne!(board.bus.soc.interrupt_lines() & 1 << 11, 0, "DMA_IRQ_0");
    board.write_register(DMA + INTS0, 1);
    assert_eq!(board.read_register(DMA + INTR), 0);
}

#[test]
fn there_is_one_transfer_a_cycle_however_often_one_asks() {
    let mut dma = Dma::new();
    for (register, value) in [(TRANS_COUNT, 2), (CTRL_TRIG, EN | PERMANENT)] {
        dma.write(register, RegisterWrite::plain(value), 0);
    }
    let transfer = dma.next_transfer(ALL, 0, 10).expect("it is ready");
    dma.complete(transfer, Ok(()), 10);
    assert_eq!(dma.next_transfer(ALL, 0, 10), None);
    assert_eq!(dma.next_transfer_time(ALL, 0), 11);
    assert_eq!(dma.next_transfer(ALL, 0, 11), Some(transfer));
}

#[test]
fn sizes_and_ring() {
    let mut board = board();
    set_up(&mut board, 0, 3);
    write(&mut board, 0, CTRL_TRIG, COPY | HALF);
    board.run_for(1);
    assert_eq!(board.read_memory(TO, 6), [0, 1, 2, 3, 4, 5]);
    set_up(&mut board, 1, 3);
    let ring = COPY | WORD | RING_WRITE_8_BYTES | chain_to(1);
    write(&mut board, 1, CTRL_TRIG, ring);
    board.run_for(1);
    assert_eq!(
        board.read_memory(TO, 9),
        [8, 9, 10, 11, 4, 5, 6, 7, 0xee],
        "the third wraps to the first"
    );
}

#[test]
fn the_last_register_of_each_alias_group_triggers() {
    // CTRL_TRIG, AL1_TRANS_COUNT_TRIG, AL2_WRITE_ADDR_TRIG, AL3_READ_ADDR_TRIG.
    let ctrl = COPY | chain_to(3);
    for (offset, value) in [(CTRL_TRIG, ctrl), (0x1c, 4), (0x2c, TO), (0x3c, FROM)] {
        let mut board = board();
        set_up(&mut board, 3, 4);
        write(&mut board, 3, AL1_CTRL, ctrl);
        board.run_for(1);
        assert_eq!(board.read_memory(TO, 1), [0xee], "AL1_CTRL does not trigger");
        write(&mut board, 3, offset, value);
        board.run_for(1);
        assert_eq!(board.read_memory(TO, 5), [0, 1, 2, 3, 0xee], "{offset:#x}");
    }
}

#[test]
fn a_channel_chains_to_another_and_quiet_ones_raise_no_interrupt() {
    let mut board = board();
    set_up(&mut board, 0, 4);
    set_up(&mut board, 5, 2);
    write(&mut board, 5, WRITE_ADDR, TO + 4);
    write(&mut board, 5, AL1_CTRL, COPY | chain_to(5));
    write(&mut board, 0, CTRL_TRIG, COPY | chain_to(5) | IRQ_QUIET);
    board.run_for(1);
    assert_eq!(board.read_memory(TO, 7), [0, 1, 2, 3, 0, 1, 0xee]);
    assert_eq!(board.read_register(DMA + INTR), 1 << 5);
}

#[test]
fn a_null_trigger_of_a_quiet_channel_raises_its_interrupt_and_moves_nothing() {
    let mut board = board();
    set_up(&mut board, 2, 4);
    write(&mut board, 2, AL1_CTRL, COPY | chain_to(2) | IRQ_QUIET);
    write(&mut board, 2, 0x3c, 0);
    board.run_for(1);
    assert_eq!(board.read_register(DMA + INTR), 1 << 2);
    assert_eq!(board.read_memory(TO, 1), [0xee]);
}

#[test]
fn a_bus_error_halts_the_channel_and_is_no_fault_of_the_processor() {
    let mut board = board();
    set_up(&mut board, 0, 4);
    write(&mut board, 0, READ_ADDR, UNMAPPED);
    write(&mut board, 0, CTRL_TRIG, EN | PERMANENT);
    board.run_for(1);
    let ctrl = read(&mut board, 0, CTRL_TRIG);
    assert_eq!((ctrl >> 29, ctrl & BUSY), (0b110, 0), "READ_ERROR and AHB_ERROR");
    assert_eq!(board.read_register(DMA + INTR), 1);
    assert_eq!(board.bus_errors()[0].address, UNMAPPED);
    assert_eq!(board.active_exception(), 0);
}

#[test]
fn abort_stops_a_channel_that_waits() {
    let mut board = board();
    set_up(&mut board, 0, 4);
    write(&mut board, 0, CTRL_TRIG, EN | 21 << 15);
    board.run_for(1);
    assert_ne!(read(&mut board, 0, CTRL_TRIG) & BUSY, 0, "no request from UART0");
    board.write_register(DMA + CHAN_ABORT, 1);
    assert_eq!(read(&mut board, 0, CTRL_TRIG) & BUSY, 0);
}

const ADC: u32 = 0x4004_c000;
const ADC_FCS: u32 = ADC + 0x8;
const FCS_OVER: u32 = 1 << 11;

/// Channel 0 brings samples of channel 0 of the converter, 500,000 a second, to TO; the code of each is the time in microseconds.
fn sampling_board(count: u32) -> Board {
    const DREQ_ADC: u32 = 36 << 15;
    let mut board = board();
    board.adc_input(0, AdcInput::CodeAt(Box::new(|micros| micros as u16)));
    board.write_register(ADC, 1);
    board.write_register(ADC_FCS, 1 | 1 << 3 | 1 << 24);
    set_up(&mut board, 0, count);
    write(&mut board, 0, READ_ADDR, ADC + 0xc);
    write(&mut board, 0, CTRL_TRIG, EN | HALF | INCR_WRITE | DREQ_ADC);
    board.run_for(10);
    board.write_register(ADC, 1 | 1 << 3);
    board
}

fn samples(board: &Board, count: usize) -> Vec<u16> {
    let bytes = board.read_memory(TO, 2 * count);
    let halves = bytes.chunks(2);
    halves
        .map(|half| u16::from_le_bytes([half[0], half[1]]))
        .collect()
}

#[test]
fn adc_samples_arrive_at_the_pace_of_the_converter() {
    let mut board = sampling_board(16);
    board.run_for(31);
    assert_ne!(read(&mut board, 0, CTRL_TRIG) & BUSY, 0, "15 conversions so far");
    board.run_for(2);
    assert_eq!(read(&mut board, 0, CTRL_TRIG) & BUSY, 0);
    let samples = samples(&board, 16);
    assert!(
        samples.windows(2).all(|pair| pair[1] == pair[0] + 2),
        "{samples:?}"
    );
}

/// "Any conversion that completes whilst the FIFO is full will be lost" (4.9.2.4).
#[test]
fn the_fifo_overruns_while_the_dma_is_held() {
    let mut board = sampling_board(100);
    board.run_for(11);
    board.hold_dma();
    board.run_for(16);
    assert_eq!(board.read_register(ADC_FCS) & FCS_OVER, 0, "eight are held");
    board.run_for(4);
    assert_ne!(board.read_register(ADC_FCS) & FCS_OVER, 0);
    assert_eq!(read(&mut board, 0, TRANS_COUNT), 95);
    board.release_dma();
    board.run_for(4);
    let times: Vec<u16> = samples(&board, 16).iter().map(|code| code - 10).collect();
    assert_eq!(times[..13], [0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24]);
    assert_eq!(times[13], 30, "two were lost");
}

#[test]
fn a_transfer_that_fails_halts_its_channel() {
    let mut board = sampling_board(100);
    board.run_for(11);
    board.fail_dma_transfer(0);
    board.run_for(4);
    let ctrl = read(&mut board, 0, CTRL_TRIG);
    assert_eq!((ctrl >> 29, ctrl & BUSY), (0b110, 0), "READ_ERROR and AHB_ERROR");
    assert_eq!(read(&mut board, 0, TRANS_COUNT), 95);
    write(&mut board, 0, CTRL_TRIG, ctrl);
    board.run_for(4);
    let ctrl = read(&mut board, 0, CTRL_TRIG);
    assert_eq!((ctrl >> 29, ctrl & BUSY), (0, BUSY), "it was one transfer only");
}

#[test]
fn resets_stops_what_runs_and_a_fault_outlasts_it() {
    const RESETS_SET: u32 = 0x4000_e000;
    const DMA_RESET: u32 = 1 << 2;
    let mut board = sampling_board(100);
    board.run_for(11);
    board.hold_dma();
    board.write_register(RESETS_SET, DMA_RESET);
    board.run_for(10);
    board.write_register(RESETS_CLEAR, DMA_RESET);
    assert_eq!(read(&mut board, 0, CTRL_TRIG), 0);
    assert_eq!(read(&mut board, 0, TRANS_COUNT), 0);
    set_up(&mut board, 1, 4);
    write(&mut board, 1, CTRL_TRIG, COPY | chain_to(1));
    board.run_for(10);
    assert_eq!(read(&mut board, 1, TRANS_COUNT), 4, "held");
    board.release_dma();
    board.run_for(10);
    assert_eq!(read(&mut board, 1, TRANS_COUNT), 0);
}

#[test]
fn uart_data_goes_out_at_the_pace_of_the_wire() {
    const DREQ_UART1_TX: u32 = 22 << 15;
    let mut board = board();
    select_function(&mut board, 8, FUNCTION_UART);
    set_up_uart(&mut board, UART1);
    board.write_register(UARTDMACR, 2);
    set_up(&mut board, 11, 200);
    write(&mut board, 11, WRITE_ADDR, UART1);
    let send = EN | INCR_READ | DREQ_UART1_TX | chain_to(11);
    write(&mut board, 11, CTRL_TRIG, send);
    board.run_for(20_000);
    let sent = board.uart(1).take_sent();
    let bytes: Vec<u8> = sent.iter().map(|sent| sent.byte).collect();
    assert_eq!(bytes, (0..200).collect::<Vec<u8>>());
    assert_eq!(sent[199].end - sent[0].start, 200 * 10850);
}

/// Chaining (2.5.2.2), a ring for the write address (2.5.1), a trigger by TRANS_COUNT in its alias group (2.5.2.1): the first
/// channel receives six bytes at a time, the second one writes 6 into the first one's count whenever that has ended.
#[test]
fn a_second_channel_starts_one_that_receives_into_a_ring_again_and_again() {
    const DREQ_UART1_RX: u32 = 23 << 15;
    const AL1_TRANS_COUNT_TRIG: u32 = 0x1c;
    let mut board = board();
    select_function(&mut board, 9, FUNCTION_UART);
    set_up_uart(&mut board, UART1);
    board.write_register(UARTDMACR, 1);
    write(&mut board, 0, READ_ADDR, UART1);
    write(&mut board, 0, WRITE_ADDR, TO);
    let receive = EN | INCR_WRITE | RING_WRITE_8_BYTES | DREQ_UART1_RX | IRQ_QUIET;
    write(&mut board, 0, AL1_CTRL, receive | chain_to(1));
    board.write_memory(FROM, &6u32.to_le_bytes());
    write(&mut board, 1, READ_ADDR, FROM);
    write(&mut board, 1, WRITE_ADDR, DMA + AL1_TRANS_COUNT_TRIG);
    write(&mut board, 1, TRANS_COUNT, 1);
    let rearm = EN | WORD | chain_to(1) | PERMANENT | IRQ_QUIET;
    write(&mut board, 1, CTRL_TRIG, rearm);

    board.uart_send(1, 100, &(1..=20).collect::<Vec<u8>>());
    board.run_for(2000);
    assert_eq!(board.uart(1).overruns(), 0);
    assert_eq!(read(&mut board, 0, TRANS_COUNT), 4, "two of the fourth six");
    assert_eq!(read(&mut board, 0, WRITE_ADDR), TO + 20 % 8);
    assert_eq!(board.read_memory(TO, 9), [17, 18, 19, 20, 13, 14, 15, 16, 0xee]);
    assert_ne!(read(&mut board, 0, CTRL_TRIG) & BUSY, 0, "it goes on");
    assert_eq!(board.read_register(DMA + INTR), 0, "without an interrupt");
}
