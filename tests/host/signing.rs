//! Permissions on a link, and the signatures of what leaves it, once a signing key is set.

use proptest::prelude::*;
use rover_battmon::autopilot::Start;
use rover_battmon::mavlink::{Event, LinkKind, SetupRefused, SigningChange, SigningTrouble, StoredSigning};
use rover_battmon::memory::storage::Condition;
use rover_battmon::parameter::{Parameters, VehicleParameter};
use rover_battmon::time::Utc;
use rover_battmon::vehicle::{ArmState, Mode};
use support::commands::{ARM_DISARM, REQUEST_MESSAGE};
use support::desk::Desk;
use support::frames::{
    COMMAND_ACK, PARAM_SET, PARAM_VALUE, SYS_STATUS, SysStatus, encode_v1, of_message, texts_of,
};
use support::requests::{
    EVERYONE, GCS, VEHICLE, arm, arm_by_force, command_int, command_long, disarm, do_set_mode, heartbeat,
    manual_control, param_read_by_name, param_request_list, param_set, param_set_payload, ping,
    provoke_fault, radio_status, rc_override, reboot, reboot_to_boot_loader, set_mode, setup_signing,
    setup_signing_of, system_time,
};
use support::signer::{NEW_YEAR, OWNER, STRANGER, Signer};
use support::time::MINUTE_US;

const MINUTE_TICKS: u64 = 60 * 100_000;

/// The last time that 48 bits hold, and the last one that leaves a year.
const END: u64 = (1 << 48) - 1;
const LATEST: u64 = END - 365 * 24 * 60 * MINUTE_TICKS;

const HOLD: u8 = 4;
/// In pulses of a channel: the middle, let go, and not meant.
const NEUTRAL_US: u16 = 1500;
const RELEASED_US: u16 = 0;
const UNCHANGED_US: u16 = 65535;

/// The first message of it.
const TOO_OLD: &str = "desk: signed frames too old: does the station hear";

const NOTHING: f32 = 0.0;
const REQUESTS: f32 = 1.0;
const EVERYTHING: f32 = 2.0;

fn desk(kind: LinkKind) -> Desk {
    let mut desk = Desk::without_packs();
    desk.connect(kind);
    desk
}

/// A radio link of a vehicle whose owner has set up a key by cable.
fn protected() -> Desk {
    let mut desk = desk(LinkKind::Direct);
    let events = desk.receive_in_chunks(&setup_signing([OWNER; 32], NEW_YEAR), 64);
    assert_eq!(events, [Event::SigningSetUp(SigningChange::KeySet)]);
    desk.connect(LinkKind::Radio);
    desk
}

fn was_obeyed(desk: &mut Desk, request: &[u8]) -> bool {
    let events = desk.receive_in_chunks(request, 64);
    assert_eq!(events.len(), 1);
    !matches!(
        events[0],
        Event::Unauthorized { .. } | Event::TooOld | Event::Ignored
    )
}

/// Requests that change something.
fn changing_requests() -> Vec<Vec<u8>> {
    vec![
        param_set("BATT_LOW_VOLT", 6.5),
        arm(),
        reboot(),
        reboot_to_boot_loader(),
        provoke_fault(),
        set_mode(1, 1, 0),
        manual_control(1, 0, 500),
        heartbeat(GCS),
        setup_signing([STRANGER; 32], NEW_YEAR),
    ]
}

/// Requests that only read.
fn reading_requests() -> Vec<Vec<u8>> {
    vec![
        param_request_list(VEHICLE),
        param_read_by_name("BATT_LOW_VOLT"),
        command_long(REQUEST_MESSAGE, 1.0),
        ping(1, 1),
    ]
}

