//! Wi-Fi without its radio: who may set it up, what is answered, announced, shown and stored.

use embassy_futures::block_on;
use embassy_time::Timer;
use nor_flash::SmallFlash;
use rover_battmon::autopilot::{FlashJob, FlashStore, Start, Work};
use rover_battmon::battery::{PackStatus, ReadError};
use rover_battmon::crash::{CrashCause, CrashRecord, FaultSite, STACK_WORDS, TaskName};
use rover_battmon::mavlink::{AcceptUnsigned, Event, LinkId, LinkKind, SigningChange};
use rover_battmon::memory::identity::{BoardId, Identity};
use rover_battmon::memory::storage::Storage;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, VehicleParameter};
use rover_battmon::sensor::{AnalogPin, AnalogReadings};
use rover_battmon::time::Instant;
use rover_battmon::wifi::{
    Network, Password, Radio, Ssid, StoredWifi, WIFI_WORDS, WifiMode, WifiRecord, WifiReport,
};
use support::commands::{PREFLIGHT_STORAGE, REQUEST_MESSAGE};
use support::desk::{Desk, conversions};
use support::frames::{
    COMMAND_ACK, Frame, PARAM_VALUE, ParamValue, WIFI_CONFIG_AP, encode_v2, of_message, texts_of,
};
use support::requests::{
    arm_by_force, command_long, disarm, param_set, setup_signing, wifi_config, wifi_config_payload,
};
use support::signer::{NEW_YEAR, Signer};

use crate::regions::Regions;

const ACCESS_POINT: u8 = 1;
const STATION: u8 = 2;
const DISABLED: u8 = 3;

const ACCEPTED: i8 = 1;
const REJECTED: i8 = 2;
const MODE_ERROR: i8 = 3;
const SSID_ERROR: i8 = 4;
const PASSWORD_ERROR: i8 = 5;

const OWN_PASSWORD: &str = "own password";

fn password(text: &str) -> Password {
    Password::new(text.as_bytes()).expect("valid")
}

fn network(name: &str, text: &str) -> Network {
    Network {
        ssid: Ssid::new(name.as_bytes()).expect("valid"),
        password: Some(password(text)),
    }
}

fn start(radio: Radio) -> Start {
    Start {
        identity: Identity {
            board_id: Some(BoardId([0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c])),
            ..Identity::default()
        },
        radio,
        ..Start::default()
    }
}

/// A board with a radio, at the end of this kind of link.
fn desk(kind: LinkKind) -> Desk {
    desk_of(Radio::Present, kind)
}

fn desk_of(radio: Radio, kind: LinkKind) -> Desk {
    let mut desk = Desk::starting(start(radio));
    let stored = StoredWifi {
        own_password: Some(password(OWN_PASSWORD)),
        network: None,
    };
    desk.autopilot.wifi_loaded(stored, Instant::EPOCH);
    desk.autopilot.take_work();
    desk.connect(kind);
    desk
}

/// Name, mode and response of an answer, which has no password.
fn answer(sent: &[Frame]) -> (String, u8, i8) {
    let answers = of_message(sent, WIFI_CONFIG_AP);
    let [answer] = answers[..] else {
        panic!("{} answers", answers.len());
    };
    assert_eq!(answer.text(32, 64), "", "a password");
    (answer.text(0, 32), answer.u8(96), answer.i8(97))
}

fn mode(desk: &Desk) -> f32 {
    desk.parameters().get(VehicleParameter::WifiMode)
}

#[test]
fn by_cable_it_is_set_up_and_answered_without_the_password() {
    let mut cable = desk(LinkKind::Direct);
    let sent = cable.ask(&wifi_config("home", "at home 1", STATION));
    assert_eq!(answer(&sent), ("home".into(), STATION, ACCEPTED));
    let value = ParamValue(of_message(&sent, PARAM_VALUE)[0]);
    assert_eq!((value.name(), value.value()), ("WIFI_MODE".into(), 2.0));
    let setup = cable.autopilot.wifi_setup().expect("a radio");
    assert_eq!(setup.mode, WifiMode::Station);
    assert_eq!(setup.network, Some(network("home", "at home 1")));
    let work = cable.autopilot.take_work();
    assert!(work.contains(Work::WIFI | Work::SAVE));
    let sent = cable.ask(&wifi_config("", "", DISABLED));
    assert_eq!(answer(&sent), (String::new(), DISABLED, ACCEPTED));
}

