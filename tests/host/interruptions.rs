//! A run that its driver did not end: who is informed of it after the start, until the rover is armed again, and how the newest
//! log shows it where RAM was lost.

use embassy_futures::block_on;
use proptest::prelude::*;
use rover_battmon::autopilot::{LOG_FULL, LogStep, Start};
use rover_battmon::crash::{CrashCause, CrashRecord, FaultSite, Interruption, RunEnd, STACK_WORDS, TaskName};
use rover_battmon::mavlink::LinkKind;
use rover_battmon::memory::identity::FirmwareHash;
use rover_battmon::recorder::dataflash::LastArming;
use rover_battmon::recorder::{LogFile, Ring};
use support::desk::Desk;
use support::frames::{STATUSTEXT, of_message, texts_of};
use support::requests::{
    GCS, ONBOARD_CONTROLLER, VEHICLE, arm_by_force, disarm, heartbeat, param_request_list, param_set,
};
use support::time::SECOND;
use support::vehicle::{OnHost, TestedVehicle};

use crate::logged_rover::{Flash, Rover};

const MILLISECOND: u64 = 1_000;
const POWER_WENT_OFF: &str = "Power went off while armed";
/// MAV_SEVERITY_INFO.
const INFO: u8 = 6;
const RESET: &str = "Reset while armed";
const BANNER: &str = "rover-battmon";

fn crash() -> CrashRecord {
    CrashRecord {
        task: TaskName::new("battery"),
        cause: CrashCause::Fault(FaultSite {
            pc: 0x1000_1234,
            lr: 0x1000_5679,
            xpsr: 0,
            stack: [0x1000_ABCD; STACK_WORDS],
        }),
        firmware: None,
    }
}

/// A desk after a start without packs, whose last run ended so.
fn desk(run_end: RunEnd, crash: Option<CrashRecord>) -> Desk {
    let mut start = Start {
        run_end,
        crash,
        program_code: 0x1000_0000..0x1001_0000,
        ..Start::default()
    };
    let monitor = support::desk::id_of("BATT_MONITOR");
    start.parameters.restore(monitor.key(), 0.0).unwrap();
    Desk::starting(start)
}

/// The texts about interruptions, as far as their first messages hold them, and the banner.
fn reports(mut texts: Vec<String>) -> Vec<String> {
    let starts = ["Crash", POWER_WENT_OFF, RESET, BANNER];
    texts.retain(|text| starts.iter().any(|start| text.starts_with(start)));
    for text in &mut texts {
        if text.starts_with(BANNER) {
            text.truncate(BANNER.len());
        }
    }
    texts
}

/// A ground station's side of the desk.
trait Station {
    /// The reports of a link that opens.
    fn opened(&mut self, kind: LinkKind) -> Vec<String>;

    /// The reports that follow a request.
    fn reports_after(&mut self, request: &[u8]) -> Vec<String>;
}

impl Station for Desk {
    fn opened(&mut self, kind: LinkKind) -> Vec<String> {
        self.connect(kind);
        self.autopilot.open(&mut self.endpoint);
        reports(texts_of(&self.sent()))
    }

    fn reports_after(&mut self, request: &[u8]) -> Vec<String> {
        self.now_us += SECOND;
        let mut answers = self.ask(request);
        self.drive();
        self.post_due(self.now_us);
        answers.extend(self.sent());
        reports(texts_of(&answers))
    }
}

#[test]
fn a_crash_is_reported_to_each_who_connects_until_the_rover_is_armed() {
    let headline = "Crash: hard fault in battery, PC 0x10001234 LR 0x1";
    let calls = "Crash: called from 1000abca 1000abca 1000abca 1000";
    let crashed = [headline, calls];
    let mut desk = desk(RunEnd::Interrupted(Interruption::Crash), Some(crash()));
    for kind in [LinkKind::Radio, LinkKind::Direct, LinkKind::Wifi, LinkKind::Radio] {
        assert_eq!(desk.opened(kind), crashed);
        assert!(desk.reports_after(&heartbeat(ONBOARD_CONTROLLER)).is_empty());
        assert_eq!(desk.reports_after(&heartbeat(GCS)), [BANNER, headline, calls]);
        assert!(desk.reports_after(&heartbeat(GCS)).is_empty(), "once a link");
        assert_eq!(
            desk.reports_after(&param_request_list(VEHICLE)),
            [BANNER, headline, calls]
        );
    }
    // Once more for who drives again.
    assert_eq!(desk.reports_after(&arm_by_force()), [headline]);
    desk.reports_after(&disarm());
    assert!(desk.opened(LinkKind::Wifi).is_empty());
    assert_eq!(desk.reports_after(&heartbeat(GCS)), [BANNER]);
    assert!(desk.reports_after(&arm_by_force()).is_empty());
}

