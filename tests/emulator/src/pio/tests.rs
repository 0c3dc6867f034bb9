//! Tests of PIO against the datasheet: its programs, its figures, its registers.

use super::super::bench::*;
use super::super::board::Board;
use super::super::clock::cycles;
use super::super::thumb::idle_board;
use super::*;

const PIO1_BASE: u32 = 0x5030_0000;
const FUNCTION_PIO1: u32 = 7;
const PIN: u32 = 16;

const SET_ALIAS: u32 = 0x2000;
const CLEAR_ALIAS: u32 = 0x3000;

/// Side-set of one pin, OUT and SET to the same one, IN from it.
const ONE_PIN: u32 = 1 << 29 | 1 << 26 | 1 << 20 | PIN << 15 | PIN << 10 | PIN << 5 | PIN;
const NO_SIDE_SET: u32 = ONE_PIN & !(1 << 29);
const AUTOPULL_24_LEFT: u32 = 24 << 25 | 1 << 17;
const JOIN_TX: u32 = 1 << 30;
const JOIN_RX: u32 = 1 << 31;

const SET_PINDIRS_1: u16 = 0xe081;

/// The square wave of 3.2.2, as it is assembled there.
const SQUARE_WAVE: [u16; 4] = [SET_PINDIRS_1, 0xe101, 0xe000, 0x0001];

/// The WS2812 program of 3.6.2: T1 is 2, T2 is 5 and T3 is 3 cycles.
const WS2812: [u16; 4] = [0x6221, 0x1123, 0x1400, 0xa442];

fn pio() -> Pio {
    Pio::new(PioPlace {
        interrupt_line: 9,
        dma_request: 8,
    })
}

fn write(pio: &mut Pio, offset: u32, value: u32, now: Cycle) {
    pio.advance(now);
    pio.write(offset, RegisterWrite::plain(value), now);
}

fn read(pio: &mut Pio, offset: u32, now: Cycle) -> u32 {
    pio.advance(now);
    pio.read(offset, now)
}

fn register(machine: u32, offset: u32) -> u32 {
    SM0 + MACHINE_BYTES * machine + offset
}

fn load(pio: &mut Pio, first: u32, program: &[u16]) {
    for (address, &code) in (first..).zip(program) {
        write(pio, INSTR_MEM0 + 4 * address, u32::from(code), 0);
    }
}

/// A block whose state machine 0 has this program, and wraps after it.
fn with_program(program: &[u16], pin_control: u32, shift_control: u32) -> Pio {
    let mut pio = pio();
    load(&mut pio, 0, program);
    let wrap_top = program.len() as u32 - 1;
    write(&mut pio, register(0, EXECCTRL), wrap_top << 12, 0);
    write(&mut pio, register(0, PINCTRL), pin_control, 0);
    write(&mut pio, register(0, SHIFTCTRL), shift_control, 0);
    pio
}

/// The cycles at which the pin goes up and down.
fn edges(pio: &mut Pio) -> Vec<(Cycle, bool)> {
    let mut level = false;
    let mut edges = Vec::new();
    for (at, outputs) in pio.take_changes() {
        let now = outputs.level(PIN as usize) == Some(true);
        if now != level {
            edges.push((at, now));
        }
        level = now;
    }
    edges
}

fn square_wave(divider: u32, until: Cycle) -> Vec<Cycle> {
    let mut pio = with_program(&SQUARE_WAVE, NO_SIDE_SET, 0);
    write(&mut pio, register(0, CLKDIV), divider, 0);
    write(&mut pio, CTRL, 1, 0);
    pio.advance(until);
    edges(&mut pio).into_iter().map(|(at, _)| at).collect()
}

#[test]
fn registers_after_reset() {
    let mut pio = pio();
    for (offset, value) in [
        (CTRL, 0),
        (FSTAT, 0x0f00_0f00),
        (FDEBUG, 0),
        (FLEVEL, 0),
        (INTR, 0x0f0),
    ] {
        assert_eq!(read(&mut pio, offset, 0), value, "{offset:#x}");
    }
    for machine in 0..4 {
        let registers = [CLKDIV, EXECCTRL, SHIFTCTRL, ADDR, PINCTRL];
        assert_eq!(
            registers.map(|offset| read(&mut pio, register(machine, offset), 0)),
            [0x0001_0000, 0x0001_f000, 0x000c_0000, 0, 0x1400_0000]
        );
    }
}