#[test]
fn what_is_not_valid_is_answered_with_its_error_and_changes_nothing() {
    let mut cable = desk(LinkKind::Direct);
    let before = cable.autopilot.wifi_setup();
    for (request, response) in [
        (wifi_config("home", "12345678", 4), MODE_ERROR),
        (wifi_config("other", "12345678", ACCESS_POINT), SSID_ERROR),
        (wifi_config("home", "short", STATION), PASSWORD_ERROR),
    ] {
        let expected = ("rover-0A2C".into(), ACCESS_POINT, response);
        assert_eq!(answer(&cable.ask(&request)), expected);
        assert_eq!(cable.autopilot.wifi_setup(), before);
        assert!(cable.autopilot.take_work().is_empty());
    }
}

#[test]
// Requirement: L-19
fn an_armed_rover_keeps_its_setup_until_it_is_disarmed() {
    let mut cable = desk(LinkKind::Direct);
    cable.ask(&arm_by_force());
    let before = cable.autopilot.wifi_setup();
    let sent = cable.ask(&wifi_config("home", "at home 1", STATION));
    assert_eq!(answer(&sent), ("rover-0A2C".into(), ACCESS_POINT, REJECTED));

    cable.autopilot.take_work();
    cable.ask(&param_set("WIFI_CHANNEL", 11.0));
    cable.ask(&param_set("WIFI_MODE", 0.0));
    assert_eq!(cable.autopilot.wifi_setup(), before);
    assert!(!cable.autopilot.take_work().contains(Work::WIFI));

    cable.drive();
    cable.ask(&disarm());
    cable.drive();
    let setup = cable.autopilot.wifi_setup().unwrap();
    assert_eq!((setup.mode, setup.channel), (WifiMode::Off, 11));
    assert!(cable.autopilot.take_work().contains(Work::WIFI));

    cable.ask(&param_set("WIFI_MODE", 1.0));
    assert_eq!(cable.autopilot.wifi_setup().unwrap().mode, WifiMode::AccessPoint);
    assert!(cable.autopilot.take_work().contains(Work::WIFI));
    cable.ask(&param_set("WIFI_MODE", 1.0));
    cable.ask(&param_set("BATT_LOW_VOLT", 9.0));
    assert!(!cable.autopilot.take_work().contains(Work::WIFI));
}

#[test]
fn a_reset_of_the_parameters_keeps_passwords() {
    let mut cable = desk(LinkKind::Direct);
    cable.ask(&wifi_config("home", "at home 1", STATION));
    cable.ask(&command_long(PREFLIGHT_STORAGE, 2.0));
    let setup = cable.autopilot.wifi_setup().unwrap();
    assert_eq!(setup.mode, WifiMode::AccessPoint);
    assert_eq!(setup.network, Some(network("home", "at home 1")));
    assert_eq!(setup.own_password, password(OWN_PASSWORD));
}

#[test]
fn without_proof_of_the_key_it_is_set_up_by_cable_only() {
    let request = wifi_config("home", "at home 1", STATION);
    for kind in [LinkKind::Radio, LinkKind::Wifi] {
        // Without a key nothing can be proven, whatever is allowed.
        let mut link = desk(kind);
        for allowed in [VehicleParameter::SignUartAllow, VehicleParameter::SignWifiAllow] {
            link.set(allowed, 2.0);
        }
        assert_eq!(
            AcceptUnsigned::on(kind, link.parameters()),
            AcceptUnsigned::Everything
        );
        let events = link.receive_in_chunks(&request, 64);
        assert!(matches!(events[..], [Event::Unauthorized { .. }]), "{events:?}");
        assert_eq!(link.statistics().unauthorized, 1);
        assert_eq!(of_message(&link.sent(), WIFI_CONFIG_AP).len(), 0);

        link.connect(LinkKind::Direct);
        let events = link.receive_in_chunks(&setup_signing([7; 32], NEW_YEAR), 64);
        assert_eq!(events, [Event::SigningSetUp(SigningChange::KeySet)]);
        link.set(VehicleParameter::SignUsbAllow, 1.0);
        let events = link.receive_in_chunks(&request, 64);
        assert!(matches!(events[..], [Event::Unauthorized { .. }]), "{events:?}");
        link.connect(kind);
        let stranger = Signer::new(8).sign(&request);
        for unproven in [&request, &stranger] {
            let events = link.receive_in_chunks(unproven, 64);
            assert!(matches!(events[..], [Event::Unauthorized { .. }]), "{events:?}");
        }
        assert_eq!(mode(&link), 1.0);
        let events = link.receive_in_chunks(&Signer::new(7).sign(&request), 64);
        assert_eq!(events, [Event::WifiSetUp(WifiMode::Station)]);
        assert_eq!(mode(&link), 2.0);
    }
}

