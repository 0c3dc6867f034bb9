//! The I2C block as the driver in `examples/i2c_bench.rs` uses it.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::OnceLock;

use crate::bench::{MILLISECOND, SECOND};
use crate::elf::{Artifact, build};
use crate::emulator::i2c_devices::{Ina226, RegisterMap};
use crate::emulator::{Board, Firmware, I2cTransaction};

const MONITOR: u8 = 0x40;
const NOBODY: u8 = 0x41;
const CYCLES_PER_S: f64 = 125e6;
const SCL_HZ: f64 = 400e3;
/// What a READ of a register takes: START, address and pointer, RESTART, address and two bytes, STOP.
const BITS_OF_A_READ: f64 = 1.0 + 18.0 + 1.0 + 27.0 + 1.0;
const BITS_OF_A_MISS: f64 = 1.0 + 9.0 + 1.0;
/// The firmware gives a transfer up after 5 ms.
const TIME_OUT_US: u64 = 5 * MILLISECOND;
/// All three reads and the pause after them.
const ROUND_US: u64 = 12 * MILLISECOND;

fn firmware() -> &'static Firmware {
    static FIRMWARE: OnceLock<Firmware> = OnceLock::new();
    FIRMWARE.get_or_init(|| Firmware::load(build(Artifact::Example("i2c_bench"))))
}

/// A board with a monitor that measures 11.98 V.
fn board() -> (Board, Rc<RefCell<RegisterMap<Ina226>>>) {
    let mut board = Board::power_up(firmware(), 1);
    let monitor = Rc::new(RefCell::new(Ina226::new(0.002)));
    monitor.borrow_mut().set(11.98, 10.0);
    board.i2c(1).attach(MONITOR, Box::new(Rc::clone(&monitor)));
    (board, monitor)
}

fn logged(board: &Board, text: &str) -> bool {
    board.log_lines().iter().any(|line| line.text.contains(text))
}

fn wait_for(board: &mut Board, text: &str) {
    board.take_log();
    assert!(
        board.run_until(SECOND, |board| logged(board, text)),
        "no {text:?}: {:?}",
        board.log_lines()
    );
}

fn duration_s(transaction: &I2cTransaction) -> f64 {
    (transaction.end - transaction.start) as f64 / CYCLES_PER_S
}

fn assert_takes(transaction: &I2cTransaction, bits: f64) {
    let ratio = duration_s(transaction) * SCL_HZ / bits;
    assert!((0.9..1.1).contains(&ratio), "{ratio}: {transaction:?}");
}

#[test]
fn values_are_read_and_a_missing_device_is_an_error() {
    let (mut board, monitor) = board();
    wait_for(&mut board, "bus 11980000 uV");
    let lines: Vec<&str> = board.log_lines().iter().map(|line| line.text.as_str()).collect();
    assert_eq!(
        lines,
        [
            "manufacturer 0x5449",
            "nobody: Abort(NoAcknowledge)",
            "bus 11980000 uV"
        ]
    );
    monitor.borrow_mut().set(7.4, 0.0);
    wait_for(&mut board, "bus 7400000 uV");
    assert!(board.unmodelled().is_empty(), "{:?}", board.unmodelled());
    assert!(board.bus_errors().is_empty());
}

#[test]
fn transfers_take_the_time_of_their_bits() {
    let (mut board, _) = board();
    wait_for(&mut board, "bus");
    let transactions = board.i2c(1).take_transactions();
    let [id, miss, volts] = &transactions[..] else {
        panic!("{transactions:?}");
    };
    assert_eq!((&id.written[..], &id.read[..]), (&[0xfe][..], &[0x54, 0x49][..]));
    assert_eq!(
        (&volts.written[..], &volts.read[..]),
        (&[2][..], &[0x25, 0x70][..])
    );
    assert_eq!((miss.address, miss.acked, miss.written.len()), (NOBODY, false, 0));
    assert_takes(id, BITS_OF_A_READ);
    assert_takes(volts, BITS_OF_A_READ);
    assert_takes(miss, BITS_OF_A_MISS);
}

#[test]
fn a_monitor_that_vanishes_is_an_error_until_it_is_back() {
    let (mut board, monitor) = board();
    wait_for(&mut board, "bus");
    board.i2c(1).detach(MONITOR);
    wait_for(&mut board, "no bus voltage: Abort(NoAcknowledge)");
    board.i2c(1).attach(MONITOR, Box::new(monitor));
    wait_for(&mut board, "bus 11980000 uV");
    assert!(!logged(&board, "time-out"));
}

#[test]
fn scl_that_is_held_is_a_time_out_until_it_is_free() {
    let (mut board, _) = board();
    wait_for(&mut board, "bus");
    board.i2c(1).hold_scl();
    let held_us = board.time_us();
    wait_for(&mut board, "time-out");
    assert!(board.time_us() - held_us < ROUND_US + TIME_OUT_US);
    wait_for(&mut board, "time-out");
    board.i2c(1).release_scl();
    wait_for(&mut board, "bus 11980000 uV");
    board.run_for(10 * ROUND_US);
    assert!(!logged(&board, "time-out"), "{:?}", board.log_lines());
}

#[test]
fn sda_that_is_held_is_freed_by_clocks() {
    let (mut board, _) = board();
    wait_for(&mut board, "bus");
    board.i2c(1).hold_sda(9);
    wait_for(&mut board, "time-out");
    board.run_for(10 * ROUND_US);
    assert!(logged(&board, "bus 11980000 uV"));
    let time_outs = board.log_lines().iter().filter(|line| line.text == "time-out");
    assert_eq!(time_outs.count(), 1, "one recovery is enough");
}