#[test]
// Requirement: L-13
fn a_key_can_be_set_up_by_cable_only() {
    for kind in [LinkKind::Radio, LinkKind::Wifi] {
        let mut link = desk(kind);
        let events = link.receive_in_chunks(&setup_signing([OWNER; 32], NEW_YEAR), 64);
        assert_eq!(events, [Event::SigningRefused(SetupRefused::NotDirect)]);
        assert_eq!(texts_of(&link.sent()), ["Signing is set up by USB only"]);
        let request = param_set("BATT_LOW_VOLT", 6.5);
        assert!(was_obeyed(&mut link, &request), "nothing has changed");
    }

    // Not even with the key.
    let mut radio = protected();
    let mut signer = Signer::new(OWNER);
    let signed = signer.sign(&setup_signing([STRANGER; 32], NEW_YEAR));
    let events = radio.receive_in_chunks(&signed, 64);
    assert_eq!(events, [Event::SigningRefused(SetupRefused::NotDirect)]);
    assert!(was_obeyed(&mut radio, &signer.sign(&arm())));
}

#[test]
fn a_setup_with_an_impossible_time_or_another_target_changes_nothing() {
    let mut cable = desk(LinkKind::Direct);
    for time in [LATEST + 1, END, END + 1] {
        let events = cable.receive_in_chunks(&setup_signing([OWNER; 32], time), 64);
        assert_eq!(events, [Event::SigningRefused(SetupRefused::BadTime)]);
        assert_eq!(texts_of(&cable.sent()), ["Signing not set up: bad timestamp"]);
    }
    for target in [EVERYONE, [2, 1]] {
        let request = setup_signing_of(target, [OWNER; 32], NEW_YEAR);
        assert_eq!(cable.receive_in_chunks(&request, 64), [Event::Ignored]);
    }
    cable.sent();
    cable.post_due(0);
    assert!(cable.sent().iter().all(|frame| frame.signed.is_none()));
}

#[test]
fn without_the_key_the_radio_is_deaf_to_everything_but_radios() {
    let mut radio = protected();
    for request in [changing_requests(), reading_requests()].concat() {
        assert!(!was_obeyed(&mut radio, &request));
        assert!(!was_obeyed(&mut radio, &Signer::new(STRANGER).sign(&request)));
    }
    let v1 = encode_v1(PARAM_SET, &param_set_payload(VEHICLE, "BATT_LOW_VOLT", 6.5));
    assert!(!was_obeyed(&mut radio, &v1));
    for of_neighbours in [heartbeat(2), heartbeat(GCS), system_time(UNIX_US)] {
        let events = radio.receive_in_chunks(&of_neighbours, 64);
        assert_eq!(events, [Event::Ignored], "no news");
    }
    assert!(was_obeyed(&mut radio, &radio_status(50)));
    assert_eq!(radio.sent(), [], "no request is answered");
    assert_eq!(*radio.parameters(), Parameters::defaults());
    let mut signer = Signer::new(OWNER);
    for request in [reading_requests(), changing_requests()].concat() {
        assert!(was_obeyed(&mut radio, &signer.sign(&request)));
    }
}

#[test]
fn each_link_takes_without_its_key_what_its_owner_allows_there() {
    let links = [
        (LinkKind::Radio, VehicleParameter::SignUartAllow, NOTHING),
        (LinkKind::Direct, VehicleParameter::SignUsbAllow, EVERYTHING),
        (LinkKind::Wifi, VehicleParameter::SignWifiAllow, NOTHING),
    ];
    for (kind, own, default) in links {
        assert_eq!(Parameters::defaults().get(own), default, "{kind:?}");
        for allowed in [NOTHING, REQUESTS, EVERYTHING] {
            let mut link = protected();
            link.connect(kind);
            for (_, parameter, _) in links {
                link.set(parameter, EVERYTHING - allowed);
            }
            link.set(own, allowed);
            let reads = reading_requests().into_iter().map(|request| (request, REQUESTS));
            let changes = changing_requests()
                .into_iter()
                .map(|request| (request, EVERYTHING));
            for (request, needed) in reads.chain(changes) {
                for request in [Signer::new(STRANGER).sign(&request), request] {
                    let is_allowed = was_obeyed(&mut link, &request);
                    assert_eq!(is_allowed, allowed >= needed, "{kind:?} {allowed}: {request:?}");
                }
            }
            let signed = Signer::new(OWNER).sign(&setup_signing([OWNER; 32], NEW_YEAR));
            assert!(was_obeyed(&mut link, &signed), "{kind:?} {allowed}");
        }
    }
}

