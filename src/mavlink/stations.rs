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
    /// When its last HEARTBEAT came.
    at: Instant,
}

impl Heard {
    /// Whether it is of this station, which has not been silent for long since.
    fn is_of(&self, station: Peer, now: Instant) -> bool {
        self.station == station && now.us_since(self.at) <= STATION_SILENCE_US
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
        heard.any(|heard| heard.is_of(station, now))
    }

    /// HEARTBEAT of a ground station. Returns whether what smart batteries are has to be sent for it, its introduction. That of
    /// one that is too early for it is due at a later HEARTBEAT.
    pub fn heartbeat(&mut self, station: Peer, now: Instant) -> bool {
        let mut heard = self.heard.iter_mut().flatten();
        if let Some(known) = heard.find(|heard| heard.is_of(station, now)) {
            known.at = now;
            return false;
        }
        if now < self.earliest {
            return false;
        }
        self.earliest = now.after_us(INTRODUCTION_INTERVAL_US);
        // It replaces the one that has been silent for longest.
        if let Some(place) = self
            .heard
            .iter_mut()
            .min_by_key(|heard| heard.map(|heard| heard.at))
        {
            *place = Some(Heard { station, at: now });
        }
        true
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
    fn more_stations_than_are_remembered_are_introduced_in_turn() {
        let mut stations = Stations::default();
        let mut introduced = Vec::new();
        for at_s in 0..300 {
            for system_id in 1..=6 {
                if stations.heartbeat(station(system_id, 190), at_us(at_s * SECOND)) {
                    introduced.push(system_id);
                }
            }
        }
        assert_eq!(introduced[..4], [1, 2, 3, 4]);
        assert_eq!(introduced.len(), 30, "every ten seconds");
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
