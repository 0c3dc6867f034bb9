//! Tests of the stream of results: that it makes no difference when it is advanced, and that all of it is at its own time.

use super::adc::{AdcFault, AdcInput};
use super::bench::*;
use super::board::Board;
use super::clock::{Cycle, cycles, from_adc_clock};
use super::thumb::{HANG, MAIN, adds, back, board, idle_board, load, store};

const ADC_CS: u32 = 0x4004_c000;
const ADC_FCS: u32 = 0x4004_c008;
const ADC_FIFO: u32 = 0x4004_c00c;
const ADC_DIV: u32 = 0x4004_c010;
const ADC_RESET: u32 = 1;
const DREQ_ADC: u32 = 36 << 15;

const DMA: u32 = 0x5000_0000;
const DMA_TRANS_COUNT: u32 = DMA + 8;
const DMA_CTRL: u32 = DMA + 0xc;
const DMA_INTE0: u32 = DMA + 0x404;
const DMA_IRQ_0: u32 = 11;
const IRQ_QUIET: u32 = 1 << 21;
const EN: u32 = 1;
const HALF: u32 = 1 << 2;
const WORD: u32 = 2 << 2;
const INCR_READ: u32 = 1 << 4;
const INCR_WRITE: u32 = 1 << 5;
const PERMANENT: u32 = 63 << 15;

/// 256 halfwords.
const RING: u32 = RAM + 0x2000;
const RING_RESULTS: u64 = 256;
const RING_WRITE: u32 = 9 << 6 | 1 << 10;
const COUNT_WORD: u32 = RAM + 0x1000;
/// Results until the first channel is started again.
const COUNT: u64 = 10;
/// INT 2933: 61.125 µs a conversion.
const PACE: u32 = 2933;

/// The channels' code at a time. Never 0.
fn code_at(channel: usize, micros: u64) -> u16 {
    (channel as u16) << 10 | (micros % 1000) as u16 | 1
}

/// Four inputs in turn, moved into the ring by channel 0, which channel 1 starts again. Returns when the first one is converted.
fn start_stream(board: &mut Board, quiet: u32) -> Cycle {
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    for channel in 0..4 {
        let code = move |micros| code_at(channel, micros);
        board.adc_input(channel, AdcInput::CodeAt(Box::new(code)));
    }
    board.write_memory(RING, &[0; 2 * RING_RESULTS as usize]);
    board.write_memory(COUNT_WORD, &(COUNT as u32).to_le_bytes());
    board.write_register(ADC_CS, 1);
    board.write_register(ADC_DIV, PACE << 8);
    board.write_register(ADC_FCS, 1 | 1 << 2 | 1 << 3 | 1 << 24);
    let fill = EN | HALF | INCR_WRITE | RING_WRITE | 1 << 11 | DREQ_ADC | quiet;
    let restart = EN | WORD | 1 << 11 | PERMANENT | IRQ_QUIET;
    for (offset, value) in [(0, ADC_FIFO), (4, RING), (0x10, fill)] {
        board.write_register(DMA + offset, value);
    }
    for (offset, value) in [(0, COUNT_WORD), (4, DMA + 0x1c), (8, 1), (0xc, restart)] {
        board.write_register(DMA + 0x40 + offset, value);
    }
    board.run_for(10);
    board.write_register(ADC_CS, 1 | 1 << 3 | 0xf << 16);
    board.time_cycles()
}

fn ring(board: &Board) -> Vec<u16> {
    let bytes = board.read_memory(RING, 2 * RING_RESULTS as usize);
    let halves = bytes.chunks(2);
    halves
        .map(|half| u16::from_le_bytes([half[0], half[1]]))
        .collect()
}

/// The start of a conversion, in cycles.
fn start_of(first: Cycle, conversion: u64) -> Cycle {
    first + from_adc_clock(conversion * u64::from(PACE + 1))
}

#[test]
fn each_input_is_sampled_at_its_own_instant_however_long_the_processor_sleeps() {
    let mut board = idle_board();
    let first = start_stream(&mut board, IRQ_QUIET);
    board.run_until_time(60_000_000);
    // With a pace of whole cycles the last ones would be 2.9 ms late.
    let done = (0..).find(|&number| start_of(first, number) + cycles(2) > cycles(60_000_000));
    let done = done.expect("it ends");
    assert_eq!(board.adc_conversions(), done);
    let expected = |place: u64| {
        let number = (0..done).rev().find(|number| number % RING_RESULTS == place);
        number.map(|number| code_at((number % 4) as usize, start_of(first, number) / 125))
    };
    let expected: Vec<u16> = (0..RING_RESULTS)
        .map(|place| expected(place).unwrap_or(0))
        .collect();
    assert_eq!(ring(&board), expected);
    let left = u64::from(board.read_register(DMA_TRANS_COUNT));
    assert_eq!(left, COUNT - done % COUNT);
}