#[test]
fn no_key_is_set_up_or_removed_while_armed() {
    for (mut cable, key) in [(protected(), [0; 32]), (desk(LinkKind::Direct), [STRANGER; 32])] {
        cable.connect(LinkKind::Direct);
        cable.ask(&arm_by_force());
        let events = cable.receive_in_chunks(&setup_signing(key, NEW_YEAR), 64);
        assert_eq!(events, [Event::SigningRefused(SetupRefused::Armed)]);
        assert!(texts_of(&cable.sent()).contains(&"Not while armed: disarm first".to_owned()));
        cable.ask(&disarm());
        let events = cable.receive_in_chunks(&setup_signing(key, NEW_YEAR), 64);
        assert!(matches!(events[0], Event::SigningSetUp(_)));
    }
}

#[test]
fn a_lost_key_locks_until_another_is_set_up_by_cable_whatever_the_cable_takes() {
    let without_key = |kind| {
        let signing = StoredSigning::default().restore(Condition::Damaged);
        assert_eq!(signing.trouble(), Some(SigningTrouble::KeyLost));
        let mut desk = Desk::starting(Start {
            signing,
            ..Start::with_parameters(Parameters::defaults())
        });
        desk.connect(kind);
        desk
    };
    let mut radio = without_key(LinkKind::Radio);
    for request in [changing_requests(), reading_requests()].concat() {
        assert!(!was_obeyed(&mut radio, &request));
        assert!(!was_obeyed(&mut radio, &Signer::new(OWNER).sign(&request)));
    }
    assert_eq!(radio.sent(), []);

    let mut cable = without_key(LinkKind::Direct);
    cable.set(VehicleParameter::SignUsbAllow, NOTHING);
    assert!(!was_obeyed(&mut cable, &param_set("BATT_LOW_VOLT", 6.5)));
    let events = cable.receive_in_chunks(&setup_signing([OWNER; 32], NEW_YEAR), 64);
    assert_eq!(events, [Event::SigningSetUp(SigningChange::KeySet)]);
    // From now on it takes the key again.
    assert!(!was_obeyed(&mut cable, &setup_signing([STRANGER; 32], NEW_YEAR)));
    assert!(was_obeyed(&mut cable, &Signer::new(OWNER).sign(&arm())));
}

#[test]
// Requirement: L-14
fn a_frame_that_was_held_back_for_over_a_minute_does_not_count() {
    let mut radio = protected();
    let mut owner = Signer::new(OWNER);
    assert!(was_obeyed(&mut radio, &owner.sign(&arm())));
    // The owner's next frames are jammed and recorded, and the owner falls silent.
    for (held_back_us, counts) in [(MINUTE_US, true), (MINUTE_US + 1_000, false)] {
        radio.now_us = held_back_us;
        let frame = owner.sign(&manual_control(1, 0, 1000));
        assert_eq!(was_obeyed(&mut radio, &frame), counts, "{held_back_us} us");
    }
}

/// Requests that stop the rover and do nothing else.
fn stopping_requests() -> Vec<Vec<u8>> {
    vec![
        disarm(),
        command_int(ARM_DISARM, 0.0),
        set_mode(1, 1, HOLD.into()),
        do_set_mode(HOLD.into()),
        manual_control(1, 0, 0),
        rc_override(VEHICLE, NEUTRAL_US, NEUTRAL_US),
    ]
}

