//! Safety property, for any sequence of messages and gaps: motors turn only by a stick message that is not older than
//! `FS_TIMEOUT`, has a permitted sender, and was received after arming and after MANUAL was entered. If a stick was not
//! neutral then, all have to be neutral at the same time first; one that appears later, by itself while another one drives.
//! Values beyond the range of a stick are no message about it. The expected outputs are computed from the messages by these
//! rules alone.

use std::collections::VecDeque;
use std::future::pending;

use embassy_futures::join::join;
use embassy_time::{Duration, Timer};
use proptest::prelude::*;
use rover_battmon::autopilot::Start;
use rover_battmon::mavlink::LinkKind;
use rover_battmon::parameter::{Parameters, VehicleParameter};
use rover_battmon::tasks::{ByteSource, CheckIn, Link, ReceiveError, Shared, read_frames, write_frames};
use rover_battmon::vehicle::{ArmState, Mode, MotorDrive, SideDrives};
use rover_battmon_tools::sim::clock;
use rover_battmon_tools::sim::stepped::{BYTE_US, Port};
use support::commands::{ACCEPTED, ARM_DISARM, FAILED};
use support::desk::Desk;
use support::frames::{acknowledged, frames, texts_of};
use support::requests::{
    GCS, arm, arm_by_force, disarm, do_set_mode, heartbeat, manual_control, rc_override, set_mode,
    setup_signing,
};
use support::signer::{NEW_YEAR, OWNER, STRANGER, Signer};

const TIMEOUT_US: u64 = 1_500_000;
/// Update interval of the vehicle.
const TICK_US: u64 = 20_000;
const NEUTRAL: f32 = 0.05;
/// Signatures count tens of microseconds.
const US_PER_TIMESTAMP: u64 = 10;

/// The content of a message about a stick.
#[derive(Clone, Copy, Debug)]
pub enum Says {
    At(i16),
    Released,
    Nothing,
    /// A value that no stick has.
    Beyond,
}

#[derive(Clone, Copy, Debug)]
enum Target {
    Rover,
    RoverAsAWhole,
    Everyone,
    Other,
}

#[derive(Clone, Copy, Debug)]
enum Sender {
    Owner,
    Stranger,
    Unsigned,
}

#[derive(Clone, Copy, Debug)]
enum Request {
    Sticks(Target, Says, Says),
    Arm { forced: bool },
    Disarm,
    CommandMode(u8),
    SetMode(u8),
    Heartbeat,
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Receive {
        request: Request,
        sender: Sender,
        waited_us: u64,
    },
    Wait(u64),
}

/// The message by which the driver drives.
#[derive(Clone, Copy, Debug)]
pub enum Sticks {
    ManualControl,
    ChannelOverride,
}

impl Sticks {
    /// The message for this system and component.
    pub fn frame(self, target: [u8; 2], steering: Says, throttle: Says) -> Vec<u8> {
        match self {
            Self::ManualControl => manual_control(target[0], axis(steering), axis(throttle)),
            Self::ChannelOverride => rc_override(target, pulse_us(steering), pulse_us(throttle)),
        }
    }

    /// The nearest that the message can say: MANUAL_CONTROL can't leave an axis unchanged.
    fn says(self, says: Says) -> Says {
        match (self, says) {
            (Self::ManualControl, Says::Nothing) => Says::Released,
            _ => says,
        }
    }
}

impl Request {
    fn frame(self, message: Sticks) -> Vec<u8> {
        match self {
            Self::Sticks(target, steering, throttle) => message.frame(target.ids(), steering, throttle),
            Self::Arm { forced: false } => arm(),
            Self::Arm { forced: true } => arm_by_force(),
            Self::Disarm => disarm(),
            Self::CommandMode(mode) => do_set_mode(f32::from(mode)),
            Self::SetMode(mode) => set_mode(1, 1, mode.into()),
            Self::Heartbeat => heartbeat(GCS),
        }
    }

    /// Its steering and throttle, if it is for this rover.
    fn sticks(self, message: Sticks) -> Option<[Says; 2]> {
        match self {
            Self::Sticks(target, steering, throttle) => {
                let says = [steering, throttle].map(|says| message.says(says));
                target.names_us().then_some(says)
            }
            _ => None,
        }
    }
}

impl Target {
    fn ids(self) -> [u8; 2] {
        match self {
            Self::Rover => [1, 1],
            Self::RoverAsAWhole => [1, 0],
            Self::Everyone => [0, 0],
            Self::Other => [2, 1],
        }
    }

    fn names_us(self) -> bool {
        self.ids()[0] == 1
    }
}

