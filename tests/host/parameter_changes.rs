//! A parameter that changes on one link is reported on the others.

use proptest::prelude::*;
use rover_battmon::mavlink::{Endpoint, LinkKind};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{Access, BatteryParameter, VehicleParameter};
use support::commands::{PREFLIGHT_STORAGE, RESET};
use support::desk::{Desk, LOW_VOLT, id_of};
use support::frames::{Frame, PARAM_VALUE, ParamValue, of_message, texts_of};
use support::requests::{VEHICLE, command_long, param_request_list, param_set};
use support::time::SECOND;

const NO_INDEX: u16 = u16::MAX;
const FAST: u32 = 100_000;
/// A PARAM_VALUE on the wire.
const FRAME_BYTES: usize = 37;

/// A rover with several stations, each on a link of its own.
struct Room {
    desk: Desk,
    /// The other links; one is swapped in to be used.
    others: Vec<Endpoint>,
}

impl Room {
    fn with_links(bytes_per_second: &[u32]) -> Self {
        let mut desk = Desk::without_packs();
        let mut others = Vec::new();
        for bytes_per_second in bytes_per_second {
            desk.connect_slowly(LinkKind::Wifi, *bytes_per_second);
            desk.autopilot.open(&mut desk.endpoint);
            desk.sent();
            let none = Endpoint::new("none", LinkKind::Wifi, FAST, desk.now());
            others.push(std::mem::replace(&mut desk.endpoint, none));
        }
        Self { desk, others }
    }

    fn on<R>(&mut self, link: usize, use_it: impl FnOnce(&mut Desk) -> R) -> R {
        std::mem::swap(&mut self.desk.endpoint, &mut self.others[link]);
        let result = use_it(&mut self.desk);
        std::mem::swap(&mut self.desk.endpoint, &mut self.others[link]);
        result
    }

    /// The answers on the same link.
    fn set(&mut self, link: usize, name: &str, value: f32) -> Vec<(String, f32, u16)> {
        self.on(link, |desk| values(&desk.ask(&param_set(name, value))))
    }

    /// The texts and parameters that leave on a link in this time.
    fn sent(&mut self, link: usize, seconds: u64) -> (Vec<String>, Vec<(String, f32, u16)>) {
        self.on(link, |desk| {
            let (mut texts, mut reported) = (Vec::new(), Vec::new());
            let end_us = desk.now_us + seconds * SECOND;
            while desk.now_us < end_us {
                desk.now_us += SECOND / 50;
                desk.post_due(desk.now_us);
                let sent = desk.sent();
                texts.extend(texts_of(&sent));
                reported.extend(values(&sent));
            }
            (texts, reported)
        })
    }

    /// The parameters that leave on a link in this time.
    fn reported(&mut self, link: usize, seconds: u64) -> Vec<(String, f32, u16)> {
        self.sent(link, seconds).1
    }
}

/// Names, values and indices of the parameters in `frames`.
fn values(frames: &[Frame]) -> Vec<(String, f32, u16)> {
    let frames = of_message(frames, PARAM_VALUE);
    let values = frames.iter().map(|frame| ParamValue(frame));
    values
        .map(|value| (value.name(), value.value(), value.index()))
        .collect()
}

fn unasked(name: &str, value: f32) -> (String, f32, u16) {
    (name.into(), value, NO_INDEX)
}

#[test]
fn what_one_station_sets_reaches_the_others_once_and_without_an_index() {
    let mut room = Room::with_links(&[FAST; 3]);
    let index = room
        .desk
        .parameters()
        .listed_index(LOW_VOLT)
        .expect("it is listed");
    let answer = ("BATT_LOW_VOLT".into(), 10.5, index as u16);
    assert_eq!(room.set(0, "BATT_LOW_VOLT", 10.5), std::slice::from_ref(&answer));
    for link in [1, 2] {
        assert_eq!(room.reported(link, 1), [unasked("BATT_LOW_VOLT", 10.5)]);
    }
    assert_eq!(room.reported(0, 1), [], "it has its answer");
    // What changes nothing is no news.
    assert_eq!(room.set(0, "BATT_LOW_VOLT", 10.5), [answer]);
    assert_eq!(room.reported(1, 1), []);
}

#[test]
fn a_value_is_the_one_when_it_leaves() {
    let mut room = Room::with_links(&[FAST; 2]);
    for value in [10.5, 10.4, 10.3] {
        room.set(0, "BATT_LOW_VOLT", value);
    }
    assert_eq!(room.reported(1, 1), [unasked("BATT_LOW_VOLT", 10.3)]);
    // Two stations at once: each learns of the other's.
    room.set(0, "BATT_CRT_VOLT", 9.9);
    room.set(1, "BATT_LOW_VOLT", 10.2);
    assert_eq!(room.reported(0, 1), [unasked("BATT_LOW_VOLT", 10.2)]);
    assert_eq!(room.reported(1, 1), [unasked("BATT_CRT_VOLT", 9.9)]);
}

