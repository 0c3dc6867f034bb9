//! Stations that drive, by each message and each kind of link, alone and beside another one: a stick moves nothing before its
//! driver has centred it, whatever opens its way.

use proptest::prelude::*;
use rover_battmon::mavlink::{Access, Endpoint, Framer, LinkKind};
use rover_battmon::parameter::VehicleParameter;
use rover_battmon::vehicle::{ArmState, Mode, MotorDrive, SideDrives};
use support::desk::{Desk, frames_of};
use support::frames::{resealed, texts_of};
use support::requests::{VEHICLE, arm_by_force, disarm, do_set_mode, rc_override};
use support::time::SECOND;

use crate::safe_driving::{Heard, Says, Sticks};

const TICK_US: u64 = 20_000;

/// Drives with this much, in tenths of a percent.
const DEFLECTION: i16 = 900;

const MANUAL: f32 = 0.0;
const HOLD: f32 = 4.0;

/// A way to drive: a message, and the link that it comes by.
#[derive(Clone, Copy, Debug)]
struct Way {
    message: Sticks,
    link: LinkKind,
    access: Access,
}

/// The page, and ground stations by cable and by Wi-Fi.
const WAYS: [Way; 5] = [
    Way::new(Sticks::ManualControl, LinkKind::Wifi, Access::Page),
    Way::new(Sticks::ManualControl, LinkKind::Direct, Access::Full),
    Way::new(Sticks::ChannelOverride, LinkKind::Direct, Access::Full),
    Way::new(Sticks::ManualControl, LinkKind::Wifi, Access::Full),
    Way::new(Sticks::ChannelOverride, LinkKind::Wifi, Access::Full),
];

impl Way {
    const fn new(message: Sticks, link: LinkKind, access: Access) -> Self {
        Self {
            message,
            link,
            access,
        }
    }

    /// A message with this throttle and centred steering.
    fn sticks(self, throttle: i16) -> Vec<u8> {
        self.message.frame(VEHICLE, Says::At(0), Says::At(throttle))
    }

    fn release(self) -> Vec<u8> {
        self.message.frame(VEHICLE, Says::Released, Says::Released)
    }
}

/// A station with a link of its own.
struct Station {
    way: Way,
    system_id: u8,
    endpoint: Endpoint,
    framer: Framer,
}

/// A rover without packs, and stations around it.
struct Room {
    desk: Desk,
    stations: Vec<Station>,
}

impl Room {
    /// A disarmed rover in HOLD, without a slew rate limit.
    fn new(ways: &[Way]) -> Self {
        let mut desk = Desk::without_packs();
        desk.set(VehicleParameter::MotSlewrate, 0.0);
        let mut room = Self {
            desk,
            stations: Vec::new(),
        };
        for way in ways {
            room.join(*way);
        }
        room
    }

    /// A rover that the first of them drives in MANUAL.
    fn driven(ways: &[Way]) -> Self {
        let mut room = Self::new(ways);
        room.arm(0);
        room.send(0, &do_set_mode(MANUAL));
        room.sticks(0, 0);
        assert!(room.hold_stick(0, DEFLECTION, SECOND), "{ways:?}");
        room
    }

    /// Another station, by its number.
    fn join(&mut self, way: Way) -> usize {
        let mut endpoint = Endpoint::new("station", way.link, 100_000, self.desk.now());
        endpoint.set_access(way.access);
        self.desk.autopilot.open(&mut endpoint);
        self.stations.push(Station {
            way,
            system_id: 60 + self.stations.len() as u8,
            endpoint,
            framer: Framer::new(),
        });
        let number = self.stations.len() - 1;
        // Notices for each link that is opened.
        self.texts(number);
        number
    }

    /// A station's link is closed.
    fn leave(&mut self, number: usize) {
        self.desk.autopilot.close(&self.stations[number].endpoint);
    }

    fn send(&mut self, number: usize, request: &[u8]) {
        let station = &mut self.stations[number];
        let mut frame = request.to_vec();
        frame[5] = station.system_id;
        let frame = resealed(&frame);
        assert_eq!(station.endpoint.push(&frame), frame.len());
        let now = self.desk.now();
        let autopilot = &mut self.desk.autopilot;
        while autopilot.handle_next(&mut station.endpoint, now, now).is_some() {}
    }

    fn sticks(&mut self, number: usize, throttle: i16) {
        self.send(number, &self.stations[number].way.sticks(throttle));
    }

    /// The texts that were sent to a station since the last call.
    fn texts(&mut self, number: usize) -> Vec<String> {
        let Station { endpoint, framer, .. } = &mut self.stations[number];
        let now = self.desk.now();
        let autopilot = &mut self.desk.autopilot;
        texts_of(&frames_of(autopilot, endpoint, framer, now, usize::MAX))
    }

