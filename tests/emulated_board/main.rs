//! The release firmware on an emulated RP2040, in step with the wall clock. Ground-station software reaches its UART0 and
//! its USB serial port by TCP, and its Wi-Fi by UDP and TCP; programs reach its CAN bus by slcan.
//!
//! ```sh
//! cargo test --test emulated_board -- --uart 127.0.0.1:5770 --usb 127.0.0.1:5771
//! ```

mod can;
mod flash_file;
mod pace;
mod port;
mod wifi;
mod wires;

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;

use can::CanAdapter;
use emulator::{Board, code_of_volts};
use flash_file::FlashFile;
use pace::Pace;
use port::Port;
use support::motor_poles::motors;
use support::repository;
use wifi::{HTTP_PORT, MAVLINK_PORT, WifiAir};
use wires::{UartWire, UsbWire};
use workbench::bench::{Bench, MILLISECOND, SECOND};

/// Three full LiPo cells.
const PACK_V: f64 = 12.6;
/// `BATT_VOLT_MULT`, by default.
const DIVIDER: f64 = 3.95;

/// Of the nodes at the bus, until a program has set another rate: `CAN_P1_BITRATE` by default.
const CAN_BITS_PER_SECOND: u64 = 1_000_000;

/// So much emulated time passes between looks at the sockets.
const SLICE_US: u64 = MILLISECOND;

/// Runs the release firmware on an emulated RP2040 with a full 3S pack, in step with the wall clock. Ends by Ctrl-D or Ctrl-C.
/// The line "motors" of the input shows the emulated time, and whether the motors are driven.
#[derive(Parser)]
#[command(bin_name = "cargo test --test emulated_board --")]
struct Arguments {
    /// Where a program connects to UART0 by TCP
    #[arg(long, value_name = "ADDRESS:PORT")]
    uart: SocketAddr,

    /// Where a program connects to the USB serial port by TCP
    #[arg(long, value_name = "ADDRESS:PORT")]
    usb: SocketAddr,

    /// Where a ground station waits for UDP on the board's Wi-Fi, as if on a laptop that has joined it; makes the board a
    /// Pico W. One laptop each time it is given
    #[arg(long, value_name = "ADDRESS:PORT")]
    wifi_udp: Vec<SocketAddr>,

    /// Where programs connect to the board's TCP port 5760 over Wi-Fi, from another laptop; makes the board a Pico W
    #[arg(long, value_name = "ADDRESS:PORT")]
    wifi_tcp: Vec<SocketAddr>,

    /// Where browsers connect to the board's TCP port 80 over Wi-Fi, from another laptop; makes the board a Pico W. The board
    /// answers to its own address only: chromium --host-resolver-rules="MAP 192.168.4.1:80 ADDRESS:PORT" http://192.168.4.1/
    #[arg(long, value_name = "ADDRESS:PORT")]
    wifi_http: Vec<SocketAddr>,

    /// Where a program connects to an adapter at the board's CAN bus by TCP, which speaks slcan; puts an MCP2515 with 16 MHz at
    /// the board's pins. Lines of the input make trouble on the bus: "can load 0.9", "can noise 0.1", "can wires shorted"
    /// (or open, stuck, sound)
    #[arg(long, value_name = "ADDRESS:PORT")]
    can: Option<SocketAddr>,

    /// Keep the content of the flash chip in this file; written at the end
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,

    /// End after so much emulated time
    #[arg(long, value_name = "N")]
    seconds: Option<u64>,
}

/// Whether the board has to stop.
static STOP: AtomicBool = AtomicBool::new(false);

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("{reason}.");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> Result<(), String> {
    let [uart, usb] = [arguments.uart, arguments.usb].map(listen);
    let (uart, usb) = (uart?, usb?);
    let wifi = wifi_air(&arguments)?;
    let can = arguments.can.map(listen).transpose()?;
    let name = arguments.flash.clone().unwrap_or_default();
    let failed = |error: io::Error| format!("Can't use the flash file {}: {error}", name.display());
    let mut file = FlashFile::open(arguments.flash.map(|file| repository().join(file))).map_err(failed)?;
    let mut board = Bench::power_up_updated(code_of_volts(PACK_V / DIVIDER), &file.content);
    if wifi.is_some() {
        board.attach_wifi();
    }
    let mut wires = Wires {
        uart: UartWire::new(uart),
        usb: UsbWire::plug(usb, &mut board),
        wifi,
        can: can.map(|port| CanAdapter::solder(&mut board, port, CAN_BITS_PER_SECOND)),
        typed: read_input(),
    };
    stop_by_signal()?;
    println!(
        "UART0 on tcp:{}, USB on tcp:{}. Ctrl-D ends it.",
        arguments.uart, arguments.usb
    );
    for address in &arguments.wifi_udp {
        println!("Wi-Fi to udp:{address}.");
    }
    for address in arguments.wifi_tcp.iter().chain(&arguments.wifi_http) {
        println!("Wi-Fi on tcp:{address}.");
    }
    if let Some(address) = &arguments.can {
        println!("CAN on tcp:{address}.");
    }

    let end_us = arguments.seconds.map_or(u64::MAX, |seconds| seconds * SECOND);
    emulate(&mut board, &mut wires, end_us);
    file.write(board.read_flash(0, file.content.len()))
        .map_err(failed)
}