fn axis(says: Says) -> i16 {
    match says {
        Says::At(position) => position,
        Says::Released | Says::Nothing => i16::MAX,
        Says::Beyond => 1001,
    }
}

fn pulse_us(says: Says) -> u16 {
    match says {
        Says::At(position) => (1500 + position / 2) as u16,
        Says::Released => 0,
        Says::Nothing => u16::MAX,
        Says::Beyond => 2201,
    }
}

fn says() -> impl Strategy<Value = Says> {
    let positions = prop::sample::select(vec![-1000, -500, -52, -50, 0, 0, 0, 50, 52, 500, 1000]);
    prop_oneof![
        6 => positions.prop_map(Says::At),
        1 => Just(Says::Released),
        3 => Just(Says::Nothing),
        1 => Just(Says::Beyond),
    ]
}

fn target() -> impl Strategy<Value = Target> {
    prop_oneof![
        6 => Just(Target::Rover),
        1 => Just(Target::RoverAsAWhole),
        1 => Just(Target::Everyone),
        1 => Just(Target::Other),
    ]
}

fn request() -> impl Strategy<Value = Request> {
    prop_oneof![
        12 => (target(), says(), says())
            .prop_map(|(target, steering, throttle)| Request::Sticks(target, steering, throttle)),
        3 => any::<bool>().prop_map(|forced| Request::Arm { forced }),
        1 => Just(Request::Disarm),
        3 => prop::sample::select(vec![0, 0, 0, 4]).prop_map(Request::CommandMode),
        1 => prop::sample::select(vec![0, 0, 4]).prop_map(Request::SetMode),
        1 => Just(Request::Heartbeat),
    ]
}

fn sticks() -> impl Strategy<Value = Sticks> {
    prop_oneof![Just(Sticks::ManualControl), Just(Sticks::ChannelOverride)]
}

fn step() -> impl Strategy<Value = Step> {
    let sender = prop_oneof![
        4 => Just(Sender::Owner),
        1 => Just(Sender::Stranger),
        1 => Just(Sender::Unsigned),
    ];
    let waited_us = prop_oneof![6 => Just(0), 1 => 0u64..3_000_000];
    prop_oneof![
        3 => (request(), sender, waited_us)
            .prop_map(|(request, sender, waited_us)| Step::Receive { request, sender, waited_us }),
        1 => prop_oneof![0u64..200_000, 0u64..3_000_000].prop_map(Step::Wait),
    ]
}

/// The messages of a driver about both sticks, in short.
#[derive(Clone, Copy, Debug, Default)]
pub struct Heard {
    steering: HeardStick,
    throttle: HeardStick,
}

/// The messages about a stick since its driver released it, in short.
#[derive(Clone, Copy, Debug, Default)]
struct HeardStick {
    /// The latest position, and when it was received.
    latest: Option<(u64, f32)>,
    /// It was received since the rover was armed, and since MANUAL was entered.
    is_since: bool,
    /// Neutral since then, or as the last position before.
    is_centred: bool,
}

impl Heard {
    /// A message about steering and throttle, which has waited.
    pub fn hear(&mut self, says: [Says; 2], now_us: u64, waited_us: u64) {
        let rests = self
            .sticks()
            .iter()
            .all(|stick| is_neutral(stick.position(now_us)));
        self.steering.hear(says[0], now_us - waited_us);
        self.throttle.hear(says[1], now_us - waited_us);
        if rests && self.sticks().iter().any(|stick| stick.waits(now_us)) {
            self.steering.is_centred = false;
            self.throttle.is_centred = false;
        }
    }

    /// The rover was armed, or has entered MANUAL.
    pub fn enable(&mut self, now_us: u64) {
        let are_neutral = self
            .sticks()
            .iter()
            .all(|stick| stick.recent(now_us).is_none_or(is_neutral));
        for stick in [&mut self.steering, &mut self.throttle] {
            stick.is_since = false;
            stick.is_centred &= are_neutral && stick.recent(now_us).is_some();
        }
    }

    /// Drives of the motors.
    pub fn drives(&self, now_us: u64) -> SideDrives {
        mixed(self.throttle.position(now_us), self.steering.position(now_us))
    }

    fn sticks(&self) -> [HeardStick; 2] {
        [self.steering, self.throttle]
    }
}

impl HeardStick {
    fn hear(&mut self, says: Says, received_us: u64) {
        match says {
            Says::At(position) => {
                let position = f32::from(position) / 1000.0;
                self.latest = Some((received_us, position));
                self.is_since = true;
                self.is_centred |= is_neutral(position);
            }
            Says::Released => *self = Self::default(),
            Says::Nothing | Says::Beyond => {}
        }
    }

