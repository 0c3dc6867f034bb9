//! The ground stations on one link.

use super::Peer;
use crate::time::Instant;

/// As many are remembered.
const MAX_STATIONS: usize = 4;

/// A station that was silent for longer is new when it is heard again: it may have been restarted.
pub const STATION_SILENCE_US: u64 = 30_000_000;

/// Minimum time between two introductions, in µs: strangers with changing ids must not flood the link.
const INTRODUCTION_INTERVAL_US: u64 = 10_000_000;

#[derive(Clone, Copy, Debug)]
struct Heard {
    station: Peer,
    /// Whether it was introduced; `None` of one that has stated its time and whose HEARTBEAT is expected.
    is_introduced: Option<bool>,
    /// When its last HEARTBEAT came; until then, when its place was taken.
    heartbeat_at: Instant,
    /// When its last other message came; the start, if none came.
    other_at: Instant,
}

impl Heard {
    fn is_known(&self, now: Instant) -> bool {
        self.is_introduced.is_some() && now.us_since(self.heartbeat_at) <= STATION_SILENCE_US
    }

    fn is_silent(&self, now: Instant) -> bool {
        now.us_since(self.heartbeat_at.max(self.other_at)) > STATION_SILENCE_US
    }
}

/// The ground stations that were heard on one link.
#[derive(Debug, Default)]
pub struct Stations {
    heard: [Option<Heard>; MAX_STATIONS],
    /// When the next introduction may be at the earliest.
    earliest: Instant,
}

impl Stations {
    /// Whether a HEARTBEAT of this station came a while ago at most.
    pub fn knows(&self, station: Peer, now: Instant) -> bool {
        let mut heard = self.heard.iter().flatten();
        heard.any(|heard| heard.station == station && heard.is_known(now))
    }

    /// HEARTBEAT of a ground station. Returns whether what smart batteries are has to be sent for it, its introduction. That of
    /// one that is too early for it is due at a later HEARTBEAT.
    pub fn heartbeat(&mut self, station: Peer, now: Instant) -> bool {
        let earliest = self.earliest;
        let Some(heard) = self.place(station, now) else {
            // There is always one.
            return false;
        };
        if !heard.is_known(now) {
            heard.is_introduced = Some(false);
        }
        heard.heartbeat_at = now;
        if heard.is_introduced == Some(true) || now < earliest {
            return false;
        }
        heard.is_introduced = Some(true);
        self.earliest = now.after_us(INTRODUCTION_INTERVAL_US);
        true
    }

    /// Another message of a station, which keeps its place, if it has one, while others send heartbeats alone.
    pub fn other_message(&mut self, station: Peer, now: Instant) {
        let mut heard = self.heard.iter_mut().flatten();
        if let Some(heard) = heard.find(|heard| heard.station == station) {
            heard.other_at = now;
        }
    }

    /// A station has stated its time. It has a place until its HEARTBEAT comes: among strangers with changing ids, which send more,
    /// the place of that one may be gone before its next statement.
    pub fn expect_heartbeat(&mut self, station: Peer, now: Instant) {
        self.place(station, now);
    }

