//! Dates of logs: who says what time it is, and what is listed.

use rover_battmon::mavlink::Event;
use rover_battmon::time::Utc;
use support::frames::{GROUND_STATION, LOG_ENTRY, of_message};
use support::requests::{GCS, heartbeat, heartbeat_from, log_list, system_time, system_time_from};
use support::time::SECOND;

use crate::logged_rover::Rover;

/// 2026-11-25 20:43:16.75.
const UNIX_US: u64 = 1_795_639_396_750_000;

impl Rover {
    fn hear(&mut self, frames: &[Vec<u8>]) -> Vec<Event> {
        self.desk.receive_in_chunks(&frames.concat(), 64)
    }

    /// LOG_ENTRY of each file: when it began, in seconds since 1970.
    fn listed(&mut self) -> Vec<u32> {
        let mut answers = self.desk.ask(&log_list(0, u16::MAX));
        // A download takes its turn beside what is due.
        answers.extend(self.desk.sent());
        let entries = of_message(&answers, LOG_ENTRY);
        entries.iter().map(|entry| entry.u32(0)).collect()
    }
}

#[test]
fn a_log_is_listed_with_the_date_of_its_beginning_also_after_a_restart() {
    let mut rover = Rover::new();
    rover.drive(20);
    assert_eq!(rover.listed(), [0], "unknown");
    // As QGroundControl does: twice.
    rover.hear(&[heartbeat(GCS), system_time(UNIX_US), system_time(UNIX_US)]);
    rover.run(1);
    let began_s = (UNIX_US - 20 * SECOND) / SECOND;
    assert_eq!(rover.listed(), [began_s as u32]);

    let mut rover = Rover::starting(rover.flash);
    assert_eq!(rover.listed(), [began_s as u32]);
    rover.hear(&[heartbeat(GCS), system_time(UNIX_US + 3600 * SECOND)]);
    rover.drive(2);
    rover.run(1);
    assert_eq!(
        rover.listed(),
        [began_s, UNIX_US / SECOND + 3600].map(|s| s as u32)
    );
}

#[test]
fn what_is_not_the_time_is_ignored() {
    const YEAR_2020_US: u64 = 1_577_836_800 * SECOND;
    const END_US: u64 = (1 << 32) * SECOND;
    let mut rover = Rover::new();
    rover.hear(&[heartbeat(GCS)]);
    for (unix_us, is_heard) in [
        (0, false),
        (rover.desk.now_us, false),
        (YEAR_2020_US - 1, false),
        (YEAR_2020_US, true),
        (END_US - 1, true),
        (END_US, false),
        (u64::MAX, false),
    ] {
        let expected = match is_heard {
            true => Event::TimeHeard(Utc::from_micros(unix_us)),
            false => Event::Ignored,
        };
        assert_eq!(rover.hear(&[system_time(unix_us)]), [expected], "{unix_us}");
    }
}

#[test]
// Requirement: L-16
fn only_ground_stations_are_believed() {
    const ANOTHER_VEHICLE: [u8; 2] = [2, 1];
    const QUADROTOR: u8 = 2;
    let heard = Event::TimeHeard(Utc::from_micros(UNIX_US));
    let mut rover = Rover::new();
    assert_eq!(
        rover.hear(&[system_time(UNIX_US)]),
        [Event::Ignored],
        "no HEARTBEAT"
    );
    rover.hear(&[heartbeat(GCS), heartbeat_from(ANOTHER_VEHICLE, QUADROTOR)]);
    for (sender, expected) in [(ANOTHER_VEHICLE, Event::Ignored), (GROUND_STATION, heard)] {
        assert_eq!(
            rover.hear(&[system_time_from(sender, UNIX_US)]),
            [expected],
            "{sender:?}"
        );
    }
    rover.run(31);
    assert_eq!(
        rover.hear(&[system_time(UNIX_US)]),
        [Event::Ignored],
        "it has left"
    );
}
