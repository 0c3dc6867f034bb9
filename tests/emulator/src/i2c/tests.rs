//! Tests of the I2C blocks against datasheet 4.3, by their registers.

use std::cell::RefCell;
use std::rc::Rc;

use super::super::clock::cycles;
use super::super::peripheral::Peripheral;
use super::super::register::RegisterWrite;
use super::master::*;
use super::registers::*;
use super::*;

const ADDRESS: u8 = 0x40;
const READ: u32 = 1 << 8;
const STOP: u32 = 1 << 9;
const RESTART: u32 = 1 << 10;

/// The counts for 400 kHz, and what a clock takes with them: (187 + 1) + (126 + 11 + 7) cycles.
const HCNT: u32 = 126;
const LCNT: u32 = 187;
const SPKLEN: u32 = 11;
const HIGH: Cycle = 126 + 11 + 7;
const CLOCK: Cycle = 188 + HIGH;
const BYTE: Cycle = 9 * CLOCK;

/// Answers 0xa0, 0xa1, ...; refuses the byte `refused`, stretches SCL for `stretch`.
#[derive(Default)]
pub struct Probe {
    written: Vec<u8>,
    refused: Option<u8>,
    stretch: Cycle,
    sent: u8,
}

impl I2cDevice for Probe {
    fn write(&mut self, byte: u8) -> Ack {
        self.written.push(byte);
        match self.refused {
            Some(refused) if refused == byte => Ack::Nack,
            _ => Ack::Ack,
        }
    }

    fn read(&mut self) -> u8 {
        self.sent += 1;
        0x9f + self.sent
    }

    fn stretch(&mut self) -> Cycle {
        self.stretch
    }
}

fn write(i2c: &mut I2c, offset: u32, value: u32, now: Cycle) {
    i2c.advance(now);
    i2c.write(offset, RegisterWrite::plain(value), now);
    i2c.advance(now);
}

fn read(i2c: &mut I2c, offset: u32, now: Cycle) -> u32 {
    i2c.advance(now);
    i2c.read(offset, now)
}

/// A block with the reset values.
fn fresh() -> I2c {
    let mut i2c = I2c::new(I2cPlace {
        interrupt_line: 24,
        dma_request_tx: 34,
        dma_request_rx: 35,
    });
    i2c.connect(true, 0);
    i2c
}

/// Set up for 400 kHz and enabled, with a device at [`ADDRESS`].
fn i2c_with(probe: Probe) -> (I2c, Rc<RefCell<Probe>>) {
    let mut i2c = fresh();
    let probe = Rc::new(RefCell::new(probe));
    i2c.attach(ADDRESS, Box::new(Rc::clone(&probe)));
    for (offset, value) in [
        (IC_FS_SCL_HCNT, HCNT),
        (IC_FS_SCL_LCNT, LCNT),
        (IC_FS_SPKLEN, SPKLEN),
        (IC_TAR, u32::from(ADDRESS)),
        (IC_INTR_MASK, 0),
        (IC_ENABLE, 1),
    ] {
        write(&mut i2c, offset, value, 0);
    }
    (i2c, probe)
}

fn i2c() -> I2c {
    i2c_with(Probe::default()).0
}

fn raw(i2c: &mut I2c, now: Cycle) -> u32 {
    read(i2c, IC_RAW_INTR_STAT, now)
}

fn command(i2c: &mut I2c, commands: &[u32], now: Cycle) {
    commands
        .iter()
        .for_each(|&command| write(i2c, IC_DATA_CMD, command, now));
}

#[test]
fn registers_have_their_reset_values() {
    let mut i2c = fresh();
    for (offset, value) in [
        (IC_CON, 0x65),
        (IC_TAR, 0x55),
        (IC_FS_SCL_HCNT, 0x06),
        (IC_FS_SCL_LCNT, 0x0d),
        (IC_INTR_MASK, 0x8ff),
        (IC_STATUS, 0x6),
        (IC_ENABLE_STATUS, 0),
        (IC_COMP_TYPE, 0x4457_0140),
    ] {
        assert_eq!(read(&mut i2c, offset, 0), value, "{offset:#x}");
    }
}

