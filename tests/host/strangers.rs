//! Strangers beside the owner's stations: they end no file session that was opened with the key, and keep no station from being known.

use nor_flash::SmallFlash;
use rover_battmon::autopilot::Start;
use rover_battmon::crash::ParameterSource;
use rover_battmon::mavlink::{Event, LinkKind};
use rover_battmon::parameter::{Parameters, VehicleParameter};
use rover_battmon::time::Utc;
use support::commands::{PREFLIGHT_STORAGE, RESET};
use support::desk::{Desk, EXTRA1};
use support::frames::{FILE_TRANSFER_PROTOCOL, Frame, of_message, resealed, texts_of};
use support::requests::{
    GCS, command_long, ftp, ftp_open, heartbeat_from, ping, setup_signing, system_time_from,
};
use support::signer::{NEW_YEAR, OWNER, Signer};
use support::time::SECOND;

use crate::downloads::packed;
use crate::regions::Regions;

const TERMINATE: u8 = 1;
const RESET_SESSIONS: u8 = 2;
const READ: u8 = 5;
const CREATE: u8 = 6;
const WRITE: u8 = 7;

const ACK: u8 = 128;
const NAK: u8 = 129;

const PARAMETERS: &str = "@PARAM/param.pck";

const REQUESTS: f32 = 1.0;
const EVERYTHING: f32 = 2.0;

/// A rover with a key whose radio accepts this much without it, and its owner.
fn with_key(allowed: f32) -> (Desk, Signer) {
    let mut desk = Desk::without_packs();
    desk.connect(LinkKind::Direct);
    desk.receive_in_chunks(&setup_signing([OWNER; 32], NEW_YEAR), 64);
    desk.connect(LinkKind::Radio);
    desk.set(VehicleParameter::SignUartAllow, allowed);
    desk.set(VehicleParameter::SignWifiAllow, allowed);
    (desk, Signer::new(OWNER))
}

fn from(sender: [u8; 2], request: &[u8]) -> Vec<u8> {
    let mut frame = request.to_vec();
    [frame[5], frame[6]] = sender;
    resealed(&frame)
}

/// ACK or NAK of a request of MAVLink FTP, and the texts with it.
fn answer(desk: &mut Desk, request: &[u8]) -> (u8, Vec<String>) {
    let frames = desk.ask(request);
    let answers: Vec<&Frame> = of_message(&frames, FILE_TRANSFER_PROTOCOL);
    assert_eq!(answers.len(), 1, "{frames:?}");
    (answers[0].u8(6), texts_of(&frames))
}

/// Requests that end a session or put another one in its place.
fn endings() -> [Vec<u8>; 3] {
    [
        ftp(90, TERMINATE, 0, 0, &[]),
        ftp(91, RESET_SESSIONS, 0, 0, &[]),
        ftp_open(92, PARAMETERS),
    ]
}

#[test]
fn no_unsigned_request_ends_an_upload_that_was_opened_with_the_key() {
    let path = PARAMETERS.as_bytes();
    for kind in [LinkKind::Radio, LinkKind::Wifi] {
        for ending in endings() {
            for sender in [[255, 190], [255, 0], [77, 9]] {
                let (mut desk, mut owner) = with_key(REQUESTS);
                desk.connect(kind);
                let file = packed(&[("SR0_EXTRA1", 5.0), ("SR0_PARAMS", 7.0)]);
                let (first, second) = file.split_at(21);
                let create = owner.sign(&ftp(1, CREATE, path.len() as u8, 0, path));
                assert_eq!(answer(&mut desk, &create).0, ACK);
                let write = owner.sign(&ftp(2, WRITE, first.len() as u8, 0, first));
                assert_eq!(answer(&mut desk, &write).0, ACK);
                desk.now_us += 10 * SECOND - 1;
                assert_eq!(answer(&mut desk, &from(sender, &ending)).0, NAK, "{sender:?}");
                let write = owner.sign(&ftp(3, WRITE, second.len() as u8, 21, second));
                assert_eq!(answer(&mut desk, &write).0, ACK);
                // With the number of the owner's next one.
                answer(&mut desk, &from(sender, &ftp(4, TERMINATE, 0, 0, &[])));
                let end = owner.sign(&ftp(4, TERMINATE, 0, 0, &[]));
                let (result, texts) = answer(&mut desk, &end);
                assert_eq!(result, ACK);
                assert_eq!(texts, [""; 0]);
                assert_eq!(desk.parameters().get(EXTRA1), 5.0);
                assert_eq!(desk.parameters().get(VehicleParameter::Sr0Params), 7.0);
            }
        }
    }
}

