//! Two stations with the same ids and the same key share one timestamp: the one whose frames take longer still stops the rover, and
//! no recording does.

use std::mem::swap;

use proptest::prelude::*;
use rover_battmon::autopilot::{FlashJob, FlashStore, Start};
use rover_battmon::mavlink::{Endpoint, Event, LinkKind, StoredSigning};
use rover_battmon::memory::storage::Condition;
use rover_battmon::parameter::{Parameters, VehicleParameter};
use rover_battmon::time::Instant;
use rover_battmon::vehicle::{ArmState, Mode};
use support::commands::ARM_DISARM;
use support::desk::Desk;
use support::frames::{COMMAND_ACK, PARAM_VALUE, acknowledged, of_message, texts_of};
use support::requests::{
    GCS, arm, command_int, disarm, do_set_mode, heartbeat, manual_control, manual_mode, param_read_by_name,
    param_set, ping, rc_override, set_mode, setup_signing, system_time,
};
use support::signer::{NEW_YEAR, OWNER, Signer};
use support::time::{MINUTE_US, SECOND};

const MINUTE_TICKS: u64 = 60 * 100_000;
const HOLD: f32 = 4.0;

/// Ground stations as they are installed, and scripts.
const STATIONS: [u8; 2] = [255, 190];
const SCRIPTS: [u8; 2] = [255, 0];

/// A rover with a key, its cable, and two other links.
struct Field {
    desk: Desk,
    wifi: Endpoint,
    radio: Endpoint,
    cable: Endpoint,
    ids: [u8; 2],
}

impl Field {
    fn new(ids: [u8; 2]) -> Self {
        let parameters = Parameters::defaults();
        Self::starting(Start::with_parameters(parameters), ids, true)
    }

    fn starting(start: Start, ids: [u8; 2], sets_key: bool) -> Self {
        let mut desk = Desk::starting(start);
        desk.set(VehicleParameter::ArmingCheck, 0.0);
        let mut open = |name, kind| {
            let mut endpoint = Endpoint::new(name, kind, 100_000, Instant::EPOCH);
            desk.autopilot.open(&mut endpoint);
            endpoint
        };
        let mut field = Self {
            wifi: open("WIFI", LinkKind::Wifi),
            radio: open("RADIO", LinkKind::Radio),
            cable: open("CABLE", LinkKind::Direct),
            desk,
            ids,
        };
        if sets_key {
            field.deliver(LinkKind::Direct, &setup_signing([OWNER; 32], NEW_YEAR));
        }
        for link in [LinkKind::Wifi, LinkKind::Radio] {
            field.on(link, Desk::sent);
        }
        field.said();
        field
    }

    /// Does something on a link.
    fn on<R>(&mut self, link: LinkKind, act: impl FnOnce(&mut Desk) -> R) -> R {
        let endpoint = match link {
            LinkKind::Wifi => &mut self.wifi,
            LinkKind::Radio => &mut self.radio,
            LinkKind::Direct => &mut self.cable,
        };
        swap(&mut self.desk.endpoint, endpoint);
        let result = act(&mut self.desk);
        swap(&mut self.desk.endpoint, endpoint);
        result
    }

    fn deliver(&mut self, link: LinkKind, frame: &[u8]) -> Vec<Event> {
        self.on(link, |desk| desk.receive_in_chunks(frame, 64))
    }

    /// A request of both stations' ids, signed when the rover's time is so many ticks after New Year.
    fn signed(&self, ticks: u64, request: &[u8]) -> Vec<u8> {
        let mut request = request.to_vec();
        [request[5], request[6]] = self.ids;
        let mut signer = Signer::new(OWNER);
        signer.timestamp = NEW_YEAR + ticks;
        signer.sign(&request)
    }

    /// The rover's time now, in ticks after New Year.
    fn ticks(&self) -> u64 {
        self.desk.now_us / 10
    }

    /// A frame of the nearer station, by Wi-Fi, signed now.
    fn near(&mut self, request: &[u8]) {
        let frame = self.signed(self.ticks(), request);
        let events = self.deliver(LinkKind::Wifi, &frame);
        assert!(
            !matches!(events[..], [Event::TooOld | Event::Ignored]),
            "{events:?}"
        );
    }

