//! Age of what the rover's own page sends: a connection that stalls delivers commands late.

use rover_battmon::battery::{BatteryState, PackStatus, Readings};
use rover_battmon::mavlink::{Access, Event, LinkKind};
use rover_battmon::parameter::VehicleParameter;
use rover_battmon::vehicle::{ArmState, Mode, SideDrives};
use support::commands::{BATTERY_RESET, FAILED, PREFLIGHT_STORAGE};
use support::desk::Desk;
use support::frames::{COMMAND_ACK, LOG_ERASE, encode_v2, of_message, texts_of};
use support::requests::{
    VEHICLE, VEHICLE_ID, arm_by_force, command_int, command_long, command_long_2, disarm, do_set_mode, ftp,
    manual_control, param_set, reboot, set_mode, stated_times, system_time,
};

const TOO_LATE: &str = "Command waited for too long: refused";

/// FTP: create a file.
const CREATE_FILE: u8 = 6;

/// The quickest way of a message from the page.
const LEAST_DELAY_MS: u64 = 40;

/// The limits of what moves the rover, and of what changes something for good.
const MOTION_MS: u64 = 1_500;
const CHANGE_MS: u64 = 3_000;

/// The time in UTC when the rover has started, in ms.
const UNIX_MS: u64 = 1_790_000_000_000;

/// A page whose clock is three seconds behind the rover's.
struct Page {
    desk: Desk,
    /// For how long its phone has slept, which stops the first of its clocks.
    slept_ms: u64,
    /// By how much its time in UTC is slow.
    slow_ms: u64,
}

impl Page {
    /// It has stated its time each second for a while.
    fn new(kind: LinkKind, access: Access) -> Self {
        let mut desk = Desk::with_packs(&[BatteryState {
            status: PackStatus::Healthy,
            readings: Readings {
                voltage_v: Some(7.4),
                ..Readings::NONE
            },
            ..BatteryState::default()
        }]);
        desk.set(VehicleParameter::MotSlewrate, 0.0);
        desk.connect(kind);
        desk.endpoint.set_access(access);
        desk.now_us = 10_000_000;
        let mut page = Self {
            desk,
            slept_ms: 0,
            slow_ms: 0,
        };
        for _ in 0..10 {
            page.send(LEAST_DELAY_MS, &[]);
        }
        page
    }

    fn own() -> Self {
        Self::new(LinkKind::Wifi, Access::Page)
    }

    fn armed_in(mode: f32) -> Self {
        let mut page = Self::own();
        page.send(LEAST_DELAY_MS, &arm_by_force());
        page.send(LEAST_DELAY_MS, &do_set_mode(mode));
        page.send(LEAST_DELAY_MS, &manual_control(VEHICLE_ID, 0, 0));
        page
    }

    /// The page's statement of its time, sent this long ago.
    fn statement(&self, delay_ms: u64) -> Vec<u8> {
        let sent_ms = self.desk.now_us / 1_000 - delay_ms;
        let boot_ms = sent_ms - 3_000 - self.slept_ms;
        stated_times(boot_ms as u32, (UNIX_MS + sent_ms - self.slow_ms) * 1_000)
    }

    /// A second later a request arrives that was sent this long ago, behind a statement of the page's time then. Returns the
    /// event, and the texts of the answer.
    fn send(&mut self, delay_ms: u64, request: &[u8]) -> (Event, Vec<String>) {
        self.send_after(1_000, delay_ms, request)
    }

    fn send_after(&mut self, pause_ms: u64, delay_ms: u64, request: &[u8]) -> (Event, Vec<String>) {
        self.desk.now_us += pause_ms * 1_000;
        self.desk.receive_in_chunks(&self.statement(delay_ms), 64);
        let events = self.desk.receive_in_chunks(request, 64);
        self.desk.drive();
        let answers = self.desk.sent();
        if texts_of(&answers) == [TOO_LATE] {
            let acks = of_message(&answers, COMMAND_ACK);
            assert!(acks.iter().all(|ack| ack.u8(2) == FAILED));
        }
        (
            events.last().copied().unwrap_or(Event::Ignored),
            texts_of(&answers),
        )
    }
}

