//! `board-check` against the release firmware, at its telemetry port.

use crate::wheels::duties;
use std::cell::RefCell;
use std::io;
use std::rc::Rc;

use rover_battmon::time::Instant;
use rover_battmon_tools::board_check::{Divider, Multimeter, Plan, Port, Verdict, hash_of_elf, run};

use support::checked::{Turned, Watcher, failed, not_measured};
use support::motor_poles::{LEFT, Motor, RIGHT};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, TestedVehicle};
use workbench::elf::{Artifact, build};
use workbench::rover_circuit::{OPEN_CIRCUIT_V, WITH_SENSOR, connect};

const BAUD: u32 = 115_200;

const STEP_US: u64 = 5 * MILLISECOND;

struct BenchBoard {
    bench: Bench,
    turned: Rc<RefCell<Turned>>,
}

impl BenchBoard {
    /// How a side turns; wheels that disagree do not turn as a side.
    fn side(&self, motors: [Motor; 2]) -> f32 {
        let [front, rear] = motors.map(|motor| {
            let (positive, negative) = duties(motor, &self.bench);
            (positive - negative) as f32
        });
        if front * rear > 0.0 { front } else { 0.0 }
    }

    fn step(&mut self) -> Vec<u8> {
        self.bench.run_for(STEP_US);
        let (left, right) = (self.side(LEFT), self.side(RIGHT));
        self.turned.borrow_mut().note(left, right);
        let sent = self.bench.uart(0).take_sent();
        sent.iter().map(|sent| sent.byte).collect()
    }
}

impl Port for BenchBoard {
    fn now(&mut self) -> Instant {
        Instant::from_micros(self.bench.time_us())
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let now_us = self.bench.time_us();
        self.bench.uart_send_at_baud(0, now_us, bytes, BAUD);
        Ok(())
    }

    fn receive(&mut self, deadline: Instant, bytes: &mut Vec<u8>) -> io::Result<()> {
        loop {
            let sent = self.step();
            if !sent.is_empty() || self.now() >= deadline {
                bytes.extend(sent);
                return Ok(());
            }
        }
    }

    fn reopen(&mut self, _: Instant) -> io::Result<()> {
        unreachable!("it never closes")
    }
}

#[test]
fn a_sound_board_passes() {
    let file = std::fs::read(build(Artifact::Binary("rover-battmon"))).expect("it was built");
    let plan = Plan {
        provoke_fault: true,
        turn_motors: true,
        multimeter: Multimeter::Shows(7.93),
        apply_calibration: false,
        divider: Divider::AsBefore,
        firmware_hash: Some(hash_of_elf(&file).expect("cargo links ELF files")),
    };
    let mut bench = Bench::configured(DIVIDER_CODE, &WITH_SENSOR);
    connect(&mut bench, OPEN_CIRCUIT_V);
    bench.reboot();
    // Until the firmware knows its hash; and its first second, in which it looks for logs, does not measure its load.
    bench.run_for(2 * SECOND + 200 * MILLISECOND);
    bench.run_until_silent();
    let mut owner = Watcher::default();
    let turned = owner.turned.clone();
    let report = run(&mut BenchBoard { bench, turned }, &mut owner, &plan);
    println!("{}", report.markdown("emulated board"));
    assert_eq!(failed(&report), [""; 0]);
    assert_eq!(not_measured(&report), [""; 0]);
    assert_eq!(report.verdict(), Verdict::Passed);
    let report = report.markdown("of the emulated board");
    let expected = ": 29 passed, 0 failed, 0 not measured.";
    assert!(report.contains(expected), "{report}");
}
