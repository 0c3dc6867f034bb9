//! Stations that get a HEARTBEAT without having a link.

use core::cell::{Cell, RefCell};
use core::net::Ipv4Addr;

use heapless::Vec;

use super::address::MAX_CLIENTS;

/// The HEARTBEATs for those who have no link yet.
pub(super) struct Greetings {
    next_sequence: Cell<u8>,
    /// Addresses that have not been sent the present one.
    waiting: RefCell<Vec<Ipv4Addr, MAX_CLIENTS>>,
}

impl Greetings {
    pub fn new() -> Self {
        Self {
            next_sequence: Cell::new(0),
            waiting: RefCell::default(),
        }
    }

    /// The sequence number of the first frame on the link that `station` has got. It gets no greeting any more: that would arrive
    /// between the frames of its link, and count as a loss of many.
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

    /// All of `addresses` are to get a HEARTBEAT with this sequence number.
    pub fn begin(&self, sequence: u8, addresses: impl Iterator<Item = Ipv4Addr>) {
        self.next_sequence.set(sequence.wrapping_add(1));
        let mut waiting = self.waiting.borrow_mut();
        waiting.clear();
        for address in addresses {
            // There are no more clients than that.
            let _ = waiting.push(address);
        }
    }

    /// The address that gets it next.
    pub fn next_address(&self) -> Option<Ipv4Addr> {
        self.waiting.borrow_mut().pop()
    }

    /// Whether all have got it.
    pub fn is_over(&self) -> bool {
        self.waiting.borrow().is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_begins_after_the_last_greeting_that_was_sent_to_its_station() {
        let [two, three] = [2, 3].map(|number| Ipv4Addr::new(192, 168, 4, number));
        let greetings = Greetings::new();
        assert_eq!(greetings.end_for(two), 0);
        greetings.begin(255, [two, three].into_iter());
        assert_eq!(greetings.next_address(), Some(three));
        assert_eq!(greetings.end_for(three), 0);
        assert_eq!(greetings.end_for(two), 255);
        assert!(greetings.is_over());
        assert_eq!(greetings.next_address(), None);
    }
}