/// "CLKDIV 2.5: 50 MHz" for the state machine, 12.5 MHz at the pin (3.2.2). A divider of 0 is 65536.
#[test]
fn the_square_wave_of_the_datasheet_has_two_divided_cycles_each_way() {
    for (divider, apart) in [(1 << 16, 2), (2 << 16 | 128 << 8, 5), (0, 2 * 65_536)] {
        let edges = square_wave(divider, 200 * apart);
        assert!(edges.len() > 190, "{} edges", edges.len());
        assert!(
            edges.windows(2).all(|pair| pair[1] - pair[0] == apart),
            "{edges:?}"
        );
    }
}

#[test]
fn a_fraction_makes_some_cycles_longer_by_one() {
    let edges = square_wave(15 << 16 | 160 << 8, 400_000);
    let (first, last) = (edges[0], edges[4000]);
    assert!(
        (last - first).abs_diff(125_000) <= 1,
        "4000 times 2 of 15.625 cycles"
    );
    let apart = edges.windows(2).map(|pair| pair[1] - pair[0]);
    assert!(apart.into_iter().all(|length| length == 31 || length == 32));
}

/// How long the line is high and low for each bit of what the WS2812 program of the datasheet sends.
fn ws2812_pulses(words: &[u32]) -> (Pio, Vec<(Cycle, Cycle)>) {
    let mut pio = with_program(&WS2812, ONE_PIN, AUTOPULL_24_LEFT | JOIN_TX);
    write(&mut pio, register(0, INSTR), u32::from(SET_PINDIRS_1), 0);
    for &word in words {
        write(&mut pio, TXF0, word, 0);
    }
    write(&mut pio, CTRL, 1, 0);
    pio.advance(10_000);
    let edges = edges(&mut pio);
    let ends = edges.iter().skip(2).step_by(2).map(|edge| edge.0).chain([NEVER]);
    let pulses = edges.chunks(2).zip(ends);
    let pulses = pulses.map(|(pulse, end)| (pulse[1].0 - pulse[0].0, end - pulse[1].0));
    (pio, pulses.collect())
}

#[test]
fn a_bit_of_the_ws2812_program_takes_ten_cycles() {
    let words = [0xa5c3_0f00, 0x0000_0100, 0xffff_ff00];
    let (_, pulses) = ws2812_pulses(&words);
    assert_eq!(pulses.len(), 3 * 24, "24 bits of each word");
    for (index, &(high, low)) in pulses.iter().enumerate() {
        let is_one = words[index / 24] >> (31 - index % 24) & 1 != 0;
        assert_eq!(high, if is_one { 7 } else { 2 }, "bit {index}");
        if index + 1 < pulses.len() {
            assert_eq!(high + low, 10, "bit {index}: no gap between words");
        }
    }
}

#[test]
fn it_then_waits_with_the_line_low_and_costs_nothing() {
    let (mut pio, _) = ws2812_pulses(&[0]);
    assert_eq!(pio.next_event(), NEVER);
    assert_eq!(pio.level(PIN as usize), Some(false));
    assert_eq!(read(&mut pio, FDEBUG, 10_000), 1 << 24, "TXSTALL");
    write(&mut pio, TXF0, 0, 20_000);
    write(&mut pio, FDEBUG, 1 << 24, 20_002);
    assert_eq!(read(&mut pio, FDEBUG, 20_010), 0, "it goes on");
    pio.advance(30_000);
    let edges = edges(&mut pio);
    assert_eq!(edges.len(), 48);
    // The refill takes a cycle, then OUT has three with the line low (3.5.4.2).
    assert_eq!(edges[0].0, 20_000 + 1 + 1 + 3);
}

#[test]
fn a_fifo_has_four_places_and_eight_when_joined() {
    for (shift_control, tx, rx_full) in [(0, 4, false), (JOIN_TX, 8, true), (JOIN_RX, 0, false)] {
        let mut pio = with_program(&WS2812, ONE_PIN, shift_control);
        for _ in 0..tx {
            assert_eq!(pio.dma_requests() & 1 << 8, 1 << 8, "DREQ_PIO1_TX0");
            write(&mut pio, TXF0, 1, 0);
        }
        assert_eq!(pio.dma_requests() & 1 << 8, 0);
        assert_eq!(read(&mut pio, FLEVEL, 0), tx);
        let status = read(&mut pio, FSTAT, 0);
        assert_eq!((bit(status, 16), bit(status, 0)), (true, rx_full));
        assert_eq!(read(&mut pio, FDEBUG, 0), 0);
        write(&mut pio, TXF0, 2, 0);
        assert_eq!(read(&mut pio, FDEBUG, 0), 1 << 16, "TXOVER");
        assert_eq!(read(&mut pio, FLEVEL, 0), tx);
        write(&mut pio, register(0, SHIFTCTRL), 3 << 30, 0);
        assert_eq!(read(&mut pio, FLEVEL, 0), 0, "a change of FJOIN clears");
    }
}