/// What connects the board with the host.
struct Wires {
    uart: UartWire,
    usb: UsbWire,
    /// `None`: the board has no Wi-Fi.
    wifi: Option<WifiAir>,
    /// `None`: the board has no CAN controller.
    can: Option<CanAdapter>,
    /// Lines of the input.
    typed: Receiver<String>,
}

impl Wires {
    fn exchange(&mut self, board: &mut Board, until_us: u64) {
        self.uart.exchange(board, until_us);
        self.usb.exchange(board);
        if let Some(wifi) = &mut self.wifi {
            wifi.exchange(board);
        }
        if let Some(can) = &mut self.can {
            can.exchange(board);
        }
        self.obey_input(board);
    }

    /// What else is typed means nothing.
    fn obey_input(&mut self, board: &mut Board) {
        for line in self.typed.try_iter() {
            let words: Vec<_> = line.split_whitespace().collect();
            match (&mut self.can, &words[..]) {
                (Some(can), ["can", words @ ..]) => can.trouble(board, words),
                (_, ["motors"]) => show_motors(board),
                _ => {}
            }
        }
    }
}

fn show_motors(board: &Board) {
    let duty = |pin| board.pwm_output(pin).map(|output| output.duty);
    let are_driven = motors().any(|motor| duty(motor.positive) != duty(motor.negative));
    let what = if are_driven { "driven" } else { "at rest" };
    println!("Motors {what} at {} us.", board.time_us());
}

/// The air around the board, if anything on the host is to be in it.
fn wifi_air(arguments: &Arguments) -> Result<Option<WifiAir>, String> {
    let Arguments {
        wifi_udp,
        wifi_tcp,
        wifi_http,
        ..
    } = arguments;
    if wifi_udp.is_empty() && wifi_tcp.is_empty() && wifi_http.is_empty() {
        return Ok(None);
    }
    let mut air = WifiAir::new();
    for address in wifi_udp {
        air.add_udp(*address)?;
    }
    for address in wifi_tcp {
        air.add_tcp(*address, MAVLINK_PORT)?;
    }
    for address in wifi_http {
        air.add_tcp(*address, HTTP_PORT)?;
    }
    Ok(Some(air))
}

fn listen(address: SocketAddr) -> Result<Port, String> {
    Port::listen(address).map_err(|error| format!("Can't listen on {address}: {error}"))
}

fn stop() {
    STOP.store(true, Ordering::Relaxed);
}

/// Lines of the input, whose end stops the board.
fn read_input() -> Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        for line in io::stdin().lines().map_while(Result::ok) {
            // The board has stopped.
            if sender.send(line).is_err() {
                return;
            }
        }
        stop();
    });
    receiver
}

/// Ctrl-C also ends the cargo that has started this, which does not wait then; the end of the input does not.
fn stop_by_signal() -> Result<(), String> {
    ctrlc::set_handler(stop).map_err(|error| format!("Can't catch Ctrl-C: {error}"))
}

/// Lets the board run until it has to stop, and shows its log.
fn emulate(board: &mut Bench, wires: &mut Wires, end_us: u64) {
    let started = Instant::now();
    let mut pace = Pace::new();
    let mut busy = Duration::ZERO;
    while !STOP.load(Ordering::Relaxed) && board.time_us() < end_us {
        let slice_started = Instant::now();
        let until_us = board.time_us() + SLICE_US;
        wires.exchange(board, until_us);
        board.run_for(SLICE_US);
        drop_records(board);
        busy += slice_started.elapsed();
        pace.wait(Duration::from_micros(board.time_us()));
    }
    println!(
        "Stopped after {:.1} s: {:.1} s emulated, in {:.1} s of work.",
        started.elapsed().as_secs_f64(),
        board.time_us() as f64 / SECOND as f64,
        busy.as_secs_f64()
    );
}

/// The log is shown; what else grows with time is of no use here.
fn drop_records(board: &mut Bench) {
    for line in board.take_log() {
        println!("{line}");
    }
    board.take_flash_operations();
    board.usb().take_events();
    board.uart(1).take_sent();
}
