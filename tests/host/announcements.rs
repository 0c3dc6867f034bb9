//! Announcements on a link that is too slow for all of them.

use rover_battmon::battery::{BusError, FailsafeLevel, Measurement, ReadError, SupplyEvent};
use rover_battmon::mavlink::LinkKind;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::BatteryParameter;
use rover_battmon::sensor::{AnalogPin, AnalogReadings, CanEvent, CanNotice, NodeId};
use support::commands::RUN_PREARM_CHECKS;
use support::desk::{DIVIDER, Desk, conversions, start_with};
use support::frames::{COMMAND_ACK, HEARTBEAT, STATUSTEXT, texts_of};
use support::monitor_types::{INA2XX, SMART_BATTERY};
use support::requests::{VEHICLE, arm, arm_by_force, command_long, do_set_mode, param_request_list};

const TICK_US: u64 = 100_000;
const TICKS_PER_SECOND: u64 = 10;

/// 1200 baud.
const BYTES_PER_SECOND: i64 = 120;

/// Of a MAVLink 2 frame, beside its payload.
const FRAME_BYTES: usize = 12;

const FULL_V: f32 = 12.4;
const LOW_V: f32 = 10.2;

const MANUAL: f32 = 0.0;

/// A rover with a pack of three cells, whose slow link is flooded by texts of nodes on the CAN bus.
struct FloodedRover {
    desk: Desk,
    pack_v: f32,
    tick: u64,
    /// Bytes that the wire can take by now.
    credit: i64,
    /// Messages that have left, with their texts.
    sent: Vec<(u64, u32, String)>,
}

impl FloodedRover {
    fn new() -> Self {
        Self::with(&[
            ("BATT_CELLS", 3.0),
            ("BATT_LOW_VOLT", 10.5),
            ("BATT_LOW_TIMER", 1.0),
            // RTL, which needs a position.
            ("BATT_FS_LOW_ACT", 1.0),
            // No charge states.
            ("BATT_LOW_PCT", 0.0),
            ("BATT_CRT_PCT", 0.0),
            ("BATT_EMR_PCT", 0.0),
        ])
    }

    fn with(parameters: &[(&str, f32)]) -> Self {
        let mut desk = Desk::starting(start_with(parameters));
        desk.connect_slowly(LinkKind::Radio, BYTES_PER_SECOND as u32);
        Self {
            desk,
            pack_v: FULL_V,
            tick: 0,
            credit: 0,
            sent: Vec::new(),
        }
    }

    /// A tick, in which a node appears or is lost: 600 texts a minute.
    fn step(&mut self) {
        self.tick += 1;
        self.desk.now_us = self.tick * TICK_US;
        let node = NodeId::new((self.tick % 40) as u8 + 20).expect("an id");
        let notice = match self.tick.is_multiple_of(2) {
            true => CanNotice::Appeared(node),
            false => CanNotice::Lost(node),
        };
        let event = CanEvent::Announce(notice);
        self.desk.autopilot.add_can_event(&event, self.desk.now());
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp26, Ok(conversions(self.pack_v / DIVIDER)));
        self.desk.sample(readings);
        self.desk.drive();
        self.desk.post_due(self.desk.now_us);
        self.credit += BYTES_PER_SECOND / TICKS_PER_SECOND as i64;
        self.send();
    }

    fn send(&mut self) {
        while self.credit > 0 {
            let Some(frame) = self.desk.sent_at_most(1).pop() else {
                self.credit = 0;
                return;
            };
            self.credit -= (FRAME_BYTES + frame.payload_len()) as i64;
            let text = match frame.message_id {
                STATUSTEXT => frame.text(1, 50),
                _ => String::new(),
            };
            self.sent.push((self.tick, frame.message_id, text));
        }
    }

    fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.step();
        }
    }

    fn receive(&mut self, frames: &[u8]) {
        self.desk.receive_in_chunks(frames, 64);
    }

    /// Ticks from `from_tick` until a text that starts like this has left.
    #[track_caller]
    fn delay(&self, from_tick: u64, start: &str) -> u64 {
        let mut sent = self.sent.iter();
        let found = sent.find(|(tick, _, text)| *tick >= from_tick && text.starts_with(start));
        let (tick, ..) = found.unwrap_or_else(|| panic!("{start:?} never arrives: {:?}", self.sent));
        tick - from_tick
    }
}

