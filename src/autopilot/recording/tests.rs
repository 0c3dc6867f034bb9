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

/// The ring of the board, on a flash that does everything and holds nothing.
struct Board {
    recording: Recording,
    vehicle: Vehicle,
    now: Instant,
}

impl Board {
    fn starting_with(ring: Ring) -> Self {
        let mut recording = Recording::new(None);
        recording.found(ring);
        let mut board = Self {
            recording,
            vehicle: Vehicle::new(),
            now: Instant::EPOCH,
        };
        board.run(20);
        board
    }

    /// Lets `seconds` pass, with 9 records of 75 bytes in each.
    fn run(&mut self, seconds: u64) {
        let parameters = Parameters::defaults();
        for _ in 0..seconds {
            self.now = self.now.after_us(1_000_000);
            self.recording.follow(self.now, &parameters, &self.vehicle);
            for _ in 0..9 {
                self.recording.add(&Record::Message("climbing"));
            }
            let may_erase = match self.vehicle.arm_state() {
                ArmState::Armed => Erase::Forbidden,
                ArmState::Disarmed => Erase::Allowed,
            };
            while let Some(step) = self.recording.next_step(self.now, &parameters, may_erase) {
                match step {
                    LogStep::Program { .. } => self.recording.written(outcome(true), self.now),
                    LogStep::Erase(erasure) => self.recording.erased(erasure, outcome(true)),
                }
            }
        }
    }

    /// Drives for so long, and returns the length of the newest file then.
    fn drive(&mut self, seconds: u64) -> u32 {
        self.vehicle
            .arm(self.now, crate::vehicle::Fitness::Checked)
            .unwrap();
        self.run(seconds);
        let bytes = self.newest_bytes();
        self.vehicle.disarm();
        self.run(20);
        bytes
    }

    fn newest_bytes(&self) -> u32 {
        self.recording.files().last().map_or(0, |file| file.bytes)
    }

    /// Switches it off and on.
    fn restart(mut self) -> Self {
        let mut ring = self.recording.ring.take().unwrap();
        ring.close();
        Self::starting_with(ring)
    }
}

#[test]
fn the_last_drive_is_kept_however_long_it_was_and_the_next_one_has_space() {
    let blank = || Ring::new(0..crate::recorder::MAX_SECTORS * crate::recorder::SECTOR_BYTES);
    for seconds in [60, 800, 1000, 1200, 1500, 3000] {
        let mut board = Board::starting_with(blank());
        let bytes = board.drive(seconds);
        assert!(board.newest_bytes() >= bytes, "{seconds}");
        let mut board = board.restart();
        assert!(board.newest_bytes() >= bytes, "{seconds}");
        assert!(board.drive(200) > 130_000, "{seconds}");
    }
}

#[test]
fn a_drive_that_fills_the_log_has_one_file_and_the_next_one_another() {
    let blank = Ring::new(0..crate::recorder::MAX_SECTORS * crate::recorder::SECTOR_BYTES);
    let mut board = Board::starting_with(blank);
    board.drive(3000);
    assert_eq!(board.recording.files().len(), 1);
    assert!(board.drive(60) > 30_000);
    assert_eq!(board.recording.files().last().unwrap().number, 2);
}