#[test]
fn settings_change_only_while_disabled() {
    let mut i2c = i2c();
    write(&mut i2c, IC_TAR, 0x22, 0);
    write(&mut i2c, IC_FS_SCL_LCNT, 100, 0);
    assert_eq!(read(&mut i2c, IC_TAR, 0), u32::from(ADDRESS));
    assert_eq!(read(&mut i2c, IC_FS_SCL_LCNT, 0), LCNT);
    write(&mut i2c, IC_ENABLE, 0, 0);
    write(&mut i2c, IC_TAR, 0x22, 0);
    write(&mut i2c, IC_FS_SCL_LCNT, 1, 0);
    assert_eq!(read(&mut i2c, IC_TAR, 0), 0x22);
    assert_eq!(read(&mut i2c, IC_FS_SCL_LCNT, 0), 8, "the least");
}

#[test]
fn a_write_takes_nine_clocks_a_byte_and_ends_with_a_stop() {
    let mut i2c = i2c();
    command(&mut i2c, &[0x11, 0x22 | STOP], 1000);
    let end = 1000 + HIGH + 3 * BYTE + CLOCK;
    assert_eq!(i2c.next_event(), 1000 + HIGH + BYTE);
    assert_eq!(raw(&mut i2c, end - 1) & (STOP_DET | START_DET), START_DET);
    assert_eq!(read(&mut i2c, IC_STATUS, end - 1) & 1, 1);
    assert_eq!(raw(&mut i2c, end) & STOP_DET, STOP_DET);
    assert_eq!(read(&mut i2c, IC_STATUS, end), 0x6, "idle, nothing in the FIFOs");
    let expected = I2cTransaction {
        start: 1000,
        end,
        address: ADDRESS,
        written: vec![0x11, 0x22],
        read: vec![],
        acked: true,
    };
    assert_eq!(i2c.take_transactions(), [expected]);
}

#[test]
fn a_read_after_a_restart_is_the_same_transaction() {
    let mut i2c = i2c();
    command(&mut i2c, &[0xfe, READ | RESTART, READ | STOP], 0);
    let end = HIGH + 2 * BYTE + (CLOCK + HIGH + BYTE) + 2 * BYTE + CLOCK;
    assert_eq!(read(&mut i2c, IC_RXFLR, end - CLOCK), 2);
    assert_eq!(raw(&mut i2c, end - 1) & STOP_DET, 0);
    assert_eq!(raw(&mut i2c, end) & STOP_DET, STOP_DET);
    assert_eq!(read(&mut i2c, IC_DATA_CMD, end), 0x8a0, "the first is marked");
    assert_eq!(read(&mut i2c, IC_DATA_CMD, end), 0xa1);
    assert_eq!(read(&mut i2c, IC_DATA_CMD, end), 0);
    assert_eq!(raw(&mut i2c, end) & RX_UNDER, RX_UNDER);
    let transactions = i2c.take_transactions();
    assert_eq!(transactions.len(), 1);
    assert_eq!(transactions[0].written, [0xfe]);
    assert_eq!(transactions[0].read, [0xa0, 0xa1]);
}

/// With IC_RESTART_EN "a RESTART is issued only if the transfer direction is changing from the previous command"
/// (IC_DATA_CMD.RESTART): drivers leave it to that.
#[test]
fn a_change_of_direction_restarts_by_itself() {
    let restarted_at = |second: u32| {
        let mut i2c = i2c();
        command(&mut i2c, &[0xfe, second, READ, 0x33 | STOP], 0);
        i2c.advance(cycles(1000));
        i2c.take_transactions()
    };
    let transactions = restarted_at(READ);
    assert_eq!(transactions, restarted_at(READ | RESTART));
    let [transaction] = &transactions[..] else {
        panic!("{transactions:?}");
    };
    assert_eq!(transaction.written, [0xfe, 0x33]);
    assert_eq!(transaction.read, [0xa0, 0xa1]);
    let restart = CLOCK + HIGH + BYTE;
    assert_eq!(
        transaction.end,
        HIGH + 2 * BYTE + restart + 2 * BYTE + restart + BYTE + CLOCK
    );
}