#[test]
fn old_commands_of_the_page_are_refused_with_a_text() {
    let erase_logs = encode_v2(LOG_ERASE, &VEHICLE);
    let create_file = ftp(1, CREATE_FILE, 16, 0, b"@PARAM/param.pck");
    for (request, longest_ms) in [
        (arm_by_force(), MOTION_MS),
        (command_int(400, 1.0), MOTION_MS),
        (do_set_mode(0.0), MOTION_MS),
        (set_mode(1, 1, 0), MOTION_MS),
        (reboot(), CHANGE_MS),
        (command_long(PREFLIGHT_STORAGE, 2.0), CHANGE_MS),
        (command_long_2(BATTERY_RESET, 1.0, 100.0), CHANGE_MS),
        (param_set("BATT_LOW_VOLT", 7.0), CHANGE_MS),
        (erase_logs, CHANGE_MS),
        (create_file, CHANGE_MS),
    ] {
        for (age_ms, is_refused) in [(longest_ms, false), (longest_ms + 1, true), (12_000, true)] {
            let mut page = Page::own();
            let before = page.desk.vehicle().status();
            let (event, texts) = page.send(LEAST_DELAY_MS + age_ms, &request);
            let case = format!("{request:?} after {age_ms} ms: {event:?}, {texts:?}");
            assert_eq!(texts.contains(&TOO_LATE.into()), is_refused, "{case}");
            if is_refused {
                assert!(
                    matches!(event, Event::Answered | Event::CommandRefused(_)),
                    "{case}"
                );
                assert_eq!(page.desk.vehicle().status(), before, "{case}");
                // In time this request is obeyed.
                let (_, texts) = page.send(LEAST_DELAY_MS, &request);
                assert!(!texts.contains(&TOO_LATE.into()), "{case}");
            }
        }
    }
}

#[test]
fn what_stops_the_rover_is_obeyed_however_old_it_is() {
    for delay_ms in [100, 2_000, 12_000] {
        for hold in [do_set_mode(4.0), set_mode(1, 1, 4)] {
            let mut page = Page::armed_in(0.0);
            assert_eq!(page.send(delay_ms, &hold), (Event::Driven, vec![]));
            assert_eq!(page.desk.vehicle().status().mode, Mode::Hold);
        }
        let mut page = Page::armed_in(0.0);
        assert_eq!(page.send(delay_ms, &disarm()), (Event::Driven, vec![]));
        assert_eq!(page.desk.vehicle().arm_state(), ArmState::Disarmed);
        for neutral in [
            manual_control(VEHICLE_ID, 0, 0),
            manual_control(VEHICLE_ID, i16::MAX, i16::MAX),
        ] {
            let mut page = Page::armed_in(0.0);
            page.send(LEAST_DELAY_MS, &manual_control(VEHICLE_ID, 0, 900));
            assert_ne!(page.desk.vehicle().drives(), SideDrives::COAST);
            assert_eq!(page.send(delay_ms, &neutral), (Event::Driven, vec![]));
            assert_eq!(page.desk.drive(), SideDrives::COAST, "{neutral:?}");
        }
    }
}

#[test]
fn old_deflected_sticks_of_the_page_are_dropped() {
    for sticks in [
        manual_control(VEHICLE_ID, 0, 900),
        manual_control(VEHICLE_ID, 900, 0),
        manual_control(VEHICLE_ID, i16::MAX, 900),
    ] {
        let mut page = Page::armed_in(0.0);
        let (event, _) = page.send(LEAST_DELAY_MS + MOTION_MS + 1, &sticks);
        assert_eq!(
            (event, page.desk.drive()),
            (Event::ControlTooLate, SideDrives::COAST)
        );
        let (event, _) = page.send(LEAST_DELAY_MS + MOTION_MS, &sticks);
        assert_eq!(event, Event::Driven);
    }
}

#[test]
fn late_sticks_are_announced_every_five_seconds() {
    let mut page = Page::armed_in(0.0);
    page.send(LEAST_DELAY_MS, &manual_control(VEHICLE_ID, 0, 900));
    let mut announced_ms = Vec::new();
    for ms in (0..12_000).step_by(50) {
        let delay_ms = LEAST_DELAY_MS + MOTION_MS + 1;
        let (event, texts) = page.send_after(50, delay_ms, &manual_control(VEHICLE_ID, 0, 900));
        assert_eq!(event, Event::ControlTooLate);
        let late = texts.iter().filter(|text| *text == "Sticks ignored: too late");
        announced_ms.extend(late.map(|_| ms));
    }
    assert_eq!(announced_ms, [0, 5_000, 10_000]);
}

