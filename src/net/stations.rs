//! Which ground stations have a link by UDP, and which are sent a HEARTBEAT without one.

use core::cell::{Cell, RefCell};
use core::net::{Ipv4Addr, SocketAddrV4};

use heapless::Vec;

use super::address::MAX_CLIENTS;

/// Ground stations that can have a link by UDP at a time.
pub(super) const SLOTS: usize = 2;

/// Result of a station's request for a slot.
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
    pub fn has_address(&self, address: Ipv4Addr) -> bool {
        self.slots
            .iter()
            .flatten()
            .any(|station| *station.ip() == address)
    }
}

/// Which ground stations the discovery looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Search {
    /// There is none yet: a broadcast reaches all.
    Anyone,
    /// Stations that are not connected yet. A broadcast would reach the connected ones, too.
    Others,
    /// No slot is free.
    NoOne,
}

/// The HEARTBEAT that is being sent to addresses without a link.
pub(super) struct Discovery {
    next_sequence: Cell<u8>,
    /// Addresses that it has not been sent to yet.
    waiting: RefCell<Vec<Ipv4Addr, MAX_CLIENTS>>,
}

impl Discovery {
    pub fn new() -> Self {
        Self {
            next_sequence: Cell::new(0),
            waiting: RefCell::default(),
        }
    }

    /// The sequence number of the first frame on the link that `station` has got. It is sent no more HEARTBEATs of the discovery: they
    /// would arrive between the frames of its link, and count as a loss of many.
    pub fn end_for(&self, station: Ipv4Addr) -> u8 {
        let mut waiting = self.waiting.borrow_mut();
        let next_sequence = self.next_sequence.get();
        match waiting.iter().position(|address| *address == station) {
            Some(index) => {
                waiting.swap_remove(index);
                next_sequence.wrapping_sub(1)
            }
            None => next_sequence,
        }
    }

    /// Begins to send a HEARTBEAT with this sequence number to `addresses`.
    pub fn begin(&self, sequence: u8, addresses: impl Iterator<Item = Ipv4Addr>) {
        self.next_sequence.set(sequence.wrapping_add(1));
        let mut waiting = self.waiting.borrow_mut();
        waiting.clear();
        for address in addresses {
            // There are no more clients than that.
            let _ = waiting.push(address);
        }
    }

    /// The address that it is sent to next.
    pub fn next_address(&self) -> Option<Ipv4Addr> {
        self.waiting.borrow_mut().pop()
    }

    /// Whether it was sent to all of them.
    pub fn is_done(&self) -> bool {
        self.waiting.borrow().is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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

    #[test]
    fn a_link_begins_after_the_last_heartbeat_that_was_sent_to_its_station() {
        let [two, three] = [2, 3].map(|number| Ipv4Addr::new(192, 168, 4, number));
        let discovery = Discovery::new();
        assert_eq!(discovery.end_for(two), 0);
        discovery.begin(255, [two, three].into_iter());
        assert_eq!(discovery.next_address(), Some(three));
        assert_eq!(discovery.end_for(three), 0);
        assert_eq!(discovery.end_for(two), 255);
        assert!(discovery.is_done());
        assert_eq!(discovery.next_address(), None);
    }

    proptest! {
        #[test]
        fn no_station_has_two_slots_and_none_loses_its_own(steps in prop::collection::vec((0_u8..6, any::<bool>()), 0..60)) {
            let mut stations = Stations::default();
            let mut model: [Option<SocketAddrV4>; SLOTS] = [None; SLOTS];
            for (number, comes) in steps {
                let station = station(number);
                let taken = model.iter().position(|slot| *slot == Some(station));
                prop_assert_eq!(stations.slot_of(station), taken);
                match (comes, taken) {
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