#[test]
fn the_same_direction_goes_on_without_a_restart_unless_it_is_asked_for() {
    for (second, restart) in [(READ, 0), (READ | RESTART, CLOCK + HIGH + BYTE)] {
        let mut i2c = i2c();
        command(&mut i2c, &[READ, second | STOP], 0);
        i2c.advance(cycles(1000));
        let end = HIGH + 3 * BYTE + restart + CLOCK;
        assert_eq!(i2c.take_transactions()[0].end, end, "{second:#x}");
    }
}

#[test]
fn without_a_stop_the_bus_is_held_until_more_comes() {
    let mut i2c = i2c();
    command(&mut i2c, &[0x11], 0);
    let later = cycles(10_000);
    assert_eq!(raw(&mut i2c, later) & STOP_DET, 0);
    assert_eq!(read(&mut i2c, IC_STATUS, later) & 1, 1);
    command(&mut i2c, &[0x22 | STOP], later);
    assert_eq!(raw(&mut i2c, later + BYTE + CLOCK) & STOP_DET, STOP_DET);
    assert_eq!(i2c.take_transactions()[0].written, [0x11, 0x22]);
}

#[test]
fn two_transactions_are_apart_by_the_low_time_of_a_clock() {
    let mut i2c = i2c();
    command(&mut i2c, &[1 | STOP, 2 | STOP], 0);
    i2c.advance(cycles(1000));
    let transactions = i2c.take_transactions();
    assert_eq!(transactions[1].start - transactions[0].end, CLOCK - HIGH);
}

#[test]
fn a_missing_device_aborts_with_its_source_and_a_stop() {
    let mut i2c = i2c();
    write(&mut i2c, IC_ENABLE, 0, 0);
    write(&mut i2c, IC_TAR, 0x41, 0);
    write(&mut i2c, IC_ENABLE, 1, 0);
    command(&mut i2c, &[0x11, 0x22, 0x33 | STOP], 0);
    let nacked = HIGH + BYTE;
    assert_eq!(raw(&mut i2c, nacked) & (TX_ABRT | STOP_DET), TX_ABRT);
    // The command the address was sent for has left the FIFO, two were flushed.
    assert_eq!(
        read(&mut i2c, IC_TX_ABRT_SOURCE, nacked),
        2 << 23 | ABRT_7B_ADDR_NOACK
    );
    assert_eq!(read(&mut i2c, IC_TXFLR, nacked), 0);
    assert_eq!(raw(&mut i2c, nacked + CLOCK) & STOP_DET, STOP_DET);
    command(&mut i2c, &[0x44 | STOP], nacked + CLOCK);
    assert_eq!(
        read(&mut i2c, IC_TXFLR, nacked + CLOCK),
        0,
        "flushed until cleared"
    );
    assert_eq!(read(&mut i2c, IC_CLR_TX_ABRT, nacked + CLOCK), 1);
    assert_eq!(read(&mut i2c, IC_TX_ABRT_SOURCE, nacked + CLOCK), 0);
    command(&mut i2c, &[0x44 | STOP], nacked + CLOCK);
    assert_eq!(raw(&mut i2c, cycles(1000)) & TX_ABRT, TX_ABRT);
    assert!(i2c.take_transactions().iter().all(|sent| !sent.acked));
}

#[test]
fn a_refused_byte_aborts_with_another_source() {
    let (mut i2c, probe) = i2c_with(Probe {
        refused: Some(0x22),
        ..Probe::default()
    });
    command(&mut i2c, &[0x11, 0x22, 0x33 | STOP], 0);
    let nacked = HIGH + 3 * BYTE;
    assert_eq!(
        read(&mut i2c, IC_TX_ABRT_SOURCE, nacked),
        1 << 23 | ABRT_TXDATA_NOACK
    );
    assert_eq!(raw(&mut i2c, nacked + CLOCK) & STOP_DET, STOP_DET);
    assert_eq!(probe.borrow().written, [0x11, 0x22]);
}