    /// By how much the stick drives.
    fn position(&self, now_us: u64) -> f32 {
        let drives = self.is_since && self.is_centred;
        self.recent(now_us).filter(|_| drives).unwrap_or(0.0)
    }

    /// Whether it is deflected, and has to be centred.
    fn waits(&self, now_us: u64) -> bool {
        !self.is_centred && self.recent(now_us).is_some_and(|position| !is_neutral(position))
    }

    fn recent(&self, now_us: u64) -> Option<f32> {
        let (received_us, position) = self.latest?;
        (now_us - received_us <= TIMEOUT_US).then_some(position)
    }
}

fn is_neutral(position: f32) -> bool {
    position.abs() <= NEUTRAL
}

fn mixed(throttle: f32, steering: f32) -> SideDrives {
    let scale = (throttle + steering)
        .abs()
        .max((throttle - steering).abs())
        .max(1.0);
    let drive = |share: f32| {
        if share.abs() < 0.01 {
            MotorDrive::Coast
        } else {
            MotorDrive::Turn(share)
        }
    };
    SideDrives {
        left: drive((throttle + steering) / scale),
        right: drive((throttle - steering) / scale),
    }
}

/// A side that reverses takes a quarter of a second; this with a tick before it and behind it.
const REVERSAL_US: u64 = 290_000;

/// Until when each side may have turned back, and ahead.
#[derive(Default)]
struct Turned([[Option<u64>; 2]; 2]);

impl Turned {
    fn note(&mut self, drives: SideDrives, now_us: u64) {
        for (until, drive) in self.0.iter_mut().zip([drives.left, drives.right]) {
            if let MotorDrive::Turn(share) = drive {
                until[usize::from(share > 0.0)] = Some(now_us);
            }
        }
    }

    /// Whether a side may do this where that is wanted of it: less, for a moment after it turned the other way.
    fn permits(&self, side: usize, does: MotorDrive, wanted: MotorDrive, now_us: u64) -> bool {
        let MotorDrive::Turn(wanted) = wanted else {
            return does == wanted;
        };
        let reversed_us = self.0[side][usize::from(wanted < 0.0)];
        let reverses = reversed_us.is_some_and(|at_us| now_us - at_us < REVERSAL_US);
        match does {
            MotorDrive::Turn(share) if reverses => share * wanted > 0.0 && share.abs() < wanted.abs() + 1e-6,
            MotorDrive::Turn(share) => (share - wanted).abs() < 1e-6,
            MotorDrive::Coast => reverses,
            MotorDrive::Brake => false,
        }
    }
}