#[test]
fn another_vehicles_answer_is_no_request() {
    let mut cable = desk(LinkKind::Direct);
    let mut payload = wifi_config_payload("home", "", STATION);
    for response in 1..=5 {
        payload[97] = response;
        assert_eq!(
            cable.receive_in_chunks(&encode_v2(WIFI_CONFIG_AP, &payload), 64),
            [Event::Ignored]
        );
    }
    assert_eq!(cable.sent(), []);
}

#[test]
fn what_is_set_up_can_be_requested_on_any_link() {
    for kind in LinkId::ALL.map(LinkId::kind) {
        let mut link = desk(kind);
        let sent = link.ask(&command_long(REQUEST_MESSAGE, WIFI_CONFIG_AP as f32));
        assert_eq!(sent[0].message_id, COMMAND_ACK);
        assert_eq!(sent[0].u8(2), 0, "accepted");
        assert_eq!(answer(&sent), ("rover-0A2C".into(), ACCESS_POINT, ACCEPTED));
    }
}

#[test]
fn a_board_without_a_radio_says_so() {
    let mut cable = desk_of(Radio::Absent, LinkKind::Direct);
    assert_eq!(cable.autopilot.wifi_setup(), None);
    for change_arming in [arm_by_force(), disarm()] {
        cable.ask(&change_arming);
        let sent = cable.ask(&wifi_config("home", "at home 1", STATION));
        assert_eq!(answer(&sent).2, MODE_ERROR);
    }
    assert_eq!(mode(&cable), 1.0);
    let sent = cable.ask(&command_long(REQUEST_MESSAGE, WIFI_CONFIG_AP as f32));
    assert_eq!((sent.len(), sent[0].u8(2)), (1, 2), "denied");
    assert_eq!(
        texts_of(&cable.ask(&param_set("WIFI_SHOW", 1.0))),
        ["No Wi-Fi radio on this board"]
    );
}

#[test]
fn the_password_is_shown_by_cable_only() {
    let mut cable = desk(LinkKind::Direct);
    let longest = "0123456789".repeat(6) + "abc";
    cable.ask(&wifi_config("", &longest, ACCESS_POINT));
    let sent = cable.ask(&param_set("WIFI_SHOW", 1.0));
    let shown = format!("Wi-Fi name: rover-0A2CWi-Fi password: {longest}");
    assert_eq!(texts_of(&sent).concat(), shown);
    assert_eq!(
        ParamValue(of_message(&sent, PARAM_VALUE)[1]).value(),
        0.0,
        "a trigger"
    );
    assert_eq!(texts_of(&cable.ask(&param_set("WIFI_SHOW", 0.0))), [""; 0]);
    for kind in [LinkKind::Radio, LinkKind::Wifi] {
        let mut link = desk(kind);
        assert_eq!(
            texts_of(&link.ask(&param_set("WIFI_SHOW", 1.0))),
            ["Wi-Fi password: by USB only"]
        );
        link.post_due(0);
        assert!(!texts_of(&link.sent()).concat().contains(OWN_PASSWORD));
    }
}

#[test]
fn a_radio_without_a_password_gets_one_that_is_saved() {
    let mut desk = Desk::starting(start(Radio::Present));
    assert_eq!(desk.autopilot.wifi_setup(), None);
    desk.autopilot.wifi_loaded(StoredWifi::default(), Instant::EPOCH);
    assert!(desk.autopilot.needs_entropy());
    assert_eq!(desk.autopilot.wifi_setup(), None);
    desk.autopilot.entropy_collected(Some([1; 32]), Instant::EPOCH);
    assert!(!desk.autopilot.needs_entropy());
    let made = Password::from_entropy(&[1; 32]);
    assert_eq!(desk.autopilot.wifi_setup().unwrap().own_password, made);
    assert!(desk.autopilot.take_work().contains(Work::WIFI | Work::SAVE));
    let unsaved = desk.next_flash_job(FlashStore::Wifi);
    assert_eq!(unsaved, Some(FlashJob::Wifi(WifiRecord::OwnPassword(made))));
    assert!(desk.autopilot.has_unsaved());
}