#[test]
fn a_disabled_machine_holds_its_pin_and_its_place() {
    let mut pio = with_program(&SQUARE_WAVE, NO_SIDE_SET, 0);
    write(&mut pio, CTRL, 1, 0);
    let pc = |pio: &mut Pio, now| read(pio, register(0, ADDR), now);
    while pio.level(PIN as usize) != Some(true) {
        let next = pio.next_event();
        pio.advance(next);
    }
    let now = 100;
    pio.advance(now);
    let held = (pio.level(PIN as usize), pc(&mut pio, now));
    pio.write(CTRL, RegisterWrite::to_address(CLEAR_ALIAS, 1), now);
    pio.advance(1000);
    assert_eq!((pio.level(PIN as usize), pc(&mut pio, 1000)), held);
    pio.write(CTRL, RegisterWrite::to_address(SET_ALIAS, 1), 1000);
    assert_ne!(pio.next_event(), NEVER);
    pio.reset(1001);
    assert_eq!(pio.level(PIN as usize), None);
}

#[test]
fn a_decrementing_jump_decrements_zero_too() {
    // set x, 2; jmp x-- 1; in x, 32; push block (3.4.2.2).
    let mut pio = with_program(&[0xe022, 0x0041, 0x4020, 0x8020], NO_SIDE_SET, 0);
    write(&mut pio, CTRL, 1, 0);
    pio.advance(5);
    assert!(bit(read(&mut pio, FSTAT, 5), 8), "three rounds");
    pio.advance(6);
    assert_eq!(read(&mut pio, RXF0, 6), u32::MAX);
    assert_eq!(read(&mut pio, RXF0, 6), 0);
    assert_eq!(read(&mut pio, FDEBUG, 6) & 0xf00, 1 << 8, "RXUNDER");
}

#[test]
fn restarting_a_machine_keeps_its_program_counter() {
    // set x, 2; set y, 3; jmp 2.
    let mut pio = with_program(&[0xe022, 0xe043, 0x0002], NO_SIDE_SET, 0);
    write(&mut pio, CTRL, 1, 0);
    pio.advance(10);
    write(&mut pio, CTRL, 1 | 1 << 4, 10);
    assert_eq!(read(&mut pio, register(0, ADDR), 10), 2);
    assert_eq!(read(&mut pio, CTRL, 10), 1, "the restart bit clears itself");
}

#[test]
fn what_is_written_to_instr_is_executed_at_once() {
    let mut pio = with_program(&[0x0000], NO_SIDE_SET, 0);
    write(&mut pio, register(0, INSTR), u32::from(SET_PINDIRS_1), 5);
    assert_eq!(pio.level(PIN as usize), Some(false), "disabled, all the same");
    write(&mut pio, register(0, INSTR), 0xe001, 6);
    assert_eq!(pio.level(PIN as usize), Some(true));
    // pull block: the FIFO is empty.
    write(&mut pio, register(0, INSTR), 0x80a0, 7);
    assert!(bit(read(&mut pio, register(0, EXECCTRL), 7), EXEC_STALLED));
    write(&mut pio, TXF0, 1, 20);
    pio.advance(22);
    assert!(!bit(read(&mut pio, register(0, EXECCTRL), 22), EXEC_STALLED));
    assert_eq!(pio.next_event(), NEVER, "it is still disabled");
}