/// Requests that look like it: sticks of which one is deflected, let go, or not there.
fn almost_stopping_requests() -> Vec<Vec<u8>> {
    let sticks = |steering_us, throttle_us| rc_override(VEHICLE, steering_us, throttle_us);
    vec![
        manual_control(1, 0, 300),
        manual_control(1, 300, 0),
        sticks(NEUTRAL_US, 1900),
        sticks(RELEASED_US, RELEASED_US),
        sticks(RELEASED_US, NEUTRAL_US),
        sticks(NEUTRAL_US, RELEASED_US),
        sticks(NEUTRAL_US, UNCHANGED_US),
        sticks(UNCHANGED_US, UNCHANGED_US),
        do_set_mode(0.0),
        command_long(ARM_DISARM, 0.5),
    ]
}

/// A station that the rover has heard, and another one that is so many minutes ahead, which the rover's time has followed: the
/// first one does not hear the rover, or it would follow, too.
fn one_way(minutes: u64) -> (Desk, Signer, Signer) {
    let mut radio = protected();
    radio.set(VehicleParameter::ArmingCheck, 0.0);
    let mut station = Signer::new(OWNER);
    radio.receive_in_chunks(&station.sign(&heartbeat(GCS)), 64);
    let mut ahead = Signer::new(OWNER);
    ahead.link = 4;
    ahead.timestamp += minutes * MINUTE_TICKS;
    radio.receive_in_chunks(&ahead.sign(&heartbeat(GCS)), 64);
    (radio, station, ahead)
}

#[test]
// Requirement: L-14
fn a_station_that_does_not_hear_the_rover_can_always_stop_it() {
    for (number, request) in stopping_requests().into_iter().enumerate() {
        let (mut radio, mut station, mut ahead) = one_way(60);
        assert!(was_obeyed(&mut radio, &ahead.sign(&arm())));
        assert!(was_obeyed(&mut radio, &ahead.sign(&do_set_mode(0.0))));
        assert!(was_obeyed(&mut radio, &station.sign(&request)));
        let status = radio.vehicle().status();
        let (arm_state, mode) = match number {
            0 | 1 => (ArmState::Disarmed, Mode::Manual),
            2 | 3 => (ArmState::Armed, Mode::Hold),
            _ => (ArmState::Armed, Mode::Manual),
        };
        assert_eq!(
            (status.arm_state, status.mode),
            (arm_state, mode),
            "request {number}"
        );
    }
}

#[test]
fn a_station_that_does_not_hear_the_rover_can_only_stop_it_and_is_reported_once() {
    let (mut radio, mut station, mut ahead) = one_way(2);
    let mut texts = Vec::new();
    for request in [changing_requests(), almost_stopping_requests()].concat() {
        let events = radio.receive_in_chunks(&station.sign(&request), 64);
        assert_eq!(events, [Event::TooOld], "{request:?}");
        radio.post_due(radio.now_us);
        texts.extend(texts_of(&radio.sent()));
        radio.now_us += 20_000_000;
    }
    let reports = texts.iter().filter(|text| *text == TOO_OLD);
    assert_eq!(reports.count(), 1, "{texts:?}");
    assert!(!texts.iter().any(|text| text.contains("not signed")), "{texts:?}");
    assert_eq!(radio.vehicle().arm_state(), ArmState::Disarmed);

    // It has heard the rover again, and later it has not.
    radio.post_due(radio.now_us);
    station.hear(&radio.sent());
    assert!(was_obeyed(&mut radio, &station.sign(&ping(1, 1))));
    ahead.timestamp = station.timestamp + 2 * MINUTE_TICKS;
    assert!(was_obeyed(&mut radio, &ahead.sign(&ping(1, 1))));
    assert!(!was_obeyed(&mut radio, &station.sign(&ping(1, 1))));
    radio.post_due(radio.now_us);
    assert!(texts_of(&radio.sent()).contains(&TOO_OLD.into()));
}