#[test]
fn a_session_with_the_key_is_ended_without_it_after_ten_seconds_or_where_everything_is_accepted() {
    for (allowed, silence_us, ends) in [
        (REQUESTS, 0, false),
        (REQUESTS, 10 * SECOND - 1, false),
        (REQUESTS, 10 * SECOND, true),
        (EVERYTHING, 0, true),
    ] {
        for ending in endings() {
            let (mut desk, mut owner) = with_key(allowed);
            assert_eq!(answer(&mut desk, &owner.sign(&ftp_open(1, PARAMETERS))).0, ACK);
            desk.now_us += silence_us / 2;
            // With the owner's ids, but not the owner's.
            desk.receive_in_chunks(&ftp(7, READ, 20, 0, &[]), 64);
            desk.post_due(desk.now_us);
            desk.sent();
            desk.now_us += silence_us - silence_us / 2;
            let (result, _) = answer(&mut desk, &ending);
            assert_eq!(result == ACK, ends, "{allowed} {silence_us} {ending:?}");
        }
    }
    // One that was opened without the key is as before.
    for ending in endings() {
        let (mut desk, _) = with_key(REQUESTS);
        assert_eq!(answer(&mut desk, &ftp_open(1, PARAMETERS)).0, ACK);
        assert_eq!(answer(&mut desk, &ending).0, ACK);
    }
}

const UNIX_US: u64 = 1_795_639_396_750_000;
const STATION: [u8; 2] = [255, 190];

/// Seconds in which the station's time is heard, in a minute among strangers, who send `per_second` messages. Its heartbeat and its
/// time come in turn.
fn seconds_heard(per_second: u64, mut stranger: impl FnMut(u64) -> Vec<u8>) -> usize {
    let mut desk = Desk::without_packs();
    let mut heard = 0;
    let step_us = SECOND / per_second;
    for number in 0..60 * per_second {
        desk.now_us = number * step_us;
        desk.receive_in_chunks(&stranger(number), 64);
        if number % per_second == per_second / 4 {
            desk.receive_in_chunks(&heartbeat_from(STATION, GCS), 64);
        }
        if number % per_second == per_second * 3 / 4 {
            let events = desk.receive_in_chunks(&system_time_from(STATION, UNIX_US), 64);
            heard += usize::from(events == [Event::TimeHeard(Utc::from_micros(UNIX_US))]);
        }
        desk.sent();
    }
    heard
}

#[test]
fn strangers_with_changing_ids_do_not_keep_the_time_of_a_station_away() {
    for per_second in [4, 30, 100] {
        let heard = seconds_heard(per_second, |number| heartbeat_from([number as u8 % 250, 33], GCS));
        assert!(heard >= 58, "{heard} at {per_second}");
        // Other vehicles state theirs, too.
        const QUADROTOR: u8 = 2;
        let heard = seconds_heard(per_second, |number| {
            let sender = [number as u8 % 250, 1];
            [
                heartbeat_from(sender, QUADROTOR),
                system_time_from(sender, UNIX_US + 1),
            ]
            .concat()
        });
        assert!(heard >= 58, "{heard} at {per_second}");
    }
}

