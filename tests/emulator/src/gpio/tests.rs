//! Tests of the inputs and their interrupts against datasheet 2.19, by registers and on a board.

use rp2040_emu::core::CoreBus;

use super::super::bench::*;
use super::super::board::Board;
use super::super::clock::{NEVER, cycles};
use super::super::peripheral::Peripheral;
use super::super::register::RegisterWrite;
use super::super::thumb::{BX_LR, HANG, WFI, adds, back, board, idle_board, load, store};
use super::registers::*;
use super::*;

const LINE: u32 = 1 << 13;
const LEVEL_LOW: u32 = 1;
const LEVEL_HIGH: u32 = 1 << 1;
const ALL_PINS: u32 = 0x3fff_ffff;
const PULL_UP_AND_INPUT: u32 = 1 << 3 | 1 << 6;
const SIO_GPIO_IN: u32 = 0xd000_0004;

fn inputs() -> Gpio {
    let mut gpio = Gpio::default();
    let pads = PadState {
        input_enabled: ALL_PINS,
        ..PadState::default()
    };
    gpio.set_pads(pads, BusLevels::default());
    gpio
}

fn write(gpio: &mut Gpio, offset: u32, value: u32) {
    gpio.write(offset, RegisterWrite::plain(value), 0);
}

/// Input `pin` as its four bits of INTR show it.
fn events(gpio: &mut Gpio, pin: u32) -> u32 {
    gpio.read(INTR0 + 4 * (pin / 8), 0) >> (4 * (pin % 8)) & 0xf
}

#[test]
fn levels_are_what_they_are_and_edges_stay_until_they_are_cleared() {
    let mut gpio = inputs();
    assert_eq!(events(&mut gpio, 9), LEVEL_LOW);
    gpio.connect(9, PinWire::High);
    assert_eq!(events(&mut gpio, 9), LEVEL_HIGH | EDGE_HIGH);
    gpio.connect(9, PinWire::Low);
    assert_eq!(events(&mut gpio, 9), LEVEL_LOW | EDGE_HIGH | EDGE_LOW);
    assert_eq!(events(&mut gpio, 8) | events(&mut gpio, 10), LEVEL_LOW);
    write(&mut gpio, INTR0 + 4, (EDGE_HIGH | LEVEL_LOW) << 4);
    assert_eq!(events(&mut gpio, 9), LEVEL_LOW | EDGE_LOW);
    gpio.connect(10, PinWire::High);
    assert_eq!(events(&mut gpio, 9), LEVEL_LOW | EDGE_LOW);
}

#[test]
fn an_output_wins_against_a_wire() {
    for (driven_high, level) in [(0, 0), (1 << 2, 1 << 2)] {
        let mut gpio = Gpio::default();
        let pads = PadState {
            driven: 1 << 2,
            driven_high,
            input_enabled: ALL_PINS,
            ..PadState::default()
        };
        gpio.set_pads(pads, BusLevels::default());
        for wire in [PinWire::Low, PinWire::High, PinWire::Open] {
            gpio.connect(2, wire);
            assert_eq!(gpio.levels(), level, "{wire:?}");
        }
    }
}

#[test]
fn an_enabled_event_raises_line_13_until_it_is_cleared_or_disabled() {
    let mut gpio = inputs();
    gpio.connect(29, PinWire::High);
    assert_eq!(gpio.interrupt_lines(), 0, "not enabled");
    let edge = EDGE_HIGH << 20;
    write(&mut gpio, PROC0_INTE0 + 12, edge);
    assert_eq!(
        (gpio.interrupt_lines(), gpio.read(PROC0_INTS0 + 12, 0)),
        (LINE, edge)
    );
    write(&mut gpio, INTR0 + 12, edge);
    assert_eq!((gpio.interrupt_lines(), gpio.read(PROC0_INTS0 + 12, 0)), (0, 0));
    write(&mut gpio, PROC0_INTE0 + 12, LEVEL_HIGH << 20);
    write(&mut gpio, INTR0 + 12, u32::MAX);
    assert_eq!(gpio.interrupt_lines(), LINE, "a level cannot be cleared");
    write(&mut gpio, PROC0_INTE0 + 12, 0);
    assert_eq!(gpio.interrupt_lines(), 0);
}