/// A processor that writes down what it reads of a register, word by word. Returns that, and the times of the conversions.
fn polled(register: u32, quiet: u32) -> (Vec<u8>, Vec<Cycle>) {
    const SEEN: u32 = RAM + 0x8000;
    let program = [load(0, 5), store(0, 6), adds(6, 4), back(3)];
    let mut board = board(&program, &[]);
    set_registers(&mut board, [(5, register), (6, SEEN)]);
    start_stream(&mut board, quiet);
    // An interrupt that the NVIC holds back. With it, each result is an event for the scheduler.
    board.write_register(DMA_INTE0, 1);
    board.run_for(900);
    let starts = board.take_adc_record();
    (
        board.read_memory(SEEN, 0x2_0000),
        starts.iter().map(|conversion| conversion.start).collect(),
    )
}

#[test]
fn the_processor_sees_every_change_in_the_same_cycle_as_if_each_was_an_event() {
    for register in [DMA_TRANS_COUNT, DMA + 4, ADC_CS, ADC_FCS, ADC_CS + 4] {
        let (seen, starts) = polled(register, IRQ_QUIET);
        assert_eq!(starts.len(), 15);
        let words: Vec<_> = seen.chunks(4).filter(|word| *word != [0; 4]).collect();
        assert!(words.len() > 8_000, "{register:#x}: {}", words.len());
        assert!((seen, starts) == polled(register, 0), "{register:#x}");
    }
}

/// Ring, registers, counts and sent bytes of a board whose ring is sent by a UART, after a run that is cut into pieces.
fn run(mut board: Board, pieces: &[u64]) -> (Vec<u16>, [u32; 4], u64, u64, Vec<u8>) {
    start_stream(&mut board, IRQ_QUIET);
    select_function(&mut board, 0, FUNCTION_UART);
    set_up_uart(&mut board, UART0);
    board.write_register(UART0 + 0x48, 2);
    let send = EN | INCR_READ | 2 << 11 | 20 << 15 | IRQ_QUIET;
    for (offset, value) in [(0, RING), (4, UART0), (8, 200), (0xc, send)] {
        board.write_register(DMA + 0x80 + offset, value);
    }
    for (number, &micros) in pieces.iter().enumerate() {
        board.run_for(micros);
        if number == 0 {
            board.adc_fault(AdcFault::LostConversions(3));
        }
    }
    let registers = [DMA_TRANS_COUNT, DMA_CTRL, ADC_CS, ADC_FCS];
    (
        ring(&board),
        registers.map(|register| board.read_register(register)),
        board.adc_conversions(),
        board.instructions(),
        board.uart(0).take_sent().iter().map(|sent| sent.byte).collect(),
    )
}

#[test]
fn how_often_one_looks_makes_no_difference() {
    let pieces = [1234, 766, 1, 99, 134]
        .into_iter()
        .chain([1; 1000])
        .chain([18_000]);
    let pieces: Vec<u64> = pieces.collect();
    for board in [idle_board, counting_board] {
        let whole = run(board(), &[1234, 20_000]);
        assert_eq!(whole.2, 348);
        assert!(whole.4[50..].iter().any(|byte| *byte != 0), "results are sent");
        assert!(whole == run(board(), &pieces));
    }
}

#[test]
fn ram_is_behind_by_100_microseconds_at_most_while_the_processor_executes() {
    const NOTED: u32 = RAM + 0x1800;
    for place in 0..20 {
        // Waits for a result in the ring, and notes the time.
        const COMPARE_0_WITH_0: u16 = 0x2800;
        const BRANCH_IF_EQUAL_OVER_THREE_BACK: u16 = 0xd0fc;
        let mut board = board(
            &[
                load(0, 5),
                COMPARE_0_WITH_0,
                BRANCH_IF_EQUAL_OVER_THREE_BACK,
                load(1, 6),
                store(1, 7),
                HANG,
            ],
            &[],
        );
        set_registers(&mut board, [(5, RING + 4 * place), (6, TIMER_RAWL), (7, NOTED)]);
        board.write_register(WATCHDOG_TICK, TICK_1_US);
        let first = start_stream(&mut board, IRQ_QUIET);
        let timer_starts = board.time_us() - u64::from(board.read_register(TIMER_RAWL));
        board.run_for(4_000);
        let noted = u64::from(board.read_word(NOTED)) + timer_starts;
        let result = (start_of(first, 2 * u64::from(place)) + cycles(2)) / 125;
        assert!(
            (result..=result + 102).contains(&noted),
            "{place}: {noted} of {result}"
        );
    }
}