    /// The place of a station. A new one takes that of a silent one, or of one that has sent heartbeats alone, or of the one
    /// whose other messages are oldest.
    fn place(&mut self, station: Peer, now: Instant) -> Option<&mut Heard> {
        let rank = |place: &&mut Option<Heard>| match place {
            Some(heard) if heard.station == station => 0,
            Some(heard) if !heard.is_silent(now) => 2 + (heard.other_at.as_micros() >> 16) as u32,
            _ => 1,
        };
        let place = self.heard.iter_mut().min_by_key(rank)?;
        place.take_if(|heard| heard.station != station);
        Some(place.get_or_insert(Heard {
            station,
            is_introduced: None,
            heartbeat_at: now,
            other_at: Instant::EPOCH,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;
    use proptest::prelude::*;

    const SECOND: u64 = 1_000_000;

    fn station(system_id: u8, component_id: u8) -> Peer {
        Peer {
            system_id,
            component_id,
        }
    }

    #[test]
    fn a_station_is_introduced_once_until_it_was_silent_for_long() {
        let mut stations = Stations::default();
        for (at_s, station, expected) in [
            (0, station(255, 190), true),
            (1, station(255, 190), false),
            // Another component is another station; it waits for its turn.
            (2, station(255, 230), false),
            (9, station(255, 230), false),
            (10, station(255, 230), true),
            (11, station(255, 230), false),
            (31, station(255, 190), false),
            (61, station(255, 190), false),
            (92, station(255, 190), true),
        ] {
            let introduction = stations.heartbeat(station, at_us(at_s * SECOND));
            assert_eq!(introduction, expected, "{station:?} after {at_s} s");
        }
    }

    #[test]
    fn as_many_stations_as_are_remembered_are_introduced_in_turn_and_more_every_ten_seconds() {
        for (count, expected) in [(4, 4), (6, 30)] {
            let mut stations = Stations::default();
            let mut introduced = Vec::new();
            for at_s in 0..300 {
                for system_id in 1..=count {
                    if stations.heartbeat(station(system_id, 190), at_us(at_s * SECOND)) {
                        introduced.push(system_id);
                    }
                }
            }
            assert_eq!(introduced.len(), expected, "{count}");
            if count == 4 {
                assert_eq!(introduced, [1, 2, 3, 4]);
            }
        }
    }

    #[test]
    fn the_first_to_go_is_silent_then_one_with_heartbeats_alone_then_the_one_with_the_oldest_other_message() {
        let mut stations = Stations::default();
        let [a, b, c, d] = [1, 2, 3, 4].map(|system_id| station(system_id, 190));
        let known =
            |stations: &Stations, at_s| [a, b, c, d].map(|id| stations.knows(id, at_us(at_s * SECOND)));
        let strangers = |stations: &mut Stations, at_s, ids: std::ops::Range<u8>| {
            for number in ids {
                stations.heartbeat(station(number, 33), at_us(at_s * SECOND));
            }
        };
        for (at_s, id) in [(0, a), (1, b), (2, c), (3, d)] {
            stations.heartbeat(id, at_us(at_s * SECOND));
        }
        for (at_s, id) in [(4, c), (5, a), (6, d)] {
            stations.other_message(id, at_us(at_s * SECOND));
        }
        // Strangers take turns at the place of the one with heartbeats alone.
        strangers(&mut stations, 7, 100..150);
        assert_eq!(known(&stations, 7), [true, false, true, true]);
        // One of them sends something else: now the oldest is that of c.
        stations.other_message(station(149, 33), at_us(8 * SECOND));
        strangers(&mut stations, 9, 200..250);
        assert_eq!(known(&stations, 9), [true, false, false, true]);
        // A silent one goes before those with heartbeats alone.
        stations.heartbeat(d, at_us(35 * SECOND));
        stations.heartbeat(station(249, 33), at_us(35 * SECOND));
        stations.heartbeat(b, at_us(36 * SECOND));
        assert_eq!(known(&stations, 36), [false, true, false, true]);
        assert!(stations.knows(station(249, 33), at_us(36 * SECOND)));
    }

    #[test]
    fn a_stated_time_holds_a_place_until_the_heartbeat_and_makes_no_station_known() {
        let mut stations = Stations::default();
        let slow = station(255, 190);
        let strangers = |stations: &mut Stations, at_s| {
            for number in 1..=100 {
                stations.heartbeat(station(number, 33), at_us(at_s * SECOND));
            }
        };
        stations.expect_heartbeat(slow, at_us(SECOND));
        stations.other_message(slow, at_us(SECOND));
        strangers(&mut stations, 2);
        assert!(!stations.knows(slow, at_us(2 * SECOND)));
        // Another one was introduced a second ago.
        assert!(!stations.heartbeat(slow, at_us(3 * SECOND)));
        strangers(&mut stations, 4);
        assert!(stations.knows(slow, at_us(4 * SECOND)));
        assert!(stations.heartbeat(slow, at_us(12 * SECOND)));
    }

    #[test]
    fn a_station_is_known_by_its_heartbeat_until_it_was_silent_for_long() {
        let mut stations = Stations::default();
        let known = station(255, 190);
        assert!(!stations.knows(known, at_us(0)));
        stations.heartbeat(known, at_us(0));
        assert!(stations.knows(known, at_us(30 * SECOND)));
        assert!(!stations.knows(known, at_us(31 * SECOND)));
        assert!(!stations.knows(station(255, 191), at_us(0)));
    }

    proptest! {
        #[test]
        fn strangers_cause_one_introduction_in_ten_seconds_at_most(
            heard in prop::collection::vec((any::<u8>(), any::<u8>(), 0u64..2 * SECOND), 1..300),
        ) {
            let mut stations = Stations::default();
            let (mut now_us, mut last_us) = (0, None);
            for (system_id, component_id, wait_us) in heard {
                now_us += wait_us;
                if stations.heartbeat(station(system_id, component_id), at_us(now_us)) {
                    prop_assert!(last_us.is_none_or(|last_us| now_us - last_us >= INTRODUCTION_INTERVAL_US));
                    last_us = Some(now_us);
                }
            }
        }
    }
}
