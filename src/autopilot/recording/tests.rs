use std::vec::Vec;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};

use super::*;
use crate::flash_model::FlashModel;
use crate::storage::Erase;
use crate::time::at_us;

const SECTORS: usize = 16;

type Flash = FlashModel<4096, 256, SECTORS>;

/// The core's part of the log, and the flash.
struct Bench {
    recording: Recording,
    flash: Flash,
    vehicle: Vehicle,
    parameters: Parameters,
    now: Instant,
}

impl Bench {
    fn new() -> Self {
        let mut recording = Recording::new(None);
        recording.found(Ring::new(Flash::REGION));
        Self {
            recording,
            flash: Flash::blank(),
            vehicle: Vehicle::new(),
            parameters: Parameters::defaults(),
            now: Instant::EPOCH,
        }
    }

    /// Lets `seconds` pass, with everything that is done meanwhile.
    fn run(&mut self, seconds: u64) {
        for _ in 0..seconds * 10 {
            self.now = self.now.after_us(100_000);
            self.recording.follow(self.now, &self.parameters, &self.vehicle);
            self.recording.tick();
            self.work();
        }
    }

    fn work(&mut self) {
        let may_erase = match self.vehicle.arm_state() {
            ArmState::Armed => Erase::Forbidden,
            ArmState::Disarmed => Erase::Allowed,
        };
        while let Some(step) = self.recording.next_step(self.now, &self.parameters, may_erase) {
            self.obey(step);
        }
    }

    fn obey(&mut self, step: LogStep) {
        match step {
            LogStep::Program { address, bytes } => {
                let written = block_on(self.flash.write(address, &bytes));
                self.recording.written(outcome(written.is_ok()), self.now);
            }
            LogStep::Erase(erasure) => {
                assert_eq!(self.vehicle.arm_state(), ArmState::Disarmed);
                let from = erasure.address();
                let erased = block_on(self.flash.erase(from, from + 4096)).is_ok()
                    && block_on(self.flash.write(erasure.mark_address(), &erasure.mark())).is_ok();
                self.recording.erased(erasure, outcome(erased));
            }
        }
    }

    /// The content of a file.
    fn file(&mut self, number: u16) -> Vec<u8> {
        let mut content = Vec::new();
        while let Some(piece) = self.recording.locate(number, content.len() as u32) {
            let start = piece.address & !3;
            let end = (piece.address + piece.bytes).next_multiple_of(4);
            let mut bytes = vec![0; (end - start) as usize];
            block_on(self.flash.read(start, &mut bytes)).unwrap();
            let skipped = (piece.address - start) as usize;
            content.extend_from_slice(&bytes[skipped..][..piece.bytes as usize]);
        }
        content
    }
}

fn outcome(is_done: bool) -> crate::recorder::Outcome {
    match is_done {
        true => crate::recorder::Outcome::Done,
        false => crate::recorder::Outcome::Failed,
    }
}

fn contains(file: &[u8], text: &str) -> bool {
    file.windows(text.len()).any(|window| window == text.as_bytes())
}

#[test]
fn a_file_begins_with_arming_and_has_formats_and_parameters_first() {
    let mut bench = Bench::new();
    bench.run(2);
    assert!(bench.recording.files().is_empty());
    bench
        .vehicle
        .arm(bench.now, crate::vehicle::Fitness::Checked)
        .unwrap();
    bench.run(3);
    assert_eq!(bench.recording.files().len(), 1);
    let file = bench.file(1);
    assert_eq!(file[..3], [0xA3, 0x95, 128]);
    for text in ["FMT", "BAT", GREETING, "BATT_CAPACITY", "LOG_BITMASK"] {
        assert!(contains(&file, text), "{text}");
    }
    let _ = at_us(0);
}