    /// A frame of the farther station, by radio.
    fn far(&mut self, ticks: u64, request: &[u8]) {
        let frame = self.signed(ticks, request);
        self.deliver(LinkKind::Radio, &frame);
    }

    fn state(&self) -> (ArmState, Mode) {
        let status = self.desk.vehicle().status();
        (status.arm_state, status.mode)
    }

    /// Arms and drives, a second apart, with a heartbeat after each.
    fn drive(&mut self, by_cable: bool) {
        for request in [
            heartbeat(GCS),
            arm(),
            heartbeat(GCS),
            manual_mode(),
            heartbeat(GCS),
        ] {
            self.desk.now_us += SECOND;
            if by_cable && request != heartbeat(GCS) {
                self.deliver(LinkKind::Direct, &request);
            } else {
                self.near(&request);
            }
        }
        assert_eq!(self.state(), (ArmState::Armed, Mode::Manual));
    }

    /// All texts since the last call, as a link of the rover has them.
    fn said(&mut self) -> Vec<String> {
        self.on(LinkKind::Direct, |desk| {
            desk.post_due(desk.now_us);
            texts_of(&desk.sent())
        })
    }
}

fn shared_ids(texts: &[String], ids: [u8; 2]) -> usize {
    assert!(!texts.iter().any(|text| text.contains("not signed")), "{texts:?}");
    let text = format!("RADIO: two stations are {}/{}? Give each its own", ids[0], ids[1]);
    texts.iter().filter(|said| said.starts_with(&text)).count()
}

fn disarming() -> [Vec<u8>; 2] {
    [disarm(), command_int(ARM_DISARM, 0.0)]
}

fn holding() -> [Vec<u8>; 2] {
    [do_set_mode(HOLD), set_mode(1, 1, HOLD as u32)]
}

#[test]
// Requirement: L-14
fn a_second_station_with_the_same_ids_stops_the_rover_whoever_has_armed() {
    for ids in [STATIONS, SCRIPTS] {
        for by_cable in [false, true] {
            for (request, stopped) in disarming()
                .map(|request| (request, (ArmState::Disarmed, Mode::Manual)))
                .into_iter()
                .chain(holding().map(|request| (request, (ArmState::Armed, Mode::Hold))))
            {
                let mut field = Field::new(ids);
                field.drive(by_cable);
                // Half a second on its way, and the other one's heartbeat has overtaken it.
                let late = field.ticks() - 50_000;
                field.far(late, &request);
                assert_eq!(field.state(), stopped, "{ids:?} {by_cable}");
                let acks = field.on(LinkKind::Radio, |desk| acknowledged(&desk.sent()));
                assert_eq!(acks.len(), 1, "{acks:?}");
                assert_eq!(acks[0].1, 0, "accepted");
                assert_eq!(shared_ids(&field.said(), ids), 0);
            }
        }
    }
}

#[test]
fn a_stop_counts_from_the_tick_after_the_arming_or_after_manual_for_a_minute() {
    for by_cable in [false, true] {
        for (requests, before_ticks) in [(disarming(), 300_000), (holding(), 100_000)] {
            for request in requests {
                for (after_ticks, stops) in [(-1, false), (0, false), (1, true)] {
                    let mut field = Field::new(STATIONS);
                    field.drive(by_cable);
                    let changed_at = field.ticks() - before_ticks;
                    field.far(changed_at.saturating_add_signed(after_ticks), &request);
                    let is_stopped = field.state() != (ArmState::Armed, Mode::Manual);
                    assert_eq!(is_stopped, stops, "{after_ticks} ticks after");
                    assert_eq!(shared_ids(&field.said(), STATIONS), usize::from(!stops));
                }
                for (age_ticks, stops) in [(MINUTE_TICKS, true), (MINUTE_TICKS + 1, false)] {
                    let mut field = Field::new(STATIONS);
                    field.drive(by_cable);
                    field.desk.now_us += 2 * MINUTE_US;
                    field.near(&heartbeat(GCS));
                    field.far(field.ticks() - age_ticks, &request);
                    let is_stopped = field.state() != (ArmState::Armed, Mode::Manual);
                    assert_eq!(is_stopped, stops, "{age_ticks} ticks old");
                    assert_eq!(shared_ids(&field.said(), STATIONS), usize::from(!stops));
                }
            }
        }
    }
}