#[test]
fn registers_have_the_bits_of_their_pins() {
    let mut gpio = inputs();
    for (register, bits) in [(8, u32::MAX), (12, 0x00ff_ffff)] {
        write(&mut gpio, PROC0_INTE0 + register, u32::MAX);
        assert_eq!(
            gpio.read(PROC0_INTE0 + register, 0),
            bits,
            "pins 24 to 29 in the last"
        );
    }
}

#[test]
fn pulses_come_at_their_times_and_are_over_after_their_number() {
    let mut gpio = inputs();
    let pulses = Pulses {
        first_rise: 100,
        high: 20,
        period: 50,
        count: 2,
    };
    let changes: Vec<_> = pulses.changes().collect();
    changes.iter().for_each(|&(at, wire)| gpio.schedule(at, 7, wire));
    let mut seen = Vec::new();
    while gpio.next_event() != NEVER {
        let now = gpio.next_event();
        gpio.advance(now - 1);
        let before = gpio.levels();
        gpio.advance(now);
        seen.push((now, before >> 7, gpio.levels() >> 7));
    }
    assert_eq!(seen, [(100, 0, 1), (120, 1, 0), (150, 0, 1), (170, 1, 0)]);
}

#[test]
#[should_panic(expected = "a pulse is high for a part of its period")]
fn pulses_longer_than_their_period_are_refused() {
    idle_board().pulses(7, 0, 10, 10, 1);
}

#[test]
fn a_reset_forgets_edges_and_enables_and_keeps_the_wire() {
    let mut gpio = inputs();
    gpio.connect(3, PinWire::High);
    gpio.schedule(10, 3, PinWire::Low);
    write(&mut gpio, PROC0_INTE0, EDGE_HIGH << 12);
    gpio.reset(5);
    assert_eq!((events(&mut gpio, 3), gpio.interrupt_lines()), (LEVEL_HIGH, 0));
    gpio.advance(10);
    assert_eq!(events(&mut gpio, 3), LEVEL_LOW | EDGE_LOW);
}

/// A board that counts the interrupts of line 13 in R7 and clears the edges of GP7, asleep meanwhile.
fn edge_counter(edges: u32) -> Board {
    let handler = [adds(7, 1), store(0, 1), BX_LR];
    let mut board = board(&[WFI, back(1)], &[(16 + 13, &handler)]);
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    board.set_register(7, 0);
    board.set_register(0, (EDGE_LOW | EDGE_HIGH) << 28);
    board.set_register(1, IO_BANK0 + INTR0);
    board.write_register(IO_BANK0 + PROC0_INTE0, edges << 28);
    board.bus.store_system_control(0xe000_e100, LINE);
    board
}

#[test]
fn a_sleeping_processor_is_woken_by_every_edge_it_asked_for() {
    for (edges, interrupts) in [(EDGE_HIGH, 1000), (EDGE_LOW | EDGE_HIGH, 2000)] {
        let mut board = edge_counter(edges);
        let end = board.pulses(7, 1000, 30, 100, 1000);
        assert_eq!(end, 1000 + 999 * 100 + 30);
        board.run_for(1000 - 1);
        assert_eq!(board.register(7), 0);
        board.run_for(6);
        assert_eq!(board.register(7), 1);
        board.run_until_time(end + 10);
        assert_eq!(board.register(7), interrupts);
        assert!(
            board.awake_cycles() < board.time_cycles() / 4,
            "it slept in between"
        );
    }
}

#[test]
fn edges_while_the_block_is_in_reset_are_lost() {
    let mut board = idle_board();
    board.drive_pin(7, PinWire::High);
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    assert_eq!(board.read_register(IO_BANK0 + INTR0) >> 28, LEVEL_HIGH);
    board.drive_pin(7, PinWire::Low);
    assert_eq!(board.read_register(IO_BANK0 + INTR0) >> 28, LEVEL_LOW | EDGE_LOW);
}

#[test]
fn registers_have_aliases_and_others_of_the_block_are_where_they_were() {
    let mut board = idle_board();
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    let inte0 = IO_BANK0 + PROC0_INTE0;
    board.write_register(inte0 + 0x2000, 0xf0);
    board.write_register(inte0 + 0x3000, 0x30);
    assert_eq!(board.read_register(inte0), 0xc0);
    select_function(&mut board, 7, FUNCTION_SIO);
    assert_eq!(board.read_register(IO_BANK0 + 8 * 7 + 4), FUNCTION_SIO);
}

