//! Failsafes end to end in stepped time: from the ADC to the motors and the link.

use rover_battmon::sensor::AnalogPin;
use rover_battmon::vehicle::{Colour, Indication, MotorDrive, SideDrives, Tone};
use support::desk::{DIVIDER, id_of};
use support::frames::{Frame, HEARTBEAT, Heartbeat, SYS_STATUS, SysStatus, of_message, texts_of};
use support::requests::{arm, do_set_mode, manual_control};
use support::time::SECOND;
use support::vehicle::{OnHost, TestedVehicle, Wire};

const MILLISECOND: u64 = 1_000;

/// A full 2S pack, and an empty one.
const FULL_V: f32 = 7.9;
const EMPTY_V: f32 = 6.366;

/// When the driver arms and starts driving.
const ARMED_AT_US: u64 = SECOND;

/// The driver arms, enters MANUAL, and sends full throttle ten times a second.
fn sent_at(now_us: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    if now_us == ARMED_AT_US {
        bytes.extend([arm(), do_set_mode(0.0), manual_control(1, 0, 0)].concat());
    }
    if now_us >= ARMED_AT_US && now_us.is_multiple_of(100 * MILLISECOND) {
        bytes.extend(manual_control(1, 0, 1000));
    }
    bytes
}

/// Result of a run: outputs to motors and lamps with their times, and all frames sent.
struct Outcome {
    drives: Vec<(u64, SideDrives)>,
    shown: Vec<(u64, Indication)>,
    frames: Vec<Frame>,
}

impl Outcome {
    /// When the motors first got `drives` after `from_us`.
    fn driven_at(&self, from_us: u64, drives: SideDrives) -> u64 {
        let mut since = self.drives.iter().filter(|(at_us, _)| *at_us >= from_us);
        let found = since.find(|(_, other)| *other == drives);
        found.expect("the motors get these outputs").0
    }

    /// `system_status` of the last HEARTBEAT.
    fn last_state(&self) -> u8 {
        let heartbeats = of_message(&self.frames, HEARTBEAT);
        Heartbeat(heartbeats[heartbeats.len() - 1]).system_status()
    }
}

/// Ten seconds with these parameters, and a pack that is empty from a time on.
fn run(parameters: &[(&str, f32)], empty_at_us: u64) -> Outcome {
    let stored = [("BATT_CELLS", 2.0), ("MOT_SLEWRATE", 0.0)];
    let stored = stored.iter().chain(parameters);
    let mut vehicle = OnHost::with_stored(stored.map(|(name, value)| (id_of(name), *value)));
    vehicle.use_wire(Wire::Usb);
    vehicle.set_pin_v(AnalogPin::Gp26, FULL_V / DIVIDER);
    while vehicle.time_us() < 10 * SECOND {
        let now_us = vehicle.time_us();
        if now_us == empty_at_us {
            vehicle.set_pin_v(AnalogPin::Gp26, EMPTY_V / DIVIDER);
        }
        vehicle.send(&sent_at(now_us));
        vehicle.run_for(MILLISECOND);
    }
    Outcome {
        drives: vehicle.board().drives.all(),
        shown: vehicle.board().indications.all(),
        frames: vehicle.frames_since(0),
    }
}

const AHEAD: SideDrives = SideDrives {
    left: MotorDrive::Turn(1.0),
    right: MotorDrive::Turn(1.0),
};

const STANDBY_STATE: u8 = 3;
const ACTIVE_STATE: u8 = 4;

const HOLD_WHEN_CRITICAL: [(&str, f32); 3] = [
    ("BATT_CRT_VOLT", 7.0),
    ("BATT_LOW_TIMER", 1.0),
    ("BATT_FS_CRT_ACT", 2.0),
];

#[test]
fn driver_drives_at_once_with_a_healthy_battery() {
    let outcome = run(&[], u64::MAX);
    let driving_at_us = outcome.driven_at(0, AHEAD);
    assert!(driving_at_us - ARMED_AT_US <= 5 * MILLISECOND, "{driving_at_us}");
    assert!(
        outcome
            .drives
            .iter()
            .all(|(at_us, drives)| (*drives == AHEAD) == (*at_us >= driving_at_us)
                || at_us.abs_diff(ARMED_AT_US) <= 5 * MILLISECOND)
    );
    // 50 times a second, and once per message of the driver.
    assert!(
        (590..=620).contains(&outcome.drives.len()),
        "{}",
        outcome.drives.len()
    );
    assert_eq!(outcome.last_state(), ACTIVE_STATE);
    assert_eq!(
        texts_of(&outcome.frames),
        ["Battery failsafes are off: set BATT_LOW_VOLT"]
    );
}

/// A period of the motors' PWM after the start.
const FIRST_TICK_US: u64 = 2 * MILLISECOND;

#[test]
// Requirement: FR-15, PX-4
fn critical_battery_holds_within_the_deciding_tick() {
    // At any offset between two battery ticks.
    for offset_us in (0..100).step_by(7).map(|offset| offset * MILLISECOND) {
        let empty_at_us = 5 * SECOND + offset_us;
        let outcome = run(&HOLD_WHEN_CRITICAL, empty_at_us);
        let held_at_us = outcome.driven_at(empty_at_us, SideDrives::BRAKE);
        // Measured in the next tick; a timer of 1 s expires in the first tick after more than 1 s.
        let seen_at_us = (empty_at_us - FIRST_TICK_US).next_multiple_of(100 * MILLISECOND) + FIRST_TICK_US;
        let decided_at_us = seen_at_us + 1_100 * MILLISECOND;
        assert!(
            (decided_at_us..decided_at_us + MILLISECOND).contains(&held_at_us),
            "{held_at_us} after {empty_at_us}"
        );
        assert!(held_at_us - empty_at_us <= 1_250 * MILLISECOND);
        // The driver still sends full throttle.
        assert!(
            outcome
                .drives
                .iter()
                .all(|(at_us, drives)| *at_us <= held_at_us || *drives == SideDrives::BRAKE)
        );
        assert_eq!(
            texts_of(&outcome.frames),
            ["Battery 1 is critical 6.37V used 0 mAh"]
        );
        assert_eq!(outcome.last_state(), STANDBY_STATE);
        let sys_status = of_message(&outcome.frames, SYS_STATUS);
        assert!(!SysStatus(sys_status[sys_status.len() - 1]).is_battery_healthy());
        let (_, shown) = outcome.shown[outcome.shown.len() - 1];
        assert_eq!(shown.colour, Colour::Red);
        assert!(
            outcome
                .shown
                .iter()
                .any(|(at_us, shown)| *at_us > held_at_us && shown.tone == Tone::Sounding)
        );
    }
}