#[test]
fn a_full_fifo_takes_no_more() {
    let mut i2c = i2c();
    // One is under way at once, sixteen wait.
    command(&mut i2c, &[0; FIFO_DEPTH + 1], 0);
    assert_eq!(read(&mut i2c, IC_TXFLR, 0), 16);
    assert_eq!(read(&mut i2c, IC_STATUS, 0) & 0b10, 0, "full");
    assert_eq!(raw(&mut i2c, 0) & TX_OVER, 0);
    command(&mut i2c, &[0], 0);
    assert_eq!(raw(&mut i2c, 0) & TX_OVER, TX_OVER);
}

#[test]
fn what_comes_into_a_full_receive_fifo_is_lost() {
    let mut i2c = i2c();
    command(&mut i2c, &[READ; FIFO_DEPTH + 1], 0);
    assert_eq!(read(&mut i2c, IC_RXFLR, cycles(10_000)), 16);
    assert_eq!(raw(&mut i2c, cycles(10_000)) & RX_OVER, RX_OVER);
}

#[test]
fn levels_of_the_fifos_make_interrupts_and_dma_requests() {
    let mut i2c = i2c();
    let line = |i2c: &I2c| i2c.interrupt_lines() >> 24;
    write(&mut i2c, IC_INTR_MASK, RX_FULL, 0);
    write(&mut i2c, IC_RX_TL, 1, 0);
    write(&mut i2c, IC_DMA_CR, 0b11, 0);
    command(&mut i2c, &[READ, READ | STOP], 0);
    assert_eq!(i2c.dma_requests(), 0, "one command waits");
    i2c.advance(HIGH + 2 * BYTE);
    assert_eq!((line(&i2c), i2c.dma_requests()), (0, 0b11 << 34));
    i2c.advance(HIGH + 3 * BYTE);
    assert_eq!(line(&i2c), 1);
    read(&mut i2c, IC_DATA_CMD, HIGH + 3 * BYTE);
    assert_eq!(line(&i2c), 0);
    write(&mut i2c, IC_INTR_MASK, TX_EMPTY, cycles(1000));
    assert_eq!(line(&i2c), 1);
}

#[test]
fn tx_empty_waits_for_the_byte_with_tx_empty_ctrl() {
    let mut i2c = i2c();
    command(&mut i2c, &[1 | STOP], 0);
    assert_eq!(raw(&mut i2c, 1) & TX_EMPTY, TX_EMPTY);
    let later = cycles(1000);
    write(&mut i2c, IC_ENABLE, 0, later);
    write(&mut i2c, IC_CON, 0x165, later);
    write(&mut i2c, IC_ENABLE, 1, later);
    command(&mut i2c, &[1 | STOP], later);
    assert_eq!(raw(&mut i2c, later + 1) & TX_EMPTY, 0);
    assert_eq!(raw(&mut i2c, later + cycles(100)) & TX_EMPTY, TX_EMPTY);
}

#[test]
fn disabling_flushes_and_ends_the_transfer_with_the_byte_under_way() {
    let mut i2c = i2c();
    command(&mut i2c, &[1, 2, 3 | STOP], 0);
    let in_first_byte = HIGH + BYTE + 1;
    write(&mut i2c, IC_ENABLE, 0, in_first_byte);
    assert_eq!(read(&mut i2c, IC_TXFLR, in_first_byte), 0);
    assert_eq!(read(&mut i2c, IC_ENABLE_STATUS, in_first_byte), 1, "still busy");
    let end = HIGH + 2 * BYTE + CLOCK;
    assert_eq!(read(&mut i2c, IC_ENABLE_STATUS, end), 0);
    assert_eq!(raw(&mut i2c, end), STOP_DET | START_DET, "they stay");
    assert_eq!(i2c.take_transactions()[0].written, [1]);
}