#[test]
fn a_stop_signed_at_the_same_tick_as_another_frame_counts() {
    for request in disarming().into_iter().chain(holding()) {
        let mut field = Field::new(SCRIPTS);
        field.drive(true);
        field.far(field.ticks(), &request);
        assert_ne!(field.state(), (ArmState::Armed, Mode::Manual));
    }
}

#[test]
fn a_stop_is_late_only_by_the_arming_before_it_not_by_manual_again_in_manual() {
    let mut field = Field::new(STATIONS);
    field.drive(false);
    let signed_at = field.ticks() - 50_000;
    // Nothing changes by these.
    field.desk.now_us += SECOND;
    field.near(&manual_mode());
    field.desk.now_us += SECOND;
    field.near(&arm());
    field.far(signed_at, &do_set_mode(HOLD));
    assert_eq!(field.state(), (ArmState::Armed, Mode::Hold));
    field.far(signed_at, &disarm());
    assert_eq!(field.state(), (ArmState::Disarmed, Mode::Hold));
    // A station that disarms a disarmed rover is answered, and takes the seat from no driver.
    field.desk.now_us += SECOND;
    field.near(&manual_control(1, 0, 0));
    let before = format!("{:?}", field.desk.vehicle());
    field.far(signed_at + 1, &disarm());
    assert_eq!(format!("{:?}", field.desk.vehicle()), before);
    let acks = field.on(LinkKind::Radio, |desk| acknowledged(&desk.sent()));
    assert_eq!(acks.len(), 3, "{acks:?}");
}

#[test]
// Requirement: L-2
fn all_else_of_a_second_station_is_refused_with_a_text_and_counts_as_heard_for_nothing() {
    let neutral_us = 1500;
    let requests = [
        heartbeat(GCS),
        system_time(1_795_564_800_000_000),
        manual_control(1, 0, 0),
        manual_control(1, 0, 700),
        rc_override([1, 1], neutral_us, neutral_us),
        param_set("BATT_LOW_VOLT", 6.5),
        param_read_by_name("BATT_LOW_VOLT"),
        ping(1, 1),
        arm(),
        manual_mode(),
    ];
    for ids in [STATIONS, SCRIPTS] {
        for request in &requests {
            let mut field = Field::new(ids);
            field.drive(false);
            let late = field.ticks() - 50_000;
            let before = format!("{:?}", field.desk.vehicle());
            let parameters = field.desk.parameters().clone();
            field.far(late, request);
            assert_eq!(format!("{:?}", field.desk.vehicle()), before, "{request:?}");
            assert_eq!(*field.desk.parameters(), parameters);
            assert_eq!(field.on(LinkKind::Radio, |desk| desk.sent()).len(), 0);
            assert_eq!(shared_ids(&field.said(), ids), 1, "{request:?}");
            assert_eq!(field.radio.statistics().unauthorized, 0);
        }
    }
    // The first station falls silent, and the second one is heard too late, each time.
    let mut field = Field::new(STATIONS);
    field.drive(false);
    let latest = field.ticks();
    let mut texts = Vec::new();
    for tenth in 0..80 {
        field.desk.now_us += SECOND / 10;
        field.far(latest - 1000 + tenth, &heartbeat(GCS));
        field.far(latest - 2000 + tenth, &manual_control(1, 0, 0));
        field.desk.drive();
        texts.extend(field.said());
    }
    assert!(texts.contains(&"GCS Failsafe: Hold".into()), "{texts:?}");
}

#[test]
fn the_text_comes_every_ten_seconds_at_most_and_not_of_frames_that_come_twice() {
    let mut field = Field::new(SCRIPTS);
    field.drive(false);
    let mut texts = 0;
    for tenth in 0..250 {
        field.desk.now_us += SECOND / 10;
        field.near(&heartbeat(GCS));
        field.far(field.ticks() - 20_001, &heartbeat(GCS));
        texts += shared_ids(&field.said(), SCRIPTS);
        if tenth == 0 {
            assert_eq!(texts, 1, "at once");
        }
    }
    assert_eq!(texts, 3);

    // Sticks by two ways, and a pause before each.
    let mut field = Field::new(STATIONS);
    field.drive(false);
    let mut sent = Vec::new();
    for step in 0..17 {
        field.desk.now_us += SECOND / 20;
        let frame = field.signed(field.ticks(), &manual_control(1, 0, step));
        field.deliver(LinkKind::Wifi, &frame);
        sent.push(frame);
    }
    for frame in sent[1..].iter().chain(sent[1..].iter().rev()) {
        field.desk.now_us += SECOND / 20;
        let before = format!("{:?}", field.desk.vehicle());
        field.deliver(LinkKind::Radio, frame);
        assert_eq!(format!("{:?}", field.desk.vehicle()), before);
        assert_eq!(shared_ids(&field.said(), STATIONS), 0);
    }
    assert_eq!(
        field.on(LinkKind::Radio, |desk| desk.sent()).len(),
        0,
        "no answer"
    );
    field.deliver(LinkKind::Radio, &sent[0]);
    assert_eq!(shared_ids(&field.said(), STATIONS), 1, "the seventeenth");
}

