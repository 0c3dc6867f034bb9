//! Tests of the PL022 against datasheet 4.4, by its registers, on a board, and with DMA.

use std::cell::RefCell;
use std::rc::Rc;

use super::super::bench::*;
use super::super::board::Board;
use super::super::clock::{Cycle, cycles};
use super::super::peripheral::Peripheral;
use super::super::pins::SpiPins;
use super::super::register::RegisterWrite;
use super::super::thumb::{HANG, board, idle_board, store};
use super::devices::Ina239;
use super::registers::*;
use super::*;

const PLACE: SpiPlace = SpiPlace {
    interrupt_line: 19,
    dma_request_tx: 18,
    dma_request_rx: 19,
};
const SELECT: usize = 22;
const EIGHT_BITS: u32 = 7;
const MODE_1: u32 = 1 << 7;
const ENABLE: u32 = 1 << 1;
/// 125 MHz / 10 / (1 + 12): 962 kHz.
const SETTINGS: u32 = 12 << 8 | MODE_1 | EIGHT_BITS;
const PRESCALER: u32 = 10;
const BYTE: Cycle = 8 * 130;

/// Answers each byte with its complement, and keeps what it came with.
#[derive(Default)]
struct Inverter {
    clocks: Vec<SpiClock>,
}

impl SpiDevice for Inverter {
    fn exchange(&mut self, byte: u8, clock: SpiClock) -> Option<u8> {
        self.clocks.push(clock);
        Some(!byte)
    }
}

fn write(spi: &mut Spi, offset: u32, value: u32, now: Cycle) {
    spi.advance(now);
    spi.write(offset, RegisterWrite::plain(value), now);
    spi.advance(now);
}

fn read(spi: &mut Spi, offset: u32, now: Cycle) -> u32 {
    spi.advance(now);
    spi.read(offset, now)
}

/// Enabled, its pins connected, a device selected.
fn spi_with(settings: u32) -> (Spi, Rc<RefCell<Inverter>>) {
    let mut spi = Spi::new(PLACE);
    let device = Rc::new(RefCell::new(Inverter::default()));
    spi.attach(SELECT, Box::new(device.clone()));
    let connected = SpiConnection {
        sck: true,
        tx: true,
        rx: true,
    };
    spi.set_pins(connected, 0);
    write(&mut spi, SSPCPSR, PRESCALER, 0);
    write(&mut spi, SSPCR0, settings, 0);
    write(&mut spi, SSPCR1, ENABLE, 0);
    spi.observe_selects(1 << SELECT, 0);
    (spi, device)
}

fn spi() -> Spi {
    spi_with(SETTINGS).0
}

#[test]
fn after_reset_the_fifos_are_empty() {
    let mut spi = Spi::new(PLACE);
    assert_eq!(read(&mut spi, SSPSR, 0), 0b11, "TFE and TNF");
    assert_eq!(read(&mut spi, SSPRIS, 0), TX);
    assert_eq!(read(&mut spi, 0xfe0, 0), 0x22, "PL022");
}

#[test]
fn a_byte_takes_eight_clocks_each_way() {
    let mut spi = spi();
    write(&mut spi, SSPDR, 0x35, 0);
    assert_eq!(spi.next_event(), BYTE);
    assert_eq!(read(&mut spi, SSPSR, BYTE - 1), 0b1_0011, "BSY, nothing received");
    assert_eq!(read(&mut spi, SSPSR, BYTE), 0b0_0111, "RNE");
    assert_eq!(read(&mut spi, SSPDR, BYTE), 0xca);
    assert_eq!(read(&mut spi, SSPSR, BYTE), 0b0_0011);
}

#[test]
fn the_device_sees_polarity_phase_and_rate() {
    for (bits, mode) in [
        (0, SpiMode::Mode0),
        (1 << 7, SpiMode::Mode1),
        (1 << 6, SpiMode::Mode2),
        (1 << 7 | 1 << 6, SpiMode::Mode3),
    ] {
        let (mut spi, device) = spi_with(24 << 8 | bits | EIGHT_BITS);
        write(&mut spi, SSPDR, 0, 0);
        spi.advance(cycles(1000));
        let clocks = &device.borrow().clocks;
        assert_eq!(*clocks, [SpiClock { mode, hz: 500_000 }], "125 MHz / 10 / 25");
    }
}

#[test]
fn eight_bytes_wait_behind_the_one_that_is_sent() {
    let mut spi = spi();
    for byte in 0..9 {
        assert_ne!(read(&mut spi, SSPSR, 0) & 0b10, 0, "TNF at byte {byte}");
        write(&mut spi, SSPDR, byte, 0);
    }
    assert_eq!(read(&mut spi, SSPSR, 0) & 0b11, 0);
    write(&mut spi, SSPDR, 99, 0);
    assert_eq!(read(&mut spi, SSPSR, 9 * BYTE - 1) >> 4, 1);
    assert_eq!(read(&mut spi, SSPSR, 9 * BYTE) >> 4, 0, "the tenth was lost");
}