fn check(steps: &[Step], message: Sticks, with_key: bool) -> Result<(), TestCaseError> {
    let mut desk = Desk::without_packs();
    let mut signers = [Signer::new(OWNER), Signer::new(STRANGER)];
    if with_key {
        desk.connect(LinkKind::Direct);
        desk.receive_in_chunks(&setup_signing([OWNER; 32], NEW_YEAR), 64);
        signers
            .iter_mut()
            .for_each(|signer| signer.timestamp = NEW_YEAR + 1_000_000);
    }
    desk.connect(LinkKind::Radio);
    desk.set(VehicleParameter::MotSlewrate, 0.0);
    desk.now_us = 10_000_000;
    let mut sticks = Heard::default();
    let (mut turned, mut wanted) = (Turned::default(), SideDrives::COAST);
    for step in steps {
        match *step {
            Step::Wait(us) => {
                let until_us = desk.now_us + us;
                while desk.now_us < until_us {
                    desk.now_us = until_us.min(desk.now_us + TICK_US);
                    desk.drive();
                }
                signers
                    .iter_mut()
                    .for_each(|signer| signer.timestamp += us / US_PER_TIMESTAMP);
            }
            Step::Receive {
                request,
                sender,
                waited_us,
            } => {
                let frame = request.frame(message);
                let frame = match sender {
                    Sender::Owner => signers[0].sign(&frame),
                    Sender::Stranger => signers[1].sign(&frame),
                    Sender::Unsigned => frame,
                };
                let before = desk.vehicle().status();
                desk.waited_us = waited_us;
                desk.receive_in_chunks(&frame, 64);
                desk.sent();
                let is_permitted = !with_key || matches!(sender, Sender::Owner);
                let after = desk.vehicle().status();
                prop_assert!(is_permitted || after.arm_state == before.arm_state);
                if let Some(says) = request
                    .sticks(message)
                    .filter(|_| is_permitted && waited_us <= TIMEOUT_US)
                {
                    sticks.hear(says, desk.now_us, waited_us);
                }
                let is_armed_now =
                    (before.arm_state, after.arm_state) == (ArmState::Disarmed, ArmState::Armed);
                let is_manual_now = (before.mode, after.mode) == (Mode::Hold, Mode::Manual);
                if is_armed_now || is_manual_now {
                    prop_assert!(waited_us <= TIMEOUT_US);
                    sticks.enable(desk.now_us);
                }
                desk.drive();
            }
        }
        let status = desk.vehicle().status();
        let expected = match (status.arm_state, status.mode) {
            (ArmState::Disarmed, _) => SideDrives::COAST,
            (ArmState::Armed, Mode::Hold) => SideDrives::BRAKE,
            (ArmState::Armed, Mode::Manual) => sticks.drives(desk.now_us),
        };
        // The output that was wanted before may have lasted until now.
        turned.note(wanted, desk.now_us);
        wanted = expected;
        turned.note(wanted, desk.now_us);
        let drives = desk.vehicle().drives();
        let is_right = turned.permits(0, drives.left, expected.left, desk.now_us)
            && turned.permits(1, drives.right, expected.right, desk.now_us);
        prop_assert!(is_right, "{drives:?}, not {expected:?}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    // Requirement: OWN-2, L-1, L-3
    fn motors_turn_only_by_recent_stick_messages_since_arming(
        message in sticks(),
        steps in prop::collection::vec(step(), 0..80),
    ) {
        check(&steps, message, false)?;
    }

    #[test]
    fn with_a_key_motors_turn_only_by_signed_stick_messages(
        message in sticks(),
        steps in prop::collection::vec(step(), 0..80),
    ) {
        check(&steps, message, true)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// However slow the throttle may become, and whatever the sticks did before.
    #[test]
    // Requirement: OWN-2
    fn the_motors_stop_within_a_second_of_letting_go(
        slew_rate_pct_per_s in prop_oneof![Just(20.0f32), Just(1.0), 1.0f32..1000.0],
        throttles in prop::collection::vec((prop::sample::select(vec![-1000, -300, 0, 300, 1000]), 0u64..100), 0..12),
    ) {
        let mut desk = Desk::without_packs();
        desk.set(VehicleParameter::MotSlewrate, slew_rate_pct_per_s.trunc());
        let hold_stick = |desk: &mut Desk, throttle, ticks: u64| {
            for _ in 0..ticks {
                desk.receive_in_chunks(&manual_control(1, 0, throttle), 64);
                desk.now_us += TICK_US;
                desk.drive();
            }
        };
        for request in [arm_by_force(), do_set_mode(0.0)] {
            desk.receive_in_chunks(&request, 64);
        }
        hold_stick(&mut desk, 0, 1);
        for (throttle, ticks) in throttles {
            hold_stick(&mut desk, throttle, ticks);
        }
        hold_stick(&mut desk, 0, 50);
        prop_assert_eq!(desk.vehicle().drives(), SideDrives::COAST);
    }
}

/// A source that holds these bytes, and gives the next piece each time it was found empty.
struct Held(VecDeque<Vec<u8>>);

impl ByteSource for Held {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        let Some(piece) = self.0.pop_front() else {
            return pending().await;
        };
        if piece.is_empty() {
            Timer::after_millis(10).await;
            return Box::pin(self.receive(buffer)).await;
        }
        buffer[..piece.len()].copy_from_slice(&piece);
        Ok(piece.len())
    }
}

/// A port that a program on the host has left, or a connection that waited, may hold orders of any age.
#[test]
// Requirement: L-1
fn what_a_source_holds_when_its_link_opens_arms_nothing() {
    let check_in = CheckIn::new("", u32::MAX);
    let port = Port::new(BYTE_US);
    clock::run_for(Duration::from_secs(5), async {
        let shared = Shared::new(&Start::with_parameters(Parameters::defaults()));
        let link = Link::new("line", LinkKind::Direct, 11_520);
        Timer::after_secs(2).await;
        let found_empty = Vec::new();
        let arm = arm_by_force();
        let source = Held(VecDeque::from([arm.clone(), found_empty, arm]));
        join(
            read_frames(source, &shared, &link, &check_in),
            write_frames(&port, &shared, &link, &check_in),
        )
        .await
    });
    let answers = frames(&port.sent());
    let results = [FAILED, ACCEPTED].map(|result| (ARM_DISARM, result));
    assert_eq!(acknowledged(&answers), results);
    assert_eq!(texts_of(&answers)[0], "Command waited for too long: refused");
}