#[test]
fn a_reset_of_the_converter_keeps_the_results_until_then_and_no_later_ones() {
    let mut board = idle_board();
    let first = start_stream(&mut board, IRQ_QUIET);
    board.run_for(3_000);
    board.write_register(RESETS_SET, ADC_RESET);
    let results = ring(&board).iter().filter(|code| **code != 0).count() as u64;
    let expected = (board.time_cycles() - first) / 7640 + 1;
    assert_eq!(results, expected);
    board.run_for(3_000);
    board.write_register(RESETS_CLEAR, ADC_RESET);
    board.run_for(3_000);
    assert_eq!(board.adc_conversions(), results);
}

#[test]
fn the_processor_resets_the_converter_and_keeps_the_results_until_then() {
    const COUNT_DOWN: [u16; 2] = [0x3801, 0xd1fd];
    const CYCLES_A_ROUND: u64 = 4;
    for rounds in (3_000..20_000).step_by(900) {
        let [subtract, branch] = COUNT_DOWN;
        let mut board = board(&[subtract, branch, store(1, 2), HANG], &[]);
        let first = start_stream(&mut board, IRQ_QUIET);
        set_registers(
            &mut board,
            [(0, rounds), (1, ADC_RESET), (2, RESETS_SET), (15, MAIN)],
        );
        board.run_for(3_000);
        let reset_at = first + u64::from(rounds) * CYCLES_A_ROUND;
        let converted = (0..).find(|&number| start_of(first, number) + cycles(2) > reset_at);
        let results = ring(&board).iter().filter(|code| **code != 0).count() as u64;
        assert_eq!(
            (Some(results), board.adc_conversions()),
            (converted, results),
            "{rounds}"
        );
    }
}

#[test]
fn a_change_at_an_input_counts_from_then_on() {
    let mut board = idle_board();
    let first = start_stream(&mut board, IRQ_QUIET);
    board.run_for(1_000);
    let before = (board.time_cycles() - first) / 7640 + 1;
    (0..4).for_each(|channel| board.adc_input(channel, AdcInput::Code(4095)));
    board.run_for(1_000);
    let ring = ring(&board);
    assert!(ring.iter().position(|code| *code == 4095) == Some(before as usize));
    assert!(
        ring[before as usize..]
            .iter()
            .all(|code| [0, 4095].contains(code))
    );
}

#[test]
fn an_interrupt_of_the_channel_comes_when_it_is_due() {
    let mut board = idle_board();
    let first = start_stream(&mut board, 0);
    board.write_register(DMA_INTE0, 1);
    let is_pending = |board: &mut Board| board.bus.soc.interrupt_lines() & 1 << DMA_IRQ_0 != 0;
    assert!(board.run_until(10_000, is_pending));
    assert_eq!(board.time_cycles(), start_of(first, COUNT - 1) + cycles(2));
}

/// Nothing of it may be late where results leave the chip.
#[test]
fn results_that_go_to_a_uart_are_sent_when_they_are_converted() {
    let mut board = idle_board();
    let first = start_stream(&mut board, IRQ_QUIET);
    select_function(&mut board, 0, FUNCTION_UART);
    // 1,250,000 baud: a byte takes 8 µs.
    for (offset, value) in [(0x24, 6), (0x28, 16), (0x2c, 0x70), (0x30, 0x301)] {
        board.write_register(UART0 + offset, value);
    }
    board.write_register(DMA + 4, UART0);
    board.write_register(DMA + 0x10, EN | DREQ_ADC | IRQ_QUIET);
    board.run_for(400);
    let starts: Vec<Cycle> = board.uart(0).take_sent().iter().map(|sent| sent.start).collect();
    let results: Vec<Cycle> = (0..5).map(|number| start_of(first, number) + cycles(2)).collect();
    assert!(starts.len() >= 5, "{starts:?}");
    for (start, result) in starts.iter().zip(results) {
        assert!((result..result + 200).contains(start), "{starts:?} {result}");
    }
}