#[test]
fn what_is_too_old_neither_moves_the_time_nor_counts_as_hearing_the_station() {
    let (mut radio, mut station, mut ahead) = one_way(2);
    for request in [arm(), do_set_mode(0.0), manual_control(1, 0, 0)] {
        assert!(was_obeyed(&mut radio, &ahead.sign(&request)));
    }
    radio.sent();
    let mut texts = Vec::new();
    for tick in 1..100 {
        radio.now_us = tick * 100_000;
        was_obeyed(&mut radio, &station.sign(&heartbeat(GCS)));
        assert!(was_obeyed(&mut radio, &station.sign(&manual_control(1, 0, 0))));
        radio.drive();
        radio.post_due(radio.now_us);
        let frames = radio.sent();
        for frame in &frames {
            let (_, time) = station.verify(frame);
            let expected = ahead.timestamp + tick * 10_000;
            assert!(
                (expected - 10..expected + 1_000).contains(&time),
                "{time} for {expected}"
            );
        }
        texts.extend(texts_of(&frames));
    }
    assert!(texts.contains(&"GCS Failsafe: Hold".to_string()), "{texts:?}");
}

#[test]
fn who_drives_or_has_armed_can_stop_the_rover_whoever_comes() {
    let (mut radio, mut driver, mut armed_by) = one_way(0);
    assert!(was_obeyed(&mut radio, &armed_by.sign(&arm())));
    // Another station than the one that has armed.
    let of_another = |mut frame: Vec<u8>| {
        frame[5] = 77;
        frame
    };
    for throttle in [0, 300] {
        let sticks = of_another(manual_control(1, 0, throttle));
        assert!(was_obeyed(&mut radio, &driver.sign(&sticks)));
    }
    let mut page = Signer::new(OWNER);
    for link in 10..=255 {
        page.link = link;
        page.timestamp += MINUTE_TICKS;
        radio.now_us += 1_000_000;
        assert!(was_obeyed(&mut radio, &page.sign(&heartbeat(GCS))));
    }
    let centred = of_another(manual_control(1, 0, 0));
    assert!(was_obeyed(&mut radio, &driver.sign(&centred)));
    assert!(was_obeyed(&mut radio, &armed_by.sign(&disarm())));
    assert_eq!(radio.vehicle().arm_state(), ArmState::Disarmed);
}

#[test]
fn every_kind_of_link_has_a_number_of_its_own_in_signatures() {
    for (kind, number) in [(LinkKind::Radio, 0), (LinkKind::Direct, 1), (LinkKind::Wifi, 2)] {
        let mut link = protected();
        link.sent();
        link.connect(kind);
        link.post_due(0);
        assert_eq!(Signer::new(OWNER).verify(&link.sent()[0]).0, number, "{kind:?}");
    }
}

#[test]
fn a_removed_key_protects_nothing_any_more() {
    let mut cable = protected();
    cable.connect(LinkKind::Direct);
    assert!(cable.ask(&ping(1, 1))[0].signed.is_some());
    let events = cable.receive_in_chunks(&setup_signing([0; 32], 0), 64);
    assert_eq!(events, [Event::SigningSetUp(SigningChange::KeyRemoved)]);
    cable.connect(LinkKind::Radio);
    let answers = cable.ask(&param_set("BATT_LOW_VOLT", 6.5));
    assert_eq!(of_message(&answers, PARAM_VALUE).len(), 1);
    assert!(answers.iter().all(|frame| frame.signed.is_none()));
}

#[test]
// Requirement: L-10
fn what_is_ignored_is_counted_and_announced_every_ten_seconds() {
    let mut radio = protected();
    radio.post_due(0);
    radio.sent();
    let mut reported = Vec::new();
    for second in 0..30 {
        radio.now_us = second * 1_000_000;
        let events = radio.receive_in_chunks(&param_set("BATT_LOW_VOLT", 6.5), 64);
        assert!(matches!(events[..], [Event::Unauthorized { .. }]), "{events:?}");
        radio.post_due(radio.now_us);
        reported.extend(texts_of(&radio.sent()));
    }
    let expected = [1, 11, 21].map(|count| format!("desk: not signed with the key, ignored: {count}"));
    assert_eq!(reported, expected);
    radio.post_due(MINUTE_US);
    let frames = radio.sent();
    let status = SysStatus(of_message(&frames, SYS_STATUS)[0]);
    assert_eq!(status.dropped(), 0);
    assert_eq!(radio.statistics().unauthorized, 30);
}