#[test]
// Requirement: L-10
fn a_failsafe_level_and_the_mode_arrive_through_a_flood_of_can_texts() {
    for phase in 0..20 {
        let mut rover = FloodedRover::new();
        rover.run(50 + phase);
        rover.receive(&[arm(), do_set_mode(MANUAL)].concat());
        rover.run(50);
        rover.pack_v = LOW_V;
        while rover.desk.autopilot.battery(Pack::First).failsafe != FailsafeLevel::Low {
            rover.step();
        }
        let reached_tick = rover.tick;
        rover.run(50);
        let level = rover.delay(reached_tick, "Battery 1 is low 10.");
        let mode = rover.delay(reached_tick, "RTL needs a position: Hold");
        // A text takes half a second, what is on its way the same, and HEARTBEAT goes first.
        assert!(level <= 12 && mode <= 18, "{level}, {mode}");
    }
}

#[test]
fn a_refused_arming_is_explained_and_answered_through_a_flood_of_can_texts() {
    for phase in 0..20 {
        let mut rover = FloodedRover::new();
        rover.pack_v = LOW_V;
        rover.run(100 + phase);
        let asked_tick = rover.tick;
        rover.receive(&arm());
        rover.run(50);
        let explained = rover.delay(asked_tick, "Arm: Battery 1 low voltage failsafe");
        assert!(explained <= 12, "{explained}");
        let answer = rover.sent.iter().find(|(_, message, _)| *message == COMMAND_ACK);
        let (answered_tick, ..) = answer.expect("an acknowledgement");
        assert!(*answered_tick >= asked_tick + explained, "the reason comes first");
    }
}

#[test]
fn of_several_refusals_and_levels_the_latest_is_sent() {
    let mut rover = FloodedRover::new();
    rover.pack_v = LOW_V;
    rover.run(50);
    rover.desk.ask(&[]);
    // Two reasons, the second of which is another one, while the wire is busy.
    rover.credit = -100;
    rover.receive(&arm());
    rover.desk.set(BatteryParameter::LowVolt.of(Pack::First), 0.0);
    rover.desk.set(BatteryParameter::ArmVolt.of(Pack::First), 11.0);
    rover.receive(&arm());
    let from = rover.sent.len();
    rover.run(60);
    let refusals = rover.sent[from..]
        .iter()
        .filter(|(_, _, text)| text.starts_with("Arm:"));
    let refusals: Vec<_> = refusals.map(|(_, _, text)| text.as_str()).collect();
    assert_eq!(refusals, ["Arm: Battery 1 below minimum arming voltage"]);
}

#[test]
// Requirement: L-10
fn texts_of_a_kind_are_limited_and_what_is_left_out_is_counted() {
    let mut rover = FloodedRover::new();
    rover.run(60 * TICKS_PER_SECOND);
    let of_nodes = |end: &str| {
        let texts = rover.sent.iter().map(|(_, _, text)| text);
        let texts = texts.filter(|text| text.starts_with("CAN node ") && text.contains(end));
        texts.cloned().collect::<Vec<_>>()
    };
    for kind in ["found", "lost"] {
        let texts = of_nodes(kind);
        assert!((6..=15).contains(&texts.len()), "{texts:?}");
        assert!(texts[texts.len() - 1].ends_with(" left out)"), "{texts:?}");
    }
    let messages = rover.sent.iter().map(|(_, message, _)| *message);
    let heartbeats = messages.filter(|message| *message == HEARTBEAT).count();
    assert!(heartbeats >= 59, "{heartbeats}");
}

