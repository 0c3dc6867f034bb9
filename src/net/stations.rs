//! Which ground stations have a link by UDP.

use core::net::SocketAddrV4;

/// Ground stations that can have a link by UDP at a time.
pub(super) const SLOTS: usize = 2;

/// Result for a ground station that was heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Admission {
    /// It has this slot.
    Admitted(usize),
    /// All slots are taken. This many datagrams were refused since the start.
    Refused(u32),
}

/// The ground stations that have a slot, by where they send from: a station is a program, and one phone may have two.
#[derive(Debug, Default)]
pub(super) struct Stations {
    slots: [Option<SocketAddrV4>; SLOTS],
    refused: u32,
}

impl Stations {
    /// The slot of a station that has one.
    pub fn slot_of(&self, station: SocketAddrV4) -> Option<usize> {
        self.slots.iter().position(|slot| *slot == Some(station))
    }

    /// Gives a station without a slot the first free one.
    pub fn admit(&mut self, station: SocketAddrV4) -> Admission {
        let mut slots = self.slots.iter_mut().enumerate();
        match slots.find(|(_, slot)| slot.is_none()) {
            Some((index, slot)) => {
                *slot = Some(station);
                Admission::Admitted(index)
            }
            None => {
                self.refused = self.refused.wrapping_add(1);
                Admission::Refused(self.refused)
            }
        }
    }

    /// The slot is free again.
    pub fn release(&mut self, index: usize) {
        if let Some(slot) = self.slots.get_mut(index) {
            *slot = None;
        }
    }

    /// The stations to look for.
    pub fn search(&self) -> Search {
        match self.slots.iter().flatten().count() {
            0 => Search::Anyone,
            SLOTS => Search::NoOne,
            _ => Search::Others,
        }
    }

    /// Whether a station sends from this address.
    pub fn has_address(&self, address: core::net::Ipv4Addr) -> bool {
        self.slots
            .iter()
            .flatten()
            .any(|station| *station.ip() == address)
    }
}

/// Which ground stations are to be looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Search {
    /// There is none yet: a broadcast reaches all.
    Anyone,
    /// Stations that are not connected yet. A broadcast would reach the connected ones, too.
    Others,
    /// No slot is free.
    NoOne,
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::net::Ipv4Addr;
    use proptest::prelude::*;

    fn station(number: u8) -> SocketAddrV4 {
        SocketAddrV4::new(Ipv4Addr::new(192, 168, 4, number), 14550)
    }

    #[test]
    fn two_stations_have_a_slot_each_and_a_third_is_counted() {
        let mut stations = Stations::default();
        assert_eq!(stations.search(), Search::Anyone);
        assert_eq!(stations.admit(station(2)), Admission::Admitted(0));
        assert_eq!(stations.search(), Search::Others);
        assert_eq!(stations.admit(station(3)), Admission::Admitted(1));
        assert_eq!(stations.search(), Search::NoOne);
        assert_eq!(stations.admit(station(4)), Admission::Refused(1));
        assert_eq!(stations.admit(station(4)), Admission::Refused(2));
        assert_eq!(stations.slot_of(station(2)), Some(0));
        assert_eq!(stations.slot_of(station(3)), Some(1));
        assert_eq!(stations.slot_of(station(4)), None);
    }

    #[test]
    fn a_slot_that_is_free_again_goes_to_the_next_one() {
        let mut stations = Stations::default();
        stations.admit(station(2));
        stations.admit(station(3));
        stations.release(0);
        assert_eq!(stations.search(), Search::Others);
        assert_eq!(stations.slot_of(station(2)), None);
        assert_eq!(stations.admit(station(4)), Admission::Admitted(0));
        assert_eq!(stations.slot_of(station(3)), Some(1));
    }

    #[test]
    fn two_programs_on_one_phone_are_two_stations() {
        let mut stations = Stations::default();
        let other = SocketAddrV4::new(*station(2).ip(), 14551);
        stations.admit(station(2));
        assert_eq!(stations.slot_of(other), None);
        assert_eq!(stations.admit(other), Admission::Admitted(1));
        assert!(stations.has_address(*station(2).ip()));
        assert!(!stations.has_address(*station(3).ip()));
    }

    proptest! {
        #[test]
        fn no_station_has_two_slots_and_none_loses_its_own(steps in prop::collection::vec((0_u8..6, any::<bool>()), 0..60)) {
            let mut stations = Stations::default();
            let mut model: [Option<SocketAddrV4>; SLOTS] = [None; SLOTS];
            for (number, comes) in steps {
                let station = station(number);
                let place = model.iter().position(|slot| *slot == Some(station));
                prop_assert_eq!(stations.slot_of(station), place);
                match (comes, place) {
                    (true, None) => {
                        let free = model.iter().position(Option::is_none);
                        match (stations.admit(station), free) {
                            (Admission::Admitted(index), Some(free)) => {
                                prop_assert_eq!(index, free);
                                model[index] = Some(station);
                            }
                            (Admission::Refused(_), None) => {}
                            (admission, free) => prop_assert!(false, "{:?} with {:?}", admission, free),
                        }
                    }
                    (false, Some(index)) => {
                        stations.release(index);
                        model[index] = None;
                    }
                    _ => {}
                }
            }
        }
    }
}
