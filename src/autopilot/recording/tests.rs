use core::num::NonZeroU32;
use std::vec::Vec;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};

use super::{GREETING, LogFailure, LogStep, Recording, Subject};
use crate::autopilot::packs::Packs;
use crate::autopilot::{Autopilot, Start};
use crate::battery::{
    BatteryState, Extremes, FailsafeTimer, FailsafeTimers, LearntPack, Measurement, PackSettings, Tick,
};
use crate::crash::{CrashCause, CrashRecord};
use crate::memory::identity::BoardId;
use crate::memory::storage::Erase;
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, Parameters, VehicleParameter};
use crate::recorder::dataflash::{ArmingMethod, ModeReason, Record};
use crate::recorder::{LogFile, PAYLOAD_BYTES, Ring};
use crate::time::{Instant, Utc, at_us};
use crate::vehicle::{ArmState, Fitness, Restart, Vehicle};
use nor_flash::FlashModel;

const SECTORS: usize = 16;

const BOARD_ID: BoardId = BoardId([0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c]);

type Flash = FlashModel<4096, 256, SECTORS>;

/// The core's part of the log, and the flash.
struct RecordingBench {
    recording: Recording,
    flash: Flash,
    vehicle: Vehicle,
    parameters: Parameters,
    packs: Packs,
    now: Instant,
    announced: Vec<LogFailure>,
    /// Records a text in each tick.
    is_chatty: bool,
}

impl RecordingBench {
    fn new() -> Self {
        Self::with(Flash::blank(), Ring::new(Flash::REGION), false)
    }

    fn with(flash: Flash, ring: Ring, has_crashed: bool) -> Self {
        let mut recording = Recording::new(has_crashed);
        recording.found(ring);
        Self {
            recording,
            flash,
            vehicle: Vehicle::new(),
            packs: Packs::new(&Parameters::defaults()),
            parameters: Parameters::defaults(),
            now: Instant::EPOCH,
            announced: Vec::new(),
            is_chatty: false,
        }
    }

    /// This flash after the power was off.
    fn restarted(mut self) -> Self {
        self.flash.power_up();
        let ring = block_on(Ring::scan(&mut self.flash, Flash::REGION));
        Self::with(self.flash, ring, false)
    }

    /// Disarmed long enough to have space erased, then armed.
    fn armed() -> Self {
        let mut bench = Self::new();
        bench.run(1);
        bench.arm();
        bench
    }

    /// An armed bench two seconds later.
    fn under_way() -> Self {
        let mut bench = Self::armed();
        bench.run(2);
        bench
    }

    fn arm(&mut self) {
        self.vehicle.arm(self.now, Fitness::Checked).unwrap();
    }

    fn disarm_for(&mut self, seconds: u64) {
        self.vehicle.disarm();
        self.run(seconds);
    }

    fn set(&mut self, parameter: VehicleParameter, value: f32) {
        self.parameters.set(parameter, value).unwrap();
    }

    /// Lets `seconds` pass, with everything that is done meanwhile.
    fn run(&mut self, seconds: u64) {
        for _ in 0..seconds * 10 {
            self.tick();
            self.work();
        }
    }

    /// A tenth of a second without the flash.
    fn tick(&mut self) {
        self.now = self.now.after_us(100_000);
        let begun = self.recording.follow(self.now, &self.parameters, &self.vehicle);
        if begun.is_some() && self.recording.crash_is_due() {
            self.recording.add(&Record::Crash(&CRASH));
        }
        self.recording.tick();
        if let Some(failure) = self.recording.take_report() {
            self.announced.push(failure);
            self.say(&format!("announced {failure:?}"));
        }
        if self.is_chatty {
            self.say(&format!("tick {:06}", self.now.as_micros() / 100_000));
        }
    }

    fn say(&mut self, text: &str) {
        self.recording.add(&Record::Message(text));
    }

    /// Records until the open file has this many sectors.
    fn fill(&mut self, sectors: u32) {
        let is_shorter = |file: LogFile| file.bytes < (sectors - 1) * PAYLOAD_BYTES;
        let open_file = |bench: &Self| bench.recording.ring.as_ref().unwrap().open_file();
        while open_file(self).is_none_or(is_shorter) {
            self.record_much();
        }
    }

    fn record_much(&mut self) {
        self.tick();
        (0..15).for_each(|_| self.say("a text that fills the log"));
        self.work();
    }

    /// Records until the log is full.
    fn fill_up(&mut self) {
        while !self.announced.contains(&LogFailure::Full) {
            self.record_much();
        }
        self.run(1);
    }

