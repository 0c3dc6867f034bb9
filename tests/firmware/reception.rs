//! What is received at the UARTs, while flash is written, at full rate both ways, and with nothing wired.

use crate::lamps::{self, LAMPS};
use crate::rover::GOOD_3S;
use emulator::{FlashOperationKind, FlashTiming, LogLevel, UartPins};
use support::commands::{ACCEPTED, ARM_DISARM};
use support::frames::{
    Frame, PARAM_VALUE, ParamValue, SYS_STATUS, SysStatus, TIMESYNC, acknowledged, last_of, of_message,
};
use support::requests::{arm_by_force, disarm, param_set, param_set_to, timesync};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SAVED_US, SECOND, TestedVehicle, count_of};

/// Of another system: what is addressed to it fills the line, and is checked and dropped.
const ELSEWHERE: [u8; 2] = [77, 1];

const TELEMETRY: usize = 0;
const ESC: usize = 1;

/// PADS_BANK0 of GP1 (datasheet 2.19.6.3): input enable alone, as the UART's driver leaves it.
const PAD_OF_GP1: u32 = 0x4001_c008;
const INPUT_ENABLE: u32 = 1 << 6;

fn fillers(count: usize) -> Vec<u8> {
    param_set_to(ELSEWHERE, "BATT_VOLT_MULT", 1.0).repeat(count)
}

/// What the vehicle counts of the link's errors: bad checksums, line errors, bytes it did not read in time.
fn errors(bench: &mut Bench) -> u16 {
    let frames = bench.frames();
    let sys_status = of_message(&frames, SYS_STATUS);
    SysStatus(sys_status.last().expect("telemetry flows")).errors_comm()
}

fn assert_nothing_lost(bench: &mut Bench) {
    bench.run_for(SECOND);
    for port in [TELEMETRY, ESC] {
        assert_eq!(bench.uart(port).overruns(), 0);
    }
    assert_eq!(errors(bench), 0);
    for text in ["line error", "bytes were lost"] {
        assert_eq!(bench.logged(LogLevel::Warn, text), [], "{text}");
    }
}

fn has_operation(bench: &Bench, kind: FlashOperationKind) -> bool {
    count_of(kind, bench.flash_operations()) > 0
}

/// A line that is never silent, with a parameter that is set again and again.
struct Sets {
    next: u16,
    line_free_at_us: u64,
}

impl Sets {
    fn begin(bench: &mut Bench) -> Self {
        bench.take_flash_operations();
        Self {
            next: 0,
            line_free_at_us: bench.time_us(),
        }
    }

    fn value(number: u16) -> f32 {
        1.0 + f32::from(number) / 1024.0
    }

    /// Sends the next value and `fill` frames for another system, beside frames of a motor controller, and lets time pass until
    /// the line is nearly free.
    fn send(&mut self, bench: &mut Bench, fill: usize) {
        let bytes = [param_set("BATT_VOLT_MULT", Self::value(self.next)), fillers(fill)].concat();
        self.next += 1;
        self.line_free_at_us = bench.uart_send(TELEMETRY, 0, &bytes);
        let now_us = bench.time_us();
        let frames = telemetry(30, 1200, 500, self.next).repeat(8);
        bench.uart_send_at_baud(ESC, now_us, &frames, 115_200);
        bench.run_until_time(self.line_free_at_us - MILLISECOND);
    }

    /// The values that were answered.
    fn answered(frames: &[Frame]) -> Vec<u16> {
        let values = of_message(frames, PARAM_VALUE);
        let number = |frame: &&Frame| ((ParamValue(frame).value() - 1.0) * 1024.0) as u16;
        values.iter().map(number).collect()
    }
}

/// Sends sets until flash has been erased and written, and for a while after.
fn set_until_erased(bench: &mut Bench, fill: usize) -> Sets {
    let mut sets = Sets::begin(bench);
    while !has_operation(bench, FlashOperationKind::SectorErase) {
        sets.send(bench, fill);
        assert!(sets.next < 2000, "no erase");
    }
    for _ in 0..20 {
        sets.send(bench, fill);
    }
    assert!(has_operation(bench, FlashOperationKind::PageProgram));
    sets
}

#[test]
// Requirement: R-5, AP-10
fn two_full_lines_lose_no_byte_while_flash_is_written_and_erased() {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.wire_uart(ESC, UartPins { tx: 4, rx: 5 });
    bench.set("BATT2_MONITOR", 9.0);
    bench.reboot();
    let from_us = bench.time_us();
    let sets = set_until_erased(&mut bench, 1);
    assert_eq!(last_of(&bench.frames(), 1).voltage_mv(0), 12_000);
    assert_nothing_lost(&mut bench);
    let answered = Sets::answered(&bench.frames_since(from_us));
    assert_eq!(answered, (0..sets.next).collect::<Vec<_>>());
    println!("{} parameters set on a full line at 115200 baud", sets.next);
}