#[test]
fn a_radio_is_off_until_there_are_random_numbers() {
    let mut desk = Desk::starting(start(Radio::Present));
    desk.connect(LinkKind::Direct);
    desk.autopilot.wifi_loaded(StoredWifi::default(), Instant::EPOCH);
    for count in [1, 0] {
        desk.autopilot.entropy_collected(None, Instant::EPOCH);
        assert_eq!(desk.autopilot.wifi_setup(), None);
        desk.post_due(0);
        let mut texts = texts_of(&desk.sent());
        texts.retain(|text| text == "Wi-Fi off: no random numbers for a password");
        assert_eq!(texts.len(), count);
    }
    desk.autopilot.entropy_collected(Some([1; 32]), Instant::EPOCH);
    assert!(desk.autopilot.wifi_setup().is_some());
}

#[test]
fn a_radio_stays_off_after_a_fault_of_its_task_or_a_second_hang_in_its_turn() {
    let fault = |interrupt: u32| {
        CrashCause::Fault(FaultSite {
            pc: 0x1000_1234,
            lr: 0x1000_5679,
            xpsr: interrupt,
            stack: [0; STACK_WORDS],
        })
    };
    const TIMER_IRQ: u32 = 16;
    for (task, cause, radio_crashes, is_off) in [
        ("Wi-Fi", fault(0), 1, true),
        ("Wi-Fi", fault(TIMER_IRQ), 1, false),
        ("Wi-Fi", fault(TIMER_IRQ), 2, true),
        ("Wi-Fi", CrashCause::Hung, 1, false),
        ("Wi-Fi", CrashCause::Hung, 2, true),
        ("Wi-Fi", CrashCause::Overdue, 1, false),
        ("Wi-Fi", CrashCause::Overdue, 3, true),
        ("flash", fault(0), 0, false),
        ("battery", CrashCause::Hung, 0, false),
    ] {
        let case = format!("{task} {cause:?} {radio_crashes}");
        let task = TaskName::new(task);
        let mut desk = Desk::starting(Start {
            has_crashed: true,
            crash: Some(CrashRecord {
                task,
                cause,
                firmware: None,
            }),
            radio_crashes,
            ..start(Radio::Present)
        });
        desk.autopilot.wifi_loaded(StoredWifi::default(), Instant::EPOCH);
        desk.autopilot.entropy_collected(Some([1; 32]), Instant::EPOCH);
        assert_eq!(desk.autopilot.wifi_setup().is_none(), is_off, "{case}");
        desk.connect(LinkKind::Direct);
        desk.post_due(0);
        let text = "Wi-Fi off after a crash: restart the board";
        assert_eq!(texts_of(&desk.sent()).contains(&text.into()), is_off, "{case}");
    }
}

/// Announces a report, and returns what reaches a link.
fn announced(desk: &mut Desk, report: WifiReport) -> Vec<String> {
    desk.autopilot.wifi_report(report, desk.now());
    desk.post_due(0);
    texts_of(&desk.sent())
}