#[test]
fn sticks_are_as_old_as_the_statement_before_them() {
    let mut page = Page::armed_in(0.0);
    for delay_ms in [700, 1_400] {
        // The page states its time with each message of the sticks, else its latest one would be a second older.
        page.desk.now_us += 950_000;
        let (event, texts) = page.send_after(50, delay_ms, &manual_control(VEHICLE_ID, 0, 900));
        assert_eq!((event, texts), (Event::Driven, vec![]), "{delay_ms}");
    }
}

#[test]
fn a_clock_that_stops_or_is_corrected_makes_nothing_late() {
    for (slept_ms, slow_ms) in [(60_000, 0), (3_600_000, 400), (0, 5_000), (0, 86_400_000)] {
        let mut page = Page::own();
        page.desk.now_us += slept_ms * 1_000;
        page.slept_ms = slept_ms;
        page.slow_ms = slow_ms;
        let case = format!("slept {slept_ms} ms, slow by {slow_ms} ms");
        let (event, texts) = page.send(LEAST_DELAY_MS, &arm_by_force());
        assert_eq!((event, texts), (Event::Driven, vec![]), "{case}");
        let (event, texts) = page.send(LEAST_DELAY_MS, &do_set_mode(0.0));
        assert_eq!((event, texts), (Event::Driven, vec![]), "{case}");
        // The other clock shows what is late.
        let late = page.send(LEAST_DELAY_MS + MOTION_MS + 1, &do_set_mode(0.0));
        assert_eq!(late.1, [TOO_LATE], "{case}");
    }
}

#[test]
fn what_comes_late_after_a_silence_is_refused_however_long_that_was() {
    for silence_ms in [10_000, 33_500, 40_000, 90_000, 3_600_000] {
        let mut page = Page::own();
        let late = page.send_after(silence_ms, silence_ms, &arm_by_force());
        assert_eq!(late.1, [TOO_LATE], "{silence_ms}");
        // The next piece of the same backlog.
        let late = page.send_after(17_000, silence_ms, &arm_by_force());
        assert_eq!(late.1, [TOO_LATE], "{silence_ms}");
        assert_eq!(
            page.send(LEAST_DELAY_MS, &arm_by_force()),
            (Event::Driven, vec![])
        );
    }
}

#[test]
fn only_the_pages_own_link_is_judged_by_what_it_states() {
    for (kind, access) in [
        (LinkKind::Wifi, Access::Full),
        (LinkKind::Direct, Access::Full),
        (LinkKind::Radio, Access::Full),
    ] {
        let mut page = Page::new(kind, access);
        assert_eq!(
            page.send(12_000, &arm_by_force()),
            (Event::Driven, vec![]),
            "{kind:?}"
        );
    }
}

#[test]
fn a_station_that_states_no_time_is_obeyed() {
    let mut desk = Desk::without_packs();
    desk.connect(LinkKind::Wifi);
    desk.endpoint.set_access(Access::Page);
    for second in 1..20 {
        desk.now_us = second * 1_000_000;
        desk.ask(&system_time(1_790_000_000_000_000));
    }
    desk.now_us = 60_000_000;
    assert_eq!(desk.receive_in_chunks(&arm_by_force(), 64), [Event::Driven]);
}

#[test]
fn what_was_sent_long_after_the_last_statement_may_be_old() {
    let mut page = Page::own();
    page.desk.now_us += 1_400_000;
    assert_eq!(page.desk.receive_in_chunks(&arm_by_force(), 64), [Event::Driven]);
    page.desk.ask(&disarm());
    page.desk.now_us += 200_000;
    assert_eq!(
        page.desk.receive_in_chunks(&arm_by_force(), 64),
        [Event::CommandRefused(400)]
    );
}

#[test]
fn a_link_that_stays_slow_counts_as_no_delay_after_half_a_minute() {
    let mut page = Page::own();
    assert_eq!(page.send(5_000, &arm_by_force()).1, [TOO_LATE]);
    for _ in 0..30 {
        page.send(5_000, &[]);
    }
    assert_eq!(page.send(5_000, &arm_by_force()), (Event::Driven, vec![]));
}