#[test]
fn a_crash_of_another_version_is_reported_without_addresses() {
    let [crashed, running] = [1, 2].map(|word| FirmwareHash::of([word]));
    let record = CrashRecord {
        firmware: Some(crashed),
        ..crash()
    };
    let mut desk = desk(RunEnd::Interrupted(Interruption::Crash), Some(record));
    // Until the hash of the one that runs is known.
    assert_eq!(desk.opened(LinkKind::Wifi), ["Crash: hard fault in battery"]);
    desk.autopilot.set_firmware_hash(running);
    assert_eq!(
        desk.opened(LinkKind::Wifi),
        ["Crash of another version: hard fault in battery"]
    );
    desk.autopilot.set_firmware_hash(crashed);
    assert_eq!(desk.opened(LinkKind::Wifi).len(), 2);
}

#[test]
fn a_dip_is_reported_once_more_when_the_rover_is_armed() {
    for (interruption, text, at_arming) in [
        (Interruption::PowerDip, POWER_WENT_OFF, true),
        (Interruption::PowerOff, POWER_WENT_OFF, false),
        (Interruption::Reset, RESET, false),
    ] {
        let mut desk = desk(RunEnd::Interrupted(interruption), None);
        assert_eq!(desk.opened(LinkKind::Direct), [text]);
        desk.connect(LinkKind::Direct);
        desk.autopilot.open(&mut desk.endpoint);
        let sent = desk.sent();
        let notices = of_message(&sent, STATUSTEXT);
        let notice = notices.iter().find(|notice| notice.text(1, 50) == text);
        assert_eq!(notice.map(|notice| notice.u8(0)), Some(INFO));
        let expected = if at_arming { vec![text] } else { vec![] };
        assert_eq!(desk.reports_after(&arm_by_force()), expected);
        assert!(desk.opened(LinkKind::Direct).is_empty());
    }
}

#[test]
fn a_station_that_opens_a_link_is_not_informed_twice() {
    let mut desk = desk(RunEnd::Interrupted(Interruption::PowerDip), None);
    assert_eq!(desk.opened(LinkKind::Wifi), [POWER_WENT_OFF]);
    desk.receive_in_chunks(&heartbeat(GCS), 64);
    assert_eq!(reports(texts_of(&desk.sent())), [BANNER]);
}

/// A rover that can be armed, with a ground station.
fn rover() -> OnHost {
    OnHost::configured(&[("ARMING_CHECK", 0.0)])
}

/// The reports in these seconds.
fn reported(rover: &mut OnHost, seconds: u64) -> Vec<String> {
    let from_us = rover.time_us();
    rover.run_for(seconds * SECOND);
    reports(texts_of(&rover.frames_since(from_us)))
}

#[test]
fn the_power_that_went_off_in_mid_drive_is_reported_after_the_next_start() {
    let mut rover = rover();
    rover.request(&arm_by_force());
    rover.run_for(3 * SECOND);
    rover.power_cycle();
    // To a link that is open from the start; a radio that the pack feeds is not yet there.
    assert_eq!(reported(&mut rover, 5), [POWER_WENT_OFF]);
    rover.send(&heartbeat(GCS));
    assert_eq!(reported(&mut rover, 2), [BANNER, POWER_WENT_OFF]);
    rover.send(&param_request_list(VEHICLE));
    assert_eq!(reported(&mut rover, 2), [BANNER, POWER_WENT_OFF]);
    // The next start finds it, too.
    rover.reboot();
    rover.send(&heartbeat(GCS));
    assert_eq!(reported(&mut rover, 2), [BANNER, POWER_WENT_OFF]);
    rover.request(&arm_by_force());
    assert!(reported(&mut rover, 2).is_empty());
    rover.send(&param_request_list(VEHICLE));
    assert_eq!(reported(&mut rover, 2), [BANNER]);
    rover.request(&disarm());
    rover.run_for(50 * MILLISECOND);
    rover.power_cycle();
    assert!(reported(&mut rover, 2).is_empty(), "it was disarmed");
}

