//! Tests of the PL011 against datasheet 4.2, by its registers and its wire.

use super::super::clock::{Cycle, cycles};
use super::super::peripheral::Peripheral;
use super::super::register::RegisterWrite;
use super::registers::*;
use super::*;

const PLACE: UartPlace = UartPlace {
    interrupt_line: 20,
    dma_request_tx: 20,
    dma_request_rx: 21,
};
const LCR_8N1: u32 = 0b11 << 5;
const LCR_FEN: u32 = 1 << 4;
const ENABLE_ALL: u32 = 1 << CR_UARTEN | 1 << CR_TXE | 1 << CR_RXE;
/// A bit at 115200 baud from 125 MHz: 16 × (67 + 52/64) cycles.
const BIT: Cycle = 1085;
const TRIGGER_1_8: u32 = 0;
const TRIGGER_7_8: u32 = 4;

fn connected(is_connected: bool) -> PinConnection {
    PinConnection {
        tx: is_connected,
        rx: is_connected,
        rx_pull: Pull::None,
    }
}

fn write(uart: &mut Uart, offset: u32, value: u32, now: Cycle) {
    uart.advance(now);
    uart.write(offset, RegisterWrite::plain(value), now);
    uart.advance(now);
}

fn read(uart: &mut Uart, offset: u32, now: Cycle) -> u32 {
    uart.advance(now);
    uart.read(offset, now)
}

/// 115200 8N1 with FIFOs, both pins connected, all interrupts enabled.
fn uart(lcr_h: u32) -> Uart {
    let mut uart = Uart::new(PLACE, Line::default());
    uart.set_pins(connected(true), 0);
    write(&mut uart, UARTIBRD, 67, 0);
    write(&mut uart, UARTFBRD, 52, 0);
    write(&mut uart, UARTLCR_H, lcr_h, 0);
    write(&mut uart, UARTIFLS, TRIGGER_7_8 << 3 | TRIGGER_1_8, 0);
    write(&mut uart, UARTIMSC, ALL_INTERRUPTS, 0);
    write(&mut uart, UARTCR, ENABLE_ALL, 0);
    uart
}

fn send_to(uart: &mut Uart, bytes: &[u8], start: Cycle) {
    let bit = uart.programmed_bit().expect("a baud rate");
    uart.send_to_chip(bytes, start, bit);
}

#[test]
fn a_hundred_bytes_at_115200_baud_take_8_68_ms() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    let (mut written, mut now) = (0, 0);
    while uart.sent().len() < 100 {
        while written < 100 && read(&mut uart, UARTFR, now) & 1 << 5 == 0 {
            write(&mut uart, UARTDR, written, now);
            written += 1;
        }
        now = uart.next_event();
        uart.advance(now);
    }
    let sent = uart.take_sent();
    assert_eq!(
        sent.iter().map(|sent| u32::from(sent.byte)).collect::<Vec<_>>(),
        (0..100).collect::<Vec<_>>()
    );
    let took = sent[99].end - sent[0].start;
    assert_eq!(took, 100 * 10 * BIT, "8.68 ms");
    assert!(took.abs_diff(cycles(8680)) < cycles(1));
}

#[test]
fn the_transmitter_takes_33_bytes_without_losing_one() {
    // 32 in the FIFO and one in the shift register.
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    for byte in 0..33 {
        assert_eq!(read(&mut uart, UARTFR, 0) & 1 << 5, 0, "TXFF at byte {byte}");
        write(&mut uart, UARTDR, byte, 0);
    }
    assert_ne!(read(&mut uart, UARTFR, 0) & 1 << 5, 0);
    write(&mut uart, UARTDR, 99, 0);
    uart.advance(cycles(10_000));
    assert_eq!(uart.sent().len(), 33, "what is written to a full FIFO is lost");
}

#[test]
fn busy_until_the_stop_bit_is_over() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    write(&mut uart, UARTDR, 1, 0);
    let flags = |uart: &mut Uart, now| (read(uart, UARTFR, now) >> 3 & 1, read(uart, UARTFR, now) >> 7 & 1);
    assert_eq!(
        flags(&mut uart, 10 * BIT - 1),
        (1, 1),
        "BUSY, and the FIFO is empty already"
    );
    assert_eq!(flags(&mut uart, 10 * BIT), (0, 1));
}

#[test]
fn the_transmit_interrupt_comes_when_the_level_falls_through_the_trigger() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    assert_eq!(
        uart.interrupt_lines(),
        0,
        "not for an empty FIFO as such (4.2.6.3)"
    );
    (0..6).for_each(|byte| write(&mut uart, UARTDR, byte, 0));
    assert_eq!(
        read(&mut uart, UARTRIS, 0) & TX,
        0,
        "five in the FIFO, trigger at four"
    );
    assert_eq!(read(&mut uart, UARTRIS, 10 * BIT) & TX, TX);
    assert_eq!(uart.interrupt_lines(), 1 << 20);
    write(&mut uart, UARTICR, TX, 10 * BIT);
    assert_eq!(read(&mut uart, UARTMIS, 60 * BIT), 0, "once for each transition");
}