    fn arm(&mut self, number: usize) {
        self.send(number, &arm_by_force());
        assert_eq!(self.desk.vehicle().arm_state(), ArmState::Armed);
    }

    fn tick(&mut self) -> SideDrives {
        self.desk.now_us += TICK_US;
        self.desk.drive()
    }

    /// A station sends these sticks twenty times a second; returns whether a motor has turned.
    fn hold_stick(&mut self, number: usize, throttle: i16, duration_us: u64) -> bool {
        let mut has_turned = false;
        for tick in 0..duration_us / TICK_US {
            if tick.is_multiple_of(2) {
                self.sticks(number, throttle);
            }
            has_turned |= turns(self.tick());
        }
        has_turned
    }

    /// Asserts that a station's held stick moves nothing, and drives once it was centred.
    fn assert_waits_for_its_centre(&mut self, number: usize, case: &str) {
        self.texts(number);
        assert!(
            !self.hold_stick(number, DEFLECTION, 2 * SECOND),
            "{case}: a held stick drives"
        );
        let texts = self.texts(number);
        assert!(
            texts.contains(&"Centre the throttle (RC3) first".into()),
            "{case}: {texts:?}"
        );
        self.sticks(number, 0);
        assert!(
            self.hold_stick(number, DEFLECTION, SECOND / 2),
            "{case}: a centred stick does not drive"
        );
    }
}

fn turns(drives: SideDrives) -> bool {
    [drives.left, drives.right]
        .into_iter()
        .any(|drive| matches!(drive, MotorDrive::Turn(_)))
}

/// Each way, and each pair of ways.
fn pairs() -> impl Iterator<Item = [Way; 2]> {
    WAYS.into_iter()
        .flat_map(|one| WAYS.into_iter().map(move |other| [one, other]))
}

#[test]
// Requirement: L-1
fn a_stick_held_before_arming_or_manual_does_not_drive() {
    for [driver, other] in pairs() {
        let case = format!("{driver:?}, {other:?}");
        for sends_before in [false, true] {
            for arms_first in [false, true] {
                let mut room = Room::new(&[driver, other]);
                if sends_before {
                    assert!(!room.hold_stick(0, DEFLECTION, SECOND));
                }
                if arms_first {
                    room.arm(1);
                    room.send(1, &do_set_mode(MANUAL));
                } else {
                    room.send(1, &do_set_mode(MANUAL));
                    room.arm(1);
                }
                room.assert_waits_for_its_centre(0, &case);
                // HOLD, and MANUAL again while it is held.
                room.send(1, &do_set_mode(HOLD));
                assert!(!room.hold_stick(0, DEFLECTION, SECOND));
                room.send(1, &do_set_mode(MANUAL));
                room.assert_waits_for_its_centre(0, &case);
            }
        }
    }
}

#[test]
// Requirement: L-1
fn a_stick_that_was_ignored_does_not_drive_when_the_driver_lets_go() {
    enum Ends {
        Released,
        Closed,
        Disarmed,
    }
    for [driver, other] in pairs() {
        for ends in [Ends::Released, Ends::Closed, Ends::Disarmed] {
            let case = format!("{driver:?}, {other:?}");
            let mut room = Room::driven(&[driver, other]);
            // The other one is held meanwhile.
            for _ in 0..50 {
                room.sticks(0, 0);
                room.sticks(1, DEFLECTION);
                assert!(!turns(room.tick()), "{case}");
            }
            match ends {
                Ends::Released => room.send(0, &driver.release()),
                Ends::Closed => room.leave(0),
                Ends::Disarmed => {
                    room.send(0, &disarm());
                    room.arm(0);
                }
            }
            room.assert_waits_for_its_centre(1, &case);
        }
    }
}

#[test]
fn the_axis_that_has_to_be_centred_is_named() {
    let mut room = Room::new(&[Way::new(Sticks::ChannelOverride, LinkKind::Direct, Access::Full)]);
    room.arm(0);
    room.send(0, &do_set_mode(MANUAL));
    for (steering, throttle) in [(1500, 1500), (1600, 1600), (0, 1600), (1900, u16::MAX)] {
        room.send(0, &rc_override(VEHICLE, steering, throttle));
        room.tick();
    }
    assert_eq!(room.texts(0), ["Centre the steering (RC1) first"]);
}

