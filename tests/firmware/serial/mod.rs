//! What is connected to the second serial port, at GP4 and GP5.

mod faults;
mod generators;

use emulator::UartPins;
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND};

const PORT: usize = 1;

/// Generator.
const PROTOCOL: f32 = 30.0;
const ELECTRICAL: f32 = 17.0;
const FUEL: f32 = 18.0;

/// Their rate by the makers' documents.
const BAUD: u32 = 9_600;

/// `GEN_TYPE`.
const SMALL_FUEL_CELL: f32 = 1.0;
const LARGE_FUEL_CELL: f32 = 2.0;
const RICHEN_POWER: f32 = 3.0;

/// The second pack is the output of this generator, the third one its tank.
fn with_generator(kind: f32) -> Bench {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.wire_uart(PORT, UartPins { tx: 4, rx: 5 });
    bench.set_all(&[
        ("BATT2_MONITOR", ELECTRICAL),
        ("BATT3_MONITOR", FUEL),
        ("BATT3_CAPACITY", 100.0),
        ("SERIAL1_PROTOCOL", PROTOCOL),
        ("GEN_TYPE", kind),
        ("SR0_EXTRA1", 10.0),
    ]);
    bench.reboot();
    bench
}

fn send(bench: &mut Bench, bytes: &[u8]) {
    let at_us = bench.time_us();
    bench.uart_send_at_baud(PORT, at_us, bytes, BAUD);
}

/// The generator reports this many times, every 500 ms.
fn report(bench: &mut Bench, bytes: &[u8], times: usize) {
    for _ in 0..times {
        send(bench, bytes);
        bench.run_for(500 * MILLISECOND);
    }
}

/// A report of RichenPower's generator: the bytes that a controller of an H2 sent (ArduPilot/ardupilot, a comment in
/// libraries/AP_Generator/AP_Generator_RichenPower.cpp), with these errors, voltage and current.
pub fn richen_power(errors: u16, centivolts: u16, centiamperes: u16) -> Vec<u8> {
    let mut frame = vec![
        0xaa, 0x55, 0x00, 0x0a, 0x00, 0x00, 0x00, 0x00, 0x00, 0x04, 0x1e, 0xb0,
    ];
    for word in [errors, 0, 0x237a, 0x237a, centivolts, centiamperes, 0, 0x0100] {
        frame.extend(word.to_be_bytes());
    }
    frame.resize(66, 0);
    frame.extend([0x1e, 0xbe, 0x55, 0xaa]);
    frame
}

/// A sentence of protocol 4 of Intelligent Energy's 2.4 kW cell, by the checksum of ArduPilot's decoder
/// (ArduPilot/ardupilot, libraries/AP_Generator/AP_Generator_IE_2400.cpp, `decode_v2_data`).
pub fn protocol_4(terms: &str) -> Vec<u8> {
    let body = format!("<{terms},");
    let sum: u32 = body.bytes().map(u32::from).sum();
    format!("{body}{}>\n", !(sum as u8)).into_bytes()
}