#[test]
fn a_wire_in_the_air_is_pulled_and_a_disabled_input_is_low() {
    let mut board = idle_board();
    let is_high = |board: &mut Board| board.bus.read32(SIO_GPIO_IN) & 1 << 7 != 0;
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    assert!(!is_high(&mut board), "pulled down after reset");
    let pad = PADS_BANK0 + 4 + 4 * 7;
    for (pad_value, wire, expected) in [
        (PULL_UP_AND_INPUT, PinWire::Open, true),
        (PULL_UP_AND_INPUT, PinWire::Low, false),
        (PULL_UP_AND_INPUT, PinWire::Open, true),
        (1 << 3, PinWire::Open, false),
    ] {
        board.write_register(pad, pad_value);
        board.drive_pin(7, wire);
        assert_eq!(is_high(&mut board), expected, "pad {pad_value:#x}, {wire:?}");
    }
}

#[test]
fn the_processor_reads_wires_and_its_own_outputs() {
    // SIO GPIO_OUT_SET is at 0xd0000014, GPIO_OE_SET at 0xd0000024 (datasheet 2.3.1.7).
    let mut board = board(&[store(0, 1), store(0, 2), load(3, 4), HANG], &[]);
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    select_function(&mut board, 2, FUNCTION_SIO);
    for (register, value) in [(0, 1 << 2), (1, 0xd000_0014), (2, 0xd000_0024), (4, SIO_GPIO_IN)] {
        board.set_register(register, value);
    }
    board.drive_pin(20, PinWire::High);
    board.drive_pin(2, PinWire::Low);
    board.run_for(10);
    assert_eq!(
        board.register(3),
        1 << 2 | 1 << 20,
        "the output wins against the wire"
    );
}

#[test]
fn a_change_is_there_at_its_time_while_the_processor_runs() {
    // Reads the inputs without end.
    let mut board = board(&[load(3, 4), back(1)], &[]);
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    board.set_register(4, SIO_GPIO_IN);
    board.pulses(20, 50, 100, 200, 1);
    board.run_for(50);
    assert_eq!(board.register(3), 0);
    board.run_for(1);
    assert_eq!(board.register(3), 1 << 20);
    assert_eq!(board.time_cycles() / cycles(1), 51);
}

/// Input enable alone, without the pull-down of the reset value (2.19.6.3).
#[test]
fn an_input_without_a_wire_and_a_pull_is_noise() {
    let mut board = edge_counter(EDGE_LOW);
    select_function(&mut board, 7, FUNCTION_SIO);
    board.run_for(10_000);
    assert_eq!(board.register(7), 0, "pulled down");
    board.write_register(PADS_BANK0 + 4 + 4 * 7, 1 << 6);
    board.run_for(10_000);
    let edges = board.register(7);
    assert!((40..200).contains(&edges), "{edges} edges in 10 ms");
    board.write_register(PADS_BANK0 + 4 + 4 * 7, PULL_UP_AND_INPUT);
    board.run_for(100);
    let edges = board.register(7);
    board.run_for(10_000);
    assert_eq!(board.register(7), edges, "pulled up");
    board.write_register(PADS_BANK0 + 4 + 4 * 7, 1 << 6);
    board.drive_pin(7, PinWire::High);
    board.run_for(100);
    let edges = board.register(7);
    board.run_for(10_000);
    assert_eq!(board.register(7), edges, "driven");
}

/// The interrupts of a pin follow its level whatever its function is (2.19.3).
#[test]
fn a_start_bit_at_a_uarts_pin_is_an_edge() {
    let mut board = edge_counter(EDGE_LOW);
    start_uart0(&mut board);
    select_function(&mut board, 1, FUNCTION_UART);
    set_registers(&mut board, [(0, EDGE_LOW << 4), (1, IO_BANK0 + INTR0)]);
    board.write_register(IO_BANK0 + PROC0_INTE0, EDGE_LOW << 4);
    let over = board.uart_send(0, 1000, b"\xff\x55");
    board.run_for(1000 - 1);
    assert_eq!(board.register(7), 0);
    board.run_for(6);
    assert_eq!(board.register(7), 1, "the start bit");
    board.run_until_time(over + 10);
    assert_eq!(
        board.register(7),
        1 + 5,
        "the start bit of 0x55 and its four zeros"
    );
}