#[test]
// Requirement: OWN-2
fn a_rover_whose_driver_has_left_stands_at_once_and_holds_after_the_time_out() {
    for way in WAYS {
        let mut room = Room::driven(&[way, way]);
        room.leave(0);
        assert!(!turns(room.tick()), "{way:?}");
        // A release by others does not stand for the driver's sticks.
        room.send(1, &way.release());
        for _ in 0..(SECOND / TICK_US) {
            assert!(!turns(room.tick()));
            assert_eq!(room.desk.vehicle().status().mode, Mode::Manual);
        }
        for _ in 0..(SECOND / TICK_US) {
            room.tick();
        }
        assert_eq!(room.desk.vehicle().status().mode, Mode::Hold, "{way:?}");
        let now = room.desk.now();
        room.desk.autopilot.post_due(&mut room.stations[1].endpoint, now);
        assert_eq!(room.texts(1), ["Radio Failsafe: Hold"]);
    }
}

#[test]
fn after_a_reload_the_page_is_its_own_successor_at_once() {
    for way in WAYS {
        let mut room = Room::driven(&[way]);
        room.leave(0);
        let reloaded = room.join(way);
        room.sticks(reloaded, 0);
        room.sticks(reloaded, DEFLECTION);
        assert!(turns(room.tick()), "{way:?}");
        assert_eq!(room.texts(reloaded), [""; 0]);
    }
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Sticks(usize, i16),
    Release(usize),
    Arm(usize),
    Disarm(usize),
    Mode(usize, f32),
    Reload(usize),
    Wait(u64),
}

fn step() -> impl Strategy<Value = Step> {
    let number = 0usize..2;
    let throttle = prop::sample::select(vec![0, 0, 40, 600, DEFLECTION, -DEFLECTION]);
    prop_oneof![
        8 => (number.clone(), throttle).prop_map(|(number, throttle)| Step::Sticks(number, throttle)),
        1 => number.clone().prop_map(Step::Release),
        2 => number.clone().prop_map(Step::Arm),
        1 => number.clone().prop_map(Step::Disarm),
        3 => (number.clone(), prop::sample::select(vec![MANUAL, MANUAL, HOLD]))
            .prop_map(|(number, mode)| Step::Mode(number, mode)),
        1 => number.prop_map(Step::Reload),
        3 => prop_oneof![Just(TICK_US), Just(SECOND), 0..3 * SECOND].prop_map(Step::Wait),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1_000))]

    /// Motors turn by the latest stick of one of the stations only, that was centred; HOLD always holds.
    #[test]
    // Requirement: L-1
    fn what_turns_was_centred_and_hold_always_holds(
        ways in prop::sample::select(pairs().collect::<Vec<_>>()),
        steps in prop::collection::vec(step(), 0..60),
        stops in prop::sample::select(vec![0usize, 1]),
    ) {
        let mut room = Room::new(&ways);
        let mut at = [0, 1];
        let mut heard = [Heard::default(); 2];
        for step in steps {
            let before = room.desk.vehicle().status();
            match step {
                Step::Sticks(place, throttle) => {
                    room.sticks(at[place], throttle);
                    heard[place].hear(Says::At(throttle), room.desk.now_us);
                }
                Step::Release(place) => {
                    room.send(at[place], &ways[place].release());
                    heard[place] = Heard::default();
                }
                Step::Arm(place) => room.send(at[place], &arm_by_force()),
                Step::Disarm(place) => room.send(at[place], &disarm()),
                Step::Mode(place, mode) => room.send(at[place], &do_set_mode(mode)),
                Step::Reload(place) => {
                    room.leave(at[place]);
                    at[place] = room.join(ways[place]);
                    heard[place] = Heard::default();
                }
                Step::Wait(us) => {
                    for _ in 0..us / TICK_US {
                        room.tick();
                    }
                }
            }
            room.desk.drive();
            let after = room.desk.vehicle().status();
            if (before.arm_state, after.arm_state) == (ArmState::Disarmed, ArmState::Armed)
                || (before.mode, after.mode) == (Mode::Hold, Mode::Manual)
            {
                heard.iter_mut().for_each(|heard| heard.enable(room.desk.now_us));
            }
            let drives = room.desk.vehicle().drives();
            if let MotorDrive::Turn(share) = drives.left {
                let may_turn = |heard: &Heard| {
                    let wanted = heard.position(room.desk.now_us);
                    // Less than is wanted while it reverses.
                    share * wanted > 0.0 && share.abs() < wanted.abs() + 1e-6
                };
                prop_assert!(heard.iter().any(may_turn), "{step:?}: {share} of {heard:?}");
            }
        }
        let was_armed = room.desk.vehicle().arm_state();
        room.send(at[stops], &do_set_mode(HOLD));
        prop_assert_eq!(room.desk.vehicle().status().mode, Mode::Hold);
        let expected = match was_armed {
            ArmState::Armed => SideDrives::BRAKE,
            ArmState::Disarmed => SideDrives::COAST,
        };
        prop_assert_eq!(room.desk.drive(), expected);
    }
}