#[test]
fn a_ninth_byte_that_finds_no_room_is_an_overrun() {
    let mut spi = spi();
    write(&mut spi, SSPIMSC, ROR, 0);
    (0..9).for_each(|byte| write(&mut spi, SSPDR, byte, 0));
    spi.advance(8 * BYTE);
    assert_eq!(
        (read(&mut spi, SSPSR, 8 * BYTE) >> 3 & 1, spi.interrupt_lines()),
        (1, 0)
    );
    spi.advance(9 * BYTE);
    assert_eq!(
        (read(&mut spi, SSPMIS, 9 * BYTE), spi.interrupt_lines()),
        (ROR, 1 << 19)
    );
    write(&mut spi, SSPICR, ROR, 9 * BYTE);
    assert_eq!(spi.interrupt_lines(), 0);
    for byte in 0..8 {
        assert_eq!(read(&mut spi, SSPDR, 9 * BYTE), 0xff - byte);
    }
}

#[test]
fn interrupts_come_at_half_full_fifos() {
    let mut spi = spi();
    (0..6).for_each(|byte| write(&mut spi, SSPDR, byte, 0));
    assert_eq!(read(&mut spi, SSPRIS, 0), 0, "five wait");
    assert_eq!(read(&mut spi, SSPRIS, BYTE), TX);
    assert_eq!(read(&mut spi, SSPRIS, 4 * BYTE - 1), TX);
    assert_eq!(read(&mut spi, SSPRIS, 4 * BYTE), TX | RX);
    read(&mut spi, SSPDR, 4 * BYTE);
    assert_eq!(read(&mut spi, SSPRIS, 4 * BYTE), TX);
}

#[test]
fn dma_requests_follow_the_fifos_while_the_block_is_enabled() {
    let mut spi = spi();
    assert_eq!(spi.dma_requests(), 0);
    write(&mut spi, SSPDMACR, 0b11, 0);
    assert_eq!(spi.dma_requests(), 1 << 18);
    (0..9).for_each(|byte| write(&mut spi, SSPDR, byte, 0));
    assert_eq!(spi.dma_requests(), 0);
    spi.advance(BYTE);
    assert_eq!(spi.dma_requests(), 1 << 18 | 1 << 19);
    write(&mut spi, SSPCR1, 0, BYTE);
    assert_eq!(spi.dma_requests(), 0);
}

#[test]
fn a_disabled_block_keeps_what_it_has() {
    let mut spi = spi();
    write(&mut spi, SSPCR1, 0, 0);
    write(&mut spi, SSPDR, 1, 0);
    assert_eq!(read(&mut spi, SSPSR, cycles(100)) & 0b101, 0, "not sent");
    write(&mut spi, SSPCR1, ENABLE, cycles(100));
    assert_eq!(read(&mut spi, SSPDR, cycles(100) + BYTE), 0xfe);
}

#[test]
fn only_the_selected_device_is_clocked_else_the_line_floats() {
    let (mut spi, device) = spi_with(SETTINGS);
    spi.observe_selects(1 << 21, 0);
    write(&mut spi, SSPDR, 1, 0);
    assert_eq!(read(&mut spi, SSPDR, BYTE), 0xff);
    spi.set_floating(0);
    write(&mut spi, SSPDR, 1, BYTE);
    assert_eq!(read(&mut spi, SSPDR, 2 * BYTE), 0);
    assert!(device.borrow().clocks.is_empty());
    let before = &spi.take_transactions()[0];
    assert!(before.written.is_empty(), "selected and left alone");
    spi.observe_selects(1 << SELECT, 2 * BYTE);
    write(&mut spi, SSPDR, 1, 2 * BYTE);
    assert_eq!(read(&mut spi, SSPDR, 3 * BYTE), 0xfe);
    spi.observe_selects(0, 3 * BYTE);
    let expected = SpiTransaction {
        select: SELECT,
        start: 2 * BYTE,
        end: 3 * BYTE,
        written: vec![1],
        read: vec![0xfe],
    };
    assert_eq!(spi.take_transactions(), [expected]);
}

#[test]
fn without_its_pins_the_block_talks_to_itself() {
    let lost = [
        (false, true, true, 0xff),
        (true, false, true, 0xff),
        (true, true, false, 0),
    ];
    for (sck, tx, rx, received) in lost {
        let (mut spi, device) = spi_with(SETTINGS);
        spi.set_pins(SpiConnection { sck, tx, rx }, 0);
        write(&mut spi, SSPDR, 0x35, 0);
        assert_eq!(read(&mut spi, SSPDR, BYTE), received, "{sck} {tx} {rx}");
        assert_eq!(device.borrow().clocks.len(), usize::from(sck));
    }
}

#[test]
#[should_panic(expected = "SPI is modelled as a master")]
fn sixteen_bits_are_refused() {
    spi_with(SETTINGS | 0xf);
}

#[test]
#[should_panic(expected = "SPI is enabled with SSPCPSR 0")]
fn no_clock_is_refused() {
    let mut spi = Spi::new(PLACE);
    write(&mut spi, SSPCR0, SETTINGS, 0);
    write(&mut spi, SSPCR1, ENABLE, 0);
}