#[test]
fn a_reset_is_announced_and_reported_with_what_is_listed_no_more() {
    let mut room = Room::with_links(&[FAST; 2]);
    room.set(0, "BATT2_MONITOR", 4.0);
    room.set(0, "BATT2_CAPACITY", 2200.0);
    for link in [0, 1] {
        room.reported(link, 1);
    }
    room.on(0, |desk| desk.ask(&command_long(PREFLIGHT_STORAGE, RESET)));
    for link in [0, 1] {
        let (texts, mut reported) = room.sent(link, 1);
        let text = "All parameters reset to their defaults".to_string();
        assert!(texts.contains(&text), "link {link}: {texts:?}");
        reported.retain(|(name, ..)| name.starts_with("BATT2"));
        let capacity = BatteryParameter::Capacity.of(Pack::Second).default_value();
        assert_eq!(
            reported,
            [unasked("BATT2_MONITOR", 0.0), unasked("BATT2_CAPACITY", capacity)]
        );
    }
}

#[test]
fn a_new_system_id_is_not_reported() {
    let mut room = Room::with_links(&[FAST; 2]);
    room.on(0, |desk| {
        desk.receive_in_chunks(&param_set("SYSID_THISMAV", 7.0), 64)
    });
    assert_eq!(room.desk.parameters().get(VehicleParameter::SysidThismav), 7.0);
    assert_eq!(room.reported(1, 1), []);
}

/// Whatever changes a value: here a program of the board, as learning is one.
#[test]
fn what_the_rover_changes_itself_is_reported_on_every_link() {
    let mut room = Room::with_links(&[FAST; 2]);
    room.desk.set(LOW_VOLT, 10.1);
    // It follows with the next request, or the next sample.
    room.on(0, |desk| desk.receive_in_chunks(&param_request_list(VEHICLE), 64));
    assert_eq!(room.reported(1, 1), [unasked("BATT_LOW_VOLT", 10.1)]);
    let listed = room.reported(0, 10);
    assert_eq!(listed.len(), room.desk.parameters().listed_count() + 1);
    assert_eq!(
        listed.last(),
        Some(&unasked("BATT_LOW_VOLT", 10.1)),
        "behind the list"
    );
}

#[test]
fn many_changes_take_no_more_than_a_lists_share_and_push_no_text_out() {
    const SLOW: u32 = 960;
    let mut room = Room::with_links(&[FAST, SLOW]);
    let settings: Vec<_> = BatteryParameter::ALL
        .iter()
        .filter(|parameter| parameter.row().name != "MONITOR")
        .map(|parameter| parameter.of(Pack::First))
        .filter(|id| room.desk.autopilot.parameters_mut().set(*id, 1.0).is_ok())
        .filter(|id| id.default_value() != 1.0 && matches!(id.row().access, Access::Setting(_)))
        .collect();
    assert!(settings.len() > 20);
    room.set(0, "BATT_LOW_VOLT", 999.0);
    let (texts, reported) = room.sent(1, 1);
    let most = SLOW as usize * 3 / 10 / FRAME_BYTES + 2;
    assert!((1..=most).contains(&reported.len()), "{reported:?}");
    assert!(
        texts.iter().any(|text| text.starts_with("BATT_LOW_VOLT refused")),
        "{texts:?}"
    );
    let rest = room.reported(1, 30);
    assert_eq!(reported.len() + rest.len(), settings.len());
}

#[test]
fn a_link_that_opens_later_or_is_closed_has_nothing_to_report() {
    let mut room = Room::with_links(&[FAST; 2]);
    room.set(0, "BATT_LOW_VOLT", 10.5);
    let mut closed = room.others.pop().expect("the second");
    room.desk.autopilot.close(&closed);
    room.set(0, "BATT_LOW_VOLT", 10.4);
    std::mem::swap(&mut room.desk.endpoint, &mut closed);
    room.desk.autopilot.open(&mut room.desk.endpoint);
    room.desk.post_due(room.desk.now_us);
    assert_eq!(values(&room.desk.sent()), []);
}

proptest! {
    /// However sets and reports interleave, each station ends with the values that are in force.
    #[test]
    fn each_station_ends_with_what_is_in_force(
        steps in prop::collection::vec((0usize..3, 0usize..4, 1u8..20, any::<bool>()), 1..60),
    ) {
        const NAMES: [&str; 4] = ["BATT_LOW_VOLT", "BATT_CRT_VOLT", "BATT_CAPACITY", "SR0_EXTRA1"];
        let mut room = Room::with_links(&[FAST; 3]);
        let mut known = [0; 3].map(|_| NAMES.map(|name| {
            room.desk.parameters().get(id_of(name))
        }));
        let note = |known: &mut [f32; 4], values: Vec<(String, f32, u16)>| {
            for (name, value, _) in values {
                let place = NAMES.iter().position(|known| *known == name).expect("nothing else changes");
                known[place] = value;
            }
        };
        for (link, name, value, reports) in steps {
            let answers = room.set(link, NAMES[name], value.into());
            note(&mut known[link], answers);
            if reports {
                let reported = room.reported(link, 1);
                note(&mut known[link], reported);
            }
        }
        for (link, known) in known.iter_mut().enumerate() {
            let reported = room.reported(link, 1);
            note(known, reported);
            for (name, known) in NAMES.iter().zip(known) {
                prop_assert_eq!(*known, room.desk.parameters().get(id_of(name)), "{} on link {}", name, link);
            }
        }
    }
}