#[test]
fn divisors_take_effect_with_the_next_write_of_lcr_h() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    write(&mut uart, UARTIBRD, 134, 0);
    write(&mut uart, UARTDR, 0, 0);
    assert_eq!(uart.next_event(), 10 * BIT);
    uart.advance(10 * BIT);
    write(&mut uart, UARTLCR_H, LCR_8N1 | LCR_FEN, 10 * BIT);
    write(&mut uart, UARTDR, 0, 10 * BIT);
    assert_eq!(uart.next_event(), 10 * BIT + 10 * (134 * 16 + 13));
}

#[test]
fn a_disabled_uart_keeps_what_it_has_and_hears_nothing() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    write(&mut uart, UARTCR, 0, 0);
    write(&mut uart, UARTDR, b'x'.into(), 0);
    send_to(&mut uart, b"lost", 0);
    uart.advance(cycles(1000));
    assert!(uart.sent().is_empty());
    write(&mut uart, UARTCR, ENABLE_ALL, cycles(1000));
    uart.advance(cycles(2000));
    assert_eq!(uart.sent().len(), 1, "the byte waited in the FIFO");
    assert_ne!(read(&mut uart, UARTFR, cycles(2000)) & 1 << 4, 0, "RXFE");
}

#[test]
fn what_leaves_through_another_pin_does_not_reach_the_wire() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    uart.set_pins(connected(false), 0);
    write(&mut uart, UARTDR, 1, 0);
    send_to(&mut uart, b"unheard", 0);
    uart.advance(cycles(10_000));
    let flags = read(&mut uart, UARTFR, cycles(10_000));
    assert_eq!((uart.sent().len(), flags & 0xf8), (0, 0x90), "TXFE and RXFE");
}

#[test]
fn received_bytes_arrive_one_by_one_in_the_middle_of_their_stop_bits() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    send_to(&mut uart, b"ab", 0);
    let level = |uart: &mut Uart, now| {
        uart.advance(now);
        uart.receiver.level()
    };
    let first = 9 * BIT + BIT / 2;
    assert_eq!((level(&mut uart, first - 1), level(&mut uart, first)), (0, 1));
    assert_eq!(level(&mut uart, first + 10 * BIT), 2);
    assert_eq!(read(&mut uart, UARTDR, 20 * BIT), u32::from(b'a'));
    assert_eq!(read(&mut uart, UARTDR, 20 * BIT), u32::from(b'b'));
}

#[test]
fn the_receive_interrupt_comes_at_the_trigger_level_and_goes_when_it_is_read_below() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    send_to(&mut uart, &[7; 28], 0);
    assert_eq!(read(&mut uart, UARTRIS, 279 * BIT) & RX, 0, "27 of 28");
    assert_eq!(read(&mut uart, UARTRIS, 280 * BIT) & RX, RX);
    read(&mut uart, UARTDR, 280 * BIT);
    assert_eq!(read(&mut uart, UARTRIS, 280 * BIT) & RX, 0);
}

#[test]
fn the_receive_timeout_comes_32_bits_after_the_last_byte() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    send_to(&mut uart, b"x", 0);
    let timeout = 9 * BIT + BIT / 2 + 32 * BIT;
    assert_eq!(read(&mut uart, UARTRIS, timeout - 1) & RT, 0);
    assert_eq!(read(&mut uart, UARTRIS, timeout) & RT, RT);
    read(&mut uart, UARTDR, timeout);
    assert_eq!(
        read(&mut uart, UARTRIS, timeout) & RT,
        0,
        "cleared when the FIFO is empty"
    );
}

#[test]
fn the_33rd_byte_is_lost_and_the_next_that_fits_says_so() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    let bytes: Vec<u8> = (0..33).collect();
    send_to(&mut uart, &bytes, 0);
    assert_eq!(read(&mut uart, UARTRIS, 330 * BIT) & OE, OE);
    assert_eq!(uart.overruns(), 1);
    for expected in 0..32 {
        assert_eq!(read(&mut uart, UARTDR, 330 * BIT), expected);
    }
    send_to(&mut uart, b"zz", 330 * BIT);
    assert_eq!(
        read(&mut uart, UARTDR, 350 * BIT),
        1 << 11 | u32::from(b'z'),
        "UARTDR.OE"
    );
    assert_eq!(read(&mut uart, UARTRSR, 350 * BIT), 1 << 3);
    assert_eq!(read(&mut uart, UARTDR, 350 * BIT), u32::from(b'z'));
}