#[test]
fn busy_strangers_lock_no_station_out() {
    let of_stranger = |number: u64| {
        let sender = [number as u8 + 11, 190];
        [heartbeat_from(sender, GCS), from(sender, &ping(1, 1))]
    };
    // Four of them have all places at first, and go on at a station's rate.
    for phase in 0..7 {
        let heard = seconds_heard(30, |number| match (number + phase) % 7 {
            stranger @ 0..4 if number % 30 < 7 => of_stranger(stranger).concat(),
            _ => Vec::new(),
        });
        assert!(heard >= 20, "{heard} at {phase}");
    }
    // They have been busy, and send heartbeats alone from now on.
    let heard = seconds_heard(30, |number| match of_stranger(number % 4) {
        messages if number < 4 => messages.concat(),
        [heartbeat, _] => heartbeat,
    });
    assert!(heard >= 58, "{heard}");
}

#[test]
fn a_reset_of_parameters_opens_no_link_wherever_power_is_cut() {
    let allow = |uart, usb, wifi| {
        [
            (VehicleParameter::SignUartAllow, uart),
            (VehicleParameter::SignUsbAllow, usb),
            (VehicleParameter::SignWifiAllow, wifi),
        ]
    };
    for (before, after) in [
        (allow(0.0, 0.0, 0.0), allow(0.0, 0.0, 0.0)),
        (allow(2.0, 1.0, 1.0), allow(0.0, 1.0, 0.0)),
        (allow(1.0, 2.0, 2.0), allow(0.0, 2.0, 0.0)),
    ] {
        let regions = Regions::blank();
        regions.run(Start::default(), async |vehicle| {
            for (parameter, value) in before {
                vehicle.set(parameter.row().name, value);
            }
            vehicle.set("SR0_EXTRA1", 7.0);
            vehicle.wait(2).await;
        });
        let stored = regions.parameters.bytes();
        let started = |regions: &Regions| regions.started(ParameterSource::Stored).parameters;
        let values = |parameters: &Parameters| before.map(|(parameter, _)| parameters.get(parameter));
        let expected = |of: [(VehicleParameter, f32); 3]| of.map(|(_, value)| value);
        let mut is_cut = true;
        let (mut operation, mut kept) = (0, 0);
        while is_cut {
            for seed in 0..8 {
                let regions = Regions {
                    parameters: SmallFlash::with(&stored),
                    ..Regions::blank()
                };
                let vehicle = regions.run(Start::default(), async |vehicle| {
                    regions.parameters.chip().cut_power_after(operation, seed);
                    vehicle.ask(&command_long(PREFLIGHT_STORAGE, RESET));
                    vehicle.wait(2).await;
                });
                let live = vehicle.shared.with(|autopilot| values(autopilot.parameters()));
                assert_eq!(live, expected(after), "live");
                is_cut = regions.parameters.chip().is_powered_off();
                regions.parameters.chip().power_up();
                let parameters = started(&regions);
                let is_reset = parameters.get(EXTRA1) != 7.0;
                let expected = expected(if is_reset { after } else { before });
                assert_eq!(values(&parameters), expected, "{operation} {seed}");
                kept += usize::from(!is_reset);
                assert!(is_cut || is_reset, "done");
            }
            operation += 1;
        }
        assert!(operation > 3 && kept > 3, "{operation} {kept}");
    }
}

#[test]
fn a_permission_set_right_before_a_reset_is_stored_with_it() {
    let regions = Regions::blank();
    for (value, extra1) in [(0.0, 7.0), (2.0, 6.0), (1.0, 5.0), (0.0, 4.0)] {
        regions.run(Start::default(), async |vehicle| {
            vehicle.set("SR0_EXTRA1", extra1);
            vehicle.set("SIGN_USB_ALLOW", value);
            vehicle.ask(&command_long(PREFLIGHT_STORAGE, RESET));
            vehicle.wait(2).await;
        });
        let parameters = regions.started(ParameterSource::Stored).parameters;
        assert_eq!(parameters.get(VehicleParameter::SignUsbAllow), value);
        assert_eq!(parameters.get(EXTRA1), 2.0);
    }
}