#[test]
fn where_a_link_accepts_more_a_second_station_has_what_anyone_has_and_the_stop() {
    const REQUESTS: f32 = 1.0;
    const EVERYTHING: f32 = 2.0;
    for allowed in [REQUESTS, EVERYTHING] {
        let mut field = Field::new(STATIONS);
        field.desk.set(VehicleParameter::SignUartAllow, allowed);
        field.drive(true);
        let late = field.ticks() - 50_000;
        field.far(late, &param_read_by_name("BATT_LOW_VOLT"));
        field.far(late + 1, &param_set("BATT_LOW_VOLT", 6.5));
        let answers = field.on(LinkKind::Radio, |desk| desk.sent());
        let is_set = allowed == EVERYTHING;
        assert_eq!(of_message(&answers, PARAM_VALUE).len(), 1 + usize::from(is_set));
        assert_eq!(shared_ids(&field.said(), STATIONS), usize::from(!is_set));
        field.far(late + 2, &disarm());
        assert_eq!(field.state().0, ArmState::Disarmed, "{allowed}");
        let answers = field.on(LinkKind::Radio, |desk| desk.sent());
        assert_eq!(of_message(&answers, COMMAND_ACK).len(), 1);
    }
}

#[test]
fn after_a_restart_no_recording_from_before_stops_the_rover() {
    let mut field = Field::new(STATIONS);
    field.drive(false);
    let recorded: Vec<_> = (0..40)
        .flat_map(|tenth| [disarm(), do_set_mode(HOLD)].map(|stop| (tenth, stop)))
        .map(|(tenth, stop)| field.signed(field.ticks() + tenth * 10_000, &stop))
        .collect();
    let mut stored = StoredSigning::default();
    let now = field.desk.now();
    while let Some(job) = field.desk.autopilot.next_flash_job(FlashStore::Signing, now) {
        let FlashJob::Signing(unsaved) = &job else {
            panic!("{job:?}")
        };
        for (key, word) in stored.words(unsaved) {
            stored.found(key, word);
        }
        field.desk.autopilot.flash_done(&job, Ok(None), now);
    }
    let start = Start {
        signing: stored.restore(Condition::Intact),
        ..Start::with_parameters(Parameters::defaults())
    };
    let mut field = Field::starting(start, STATIONS, false);
    // The stations follow the rover's time.
    let mut signer = Signer::new(OWNER);
    signer.timestamp = 0;
    field.on(LinkKind::Wifi, |desk| {
        desk.post_due(0);
        signer.hear(&desk.sent());
    });
    for request in [heartbeat(GCS), arm(), manual_mode(), heartbeat(GCS)] {
        field.deliver(LinkKind::Wifi, &signer.sign(&request));
    }
    assert_eq!(field.state(), (ArmState::Armed, Mode::Manual));
    let before = format!("{:?}", field.desk.vehicle());
    for frame in &recorded {
        field.deliver(LinkKind::Radio, frame);
    }
    assert_eq!(format!("{:?}", field.desk.vehicle()), before);
    // Later ones do.
    let stop = signer.sign(&disarm());
    field.deliver(LinkKind::Wifi, &signer.sign(&heartbeat(GCS)));
    field.deliver(LinkKind::Radio, &stop);
    assert_eq!(field.state().0, ArmState::Disarmed);
}

/// A frame of a story.
#[derive(Clone, Debug)]
struct Scene {
    /// After the one before, in ms.
    pause_ms: u64,
    /// Which of the requests it is.
    request: usize,
    by: By,
}