#[test]
fn without_fifos_each_direction_holds_one_byte() {
    let mut uart = uart(LCR_8N1);
    send_to(&mut uart, b"ab", 0);
    assert_eq!(read(&mut uart, UARTRIS, 10 * BIT) & RX, RX);
    assert_eq!(read(&mut uart, UARTRIS, 20 * BIT) & OE, OE);
    write(&mut uart, UARTDR, 1, 20 * BIT);
    assert_eq!(
        read(&mut uart, UARTFR, 20 * BIT) & 1 << 5,
        0,
        "one in the shift register"
    );
    write(&mut uart, UARTDR, 2, 20 * BIT);
    assert_ne!(
        read(&mut uart, UARTFR, 20 * BIT) & 1 << 5,
        0,
        "one in the holding register"
    );
}

#[test]
fn a_sender_at_half_the_speed_is_garbage_with_framing_errors() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    uart.send_to_chip(b"\x00hello", 0, BitTime::of_baud(57_600));
    uart.advance(cycles(10_000));
    assert_ne!(read(&mut uart, UARTRIS, cycles(10_000)) & FE, 0);
    let received: Vec<u32> = (0..6).map(|_| read(&mut uart, UARTDR, cycles(10_000))).collect();
    assert_ne!(received[1..], b"hello".map(u32::from));
}

#[test]
fn a_sender_two_percent_off_is_understood() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    uart.send_to_chip(b"hello", 0, BitTime::of_baud(117_500));
    uart.advance(cycles(10_000));
    let received: Vec<u32> = (0..5).map(|_| read(&mut uart, UARTDR, cycles(10_000))).collect();
    assert_eq!(received, b"hello".map(u32::from));
}

#[test]
fn dma_requests_follow_the_fifos_and_dmacr() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    assert_eq!(uart.dma_requests(), 0);
    write(&mut uart, UARTDMACR, 0b111, 0);
    assert_eq!(uart.dma_requests(), 1 << 20, "room to transmit, nothing received");
    (0..33).for_each(|byte| write(&mut uart, UARTDR, byte, 0));
    assert_eq!(uart.dma_requests(), 0);
    send_to(&mut uart, b"x", 0);
    uart.advance(10 * BIT);
    assert_eq!(uart.dma_requests(), 1 << 20 | 1 << 21);
    uart.ris |= FE;
    assert_eq!(uart.dma_requests(), 1 << 20, "DMAONERR");
}

#[test]
fn reset_forgets_the_chip_and_keeps_the_wire() {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    write(&mut uart, UARTDR, 1, 0);
    uart.advance(10 * BIT);
    write(&mut uart, UARTDR, 2, 10 * BIT);
    uart.reset(10 * BIT);
    uart.advance(cycles(1000));
    assert_eq!(uart.sent().len(), 1, "the second byte was cut off");
    assert_eq!(read(&mut uart, UARTCR, cycles(1000)), 0x300);
    assert_eq!(
        read(&mut uart, UARTFR, cycles(1000)) & 0xfe,
        0x90,
        "TXFE and RXFE"
    );
    assert_eq!(read(&mut uart, UARTIFLS, cycles(1000)), 0x12);
}

fn open_line(pull: Pull) -> Uart {
    let mut uart = uart(LCR_8N1 | LCR_FEN);
    uart.disconnect_receiver(0);
    let pins = PinConnection {
        rx_pull: pull,
        ..connected(true)
    };
    uart.set_pins(pins, 0);
    uart
}

#[test]
fn an_open_line_is_silent_when_it_is_pulled_up_and_noise_without_a_pull() {
    let mut pulled = open_line(Pull::Up);
    assert_eq!(read(&mut pulled, UARTRIS, cycles(100_000)), 0);
    assert_eq!(pulled.next_event(), NEVER);
    let mut noisy = open_line(Pull::None);
    let ris = read(&mut noisy, UARTRIS, cycles(100_000));
    assert_eq!(ris & (FE | BE | OE), FE | BE | OE);
}

#[test]
fn a_line_that_is_pulled_down_is_one_break() {
    let mut uart = open_line(Pull::Up);
    let pins = PinConnection {
        rx_pull: Pull::Down,
        ..connected(true)
    };
    uart.set_pins(pins, 1000);
    assert_eq!(read(&mut uart, UARTRIS, cycles(1000)) & (FE | BE), FE | BE);
    write(&mut uart, UARTICR, ALL_INTERRUPTS, cycles(1000));
    assert_eq!(
        read(&mut uart, UARTRIS, cycles(100_000)) & (FE | BE),
        0,
        "until it was high again"
    );
}