#[test]
// Requirement: R-5
fn bytes_lost_in_the_longest_erase_are_counted_and_the_link_recovers() {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.flash_timing(FlashTiming::MAXIMUM);
    let from_us = bench.time_us();
    let sets = set_until_erased(&mut bench, 1);
    bench.run_for(SECOND);

    let lines = bench.logged(LogLevel::Warn, "received bytes were lost");
    // "UART0: 4630 received bytes were lost"
    let numbers = lines.iter().filter_map(|(_, text)| text.split(' ').nth(1));
    let lost: usize = numbers
        .map(|number| number.parse::<usize>().expect("a number"))
        .sum();
    let answered = Sets::answered(&bench.frames_since(from_us));
    assert!(lost > 4096, "an erase of 400 ms is longer than the ring");
    assert!(errors(&mut bench) >= lines.len() as u16);
    assert_eq!(bench.uart(TELEMETRY).overruns(), 0, "DMA never stopped");
    let last = answered.last().copied();
    assert_eq!(last, Some(sets.next - 1), "the link recovers");
    assert!(bench.resets().is_empty());
}

/// Long enough for the count of received bytes to wrap.
const FULL_RATE_US: u64 = 3200 * MILLISECOND;

#[test]
fn no_byte_is_lost_at_921600_baud_both_ways_with_lamps_changing() {
    // Arming and disarming begin a log, and the erase that makes good for it is longer than the ring of received bytes.
    let parameters = [
        ("SERIAL0_BAUD", 921.0),
        ("BATT_CELLS", 3.0),
        ("SR0_EXTRA1", 50.0),
        ("LOG_BITMASK", 0.0),
    ];
    let mut bench = Bench::configured(GOOD_3S, &parameters);
    bench.run_for(SAVED_US);
    bench.take_log();
    bench.run_until_silent();
    let from_us = bench.time_us();
    bench.record_pin(LAMPS);
    let (mut asked, mut commands, mut free_at_us) = (0, 0_usize, 0);
    while bench.time_us() < from_us + FULL_RATE_US {
        let mut bytes = [arm_by_force, disarm][commands % 2]();
        commands += 1;
        // A quarter of a second.
        for _ in 0..50 {
            bytes.extend(timesync(0x0123_4567_89ab_0000 + asked));
            bytes.extend(fillers(12));
            asked += 1;
        }
        free_at_us = bench.uart_send(TELEMETRY, 0, &bytes);
        bench.run_until_time(free_at_us - MILLISECOND);
    }
    bench.run_until_time(free_at_us + SECOND);
    let frames = bench.frames_since(from_us);
    assert_eq!(of_message(&frames, TIMESYNC).len() as i64, asked);
    let expected = vec![(ARM_DISARM, ACCEPTED); commands];
    assert_eq!(acknowledged(&frames), expected, "armed and disarmed");
    let edges = bench.take_edges(LAMPS);
    assert_eq!(lamps::frames(&edges).len(), commands);
    assert_eq!(lamps::lengths(&edges), (vec![360, 720], vec![1200]), "ns");
    assert_nothing_lost(&mut bench);
}

#[test]
// Requirement: R-4
fn an_unwired_gp1_has_no_errors_by_its_pull_up() {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.disconnect_uart_receiver(TELEMETRY);
    bench.run_for(10 * SECOND);
    assert_eq!(errors(&mut bench), 0);
    bench.assert_untroubled();
    bench.write_register(PAD_OF_GP1, INPUT_ENABLE);
    bench.run_for(2 * SECOND);
    assert!(errors(&mut bench) > 100, "without it the line is noise");
}

#[test]
fn a_line_that_is_nothing_but_noise_is_looked_at_every_millisecond() {
    let mut bench = Bench::configured(GOOD_3S, &[("SERIAL0_BAUD", 921.0)]);
    bench.run_for(SAVED_US);
    bench.take_log();
    // Low for twice as long as a byte: each is a framing error, and there are some 40 in a millisecond.
    let from_us = bench.time_us();
    let noise_ends_us = bench.uart_send_at_baud(TELEMETRY, from_us, &[0; 46_080], 460_800);
    bench.run_until_time(noise_ends_us);
    let reports = bench.logged(LogLevel::Warn, "line error").len();
    println!(
        "{reports} errors reported in {} ms",
        (noise_ends_us - from_us) / MILLISECOND
    );
    assert!((400..=1000).contains(&reports), "{reports}");
    assert_eq!(
        bench.logged(LogLevel::Warn, "bytes were lost"),
        [],
        "they are read"
    );
    bench.run_for(SECOND);
    let asked_us = bench.time_us();
    bench.uart_send(TELEMETRY, 0, &timesync(1));
    bench.run_for(SECOND);
    let frames = bench.frames_since(asked_us);
    assert_eq!(of_message(&frames, TIMESYNC).len(), 1);
}

fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc: u8, _| {
            crc << 1 ^ if crc & 0x80 != 0 { 7 } else { 0 }
        })
    })
}

/// Temperature, voltage, current, consumption and speed, as KISS controllers send them.
fn telemetry(celsius: u8, centivolts: u16, centiamperes: u16, mah: u16) -> Vec<u8> {
    let mut frame = vec![celsius];
    for word in [centivolts, centiamperes, mah, 100] {
        frame.extend(word.to_be_bytes());
    }
    frame.push(crc8(&frame));
    frame
}
