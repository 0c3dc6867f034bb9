//! `board-check` against the release firmware, at its telemetry port.

use crate::wheels::duties;
use std::cell::RefCell;
use std::rc::Rc;

use rover_battmon::memory::identity::FirmwareHash;
use rover_battmon_tools::board_check::{Divider, Multimeter, Plan, Report, Verdict, hash_of_elf, run};

use crate::firmware_hash::flipped_byte;
use emulator::{AdcInput, SentByte};
use support::checked::{Checked, Line, Turned, Watcher, failed, not_measured};
use support::motor_poles::{LEFT, Motor, RIGHT};
use workbench::bench::{
    Bench, DIVIDER_CODE, MILLISECOND, PACK, PARAMETER_BYTES, PARAMETER_OFFSET, SECOND, SECTOR_BYTES,
};
use workbench::elf::{Artifact, build};

const BAUD: u32 = 115_200;

const STEP_US: u64 = 5 * MILLISECOND;

/// In the time in which the check listens.
const LISTENING_US: u64 = 10 * SECOND;

/// What is wrong with the board or its line.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// M2's plug is turned round.
    LeftRearReversed,
    HangsOnce,
    DamagedLine,
}

struct BenchBoard {
    bench: Bench,
    turned: Rc<RefCell<Turned>>,
    fault: Fault,
    has_hung: bool,
    sent_bytes: usize,
}

impl BenchBoard {
    /// How a side turns; wheels that disagree do not turn as a side.
    fn side(&self, motors: [Motor; 2]) -> f32 {
        let [front, rear] = motors.map(|motor| {
            let (positive, negative) = duties(motor, &self.bench);
            let is_reversed = self.fault == Fault::LeftRearReversed && motor.positive == LEFT[1].positive;
            let duty = (positive - negative) as f32;
            if is_reversed { -duty } else { duty }
        });
        if front * rear > 0.0 { front } else { 0.0 }
    }

    fn step(&mut self) -> Vec<u8> {
        let is_time = self.bench.time_us() > LISTENING_US;
        if self.fault == Fault::HangsOnce && is_time && !std::mem::replace(&mut self.has_hung, true) {
            self.bench.hang_program();
        }
        self.bench.run_for(STEP_US);
        let (left, right) = (self.side(LEFT), self.side(RIGHT));
        self.turned.borrow_mut().note(left, right);
        let sent = self.bench.uart(0).take_sent();
        sent.into_iter()
            .map(|SentByte { byte, .. }| self.carry(byte))
            .collect()
    }

    /// Of every thousandth byte a bit is flipped on a line that is damaged.
    fn carry(&mut self, byte: u8) -> u8 {
        self.sent_bytes += 1;
        let is_hit = self.fault == Fault::DamagedLine && self.sent_bytes.is_multiple_of(1000);
        if is_hit { byte ^ 1 } else { byte }
    }
}

impl Checked for BenchBoard {
    fn now_us(&mut self) -> u64 {
        self.bench.time_us()
    }

    fn deliver(&mut self, bytes: &[u8]) {
        let now_us = self.bench.time_us();
        self.bench.uart_send_at_baud(0, now_us, bytes, BAUD);
    }

    fn run_until(&mut self, until_us: u64) -> Vec<u8> {
        loop {
            let sent = self.step();
            if !sent.is_empty() || self.bench.time_us() >= until_us {
                return sent;
            }
        }
    }
}

const EVERYTHING: Plan = Plan {
    provoke_fault: true,
    turn_motors: true,
    multimeter: Multimeter::Shows(7.93),
    apply_calibration: false,
    divider: Divider::AsBefore,
    firmware_hash: None,
};