/// 2026-11-25.
const UNIX_US: u64 = 1_795_564_800_000_000;

#[test]
fn the_time_is_believed_with_the_key_only_and_without_it_no_news() {
    let mut radio = protected();
    let mut owner = Signer::new(OWNER);
    radio.receive_in_chunks(&owner.sign(&heartbeat(GCS)), 64);
    let time = system_time(UNIX_US);
    let heard = Event::TimeHeard(Utc::from_micros(UNIX_US));
    for (allowed, unsigned) in [
        (NOTHING, Event::Ignored),
        (REQUESTS, Event::Ignored),
        (EVERYTHING, heard),
    ] {
        radio.set(VehicleParameter::SignUartAllow, allowed);
        for time in [time.clone(), Signer::new(STRANGER).sign(&time)] {
            assert_eq!(radio.receive_in_chunks(&time, 64), [unsigned], "{allowed}");
        }
        assert_eq!(radio.receive_in_chunks(&owner.sign(&time), 64), [heard]);
    }
}

#[test]
// Requirement: L-2
fn a_ground_station_without_the_key_does_not_keep_the_failsafe_from_acting() {
    let mut radio = protected();
    let mut owner = Signer::new(OWNER);
    radio.receive_in_chunks(&owner.sign(&heartbeat(GCS)), 64);
    radio.set(VehicleParameter::ArmingCheck, 0.0);
    assert!(was_obeyed(&mut radio, &owner.sign(&arm())));
    for second in 1..10 {
        radio.now_us = second * 1_000_000;
        radio.receive_in_chunks(&heartbeat(GCS), 64);
        radio.drive();
    }
    radio.post_due(radio.now_us);
    let texts = texts_of(&radio.sent());
    assert!(
        texts.contains(&"GCS Failsafe: Hold".to_string()),
        "the ground station with the key has been silent for 9 s"
    );
}

#[test]
fn no_answer_holds_the_key() {
    let mut radio = protected();
    let mut signer = Signer::new(OWNER);
    let mut sent = radio.ask(&signer.sign(&param_request_list(VEHICLE)));
    for step in 0..3000 {
        radio.now_us = step * 10_000;
        radio.post_due(radio.now_us);
        sent.extend(radio.sent());
    }
    assert!(of_message(&sent, PARAM_VALUE).len() > 50);
    assert!(of_message(&sent, COMMAND_ACK).is_empty());
    for frame in sent {
        let bytes = frame.signed.expect("it is signed");
        assert!(bytes.windows(4).all(|bytes| bytes != [OWNER; 4]));
    }
}

/// The time at which a frame was signed.
#[derive(Clone, Copy, Debug)]
enum Signed {
    /// This much before the latest frame of the station that the rover has heard.
    Before(u64),
    /// As that one.
    Equal,
    /// After it, but minutes before the rover's time.
    Late,
    /// This much before the rover's time, less than a minute.
    InTime(u64),
    /// This much ahead of the rover.
    Ahead(u64),
    /// This much before the end.
    AtTheEnd(u64),
}

/// The effect of such a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Counts {
    Fully,
    IsTooOld,
    Not,
}

fn signed() -> impl Strategy<Value = Signed> {
    prop_oneof![
        (1..=MINUTE_TICKS).prop_map(Signed::Before),
        Just(Signed::Equal),
        Just(Signed::Late),
        (0..MINUTE_TICKS - 10).prop_map(Signed::InTime),
        (1..=LATEST - NEW_YEAR - 60 * MINUTE_TICKS).prop_map(Signed::Ahead),
        (0..END - LATEST).prop_map(Signed::AtTheEnd),
    ]
}