#[test]
fn a_stopped_machine_takes_x_and_y_through_its_fifo() {
    // out pins, 1; jmp x-- 0: with autopull of 32 bits to the left.
    let mut pio = with_program(&[0x6001, 0x0040], NO_SIDE_SET, 1 << 17);
    write(&mut pio, register(0, INSTR), u32::from(SET_PINDIRS_1), 0);
    // out x, 32 and out y, 32 (3.4.5), each with its word in the FIFO.
    for (at, value, code) in [(10, 3, 0x6020), (20, 0xffff_fff0, 0x6040)] {
        write(&mut pio, TXF0, value, at);
        write(&mut pio, register(0, INSTR), code, at + 2);
        assert!(!bit(read(&mut pio, register(0, EXECCTRL), at + 6), EXEC_STALLED));
        assert_eq!(read(&mut pio, FLEVEL, at + 6), 0);
    }
    // in y, 32; push noblock.
    write(&mut pio, register(0, INSTR), 0x4040, 30);
    write(&mut pio, register(0, INSTR), 0x8000, 31);
    assert_eq!(read(&mut pio, RXF0, 32), 0xffff_fff0);
    // jmp 0, and four bits: X was 3.
    write(&mut pio, register(0, INSTR), 0x0000, 33);
    write(&mut pio, TXF0, 0xaaaa_aaaa, 34);
    write(&mut pio, CTRL, 1, 35);
    pio.advance(44);
    let rises = edges(&mut pio).into_iter().filter(|edge| edge.1);
    assert_eq!(rises.count(), 2);
    assert_eq!(read(&mut pio, register(0, ADDR), 44), 0, "wrapped");
}

#[test]
fn input_bits_are_pushed_at_the_threshold_and_stall_when_the_fifo_is_full() {
    // in pins, 1, shifted to the left, autopush after 8 bits.
    let mut pio = with_program(&[0x4001], NO_SIDE_SET, 8 << 20 | 1 << 16);
    pio.set_inputs(1 << PIN, 0);
    write(&mut pio, CTRL, 1, 0);
    pio.advance(4);
    pio.set_inputs(0, 4);
    pio.advance(8);
    assert_eq!(pio.dma_requests() & 1 << 12, 1 << 12, "DREQ_PIO1_RX0");
    pio.advance(1000);
    assert_eq!(read(&mut pio, FLEVEL, 1000), 4 << 4);
    assert_eq!(read(&mut pio, FDEBUG, 1000), 1, "RXSTALL");
    assert_eq!(pio.next_event(), NEVER);
    assert_eq!(read(&mut pio, RXF0, 1000), 0xf0);
    assert_eq!(read(&mut pio, RXF0, 1000), 0);
}

#[test]
fn machines_wait_for_each_other_by_flags() {
    // Machine 0: irq wait 4; set pins, 1. Machine 1, from 4: set x, 9; jmp x-- 5; wait 1 irq 4; jmp 7.
    let mut pio = with_program(&[0xc024, 0xe001, 0x0002], NO_SIDE_SET, 0);
    load(&mut pio, 4, &[0xe029, 0x0045, 0x20c4, 0x0007]);
    write(&mut pio, register(0, INSTR), u32::from(SET_PINDIRS_1), 0);
    write(&mut pio, register(1, INSTR), 0x0004, 0);
    write(&mut pio, CTRL, 0b11, 0);
    pio.advance(9);
    assert_eq!(read(&mut pio, IRQ, 9), 1 << 4, "raised, and not lowered yet");
    assert_eq!(pio.level(PIN as usize), Some(false));
    pio.advance(30);
    assert_eq!(read(&mut pio, IRQ, 30), 0);
    assert_eq!(pio.level(PIN as usize), Some(true));
}

#[test]
fn a_flag_reaches_the_interrupt_line_it_is_enabled_for() {
    // irq 0 rel in machine 0.
    let mut pio = with_program(&[0xc010, 0x0001], NO_SIDE_SET, 0);
    write(&mut pio, IRQ1_INTS - 8, 1 << 8, 0);
    write(&mut pio, CTRL, 1, 0);
    pio.advance(3);
    assert_eq!(pio.interrupt_lines(), 1 << 10, "PIO1_IRQ_1");
    write(&mut pio, IRQ, 1, 3);
    assert_eq!(pio.interrupt_lines(), 0);
}

#[test]
fn out_mov_and_exec_reach_registers_and_pins() {
    // pull block; out y, 8; mov x, !y; mov isr, ::x; push block.
    let mut pio = with_program(&[0x80a0, 0x6048, 0xa02a, 0xa0d1, 0x8020], NO_SIDE_SET, 1 << 19);
    write(&mut pio, TXF0, 0x0000_120f, 0);
    write(&mut pio, CTRL, 1, 0);
    pio.advance(20);
    assert_eq!(read(&mut pio, RXF0, 20), (!0x0fu32).reverse_bits());
    // out exec, 16 of set pindirs, 1; then of set pins, 1.
    let mut pio = with_program(&[0x80a0, 0x60f0, 0x60f0], NO_SIDE_SET, 1 << 19);
    write(&mut pio, TXF0, 0xe001 << 16 | u32::from(SET_PINDIRS_1), 0);
    write(&mut pio, CTRL, 1, 0);
    pio.advance(20);
    assert_eq!(pio.level(PIN as usize), Some(true));
}

