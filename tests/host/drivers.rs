//! Stations that drive, by each message and each kind of link, alone and beside another one: sticks move nothing before their
//! driver has centred them, whatever opens their way.

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

/// The steering of a finger that is held ahead: neutral, yet off its centre.
const STRAY: i16 = 30;

const RADIO_FAILSAFE: &str = "Radio Failsafe: Hold";

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

    /// A message about steering and throttle.
    fn frame(self, [steering, throttle]: [Says; 2]) -> Vec<u8> {
        self.message.frame(VEHICLE, steering, throttle)
    }

    fn release(self) -> Vec<u8> {
        self.frame([Says::Released; 2])
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

    /// This many links are opened and closed.
    fn come_and_go(&mut self, links: u32) {
        let mut endpoint = Endpoint::new("guest", LinkKind::Wifi, 100_000, self.desk.now());
        for _ in 0..links {
            self.desk.autopilot.open(&mut endpoint);
            self.desk.autopilot.close(&endpoint);
        }
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
        self.send(number, &self.stations[number].way.frame(held(throttle)));
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

    /// A station says this twenty times a second; returns whether a motor has turned.
    fn say(&mut self, number: usize, says: [Says; 2], duration_us: u64) -> bool {
        let frame = self.stations[number].way.frame(says);
        let ticks = 0..duration_us / TICK_US;
        ticks.fold(false, |has_turned, tick| {
            if tick.is_multiple_of(2) {
                self.send(number, &frame);
            }
            turns(self.tick()) || has_turned
        })
    }

    fn mode(&self) -> Mode {
        self.desk.vehicle().status().mode
    }

    /// The texts that were announced to a station since the last call.
    fn announced(&mut self, number: usize) -> Vec<String> {
        let now = self.desk.now();
        self.desk
            .autopilot
            .post_due(&mut self.stations[number].endpoint, now);
        self.texts(number)
    }

    /// A station sends these sticks twenty times a second; returns whether a motor has turned.
    fn hold_stick(&mut self, number: usize, throttle: i16, duration_us: u64) -> bool {
        self.say(number, held(throttle), duration_us)
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

/// A finger that holds this throttle.
fn held(throttle: i16) -> [Says; 2] {
    let steering = if throttle == 0 { 0 } else { STRAY };
    [steering, throttle].map(Says::At)
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
fn the_numbers_of_links_do_not_wrap_onto_open_ones() {
    let mut room = Room::driven(&WAYS[1..2]);
    room.come_and_go(70_000);
    room.sticks(0, DEFLECTION);
    assert!(turns(room.tick()), "a closed link has taken the driver along");
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

/// A driver by channels, whose message may leave one out.
const BY_CHANNELS: Way = Way::new(Sticks::ChannelOverride, LinkKind::Direct, Access::Full);

#[test]
// Requirement: L-1
fn from_rest_nothing_moves_until_all_axes_were_neutral_at_the_same_time() {
    use Says::{At, Beyond, Nothing, Released};
    let (still, moves) = (false, true);
    let full = At(DEFLECTION);
    let assert_story = |story: &str, steps: &[([Says; 2], bool)]| {
        let mut room = Room::new(&[BY_CHANNELS]);
        room.arm(0);
        room.send(0, &do_set_mode(MANUAL));
        for (number, (says, expected)) in steps.iter().enumerate() {
            let has_turned = room.say(0, *says, 400_000);
            assert_eq!(has_turned, *expected, "{story}: step {number}");
            assert_eq!(room.mode(), Mode::Manual, "{story}");
        }
    };
    assert_story(
        "one after the other",
        &[
            ([At(0), full], still),
            ([full, At(0)], still),
            ([At(0), At(0)], still),
            ([full, full], moves),
        ],
    );
    assert_story(
        "in one message",
        &[
            ([At(0), full], still),
            ([At(60), At(0)], still),
            ([At(60), full], still),
            ([At(0), At(0)], still),
            ([At(60), full], moves),
        ],
    );
    assert_story(
        "never sent",
        &[
            ([Nothing, full], still),
            ([Nothing, At(0)], still),
            ([Nothing, full], moves),
        ],
    );
    assert_story(
        "released",
        &[
            ([Released, full], still),
            ([Released, At(0)], still),
            ([Released, full], moves),
        ],
    );
    assert_story(
        "sent later, from rest",
        &[
            ([Nothing, At(0)], still),
            ([full, full], still),
            ([full, At(0)], still),
            ([At(0), At(0)], still),
            ([full, full], moves),
        ],
    );
    assert_story(
        "sent later, alone",
        &[
            ([At(0), Nothing], still),
            ([Nothing, full], still),
            ([full, Nothing], still),
            ([At(0), At(0)], still),
            ([full, Nothing], moves),
        ],
    );
    assert_story(
        "deflected and not sent any more",
        &[
            ([full, full], still),
            ([Nothing, At(0)], still),
            ([Nothing, full], still),
        ],
    );
    assert_story(
        "deflected and then released",
        &[
            ([full, full], still),
            ([Released, At(0)], still),
            ([Nothing, full], moves),
        ],
    );
    assert_story(
        "deflected and then beyond its range",
        &[
            ([full, full], still),
            ([Beyond, At(0)], still),
            ([Beyond, full], still),
        ],
    );
}

#[test]
fn an_axis_that_comes_back_deflected_waits_without_stopping_the_other() {
    use Says::{At, Released};
    for back in [Released, Says::Nothing] {
        let mut room = Room::driven(&[BY_CHANNELS]);
        assert!(room.say(0, [Released, At(DEFLECTION)], SECOND));
        assert!(room.say(0, [back, At(DEFLECTION)], SECOND));
        assert!(room.say(0, [At(DEFLECTION), At(DEFLECTION)], SECOND));
        let straight = room.desk.vehicle().drives();
        assert_eq!(straight.left, straight.right, "the steering waits");
        // Centred while the other one drives.
        assert!(room.say(0, [At(0), At(DEFLECTION)], SECOND));
        assert!(room.say(0, [At(DEFLECTION), At(DEFLECTION)], SECOND));
        let curve = room.desk.vehicle().drives();
        assert_ne!(curve.left, curve.right);
    }
}

#[test]
// Requirement: OWN-2
fn a_deflected_stick_that_is_not_sent_any_more_times_out_and_is_not_taken_over() {
    for lost in [Says::Nothing, Says::Beyond] {
        let mut room = Room::driven(&[BY_CHANNELS; 2]);
        let frame = BY_CHANNELS.frame([Says::At(0), lost]);
        for _ in 0..SECOND * 7 / 5 / TICK_US {
            room.send(0, &frame);
            room.sticks(1, 0);
            room.sticks(1, -DEFLECTION);
            let drives = room.tick();
            assert!(
                matches!(drives.left, MotorDrive::Turn(share) if share > 0.0),
                "{lost:?}"
            );
        }
        assert!(room.say(0, [Says::At(0), lost], SECOND / 5));
        assert_eq!(room.mode(), Mode::Hold, "{lost:?}");
        assert!(room.announced(1).contains(&RADIO_FAILSAFE.into()), "{lost:?}");
    }
}

#[test]
// Requirement: OWN-2
fn the_successor_of_a_silent_driver_finds_hold_if_a_stick_was_deflected() {
    use Says::{At, Nothing, Released};
    let full = At(DEFLECTION);
    for [driver, other] in pairs() {
        // By MANUAL_CONTROL an axis is there or released.
        let partly_released = match driver.message {
            Sticks::ManualControl => Mode::Manual,
            Sticks::ChannelOverride => Mode::Hold,
        };
        for (last, mode) in [
            ([At(0), full], Mode::Hold),
            ([full, At(0)], Mode::Hold),
            ([Released, full], Mode::Hold),
            ([Released, Nothing], partly_released),
            ([Released; 2], Mode::Manual),
            ([At(0); 2], Mode::Manual),
        ] {
            let case = format!("{driver:?}, {other:?}: {last:?}");
            let mut room = Room::driven(&[driver, other]);
            room.say(0, last, TICK_US);
            let last_us = room.desk.now_us - TICK_US;
            while room.desk.now_us < last_us + SECOND - TICK_US {
                room.sticks(1, 0);
                room.tick();
                assert_eq!(room.mode(), Mode::Manual, "{case}");
            }
            for _ in 0..2 {
                room.tick();
                room.sticks(1, 0);
            }
            let drives = room.tick();
            assert_eq!(room.mode(), mode, "{case}");
            if mode == Mode::Manual {
                assert!(room.hold_stick(1, DEFLECTION, SECOND / 2), "{case}");
                continue;
            }
            assert_eq!(drives, SideDrives::BRAKE, "{case}");
            assert_eq!(room.announced(0), [RADIO_FAILSAFE], "{case}");
            assert_eq!(room.announced(1), [RADIO_FAILSAFE], "{case}");
            assert!(!room.hold_stick(1, DEFLECTION, 2 * SECOND), "{case}");
            room.sticks(1, 0);
            room.send(1, &do_set_mode(MANUAL));
            assert!(room.hold_stick(1, DEFLECTION, SECOND), "{case}");
            assert_eq!(room.announced(1), [""; 0], "{case}");
        }
    }
}

#[test]
fn a_driver_that_disarmed_with_a_deflected_stick_has_not_timed_out() {
    for [driver, other] in pairs() {
        let case = format!("{driver:?}, {other:?}");
        let mut room = Room::driven(&[driver, other]);
        room.sticks(0, DEFLECTION);
        room.send(0, &disarm());
        room.arm(1);
        assert!(!room.hold_stick(1, 0, 2 * SECOND), "{case}");
        assert_eq!(room.mode(), Mode::Manual, "{case}");
        assert!(room.hold_stick(1, DEFLECTION, SECOND), "{case}");
    }
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
            assert_eq!(room.mode(), Mode::Manual);
        }
        for _ in 0..(SECOND / TICK_US) {
            room.tick();
        }
        assert_eq!(room.mode(), Mode::Hold, "{way:?}");
        assert_eq!(room.announced(1), [RADIO_FAILSAFE]);
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
    Sticks(usize, [i16; 2]),
    Release(usize),
    Arm(usize),
    Disarm(usize),
    Mode(usize, f32),
    Reload(usize),
    Wait(u64),
}

fn step() -> impl Strategy<Value = Step> {
    let number = 0usize..2;
    let axis = || prop::sample::select(vec![0, 0, 40, 600, DEFLECTION, -DEFLECTION]);
    prop_oneof![
        8 => (number.clone(), [axis(), axis()]).prop_map(|(number, axes)| Step::Sticks(number, axes)),
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

    /// Motors turn by the latest sticks of one of the stations only, that were centred; HOLD always holds.
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
                Step::Sticks(place, axes) => {
                    let says = axes.map(Says::At);
                    room.send(at[place], &ways[place].frame(says));
                    heard[place].hear(says, room.desk.now_us, 0);
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
                    let MotorDrive::Turn(wanted) = heard.drives(room.desk.now_us).left else {
                        return false;
                    };
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
