//! Fault confinement: error counters, and what follows from them (8).

/// From this on a node is error-passive.
const PASSIVE: u16 = 128;
/// From this on a transmitter is off the bus.
const BUS_OFF: u16 = 256;
const MOST: u16 = 255;
/// Occurrences of 11 recessive bits before a node takes part: after bus-off, and when it is switched on.
const RECOVERY: u64 = 128;
const JOINING: u64 = 1;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorState {
    /// It has not seen an idle bus yet since it was switched on.
    Joining,
    Active,
    Passive,
    BusOff,
}

/// Counters and state of one node.
#[derive(Clone, Debug)]
pub struct Confinement {
    transmit: u16,
    receive: u16,
    is_bus_off: bool,
    /// Occurrences of 11 recessive bits that are missing before it takes part.
    awaited: u64,
}

impl Default for Confinement {
    fn default() -> Self {
        Self {
            transmit: 0,
            receive: 0,
            is_bus_off: false,
            awaited: JOINING,
        }
    }
}

impl Confinement {
    pub fn transmit_errors(&self) -> u16 {
        self.transmit
    }

    pub fn receive_errors(&self) -> u16 {
        self.receive
    }

    pub fn state(&self) -> ErrorState {
        match () {
            () if self.is_bus_off => ErrorState::BusOff,
            () if self.awaited > 0 => ErrorState::Joining,
            () if self.transmit >= PASSIVE || self.receive >= PASSIVE => ErrorState::Passive,
            () => ErrorState::Active,
        }
    }

    /// Whether it takes part in what happens on the bus.
    pub fn is_present(&self) -> bool {
        matches!(self.state(), ErrorState::Active | ErrorState::Passive)
    }

    /// Rule 3.
    pub fn transmit_failed(&mut self) {
        self.transmit += 8;
        if self.transmit >= BUS_OFF {
            *self = Self {
                transmit: MOST,
                receive: 0,
                is_bus_off: true,
                awaited: RECOVERY,
            };
        }
    }

    /// Rule 1.
    pub fn receive_failed(&mut self) {
        self.receive = (self.receive + 1).min(MOST);
    }

    /// Rule 6: eight dominant bits too many.
    pub fn saw_dominant_bits(&mut self) {
        self.receive = (self.receive + 8).min(MOST);
    }

    /// Rule 7.
    pub fn sent(&mut self) {
        self.transmit = self.transmit.saturating_sub(1);
    }

    /// Rule 8: "between 119 and 127" if it was larger.
    pub fn received(&mut self) {
        self.receive = match self.receive {
            errors if errors >= PASSIVE => PASSIVE - 1,
            errors => errors.saturating_sub(1),
        };
    }

    /// Occurrences of 11 recessive bits it waits for.
    pub fn awaited(&self) -> u64 {
        self.awaited
    }

    /// This many have come. Rule 12: both counters are 0 after bus-off.
    pub fn saw_recessive(&mut self, occurrences: u64) {
        if self.awaited == 0 {
            return;
        }
        self.awaited = self.awaited.saturating_sub(occurrences);
        if self.awaited == 0 && self.is_bus_off {
            *self = Self {
                awaited: 0,
                ..Self::default()
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn present() -> Confinement {
        let mut node = Confinement::default();
        node.saw_recessive(1);
        node
    }

    #[test]
    fn sixteen_failures_make_a_transmitter_passive_and_thirty_two_switch_it_off() {
        let mut node = present();
        let states: Vec<_> = (0..32)
            .map(|_| {
                node.transmit_failed();
                node.state()
            })
            .collect();
        assert_eq!(
            (states[14], states[15]),
            (ErrorState::Active, ErrorState::Passive)
        );
        assert_eq!(
            (states[30], states[31]),
            (ErrorState::Passive, ErrorState::BusOff)
        );
    }

    #[test]
    fn bus_off_ends_after_128_times_11_recessive_bits() {
        let mut node = present();
        (0..32).for_each(|_| node.transmit_failed());
        node.saw_recessive(127);
        assert_eq!(node.state(), ErrorState::BusOff);
        node.saw_recessive(1);
        assert_eq!((node.state(), node.transmit_errors()), (ErrorState::Active, 0));
    }

    #[test]
    fn a_receiver_becomes_passive_and_never_goes_off() {
        let mut node = present();
        (0..127).for_each(|_| node.receive_failed());
        assert_eq!(node.state(), ErrorState::Active);
        (0..1000).for_each(|_| node.receive_failed());
        assert_eq!(node.state(), ErrorState::Passive);
        node.received();
        assert_eq!(
            (node.state(), node.receive_errors()),
            (ErrorState::Active, 127),
            "one good frame"
        );
    }
}
