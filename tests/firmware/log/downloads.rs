//! Downloads: how fast, and what goes on meanwhile.

use std::cell::Cell;

use super::running_with;
use support::frames::{Frame, HEARTBEAT, LOG_DATA, PARAM_VALUE, of_message};
use support::requests::param_read_by_name;
use workbench::bench::{Bench, SECOND, TestedVehicle, Wire};
use workbench::downloads::{Download, content, get, list};
use workbench::log_flash::{LogFlash, noise};

const UART_BYTES_PER_S: u64 = 11_520;

/// Header and checksum of a frame.
const OVERHEAD_BYTES: usize = 12;

/// A download, with a parameter that is asked for in each second.
struct Measured {
    frames: Vec<Frame>,
    took_us: u64,
    asked: usize,
}

impl Measured {
    fn of(bench: &mut Bench, file: (u16, u32)) -> Self {
        let download = Download::begin(bench, file.0, file.1);
        let asked = Cell::new(0);
        let frames = download.run(bench, |bench| {
            if bench.time_us() >= download.began_us + asked.get() * SECOND {
                asked.set(asked.get() + 1);
                bench.request(&param_read_by_name("BATT_LOW_VOLT"));
            }
        });
        let data = of_message(&frames, LOG_DATA);
        let ended_us = data.last().expect("some").at_us;
        Self {
            took_us: ended_us - download.began_us,
            frames,
            asked: asked.get() as usize,
        }
    }

    /// Panics unless HEARTBEAT came in each second, and each question but the last was answered.
    fn assert_shared(&self) {
        let heartbeats = of_message(&self.frames, HEARTBEAT).len();
        assert!(heartbeats as u64 >= self.took_us / SECOND, "{heartbeats}");
        let answers = of_message(&self.frames, PARAM_VALUE).len();
        let asked = self.asked;
        assert!(answers + 1 >= asked && answers > 0, "{answers} of {asked}");
    }
}

#[test]
fn a_download_takes_85_percent_of_a_slow_line_and_150_kb_a_second_of_usb() {
    let mut log = LogFlash::erased_ahead();
    let (short, long) = (noise(1, 15), noise(2, 130));
    log.add(&short);
    log.add(&long);
    let mut bench = running_with(log.bytes());
    let files = list(&mut bench);
    assert_eq!(files, [(1, short.len() as u32), (2, long.len() as u32)]);

    let uart = Measured::of(&mut bench, files[0]);
    assert!(content(&uart.frames) == short);
    let data = of_message(&uart.frames, LOG_DATA).into_iter();
    let bytes: usize = data.map(|frame| OVERHEAD_BYTES + frame.payload_len()).sum();
    let percent = 100 * bytes as u64 * SECOND / (uart.took_us * UART_BYTES_PER_S);
    println!("{bytes} bytes on the wire: {percent} % of 115200 baud");
    uart.assert_shared();
    assert!(percent >= 85, "{percent} %");

    bench.use_wire(Wire::Usb);
    let usb = Measured::of(&mut bench, files[1]);
    assert!(content(&usb.frames) == long);
    let bytes_per_s = long.len() as u64 * SECOND / usb.took_us;
    println!("by USB {bytes_per_s} bytes a second");
    usb.assert_shared();
    assert!(bytes_per_s >= 150_000, "{bytes_per_s}");

    let began_us = bench.time_us();
    assert!(get(&mut bench, "/LOGS/00000002.BIN") == long);
    let took_us = bench.time_us() - began_us;
    let bytes_per_s = long.len() as u64 * SECOND / took_us;
    println!("by MAVLink FTP in {took_us} us: {bytes_per_s} a second");
    bench.assert_untroubled();
}