#[test]
fn nothing_is_reported_without_a_log() {
    let mut rover = OnHost::configured(&[("ARMING_CHECK", 0.0), ("LOG_BITMASK", 0.0)]);
    rover.request(&arm_by_force());
    rover.run_for(3 * SECOND);
    rover.power_cycle();
    assert!(reported(&mut rover, 5).is_empty());
}

impl Rover {
    /// The content of a file of this ring.
    fn content_of(&mut self, ring: &Ring, file: LogFile) -> Vec<u8> {
        let mut content = Vec::new();
        while let Some(piece) = ring.locate(file.number, content.len() as u32) {
            content.extend_from_slice(&self.chip()[piece.address as usize..][..piece.bytes as usize]);
        }
        content
    }

    /// Whether its log ends armed.
    fn ends_armed(&mut self) -> bool {
        let ring = block_on(Ring::scan(&mut self.flash, Flash::REGION));
        let Some(newest) = ring.newest() else { return false };
        let mut read = LastArming::new(LOG_FULL);
        let content = self.content_of(&ring, newest);
        content.into_iter().for_each(|byte| read.add(byte));
        read.is_armed()
    }
}

#[test]
fn the_newest_log_shows_whether_the_power_ended_a_drive() {
    let mut rover = Rover::new();
    assert!(!rover.ends_armed(), "no log");
    rover.desk.ask(&arm_by_force());
    rover.run(20);
    assert!(rover.ends_armed());
    rover.desk.ask(&disarm());
    rover.turn();
    assert!(!rover.ends_armed(), "a disarming is written at once");
    rover.desk.ask(&arm_by_force());
    rover.turn();
    assert!(rover.ends_armed(), "the file goes on");
    // Also where the command is one too many for the log.
    for _ in 0..10 {
        rover.desk.ask(&arm_by_force());
    }
    rover.turn();
    rover.desk.ask(&disarm());
    rover.turn();
    assert!(
        !rover.ends_armed(),
        "a disarming is written at once, not its command alone"
    );
}

#[test]
fn a_log_that_was_full_shows_nothing() {
    let mut rover = Rover::new();
    rover.desk.ask(&arm_by_force());
    let is_full = |rover: &mut Rover| {
        rover.desk.post_due(rover.desk.now_us);
        texts_of(&rover.desk.sent()).iter().any(|text| text == LOG_FULL)
    };
    for value in 0..5000 {
        if is_full(&mut rover) {
            rover.run(2);
            return assert!(!rover.ends_armed());
        }
        rover.desk.ask(&param_set("BATT_LOW_VOLT", (value % 7) as f32));
        rover.turn();
        assert!(rover.ends_armed());
    }
    panic!("it is never full");
}

#[test]
fn a_log_that_could_not_be_written_any_more_shows_nothing() {
    let mut rover = Rover::new();
    rover.desk.ask(&arm_by_force());
    rover.run(2);
    assert!(rover.ends_armed());
    let mut failures = 0;
    for value in 0..100 {
        rover.desk.ask(&param_set("BATT_LOW_VOLT", (value % 7) as f32));
        rover.desk.now_us += SECOND / 50;
        rover.desk.drive();
        while let Some(step) = rover.desk.autopilot.next_log_step(rover.desk.now()) {
            match step {
                LogStep::Program { bytes, .. } if !bytes.starts_with(b"LOG1") => {
                    failures += 1;
                    rover.desk.autopilot.log_written(Err(()), rover.desk.now());
                }
                step => rover.obey(step),
            }
        }
    }
    assert!(failures > 0);
    assert!(!rover.ends_armed());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Whatever was recorded, and wherever the power went: armed and disarmed are never mistaken by more than what was not
    /// written yet.
    #[test]
    fn the_last_arming_that_is_in_flash_counts(drives in prop::collection::vec((0..4u64, 0..4u64), 1..4), cut in any::<bool>()) {
        let mut rover = Rover::new();
        for (armed_s, disarmed_s) in drives {
            rover.desk.ask(&arm_by_force());
            rover.run(armed_s);
            rover.turn();
            prop_assert!(rover.ends_armed());
            rover.desk.ask(&disarm());
            rover.turn();
            prop_assert!(!rover.ends_armed());
            rover.run(disarmed_s);
            if cut {
                rover = Rover::starting(rover.flash);
                prop_assert!(!rover.ends_armed());
            }
        }
    }
}