#[test]
fn a_report_is_announced_once_until_the_radio_does_what_it_should() {
    use WifiReport::*;
    let mut desk = desk(LinkKind::Direct);
    desk.ask(&wifi_config("home", "at home 1", STATION));
    let (lost, address) = ("Wi-Fi network lost", "Wi-Fi address 192.168.1.23");
    let (joined, not_found) = ("Wi-Fi network joined", "Wi-Fi network not found");
    let fallback = "No Wi-Fi network: access point instead";
    for (report, expected) in [
        (NetworkNotFound, Some(not_found)),
        (NetworkNotFound, None),
        (FallbackToAccessPoint, Some(fallback)),
        (AccessPointUp, Some("Wi-Fi access point on")),
        (NetworkNotFound, None),
        (FallbackToAccessPoint, None),
        (AccessPointUp, None),
        (Joined, Some(joined)),
        (NoAddress, Some("Wi-Fi network gives no address")),
        (Joined, None),
        (NoAddress, None),
        (AddressObtained([192, 168, 1, 23]), Some(address)),
        (AddressObtained([192, 168, 1, 23]), None),
        (AddressObtained([10, 0, 0, 2]), Some("Wi-Fi address 10.0.0.2")),
        (NetworkLost, Some(lost)),
        (NetworkLost, None),
        (NetworkNotFound, Some(not_found)),
        (Joined, Some(joined)),
        (AddressObtained([192, 168, 1, 23]), Some(address)),
        (WrongPassword, Some("Wi-Fi network refuses the password")),
        (NoAnswer, Some("Wi-Fi radio does not answer")),
        (DownloadFailed, Some("Wi-Fi radio does not take its firmware")),
        (NoAnswer, None),
    ] {
        assert_eq!(
            announced(&mut desk, report),
            Vec::from_iter(expected),
            "{report:?}"
        );
    }
    desk.ask(&param_set("WIFI_MODE", 1.0));
    let texts = announced(&mut desk, NoAnswer);
    assert_eq!(texts, ["Wi-Fi radio does not answer"], "it was set up again");
    assert_eq!(announced(&mut desk, AccessPointUp), ["Wi-Fi access point on"]);
    assert_eq!(announced(&mut desk, NoAnswer), ["Wi-Fi radio does not answer"]);
}

#[test]
fn a_ground_station_that_connects_later_is_sent_what_is_wrong_now() {
    let notices = |desk: &mut Desk| {
        desk.connect(LinkKind::Direct);
        desk.autopilot.open(&mut desk.endpoint);
        let texts = texts_of(&desk.sent());
        texts
            .into_iter()
            .filter(|text| text.contains("Wi-Fi"))
            .collect::<Vec<_>>()
    };
    let mut desk = desk(LinkKind::Direct);
    assert_eq!(notices(&mut desk), [""; 0]);
    desk.autopilot.wifi_report(WifiReport::NoAnswer, desk.now());
    assert_eq!(notices(&mut desk), ["Wi-Fi radio does not answer"]);
    desk.autopilot.wifi_report(WifiReport::AccessPointUp, desk.now());
    assert_eq!(notices(&mut desk), [""; 0]);
}

#[test]
fn gp29_measures_no_pack_on_a_board_with_a_radio() {
    for (radio, status) in [
        (Radio::Absent, PackStatus::Healthy),
        (Radio::Present, PackStatus::Unhealthy),
    ] {
        let mut start = start(radio);
        let pin = BatteryParameter::VoltPin.of(Pack::First);
        start.parameters.set(pin, 29.0).expect("in range");
        let mut desk = Desk::starting(start);
        desk.connect(LinkKind::Direct);
        let is_pulled = desk.autopilot.pin_pulls().any(|(pin, _)| pin == AnalogPin::Gp29);
        assert_eq!(is_pulled, radio == Radio::Absent);
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp29, Ok(conversions(2.9)));
        for _ in 0..100 {
            desk.now_us += 100_000;
            desk.sample(readings);
        }
        assert_eq!(desk.autopilot.battery(Pack::First).status, status);
        desk.post_due(desk.now_us);
        let text = format!("Battery 1 unhealthy: {}", ReadError::PinOfRadio);
        let announced = texts_of(&desk.sent()).into_iter().filter(|sent| *sent == text);
        assert_eq!(announced.count(), usize::from(radio == Radio::Present));
    }
}

fn stored(flash: &SmallFlash) -> StoredWifi {
    let mut stored = StoredWifi::default();
    let mut found = |key, words: [u32; WIFI_WORDS]| stored.found(key, &words);
    let mut storage = Storage::new(flash.clone(), SmallFlash::REGION);
    block_on(storage.load(&mut found)).expect("readable");
    stored
}

#[test]
fn what_is_set_up_is_there_after_a_restart() {
    let flash = SmallFlash::blank();
    assert_eq!(stored(&flash), StoredWifi::default());
    for request in [
        wifi_config("home", "at home 1", STATION),
        wifi_config("", "another one", ACCESS_POINT),
        wifi_config("", "", DISABLED),
    ] {
        let regions = Regions {
            wifi: Some(flash.clone()),
            ..Regions::blank()
        };
        regions.run(start(Radio::Present), async |vehicle| {
            vehicle.ask(&request);
            Timer::after_millis(100).await;
        });
    }
    let expected = StoredWifi {
        own_password: Some(password("another one")),
        network: Some(network("home", "at home 1")),
    };
    assert_eq!(stored(&flash), expected);
}
