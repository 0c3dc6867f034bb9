//! Tests of wires at pins, and of unmodelled blocks.

use super::bench::*;
use super::board::Board;
use super::pins::UartPins;
use super::thumb::{HANG, NOP, board, idle_board, store};

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
fn the_wire_can_be_soldered_to_other_pins_each_of_which_works_alone() {
    let mut board = idle_board();
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    set_up_uart(&mut board, UART1);
    board.wire_uart(1, UartPins { tx: 4, rx: 5 });
    // Its receive interrupt.
    board.write_register(UART1 + 0x38, 1 << 4);
    let has_received = |board: &mut Board| board.read_register(UART1 + 0x18) & 1 << 4 == 0;
    board.uart_send(1, 1000, b"lost");
    board.run_for(2000);
    assert!(!has_received(&mut board), "GP5 is not the UART's");
    select_function(&mut board, 5, FUNCTION_UART);
    let bytes: Vec<u8> = (0..20).collect();
    let over = board.uart_send(1, 3000, &bytes);
    assert_eq!(over, 3000 + 20 * 10850 / 125);
    board.run_until_time(over);
    let lines = board.bus.soc.interrupt_lines();
    assert_eq!(lines, 1 << 21, "20 of 32, trigger at 16");
    let received: Vec<u8> = (0..20).map(|_| board.read_register(UART1) as u8).collect();
    assert_eq!(received, bytes);
    assert!(!has_received(&mut board), "no more than that");
    select_function(&mut board, 4, FUNCTION_UART);
    board.write_register(UART1, u32::from(b'x'));
    board.run_for(200);
    assert_eq!(board.uart(1).take_sent().len(), 1);
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
    set_registers(&mut board, [(0, 1 << 2), (1, 0xd000_0014), (2, 0xd000_0024)]);
    board.run_for(10);
    assert_eq!(board.pin_level(2), Some(true));
    assert_eq!(board.pin_level(3), None);
}

#[test]
fn unmodelled_blocks_read_back_and_are_recorded() {
    let mut board = idle_board();
    board.write_register(SPI0, 5);
    assert!(board.unmodelled().is_empty(), "held in reset, the write is lost");
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    board.write_register(SPI0, 5);
    board.write_register(SPI0 + 0x2000, 2);
    assert_eq!(board.read_register(SPI0), 7);
    let access = &board.unmodelled()["SPI0"];
    assert_eq!((access.reads, access.writes, access.first_address), (1, 2, SPI0));
}

#[test]
fn edges_of_a_recorded_pin_have_their_times() {
    // SIO GPIO_OUT_XOR is at 0xd000001c (datasheet 2.3.1.7).
    let toggle = store(0, 1);
    // All toggles are in one line of flash, the second.
    let code = [NOP, NOP, NOP, store(0, 2), toggle, NOP, toggle, toggle, HANG];
    let mut board = board(&code, &[]);
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    select_function(&mut board, 16, FUNCTION_SIO);
    set_registers(&mut board, [(0, 1 << 16), (1, 0xd000_001c), (2, 0xd000_0024)]);
    board.record_pin(16);
    board.record_pin(17);
    board.run_for(10);
    let edges = board.take_edges(16);
    assert_eq!(
        edges.iter().map(|&(_, level)| level).collect::<Vec<_>>(),
        [true, false, true]
    );
    let [first, second] = [0, 1].map(|index| edges[index + 1].0 - edges[index].0);
    assert_eq!(first, second + 1, "a NOP is between the first two");
    assert!(board.take_edges(16).is_empty(), "taken");
    assert!(board.take_edges(17).is_empty());
}