#[test]
fn other_packs_keep_their_places() {
    let mut rover = FloodedRover::with(&[
        ("BATT_MONITOR", 3.0),
        ("BATT_CELLS", 3.0),
        ("BATT_LOW_VOLT", 10.5),
        ("BATT_LOW_TIMER", 1.0),
        ("BATT2_MONITOR", 3.0),
        ("BATT2_VOLT_PIN", 26.0),
        ("BATT2_CELLS", 3.0),
        ("BATT2_LOW_VOLT", 10.5),
        ("BATT2_LOW_TIMER", 1.0),
    ]);
    rover.run(100);
    rover.receive(&arm_by_force());
    rover.pack_v = LOW_V;
    rover.run(20);
    let from_tick = rover.tick;
    rover.run(30);
    for pack in [1, 2] {
        let text = format!("Battery {pack} is low 10.");
        let texts = rover.sent.iter().filter(|(_, _, sent)| sent.starts_with(&text));
        assert_eq!(texts.count(), 1, "{text} once by {from_tick}");
    }
}

#[test]
// Requirement: AP-12
fn each_station_that_connects_learns_what_answers_in_place_of_a_part_until_that_is_found() {
    let start = start_with(&[
        ("BATT_MONITOR", 0.0),
        ("BATT2_MONITOR", INA2XX),
        ("BATT2_I2C_ADDR", 64.0),
        ("BATT3_MONITOR", SMART_BATTERY),
    ]);
    let mut desk = Desk::starting(start);
    let scans = |desk: &mut Desk| {
        let mut texts = texts_of(&desk.sent());
        texts.retain(|text| text.contains("not found"));
        texts
    };
    let read = |desk: &mut Desk, pack, reading: Result<Measurement, ReadError>| {
        for _ in 0..10 {
            desk.now_us += TICK_US;
            let now = desk.now();
            desk.autopilot.add_bus_reading(pack, reading, now);
            desk.sample(AnalogReadings::NONE);
        }
    };
    read(&mut desk, Pack::Second, Err(BusError::NoAnswer.into()));
    read(&mut desk, Pack::Third, Err(BusError::NoAnswer.into()));
    desk.autopilot.open(&mut desk.endpoint);
    assert_eq!(scans(&mut desk), [""; 0]);
    let event = SupplyEvent::NotFound {
        address: Some(0x40),
        answering: [Some(0x41), Some(0x44), None, None, None],
    };
    let now = desk.now();
    desk.autopilot.announce_supply(Pack::Second, &event, now);
    // The first of two messages.
    const SCAN: &str = "Battery 2 not found at 0x40: the bus answers at 0x";
    // Its own address is the one at which it was asked, whatever is set since.
    desk.set(BatteryParameter::I2cAddr.of(Pack::Second), 65.0);
    for kind in [LinkKind::Direct, LinkKind::Wifi] {
        desk.connect(kind);
        desk.autopilot.open(&mut desk.endpoint);
        assert_eq!(scans(&mut desk), [SCAN]);
        // One that comes by a link which is open already.
        desk.receive_in_chunks(&param_request_list(VEHICLE), 64);
        assert_eq!(scans(&mut desk), [SCAN]);
    }
    desk.receive_in_chunks(&command_long(RUN_PREARM_CHECKS, 0.0), 64);
    let texts = texts_of(&desk.sent());
    for text in [
        "PreArm: Battery 2 unhealthy: no answer at 0x40",
        "PreArm: Battery 3 unhealthy: no answer at 0x0b",
    ] {
        assert!(texts.iter().any(|other| other == text), "{texts:?}");
    }
    let measured = Measurement {
        voltage_v: Some(12.0),
        ..Measurement::default()
    };
    read(&mut desk, Pack::Second, Ok(measured));
    desk.connect(LinkKind::Direct);
    desk.autopilot.open(&mut desk.endpoint);
    assert_eq!(scans(&mut desk), [""; 0]);
}