#[derive(Clone, Copy, Debug)]
enum By {
    /// Signed and at once.
    Near,
    /// Signed, and this long on its way, in ms.
    Far(u64),
    /// Unsigned, by cable.
    Cable,
}

fn story_requests() -> Vec<Vec<u8>> {
    vec![
        arm(),
        arm(),
        disarm(),
        command_int(ARM_DISARM, 0.0),
        manual_mode(),
        manual_mode(),
        do_set_mode(HOLD),
        set_mode(1, 1, HOLD as u32),
        manual_control(1, 0, 0),
        manual_control(1, 300, 800),
        rc_override([1, 1], 1500, 1500),
        rc_override([1, 1], 1500, 1900),
        heartbeat(GCS),
    ]
}

fn scene() -> impl Strategy<Value = Scene> {
    let by = prop_oneof![
        3 => Just(By::Near),
        3 => (0..4_000_u64).prop_map(By::Far),
        1 => (0..90_000_u64).prop_map(By::Far),
        1 => Just(By::Cable),
    ];
    let pause_ms = prop_oneof![Just(0), 0..100_u64, 0..1_500_u64, 0..20_000_u64];
    (pause_ms, 0..story_requests().len(), by).prop_map(|(pause_ms, request, by)| Scene {
        pause_ms,
        request,
        by,
    })
}

/// A frame at the rover: when and by which link it comes, and whether a stranger can record it.
fn deliveries(story: &[Scene], ids: [u8; 2]) -> Vec<(u64, LinkKind, Vec<u8>)> {
    let field = Field::new(ids);
    let mut sent_ms = 0;
    let mut deliveries: Vec<_> = story
        .iter()
        .map(|scene| {
            sent_ms += scene.pause_ms;
            let request = &story_requests()[scene.request];
            let signed = || field.signed(sent_ms * 100, request);
            match scene.by {
                By::Near => (sent_ms, LinkKind::Wifi, signed()),
                By::Far(delay_ms) => (sent_ms + delay_ms, LinkKind::Radio, signed()),
                By::Cable => (sent_ms, LinkKind::Direct, request.clone()),
            }
        })
        .collect();
    deliveries.sort_by_key(|(at_ms, ..)| *at_ms);
    deliveries
}

/// The vehicle's state at the end, and after each delivery.
fn played(
    deliveries: &[(u64, LinkKind, Vec<u8>)],
    repeated: &[(usize, usize, LinkKind)],
    ids: [u8; 2],
) -> Vec<String> {
    let mut field = Field::new(ids);
    let mut states = Vec::new();
    for (number, (at_ms, link, frame)) in deliveries.iter().enumerate() {
        while field.desk.now_us + 100_000 < at_ms * 1_000 {
            field.desk.now_us += 100_000;
            field.desk.drive();
        }
        field.desk.now_us = at_ms * 1_000;
        field.deliver(*link, frame);
        for (_, recorded, link) in repeated.iter().filter(|(after, ..)| *after == number) {
            let (_, _, frame) = &deliveries[*recorded];
            field.deliver(*link, frame);
        }
        field.desk.drive();
        states.push(format!(
            "{:?} {:?}",
            field.desk.vehicle(),
            field.desk.vehicle().drives()
        ));
    }
    assert!(!field.said().iter().any(|text| text.contains("not signed")));
    states
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// Whatever two stations do, by cable too, a recording of any frame changes nothing, at no later moment and by no link.
    #[test]
    // Requirement: L-14
    fn a_story_of_two_stations_goes_on_as_without_any_frame_that_is_repeated(
        story in prop::collection::vec(scene(), 2..40),
        repeats in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), any::<bool>()), 1..20),
        are_scripts in any::<bool>(),
    ) {
        let ids = if are_scripts { SCRIPTS } else { STATIONS };
        let deliveries = deliveries(&story, ids);
        let repeated: Vec<_> = repeats
            .iter()
            .map(|(after, recorded, by_radio)| {
                let after = after.index(deliveries.len());
                let link = if *by_radio { LinkKind::Radio } else { LinkKind::Wifi };
                (after, recorded.index(after + 1), link)
            })
            // Frames by cable are not signed.
            .filter(|(_, recorded, _)| deliveries[*recorded].1 != LinkKind::Direct)
            .collect();
        prop_assert_eq!(played(&deliveries, &repeated, ids), played(&deliveries, &[], ids));
    }
}