proptest! {
    /// For every sender, time and kind of frame.
    #[test]
    // Requirement: L-14
    fn a_signed_frame_counts_by_its_sender_its_time_and_what_it_does(
        is_known in any::<bool>(),
        minutes in 3..40_u64,
        signed in signed(),
        which in any::<prop::sample::Index>(),
    ) {
        let stops = stopping_requests();
        let others = [changing_requests(), reading_requests(), almost_stopping_requests()].concat();
        let which = which.index(stops.len() + others.len());
        let request = stops.iter().chain(&others).nth(which).expect("one of them");
        let (mut radio, mut station, ahead) = one_way(minutes);
        let (latest, ours) = (station.timestamp - 1, ahead.timestamp - 1);
        let mut signer = station.clone();
        signer.link = if is_known { station.link } else { 9 };
        signer.timestamp = match signed {
            Signed::Before(ticks) => latest - ticks,
            Signed::Equal => latest,
            Signed::Late => latest + 1,
            Signed::InTime(ticks) => ours - ticks,
            Signed::Ahead(ticks) => ours + ticks,
            Signed::AtTheEnd(ticks) => END - ticks,
        };
        let frame = signer.sign(request);
        let events = radio.receive_in_chunks(&frame, 64);
        let [event] = events[..] else {
            return Err(TestCaseError::fail("one event"));
        };
        let counts = match event {
            Event::Unauthorized { .. } | Event::Ignored => Counts::Not,
            Event::TooOld => Counts::IsTooOld,
            _ => Counts::Fully,
        };
        let expected = match signed {
            Signed::InTime(_) | Signed::Ahead(_) => Counts::Fully,
            Signed::Late if is_known && which < stops.len() => Counts::Fully,
            // The first frame of the station, once more.
            Signed::Equal if is_known && *request == heartbeat(GCS) => Counts::Not,
            Signed::Before(_) | Signed::Equal | Signed::Late => Counts::IsTooOld,
            Signed::AtTheEnd(_) => Counts::Not,
        };
        prop_assert_eq!(counts, expected);
        // It never counts twice, on another link neither, and moves our time only if it is ahead.
        prop_assert!(!was_obeyed(&mut radio, &frame));
        radio.connect(LinkKind::Radio);
        prop_assert!(!was_obeyed(&mut radio, &frame));
        radio.sent();
        radio.post_due(0);
        let expected = if let Signed::Ahead(ticks) = signed { ours + ticks } else { ours };
        let (_, time) = station.verify(&radio.sent()[0]);
        prop_assert!((expected..expected + 100).contains(&time), "{time} for {expected}");
        // Whatever it was, who is known still stops the rover.
        if !matches!(signed, Signed::AtTheEnd(_)) {
            station.timestamp = station.timestamp.max(signer.timestamp);
        }
        prop_assert!(was_obeyed(&mut radio, &station.sign(&disarm())));
    }

    /// Whatever is changed in a signed frame, and whatever is behind it: nothing happens.
    #[test]
    // Requirement: OWN-4
    fn nothing_forged_is_obeyed(
        which in 0..6_usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), 1..=255_u8), 1..4),
    ) {
        let mut radio = protected();
        let mut frame = Signer::new(OWNER).sign(&changing_requests()[which]);
        let whole = frame.clone();
        for (at, change) in changes {
            // The first three bytes make it a signed frame; another start is another test.
            let at = 3 + at.index(frame.len() - 3);
            frame[at] ^= change;
        }
        prop_assume!(frame != whole);
        for event in radio.receive_in_chunks(&frame, 64) {
            prop_assert!(matches!(event, Event::Unauthorized { .. } | Event::Ignored), "{event:?}");
        }
        prop_assert_eq!(radio.parameters(), &Parameters::defaults());
    }
}