fn check(mut bench: Bench, fault: Fault, plan: &Plan) -> Report {
    // Its first second, in which it looks for logs, does not measure its load.
    bench.run_for(2 * SECOND);
    bench.run_until_silent();
    let mut owner = Watcher::default();
    let mut line = Line(BenchBoard {
        bench,
        turned: owner.turned.clone(),
        fault,
        has_hung: false,
        sent_bytes: 0,
    });
    let report = run(&mut line, &mut owner, plan);
    println!("{}", report.markdown("emulated board"));
    report
}

/// The hash of the release firmware's file.
fn released() -> FirmwareHash {
    let file = std::fs::read(build(Artifact::Binary("rover-battmon"))).expect("it was built");
    hash_of_elf(&file).expect("cargo links ELF files")
}

fn sound() -> Bench {
    Bench::power_up(DIVIDER_CODE)
}

/// Waits until the firmware knows its hash.
fn hashed(mut bench: Bench) -> Bench {
    bench.run_for(200 * MILLISECOND);
    bench
}

#[test]
fn a_sound_board_passes() {
    let plan = Plan {
        firmware_hash: Some(released()),
        ..EVERYTHING
    };
    let report = check(hashed(sound()), Fault::None, &plan);
    assert_eq!(failed(&report), [""; 0]);
    assert_eq!(not_measured(&report), [""; 0]);
    assert_eq!(report.verdict(), Verdict::Passed);
    let report = report.markdown("of the emulated board");
    assert!(
        report.contains(": 27 passed, 0 failed, 0 not measured."),
        "{report}"
    );
}

#[test]
fn another_program_is_found() {
    let plan = Plan {
        firmware_hash: Some(released()),
        ..Plan::default()
    };
    let (offset, byte) = flipped_byte();
    let bench = Bench::power_up_with_flash(DIVIDER_CODE, offset, &[byte]);
    let report = check(hashed(bench), Fault::None, &plan);
    assert_eq!(failed(&report), ["firmware hash"]);
    assert!(
        !report.markdown("").contains("| **failed** | none |"),
        "it has a hash"
    );
}

#[test]
fn a_reversed_wheel_is_seen() {
    let plan = Plan {
        turn_motors: true,
        ..Plan::default()
    };
    let report = check(sound(), Fault::LeftRearReversed, &plan);
    assert_eq!(failed(&report), ["left wheels ahead", "left wheels back"]);
}

#[test]
fn a_watchdog_restart_is_found_and_named() {
    let report = check(sound(), Fault::HangsOnce, &Plan::default());
    // In the second after a start logs are looked for and the program is hashed.
    assert_eq!(failed(&report), ["restarts", "load"]);
    assert!(
        report.findings()[0].contains("Crash: hung or locked up"),
        "{:?}",
        report.findings()
    );
}

#[test]
fn a_parameter_that_worn_flash_does_not_keep_is_found() {
    let mut bench = sound();
    for sector in 0..PARAMETER_BYTES / SECTOR_BYTES {
        bench.wear_out_sector(PARAMETER_OFFSET + (sector * SECTOR_BYTES) as u32);
    }
    bench.write_flash(PARAMETER_OFFSET, &[0; PARAMETER_BYTES]);
    let report = check(bench, Fault::None, &Plan::default());
    assert_eq!(failed(&report), ["parameter kept", "announcements"]);
}

#[test]
fn a_damaged_line_and_a_noisy_divider_are_found() {
    let mut bench = sound();
    let mut codes = [0_u16, 130].into_iter().cycle();
    let mut noise = 0;
    // Twice a second, as often as it is reported.
    let noisy = move |cycle: u64| {
        if cycle.is_multiple_of(7) {
            noise = codes.next().unwrap_or(0);
        }
        DIVIDER_CODE + noise
    };
    bench.adc_input(PACK, AdcInput::CodeAt(Box::new(noisy)));
    let report = check(bench, Fault::DamagedLine, &Plan::default());
    let mut failed = failed(&report);
    // A frame of the list may be hit, too.
    failed.retain(|check| *check != "parameter list");
    assert_eq!(failed, ["damaged frames", "voltage noise"]);
}