    fn numbers(&self) -> Vec<u16> {
        self.recording.files().iter().map(|file| file.number).collect()
    }

    fn may_erase(&self) -> Erase {
        match self.vehicle.arm_state() {
            ArmState::Armed => Erase::Forbidden,
            ArmState::Disarmed => Erase::Allowed,
        }
    }

    fn next_step(&mut self) -> Option<LogStep> {
        let may_erase = self.may_erase();
        let subject = Subject {
            board_id: Some(BOARD_ID),
            packs: &self.packs,
            parameters: &self.parameters,
        };
        self.recording.next_step(self.now, &subject, may_erase)
    }

    fn work(&mut self) {
        while let Some(step) = self.next_step() {
            self.obey(step);
        }
    }

    fn obey(&mut self, step: LogStep) {
        match step {
            LogStep::Program { address, bytes } => {
                let written = block_on(self.flash.write(address, &bytes));
                self.recording.written(written.map_err(drop), self.now);
            }
            LogStep::Erase(erasure) => {
                assert_eq!(self.vehicle.arm_state(), ArmState::Disarmed);
                let from = erasure.address();
                let mut erased = block_on(self.flash.erase(from, from + 4096));
                if erased.is_ok() {
                    erased = block_on(self.flash.write(erasure.mark_address(), &erasure.mark()));
                }
                self.recording.erased(erasure, erased.map_err(drop));
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

fn contains(file: &[u8], part: impl AsRef<[u8]>) -> bool {
    count(file, part) > 0
}

fn count(file: &[u8], part: impl AsRef<[u8]>) -> usize {
    let part = part.as_ref();
    file.windows(part.len()).filter(|window| *window == part).count()
}

#[test]
fn a_file_begins_with_arming_and_has_formats_and_parameters_first() {
    let mut bench = RecordingBench::new();
    bench.run(2);
    assert!(bench.recording.files().is_empty());
    bench.arm();
    bench.run(3);
    assert_eq!(bench.numbers(), [1]);
    let file = bench.file(1);
    assert_eq!(file[..3], [0xA3, 0x95, 128]);
    for text in ["FMT", "BAT", GREETING, "BATT_CAPACITY", "LOG_BITMASK"] {
        assert!(contains(&file, text), "{text}");
    }
}

/// BRD, PACK and PCKO, with the time of the beginning of the file.
const BOARD: [u8; 3] = [0xA3, 0x95, 145];
const PACK: [u8; 3] = [0xA3, 0x95, 146];
const CURVE: [u8; 3] = [0xA3, 0x95, 147];

fn places(file: &[u8], header: [u8; 3]) -> Vec<usize> {
    (0..file.len())
        .filter(|place| file[*place..].starts_with(&header))
        .collect()
}

/// The instances in the file's records of packs, in their order.
fn packs_in(file: &[u8]) -> Vec<u8> {
    places(file, PACK)
        .into_iter()
        .map(|place| file[place + 11])
        .collect()
}

impl RecordingBench {
    /// All packs are monitored, and everything is learnt of each.
    fn with_nine_packs() -> Self {
        let mut bench = Self::new();
        for pack in Pack::ALL {
            let monitor = BatteryParameter::Monitor.of(pack);
            bench.parameters.set(monitor, 4.0).unwrap();
        }
        bench.packs = Packs::new(&bench.parameters);
        for pack in Pack::ALL {
            bench.packs.bank.get_mut(pack).0.restore_learnt(learnt());
        }
        bench
    }
}

fn learnt() -> LearntPack {
    let text = "chemistry 1\ncells 3\ncapacity_mah_sigma 2950 0.02\noffsets_100uv_sigma 1 2 3 4 5 6 7 8 9 10";
    text.parse().unwrap()
}

#[test]
fn what_a_record_of_a_text_does_not_hold_follows_in_another() {
    const MESSAGE: [u8; 3] = [0xA3, 0x95, 133];
    for (bytes, parts) in [
        (0, &[0][..]),
        (1, &[1]),
        (63, &[63]),
        // Without the second one, the next text would be joined to it.
        (64, &[64, 0]),
        (65, &[64, 1]),
        (96, &[64, 32]),
        (128, &[64, 64, 0]),
    ] {
        let mut bench = RecordingBench::under_way();
        let text: String = "a text that is long, ".chars().cycle().take(bytes).collect();
        bench.tick();
        let before = places(&bench.file(1), MESSAGE).len();
        bench.recording.add_text(&text);
        bench.run(3);
        let file = bench.file(1);
        let recorded: Vec<_> = places(&file, MESSAGE)[before..]
            .iter()
            .map(|place| {
                let text = &file[place + 11..][..64];
                let end = text.iter().position(|byte| *byte == 0).unwrap_or(64);
                std::str::from_utf8(&text[..end]).unwrap()
            })
            .collect();
        assert_eq!(recorded.concat(), text);
        let lengths: Vec<_> = recorded.iter().map(|part| part.len()).collect();
        assert_eq!(lengths, parts, "{bytes}");
    }
}

#[test]
fn a_file_begins_with_the_board_and_its_packs() {
    let mut bench = RecordingBench::under_way();
    let file = bench.file(1);
    let (board, pack) = (places(&file, BOARD)[0], places(&file, PACK)[0]);
    let greeting = file
        .windows(GREETING.len())
        .position(|text| text == GREETING.as_bytes());
    assert!(board < pack && pack < greeting.unwrap());
    assert_eq!(&file[board + 11..][..16], b"E660583883450A2C");
    assert_eq!((packs_in(&file), places(&file, CURVE)), (vec![0], vec![]));
}

#[test]
fn nine_packs_at_the_beginning_take_no_room_from_what_happens() {
    let mut bench = RecordingBench::with_nine_packs();
    bench.run(1);
    bench.arm();
    bench.tick();
    // As much as waits for the flash besides.
    (0..26).for_each(|_| bench.say("a text that fills the queue"));
    bench.run(2);
    let file = bench.file(1);
    assert_eq!(packs_in(&file), [0, 1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!((places(&file, CURVE).len(), bench.recording.dropped()), (9, 0));
}

#[test]
fn what_was_learnt_of_another_pack_is_not_recorded() {
    let mut bench = RecordingBench::with_nine_packs();
    let reading = Measurement {
        voltage_v: Some(11.1),
        ..Measurement::default()
    };
    for (pack, capacity_mah) in [(Pack::First, 2950.0), (Pack::Second, 10_000.0)] {
        let settings = PackSettings {
            capacity_mah: Some(capacity_mah),
            ..PackSettings::default()
        };
        let bank = &mut bench.packs.bank;
        let _ = bank.update(pack, Tick::default(), Ok(reading), &settings);
    }
    bench.run(1);
    bench.arm();
    bench.run(2);
    let file = bench.file(1);
    let capacities: Vec<_> = places(&file, PACK)
        .into_iter()
        .map(|place| f32::from_le_bytes(file[place + 20..][..4].try_into().unwrap()))
        .collect();
    assert!(
        capacities[0] == 2950.0 && capacities[1].is_nan(),
        "{capacities:?}"
    );
    assert_eq!(places(&file, CURVE).len(), 8);
}

#[test]
fn another_pack_is_recorded_also_in_a_pause() {
    let mut bench = RecordingBench::under_way();
    bench.recording.describe(Pack::First);
    bench.run(1);
    assert_eq!(packs_in(&bench.file(1)), [0, 0]);
    bench.disarm_for(20);
    bench.recording.describe(Pack::First);
    bench.run(1);
    assert_eq!(packs_in(&bench.file(1)), [0, 0, 0]);
}

#[test]
fn a_file_begins_when_the_flash_was_read_after_arming() {
    let mut bench = RecordingBench::armed().restarted();
    bench.recording = Recording::new(false);
    bench.arm();
    bench.run(1);
    let ring = block_on(Ring::scan(&mut bench.flash, Flash::REGION));
    bench.recording.found(ring);
    bench.run(2);
    assert_eq!((bench.numbers(), bench.announced), (vec![1], vec![]));
}

#[test]
fn a_file_pauses_15_s_after_disarming_and_goes_on_at_arming() {
    let mut bench = RecordingBench::under_way();
    bench.disarm_for(14);
    bench.say("within");
    bench.run(6);
    bench.say("after");
    bench.arm();
    bench.run(1);
    bench.say("armed again");
    bench.run(1);
    assert_eq!(bench.numbers(), [1]);
    let file = bench.file(1);
    assert!(contains(&file, "within") && !contains(&file, "after"));
    assert!(contains(&file, "armed again"));
}

#[test]
fn a_parameter_set_in_a_pause_is_recorded() {
    let mut bench = RecordingBench::under_way();
    bench.disarm_for(20);
    let before = count(&bench.file(1), "LOG_BITMASK");
    bench
        .recording
        .add_parameter(VehicleParameter::LogBitmask.into(), &bench.parameters);
    bench.run(1);
    assert_eq!(count(&bench.file(1), "LOG_BITMASK"), before + 1);
}

#[test]
// Requirement: AP-22
fn the_log_ends_and_begins_with_the_bitmask() {
    let mut bench = RecordingBench::under_way();
    bench.say("the last");
    bench.set(VehicleParameter::LogBitmask, 0.0);
    bench.run(1);
    bench.say("unwanted");
    bench.run(1);
    bench.set(VehicleParameter::LogBitmask, 520.0);
    bench.run(2);
    assert_eq!(bench.numbers(), [1, 2]);
    let file = bench.file(1);
    assert!(contains(&file, "the last") && !contains(&file, "unwanted"));
    assert!(contains(&bench.file(2), GREETING));
}

#[test]
fn a_power_cut_costs_the_last_second_at_most() {
    for operations in 0..150 {
        let mut bench = RecordingBench::armed();
        bench.is_chatty = true;
        bench.run(3);
        bench.flash.cut_power_after(operations, operations);
        // The flash is looked after four times a second.
        while !bench.flash.is_powered_off() {
            bench.tick();
            bench.tick();
            bench.work();
        }
        let lost_from = bench.now.as_micros() / 100_000 - 10;
        let mut bench = bench.restarted();
        let file = bench.file(1);
        for tick in [20, lost_from - 1, lost_from] {
            assert!(contains(&file, format!("tick {tick:06}")), "{operations}: {tick}");
        }
    }
}

#[test]
fn what_waits_is_written_before_a_sector_is_erased() {
    let mut bench = RecordingBench::under_way();
    bench.disarm_for(1);
    bench.set(VehicleParameter::LogDisarmed, 1.0);
    bench.recording.erase_all();
    bench.tick();
    while let Some(step @ LogStep::Program { .. }) = bench.next_step() {
        bench.obey(step);
    }
    bench.say("waits");
    bench.tick();
    bench.tick();
    assert!(matches!(bench.next_step(), Some(LogStep::Program { .. })));
}

#[test]
fn a_full_log_is_announced_and_goes_on_after_disarming() {
    let mut bench = RecordingBench::armed();
    bench.fill_up();
    bench.run(30);
    assert_eq!(bench.announced, [LogFailure::Full]);
    let file = bench.file(1);
    assert!(contains(&file, "announced Full"));
    bench.disarm_for(1);
    bench.arm();
    bench.run(2);
    assert_eq!(bench.numbers(), [1, 2]);
    assert!(contains(&bench.file(2), GREETING));
    assert!(bench.file(1) == file);
    assert_eq!(bench.announced, [LogFailure::Full]);
}

#[test]
fn a_drive_longer_than_half_the_ring_is_kept_for_the_next_drive() {
    let mut bench = RecordingBench::armed();
    bench.fill(10);
    bench.disarm_for(30);
    let file = bench.file(1);
    assert!(file.len() > SECTORS / 2 * PAYLOAD_BYTES as usize);
    let mut bench = bench.restarted();
    bench.run(30);
    assert!(bench.file(1) == file);
    bench.arm();
    bench.fill(4);
    assert!(bench.announced.is_empty());
    bench.disarm_for(30);
    assert_eq!(bench.numbers(), [2], "the drive before has gone for another");
}

#[test]
fn a_second_long_drive_has_a_file_of_its_own() {
    let mut bench = RecordingBench::armed();
    bench.fill(7);
    bench.disarm_for(30);
    bench.arm();
    bench.fill(8);
    assert_eq!((bench.numbers(), bench.announced), (vec![1, 2], vec![]));
}

#[test]
// Requirement: AP-22
fn while_disarmed_the_log_goes_on_in_further_files() {
    let mut bench = RecordingBench::new();
    bench.set(VehicleParameter::LogDisarmed, 1.0);
    bench.run(1);
    (0..500).for_each(|_| bench.record_much());
    assert!(bench.announced.is_empty());
    let files = bench.recording.files();
    assert!(files.len() >= 2 && files[0].number > 5, "{files:?}");
}

#[test]
fn another_file_begins_when_all_are_erased() {
    let mut bench = RecordingBench::under_way();
    bench.vehicle.disarm();
    bench.set(VehicleParameter::LogDisarmed, 1.0);
    bench.say("erased");
    bench.tick();
    bench.recording.erase_all();
    bench.run(2);
    assert_eq!(bench.numbers(), [2]);
    let file = bench.file(2);
    assert!(contains(&file, GREETING) && contains(&file, "LOG_BITMASK") && !contains(&file, "erased"));
}

#[test]
fn without_a_log_an_erase_of_all_files_is_done_and_nothing_is_erased_ahead() {
    let mut bench = RecordingBench::under_way();
    bench.disarm_for(20);
    assert_eq!(bench.numbers(), [1]);
    bench.set(VehicleParameter::LogBitmask, 0.0);
    bench.recording.erase_all();
    bench.run(2);
    let mut bench = bench.restarted();
    assert!(bench.numbers().is_empty(), "they are back after a restart");
    let before = bench.flash.operations();
    bench.set(VehicleParameter::LogBitmask, 0.0);
    bench.run(2);
    assert_eq!(bench.flash.operations(), before);
}

#[test]
fn a_failing_flash_is_announced_once_until_it_works() {
    let mut bench = RecordingBench::under_way();
    bench.is_chatty = true;
    bench.flash.cut_power_after(0, 1);
    bench.run(50);
    assert_eq!(bench.announced, [LogFailure::NotWritten]);
    bench.flash.power_up();
    bench.run(15);
    let newest = *bench.numbers().last().unwrap();
    assert!(newest > 1 && contains(&bench.file(newest), GREETING));
    bench.flash.cut_power_after(0, 1);
    bench.run(5);
    assert_eq!(bench.announced, [LogFailure::NotWritten; 2]);
}

const CRASH: CrashRecord = CrashRecord {
    task: None,
    cause: CrashCause::Hung,
    firmware: None,
};

impl RecordingBench {
    /// At a start after a crash.
    fn crashed() -> Self {
        Self::with(Flash::blank(), Ring::new(Flash::REGION), true)
    }

    /// Number of times a file has the crash.
    fn crashes_in(&mut self, number: u16) -> usize {
        let record = Record::Crash(&CRASH).encode(0);
        // Behind the time.
        count(&self.file(number), &record[11..])
    }
}

#[test]
// Requirement: W-1
fn a_crash_is_recorded_once_without_arming() {
    let mut bench = RecordingBench::crashed();
    bench.run(3);
    assert_eq!(bench.numbers(), [1]);
    assert_eq!(bench.crashes_in(1), 1);
    let bytes = bench.file(1).len();
    bench.is_chatty = true;
    bench.run(20);
    assert_eq!(bench.file(1).len(), bytes, "it is closed or waits");
    bench.arm();
    bench.run(3);
    assert_eq!((bench.numbers(), bench.crashes_in(1)), (vec![1], 1));
    assert!(contains(&bench.file(1), "tick"));
}

#[test]
// Requirement: W-1
fn a_crash_begins_no_file_with_log_bitmask_0_or_unread_parameters() {
    let mut off = RecordingBench::crashed();
    off.set(VehicleParameter::LogBitmask, 0.0);
    let mut unread = RecordingBench::crashed();
    unread.parameters.mark_not_read();
    for mut bench in [off, unread] {
        bench.run(20);
        assert_eq!(bench.numbers(), []);
    }
}

#[test]
fn a_crash_is_recorded_until_a_file_has_it() {
    for operations in 0..60 {
        let mut bench = RecordingBench::crashed();
        bench.flash.refuse_after(operations);
        bench.run(15);
        let numbers = bench.numbers();
        let has_crash = numbers.iter().any(|number| bench.crashes_in(*number) == 1);
        assert!(has_crash, "{operations}: {numbers:?}");
    }
}

#[test]
fn a_restart_has_everything_written_first() {
    let mut bench = RecordingBench::under_way();
    bench.vehicle.disarm();
    bench.say("the last second");
    assert!(!bench.recording.is_written());
    bench.vehicle.prepare_restart(Restart::default());
    bench.tick();
    bench.work();
    assert!(bench.recording.is_written());
    assert!(contains(&bench.restarted().file(1), "the last second"));
}

#[test]
fn parameters_are_repeated_after_a_reset() {
    let mut bench = RecordingBench::under_way();
    let before = count(&bench.file(1), "LOG_DISARMED");
    bench.recording.add_all_parameters();
    bench.run(2);
    assert_eq!((before, count(&bench.file(1), "LOG_DISARMED")), (1, 2));
}

#[test]
fn sectors_that_cannot_be_erased_are_announced_once() {
    let mut bench = RecordingBench::new();
    bench.flash.cut_power_after(0, 1);
    bench.run(30);
    assert_eq!(bench.announced, [LogFailure::NotWritten]);
}

#[test]
fn a_file_that_begins_after_arming_has_mode_and_arming() {
    let mut bench = RecordingBench::armed().restarted();
    let mut autopilot = Autopilot::new(&Start::default());
    autopilot.vehicle.arm(at_us(1), Fitness::Forced).unwrap();
    autopilot.drive(at_us(20_000));
    core::mem::swap(&mut autopilot.recording, &mut bench.recording);
    autopilot.drive(at_us(40_000));
    bench.now = at_us(2_000_000);
    while let Some(step) = autopilot.next_log_step(bench.now) {
        core::mem::swap(&mut autopilot.recording, &mut bench.recording);
        bench.obey(step);
        core::mem::swap(&mut autopilot.recording, &mut bench.recording);
    }
    core::mem::swap(&mut autopilot.recording, &mut bench.recording);
    let file = bench.file(1);
    let arming = Record::Arm {
        state: ArmState::Armed,
        enabled_checks: bench.parameters.get_whole(VehicleParameter::ArmingCheck) as u32,
        forced: true,
        method: ArmingMethod::Command,
    };
    let mode = Record::Mode {
        mode: autopilot.vehicle.status().mode,
        reason: ModeReason::Unknown,
    };
    for record in [arming, mode] {
        assert!(contains(&file, &record.encode(40_000)[..]), "{record:?}");
    }
}

/// 2026-11-25 20:43:16.25.
const UTC: Utc = Utc::from_micros(1_795_639_396_250_000);

impl RecordingBench {
    /// A ground station says what time it is; it has not said so before.
    fn hear_time(&mut self) {
        self.recording.set_time(UTC, self.now);
    }

    /// When each file began, in seconds since 1970.
    fn dates(&self) -> Vec<Option<u32>> {
        let files = self.recording.files().iter();
        files.map(|file| file.began_utc_s.map(NonZeroU32::get)).collect()
    }

    /// The records of what time it is in a file: time since the start in µs, UTC in ms.
    fn times(&mut self, number: u16) -> Vec<(u64, u64)> {
        const GPS: [u8; 3] = [0xA3, 0x95, 144];
        const GPS_MINUS_UTC_MS: u64 = 315_964_800_000 - 18_000;
        let file = self.file(number);
        let records = file.windows(51).filter(|record| record.starts_with(&GPS));
        records
            .map(|record| {
                let (_, fields) = record.split_at(3);
                let time_us = u64::from_le_bytes(fields[..8].try_into().unwrap());
                let ms = u32::from_le_bytes(fields[10..14].try_into().unwrap());
                let week = u16::from_le_bytes(fields[14..16].try_into().unwrap());
                let gps_ms = u64::from(week) * 604_800_000 + u64::from(ms);
                (time_us, gps_ms + GPS_MINUS_UTC_MS)
            })
            .collect()
    }

    /// Lets the board do what it would, but for one program of this many bytes, before which it stops.
    fn run_until_program_of(&mut self, length: usize) -> (u32, Vec<u8>) {
        for _ in 0..100 {
            self.tick();
            while let Some(step) = self.next_step() {
                match step {
                    LogStep::Program { address, bytes } if bytes.len() == length => {
                        return (address, bytes.to_vec());
                    }
                    step => self.obey(step),
                }
            }
        }
        panic!("there is none");
    }
}

/// The seconds of [`UTC`], and these more.
fn utc_s(more_s: f32) -> u32 {
    ((UTC.as_micros() as f64 / 1e6) + f64::from(more_s)) as u32
}

#[test]
fn a_file_gets_the_date_of_its_beginning_when_the_time_is_heard() {
    let mut bench = RecordingBench::armed();
    bench.run(60);
    assert_eq!(bench.dates(), [None]);
    bench.hear_time();
    bench.run(1);
    // It begins a tick after arming.
    let expected = [Some(utc_s(-59.9))];
    assert_eq!(bench.dates(), expected);
    assert_eq!(bench.times(1), [(61_100_000, UTC.as_micros() / 1000 + 100)]);
    assert_eq!(bench.restarted().dates(), expected);
}

#[test]
fn a_file_that_waits_for_the_next_arming_gets_its_date() {
    let mut bench = RecordingBench::under_way();
    bench.disarm_for(58);
    bench.hear_time();
    bench.run(1);
    assert_eq!(bench.dates(), [Some(utc_s(-59.9))]);
    assert_eq!(bench.times(1).len(), 1);
}

#[test]
// Requirement: L-16
fn another_time_counts_for_the_next_file() {
    let mut bench = RecordingBench::armed();
    bench.set(VehicleParameter::LogFileDsrmrot, 1.0);
    bench.hear_time();
    bench.run(2);
    let later = UTC.after_us(1_000_000_000);
    for _ in 0..3 {
        bench.recording.set_time(later, bench.now);
        bench.run(2);
    }
    assert_eq!(bench.times(1).len(), 1);
    bench.disarm_for(20);
    bench.recording.set_time(later, bench.now);
    bench.arm();
    bench.run(2);
    assert_eq!(bench.dates(), [Some(utc_s(0.1)), Some(utc_s(1000.1))]);
}

#[test]
fn a_file_without_room_for_the_time_gets_its_date_when_there_is_some() {
    let mut bench = RecordingBench::under_way();
    (0..100).for_each(|_| bench.say("a text that fills the queue"));
    bench.hear_time();
    bench.tick();
    bench.run(2);
    assert_eq!(bench.times(1).len(), 1);
    assert!(bench.dates()[0].is_some());
}

#[test]
fn an_erase_of_all_files_leaves_no_date_to_the_next_one() {
    let mut bench = RecordingBench::under_way();
    bench.hear_time();
    bench.tick();
    bench.recording.erase_all();
    bench.run(12);
    assert_eq!(bench.dates(), [Some(utc_s(0.2))]);
}

#[test]
fn a_power_cut_while_the_date_is_programmed_leaves_the_file_with_it_or_without() {
    let mut known = 0;
    for seed in 0..300 {
        let mut bench = RecordingBench::under_way();
        bench.say("before");
        bench.run(1);
        bench.hear_time();
        bench.say("after");
        let (address, date) = bench.run_until_program_of(8);
        bench.flash.cut_power_after(0, seed);
        assert!(block_on(bench.flash.write(address, &date)).is_err());
        let mut bench = bench.restarted();
        known += bench.dates().iter().flatten().count();
        assert!([None, Some(utc_s(-2.9))].contains(&bench.dates()[0]), "{seed}");
        assert!(contains(&bench.file(1), "before"), "{seed}");
        // The next file has its own date.
        bench.now = at_us(0);
        bench.hear_time();
        bench.run(1);
        bench.arm();
        bench.run(1);
        assert_eq!(bench.dates()[1], Some(utc_s(1.1)), "{seed}");
    }
    assert!((1..300).contains(&known), "{known}");
}

#[test]
fn a_date_that_can_not_be_programmed_ends_the_file_and_the_next_one_has_its_own() {
    let mut bench = RecordingBench::under_way();
    bench.hear_time();
    let (_, date) = bench.run_until_program_of(8);
    assert_eq!(date.len(), 8);
    bench.recording.written(Err(()), bench.now);
    bench.run(20);
    assert_eq!(bench.announced, [LogFailure::NotWritten]);
    assert_eq!(bench.dates().len(), 2);
    assert!(bench.dates()[1].is_some());
}

const FAILSAFE_TIMER: [u8; 3] = [0xA3, 0x95, 148];

/// A pack whose timer of low is in this state.
fn timed(low: FailsafeTimer) -> BatteryState {
    BatteryState {
        failsafe_timers: FailsafeTimers {
            low,
            ..FailsafeTimers::STOPPED
        },
        ..BatteryState::UNKNOWN
    }
}

#[test]
// Requirement: AP-21
fn timers_that_change_all_the_time_take_no_more_than_the_share() {
    let mut bench = RecordingBench::under_way();
    for tick in 0..600 {
        let low = [FailsafeTimer::Running, FailsafeTimer::Stopped][tick % 2];
        for pack in Pack::ALL {
            bench.recording.add_timers(pack, &timed(low), bench.now);
        }
        bench.tick();
        bench.work();
    }
    // Room for the latest of each.
    for _ in 0..10 {
        for pack in Pack::ALL {
            bench
                .recording
                .add_timers(pack, &timed(FailsafeTimer::Expired), bench.now);
        }
        bench.run(1);
    }
    let file = bench.file(1);
    let places = places(&file, FAILSAFE_TIMER);
    // Each with its reading.
    let bytes_per_s = places.len() as f32 * 55.0 / 60.0;
    assert!((200.0..=265.0).contains(&bytes_per_s), "{bytes_per_s}");
    let latest = places[places.len() - 9..].iter().map(|place| file[place + 13]);
    assert_eq!(latest.collect::<Vec<_>>(), [FailsafeTimer::Expired as u8; 9]);
}

const BATTERY: [u8; 3] = [0xA3, 0x95, 138];

/// The time of the record at `place` of a file, in microseconds.
fn time_us(file: &[u8], place: usize) -> u64 {
    u64::from_le_bytes(file[place + 3..place + 11].try_into().unwrap())
}

#[test]
// Requirement: AP-21
fn a_timer_that_changes_has_the_reading_and_the_time_of_its_tick() {
    let mut bench = RecordingBench::under_way();
    // The drive task has been there since.
    let tick = bench.now.before_us(15_000);
    let running = timed(FailsafeTimer::Running);
    bench.recording.add_timers(Pack::Second, &running, tick);
    bench.run(1);
    let file = bench.file(1);
    let [readings, timers] = [BATTERY, FAILSAFE_TIMER].map(|kind| places(&file, kind));
    assert_eq!((readings.len(), timers.len()), (1, 1));
    assert_eq!(timers[0], readings[0] + 41, "side by side");
    for place in [readings[0], timers[0]] {
        assert_eq!(time_us(&file, place), tick.as_micros());
        assert_eq!(file[place + 11], Pack::Second.instance());
    }
}

#[test]
// Requirement: AP-21
fn a_change_that_had_to_wait_has_the_time_at_which_it_happened() {
    let mut bench = RecordingBench::under_way();
    bench.recording.spend(600);
    let changed_at = bench.now;
    for _ in 0..30 {
        let running = timed(FailsafeTimer::Running);
        bench.recording.add_timers(Pack::First, &running, bench.now);
        bench.run(1);
    }
    let file = bench.file(1);
    let timers = places(&file, FAILSAFE_TIMER);
    assert_eq!(timers.len(), 1);
    assert_eq!(time_us(&file, timers[0]), changed_at.as_micros());
    let reading_at = time_us(&file, places(&file, BATTERY)[0]);
    assert!(reading_at >= changed_at.as_micros() + 1_000_000, "{reading_at}");
}

#[test]
// Requirement: AP-21
fn a_packs_reports_are_recorded_once_in_ten_seconds_and_in_each_file() {
    let mut bench = RecordingBench::armed();
    bench.set(VehicleParameter::LogFileDsrmrot, 1.0);
    for _ in 0..2 {
        bench.run(1);
        let mut recorded_at = Vec::new();
        for tick in 0..305 {
            bench.tick();
            if bench.recording.takes_report(Pack::Second) {
                recorded_at.push(tick);
            }
        }
        assert_eq!(recorded_at, [0, 100, 200, 300]);
        assert!(bench.recording.takes_report(Pack::First), "each pack by itself");
        bench.disarm_for(20);
        bench.arm();
    }
}

#[test]
fn extremes_are_kept_while_records_are_taken_until_a_batx_has_room() {
    let extremes = Extremes {
        lowest_voltage_v: Some(9.5),
        highest_current_a: None,
    };
    let mut bench = RecordingBench::new();
    bench.recording.add_extremes(Pack::Second, extremes);
    assert_eq!(bench.recording.extremes(Pack::Second), Extremes::default());
    let mut bench = RecordingBench::under_way();
    bench.recording.add_extremes(Pack::Second, extremes);
    let estimate = |pack| Record::Estimate(pack, &BatteryState::UNKNOWN, extremes);
    while bench.recording.dropped() == 0 {
        bench.recording.add(&estimate(Pack::First));
    }
    bench.recording.add(&estimate(Pack::Second));
    assert_eq!(bench.recording.extremes(Pack::Second), extremes);
    bench.run(1);
    bench.recording.add(&estimate(Pack::Second));
    assert_eq!(bench.recording.extremes(Pack::Second), Extremes::default());
    bench.recording.add_extremes(Pack::Second, extremes);
    bench.set(VehicleParameter::LogFileDsrmrot, 1.0);
    bench.disarm_for(20);
    bench.arm();
    bench.run(1);
    assert_eq!(
        bench.recording.extremes(Pack::Second),
        Extremes::default(),
        "in another file"
    );
}

#[test]
// Requirement: AP-22
fn another_file_begins_with_the_timers_that_run() {
    let mut bench = RecordingBench::armed();
    bench.set(VehicleParameter::LogFileDsrmrot, 1.0);
    for file in [1, 2] {
        bench.run(2);
        for _ in 0..3 {
            let running = timed(FailsafeTimer::Running);
            bench.recording.add_timers(Pack::Second, &running, bench.now);
        }
        bench.run(1);
        assert_eq!(places(&bench.file(file), FAILSAFE_TIMER).len(), 1);
        bench.disarm_for(20);
        bench.arm();
    }
}