/// A board with the WS2812 program in PIO1, at 8 MHz, on GP16.
fn lamp_board() -> Board {
    let mut board = idle_board();
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    for (address, code) in (0..).zip(WS2812) {
        board.write_register(PIO1_BASE + INSTR_MEM0 + 4 * address, u32::from(code));
    }
    for (offset, value) in [
        (CLKDIV, 15 << 16 | 160 << 8),
        (EXECCTRL, 3 << 12),
        (SHIFTCTRL, AUTOPULL_24_LEFT | JOIN_TX),
        (PINCTRL, ONE_PIN),
        (INSTR, u32::from(SET_PINDIRS_1)),
    ] {
        board.write_register(PIO1_BASE + register(0, offset), value);
    }
    board.write_register(PIO1_BASE + CTRL, 1);
    board
}

#[test]
fn a_pin_shows_its_block_when_that_is_its_function() {
    let mut board = lamp_board();
    assert_eq!(board.pin_level(PIN as usize), None);
    select_function(&mut board, PIN, FUNCTION_PIO1);
    assert_eq!(board.pin_level(PIN as usize), Some(false));
    board.record_pin(PIN as usize);
    board.write_register(PIO1_BASE + TXF0, 0xff00_ff00);
    board.run_for(100);
    let edges = board.take_edges(PIN as usize);
    assert_eq!(edges.len(), 48);
    let rises: Vec<Cycle> = edges.iter().step_by(2).map(|edge| edge.0).collect();
    let length = rises[23] - rises[0];
    assert!(length.abs_diff(23 * 10 * 125 / 8) <= 1, "1.25 us a bit (3.6.2)");
    board.write_register(PADS_BANK0 + 4 + 4 * PIN, 1 << 7);
    assert_eq!(
        board.pin_level(PIN as usize),
        None,
        "the pad's output is disabled"
    );
}

#[test]
fn its_edges_do_not_depend_on_what_the_processor_does() {
    let mut board = lamp_board();
    select_function(&mut board, PIN, FUNCTION_PIO1);
    board.record_pin(PIN as usize);
    board.write_register(PIO1_BASE + TXF0, 0xa5a5_a500);
    // Nothing looks at the pin before the end.
    board.run_for(100);
    let asleep = board.take_edges(PIN as usize);
    board.write_register(PIO1_BASE + CTRL, 1 | 1 << 8);
    let start = board.time_cycles();
    board.write_register(PIO1_BASE + TXF0, 0xa5a5_a500);
    for _ in 0..100 {
        board.run_for(1);
    }
    let looked_at = board.take_edges(PIN as usize);
    let apart = |edges: &[(Cycle, bool)]| -> Vec<Cycle> {
        edges.windows(2).map(|pair| pair[1].0 - pair[0].0).collect()
    };
    assert_eq!(looked_at.len(), asleep.len());
    assert!(looked_at[0].0 > start);
    let differences = apart(&looked_at).into_iter().zip(apart(&asleep));
    assert!(
        differences
            .into_iter()
            .all(|(one, other)| one.abs_diff(other) <= 1),
        "the fraction's cycle"
    );
}

#[test]
fn an_input_comes_from_the_pad() {
    // wait 1 gpio 16; push noblock.
    let mut board = idle_board();
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    for (address, code) in [(0, 0x2090), (1, 0x8000), (2, 0x0002)] {
        board.write_register(PIO1_BASE + INSTR_MEM0 + 4 * address, code);
    }
    board.write_register(PIO1_BASE + CTRL, 1);
    board.pulses(PIN as usize, 50, 100, 200, 1);
    let level = |board: &mut Board| board.read_register(PIO1_BASE + FLEVEL);
    board.run_for(49);
    assert_eq!(level(&mut board), 0);
    board.run_for(2);
    assert_eq!(level(&mut board), 1 << 4);
    assert!(board.time_cycles() <= cycles(60));
}