#[test]
fn a_device_that_stretches_makes_every_byte_longer() {
    let (mut i2c, _) = i2c_with(Probe {
        stretch: 5000,
        ..Probe::default()
    });
    command(&mut i2c, &[1, 2 | STOP], 0);
    i2c.advance(cycles(10_000));
    let end = HIGH + 3 * (BYTE + 5000) + CLOCK;
    assert_eq!(i2c.take_transactions()[0].end, end);
}

#[test]
fn nothing_happens_without_the_pins() {
    let mut i2c = i2c();
    i2c.connect(false, 0);
    command(&mut i2c, &[1 | STOP], 0);
    assert_eq!(
        (i2c.next_event(), raw(&mut i2c, cycles(1000)) & STOP_DET),
        (NEVER, 0)
    );
    i2c.connect(true, cycles(1000));
    assert_eq!(raw(&mut i2c, cycles(2000)) & STOP_DET, STOP_DET);
}

// ----- Lines that are held ------------------------------------------------------------------------

#[test]
fn scl_that_is_held_stops_everything_until_it_is_let_go() {
    let mut i2c = i2c();
    command(&mut i2c, &[1 | STOP], 0);
    i2c.advance(BYTE);
    i2c.hold_scl();
    assert_eq!(i2c.next_event(), NEVER);
    i2c.advance(cycles(1_000_000));
    assert_eq!(raw(&mut i2c, cycles(1_000_000)) & STOP_DET, 0);
    assert_eq!(
        i2c.levels(cycles(1_000_000)).map(|levels| levels.scl),
        Some(false)
    );
    i2c.release_scl();
    let end = cycles(1_000_000) + HIGH + BYTE + CLOCK;
    assert_eq!(raw(&mut i2c, end - 1) & STOP_DET, 0);
    assert_eq!(raw(&mut i2c, end) & STOP_DET, STOP_DET);
}

#[test]
fn disabling_and_resetting_the_block_does_not_free_scl() {
    let mut i2c = i2c();
    command(&mut i2c, &[1 | STOP], 0);
    i2c.hold_scl();
    write(&mut i2c, IC_ENABLE, 0, cycles(10));
    assert_eq!(read(&mut i2c, IC_ENABLE_STATUS, cycles(5000)), 1, "never idle");
    i2c.reset(cycles(5000));
    assert_eq!(read(&mut i2c, IC_ENABLE_STATUS, cycles(5000)), 0);
    write(&mut i2c, IC_ENABLE, 1, cycles(5000));
    command(&mut i2c, &[1 | STOP], cycles(5000));
    assert_eq!(raw(&mut i2c, cycles(10_000)) & STOP_DET, 0);
}

#[test]
fn arbitration_is_lost_at_the_first_one_while_sda_is_held() {
    let mut i2c = i2c();
    i2c.hold_sda(3);
    command(&mut i2c, &[1, 2 | STOP], 0);
    let lost = HIGH + CLOCK;
    assert_eq!(raw(&mut i2c, lost - 1) & TX_ABRT, 0);
    assert_eq!(
        raw(&mut i2c, lost) & (TX_ABRT | STOP_DET),
        TX_ABRT,
        "0x40 begins with a one"
    );
    assert_eq!(read(&mut i2c, IC_TX_ABRT_SOURCE, lost), 1 << 23 | ARB_LOST);
    assert_eq!(
        raw(&mut i2c, cycles(1000)) & STOP_DET,
        0,
        "the bus is not ours: no STOP"
    );
    i2c.release_sda();
    assert_eq!(raw(&mut i2c, cycles(1000)) & STOP_DET, STOP_DET);
    read(&mut i2c, IC_CLR_INTR, cycles(1000));
    command(&mut i2c, &[1 | STOP], cycles(1000));
    assert_eq!(raw(&mut i2c, cycles(2000)) & (TX_ABRT | STOP_DET), STOP_DET);
}