// ----- On a board -----------------------------------------------------------------------------------

const SIO_GPIO_OE_SET: u32 = 0xd000_0024;
const SIO_GPIO_OUT_SET: u32 = 0xd000_0014;

fn set_up(board: &mut Board) {
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    for pin in [10, 11, 12] {
        select_function(board, pin, FUNCTION_SPI);
    }
    select_function(board, SELECT as u32, FUNCTION_SIO);
    for (offset, value) in [
        (SSPCPSR, PRESCALER),
        (SSPCR0, SETTINGS),
        (SSPDMACR, 0b11),
        (SSPCR1, ENABLE),
    ] {
        board.write_register(SPI1 + offset, value);
    }
    let mut device = Ina239::new(0.0162);
    device.set(48.0, 6.0, 25.0);
    board.spi1().attach(SELECT, Box::new(device));
}

/// A board whose program drives the select pin low, and after a second store high.
fn selecting_board(program: &[u16]) -> Board {
    let mut board = board(program, &[]);
    set_up(&mut board);
    let registers = [(0, 1 << SELECT), (1, SIO_GPIO_OE_SET), (2, SIO_GPIO_OUT_SET)];
    set_registers(&mut board, registers);
    board
}

fn transfer(board: &mut Board, bytes: &[u8]) -> Vec<u32> {
    let exchange = |board: &mut Board, byte: u8| {
        board.write_register(SPI1 + SSPDR, byte.into());
        board.run_for(10);
        board.read_register(SPI1 + SSPDR)
    };
    bytes.iter().map(|&byte| exchange(board, byte)).collect()
}

#[test]
fn a_device_answers_while_the_processor_drives_its_select_pin_low() {
    let mut board = selecting_board(&[store(0, 1), HANG]);
    assert_eq!(transfer(&mut board, &[0xf9, 0, 0]), [0, 0x54, 0x49]);
    assert!(board.unmodelled().is_empty());
    let mut board = selecting_board(&[store(0, 1), store(0, 2), HANG]);
    board.run_for(1);
    assert_eq!(transfer(&mut board, &[0xf9, 0, 0]), [0xff; 3], "high again");
    assert_eq!(board.spi1().take_transactions().len(), 1);
}

#[test]
fn the_block_reaches_its_devices_only_through_the_right_pins() {
    let mut board = selecting_board(&[store(0, 1), HANG]);
    select_function(&mut board, 12, FUNCTION_SIO);
    assert_eq!(transfer(&mut board, &[0xf9, 0, 0]), [0; 3]);
    let mut board = selecting_board(&[store(0, 1), HANG]);
    board.wire_spi1(SpiPins {
        sck: 14,
        tx: 15,
        rx: 12,
    });
    assert_eq!(transfer(&mut board, &[0xf9, 0, 0]), [0xff; 3]);
    for pin in [14, 15] {
        select_function(&mut board, pin, FUNCTION_SPI);
    }
    assert_eq!(transfer(&mut board, &[0xf9, 0, 0]), [0, 0x54, 0x49]);
}

#[test]
#[should_panic(expected = "GPIO2 is not an SCK pin of SPI1")]
fn wires_to_pins_the_block_cannot_use_are_refused() {
    idle_board().wire_spi1(SpiPins {
        sck: 2,
        tx: 11,
        rx: 12,
    });
}

#[test]
fn two_dma_channels_read_a_register() {
    const DMA: u32 = 0x5000_0000;
    const ENABLE_BYTES: u32 = 1;
    const INCREMENT_READ: u32 = 1 << 4;
    const INCREMENT_WRITE: u32 = 1 << 5;
    let control = |channel: u32, request: u32| request << 15 | channel << 11 | ENABLE_BYTES;
    let mut board = selecting_board(&[store(0, 1), HANG]);
    // Its first conversion takes 3.2 ms.
    board.run_for(4_000);
    board.write_memory(RAM + 0x100, &[0x15, 0, 0, 0]);
    let (data, transmit, receive) = (SPI1 + SSPDR, DMA, DMA + 0x40);
    for (register, value) in [
        (receive, data),
        (receive + 4, RAM + 0x200),
        (receive + 8, 4),
        (receive + 0xc, control(1, 19) | INCREMENT_WRITE),
        (transmit, RAM + 0x100),
        (transmit + 4, data),
        (transmit + 8, 4),
        (transmit + 0xc, control(0, 18) | INCREMENT_READ),
    ] {
        board.write_register(register, value);
    }
    let start = board.time_cycles();
    let done = |board: &mut Board| board.read_register(DMA + 0x400) & 0b10 != 0;
    assert!(board.run_until(1000, done));
    let took = board.time_cycles() - start;
    assert!((4 * BYTE..4 * BYTE + cycles(12)).contains(&took), "{took}");
    // VBUS, and nothing behind it.
    assert_eq!(board.read_memory(RAM + 0x200, 4), [0, 0x3c, 0x00, 0x00]);
}