/// SPI with one data line, as drivers of the Pico W's radio have it: X + 1 bits out, Y + 1 bits in, then an input waited for.
const HALF_DUPLEX_SPI: [u16; 8] = [
    0x6001, // out pins, 1      side 0
    0x1040, // jmp x-- 0        side 1
    0xe080, // set pindirs, 0   side 0
    0xa042, // nop              side 0
    0x5001, // in pins, 1       side 1
    0x0084, // jmp y-- 4        side 0
    0x20a0, // wait 1 pin 0     side 0
    0xc000, // irq 0            side 0
];
const CLOCK_PIN: u32 = PIN + 1;
const AUTOPULL_AND_AUTOPUSH_LEFT: u32 = 0b11 << 16;

/// The program at the start of a transfer of two words out and one in.
fn transfer() -> Pio {
    let pins = NO_SIDE_SET & !(0x1f << 10) | 1 << 29 | CLOCK_PIN << 10;
    let mut pio = with_program(&HALF_DUPLEX_SPI, pins, AUTOPULL_AND_AUTOPUSH_LEFT);
    write(&mut pio, register(0, CLKDIV), 2 << 16, 0);
    write(
        &mut pio,
        register(0, PINCTRL),
        pins & !(0x1f << 5) | CLOCK_PIN << 5,
        0,
    );
    write(&mut pio, register(0, INSTR), u32::from(SET_PINDIRS_1), 0);
    write(&mut pio, register(0, PINCTRL), pins, 0);
    for (at, value, code) in [(10, 63, 0x6020), (20, 31, 0x6040)] {
        write(&mut pio, TXF0, value, at);
        write(&mut pio, register(0, INSTR), code, at);
    }
    write(&mut pio, register(0, INSTR), u32::from(SET_PINDIRS_1), 30);
    write(&mut pio, register(0, INSTR), 0x0000, 30);
    write(&mut pio, TXF0, 0xdead_beef, 30);
    write(&mut pio, TXF0, 0x0123_4567, 30);
    pio.take_changes();
    write(&mut pio, CTRL, 1, 40);
    pio
}

/// Level of FIFOs, flags and pins at a moment.
fn seen(pio: &mut Pio, now: Cycle) -> [u32; 3] {
    [FLEVEL, IRQ, INTR].map(|offset| read(pio, offset, now))
}

#[test]
fn nothing_but_pins_changes_before_the_next_event() {
    let (mut slow, mut fast) = (transfer(), transfer());
    let mut events = 0;
    let mut before = seen(&mut slow, 40);
    for now in 41..1000 {
        if fast.next_event() == now {
            fast.advance(now);
            events += 1;
            assert_eq!(seen(&mut slow, now), seen(&mut fast, now), "{now}");
        } else {
            assert_eq!(seen(&mut slow, now), before, "{now}");
        }
        before = seen(&mut slow, now);
    }
    assert_eq!(slow.take_changes(), fast.take_changes());
    assert_eq!(read(&mut fast, FLEVEL, 1000), 1 << 4, "one word came in");
    assert!(events < 30, "{events} events for 96 bits");
}

/// Gives the next bit of a word at each falling edge of the clock after 64 bits were sent to it.
struct Slave {
    clock: bool,
    received: u64,
    falls: u32,
    answer: u32,
}

impl PinDevice for Slave {
    fn follow(&mut self, outputs: Outputs, _now: Cycle) {
        let clock = outputs.level(CLOCK_PIN as usize) == Some(true);
        if clock && !self.clock && self.falls < 64 {
            self.received = self.received << 1 | u64::from(bit(outputs.high, PIN));
        }
        self.falls += u32::from(self.clock && !clock);
        self.clock = clock;
    }

    fn levels(&self) -> Outputs {
        let is_high = match self.falls {
            0..64 => return Outputs::default(),
            falls => bit(self.answer.rotate_left(falls - 64), 31),
        };
        Outputs {
            driven: 1 << PIN,
            high: u32::from(is_high) << PIN,
        }
    }

    fn advance(&mut self, _now: Cycle) {}

    fn next_event(&self) -> Cycle {
        NEVER
    }
}

#[test]
fn a_device_answers_from_one_cycle_to_the_next() {
    let mut pio = transfer();
    let mut slave = Slave {
        clock: false,
        received: 0,
        falls: 0,
        answer: 0xc0de_1dea,
    };
    pio.advance_with(&mut slave, 1000);
    assert_eq!(slave.received, 0xdead_beef_0123_4567);
    assert_eq!(pio.read(RXF0, 1000), 0xc0de_1dea);
    assert_eq!(pio.read(IRQ, 1000), 1, "the line is high after the answer");
}
