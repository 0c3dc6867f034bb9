//! Which network the radio is in: the one to join, or one of the board's own when that can't be joined.

use crate::time::Instant;

/// The limit over all attempts to join the network, and over faults of the radio meanwhile: then the board has its own network
/// instead.
const NETWORK_TIMEOUT_US: u64 = 60_000_000;

/// Time-out of an attempt to join.
const JOIN_TIMEOUT_US: u64 = 20_000_000;

/// A network that gives no address for this long is left, and joined again.
const ADDRESS_TIMEOUT_US: u64 = 25_000_000;

/// State of the radio, over its restarts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadioState {
    /// As the owner has set it up: an access point, or a station that has an address in its network or has not tried to join yet.
    AsSetUp,
    /// A station that tries to join its network, or waits for an address there.
    Joining {
        /// Then it falls back to an access point.
        give_up_at: Instant,
    },
    /// An access point, because the network could not be joined.
    Fallback,
}

/// An event that the state depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadioEvent {
    /// The station is in no network: it has just been started, or has left one.
    NotInNetwork,
    /// The network was joined.
    Joined,
    /// The network could not be joined.
    JoinFailed,
    /// The network has given an address.
    AddressObtained,
    /// The address is lost, or none has come in time.
    NoAddress,
    /// The owner has set up something else, or it is time to look for the network again.
    SetUpAgain,
}

/// The next step of the radio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadioAction {
    /// Join the network, by then.
    Join {
        /// End of the attempt.
        by: Instant,
    },
    /// Stay in the network until the address is lost, or none has come by then.
    Stay {
        /// When to leave without an address; [`Instant::MAX`] once there is one.
        leave_at: Instant,
    },
    /// Leave the network. A chip that is still in one takes no other password.
    Leave,
    /// Restart the radio in the present state.
    Restart,
}

impl RadioState {
    /// Takes over an event at `now`, and returns what to do. A fault of the radio is no event: it is restarted in the same state.
    pub fn next(&mut self, event: RadioEvent, now: Instant) -> RadioAction {
        let give_up_at = match *self {
            Self::Joining { give_up_at } => give_up_at,
            Self::AsSetUp | Self::Fallback => now.after_us(NETWORK_TIMEOUT_US),
        };
        let (state, action) = match event {
            RadioEvent::NotInNetwork if now >= give_up_at => (Self::Fallback, RadioAction::Restart),
            RadioEvent::NotInNetwork => {
                let by = give_up_at.min(now.after_us(JOIN_TIMEOUT_US));
                (Self::Joining { give_up_at }, RadioAction::Join { by })
            }
            RadioEvent::Joined => {
                let leave_at = now.after_us(ADDRESS_TIMEOUT_US);
                (*self, RadioAction::Stay { leave_at })
            }
            RadioEvent::AddressObtained => {
                let leave_at = Instant::MAX;
                (Self::AsSetUp, RadioAction::Stay { leave_at })
            }
            RadioEvent::JoinFailed | RadioEvent::NoAddress => (*self, RadioAction::Leave),
            RadioEvent::SetUpAgain => (Self::AsSetUp, RadioAction::Restart),
        };
        *self = state;
        action
    }
}

#[cfg(test)]
mod tests {
    use super::RadioAction::{Leave, Restart};
    use super::RadioEvent::{AddressObtained, JoinFailed, Joined, NoAddress, NotInNetwork, SetUpAgain};
    use super::*;
    use crate::time::at_us;

    /// Feeds events at these seconds, and expects these actions.
    fn check(state: &mut RadioState, steps: &[(u64, RadioEvent, RadioAction)]) {
        for (second, event, action) in steps {
            assert_eq!(
                state.next(*event, at(*second)),
                *action,
                "{event:?} at {second} s"
            );
        }
    }

    fn at(second: u64) -> Instant {
        at_us(second * 1_000_000)
    }

    fn join(by: u64) -> RadioAction {
        RadioAction::Join { by: at(by) }
    }

    fn stay(leave_at: u64) -> RadioAction {
        RadioAction::Stay {
            leave_at: at(leave_at),
        }
    }

    const STAY: RadioAction = RadioAction::Stay {
        leave_at: Instant::MAX,
    };

    #[test]
    fn after_a_minute_of_failed_attempts_it_falls_back_to_an_access_point() {
        let mut state = RadioState::AsSetUp;
        let steps = [
            (10, NotInNetwork, join(30)),
            (30, JoinFailed, Leave),
            // A restart after a fault of the radio does not extend the limit.
            (44, NotInNetwork, join(64)),
            (50, JoinFailed, Leave),
            (55, NotInNetwork, join(70)),
            (70, JoinFailed, Leave),
            (72, NotInNetwork, Restart),
        ];
        check(&mut state, &steps);
        assert_eq!(state, RadioState::Fallback);
        check(&mut state, &[(372, SetUpAgain, Restart)]);
        assert_eq!(state, RadioState::AsSetUp);
        check(&mut state, &[(373, NotInNetwork, join(393))]);
    }

    #[test]
    fn a_network_without_addresses_is_left_and_does_not_extend_the_limit() {
        let mut state = RadioState::AsSetUp;
        let steps = [
            (0, NotInNetwork, join(20)),
            (3, Joined, stay(28)),
            (28, NoAddress, Leave),
            (30, NotInNetwork, join(50)),
            (33, Joined, stay(58)),
            (58, NoAddress, Leave),
            (60, NotInNetwork, Restart),
        ];
        check(&mut state, &steps);
        assert_eq!(state, RadioState::Fallback);
    }

    #[test]
    fn each_loss_of_an_address_gives_another_minute() {
        let mut state = RadioState::AsSetUp;
        for start in [0, 50, 1_000] {
            let steps = [
                (start, NotInNetwork, join(start + 20)),
                (start + 3, Joined, stay(start + 28)),
                (start + 5, AddressObtained, STAY),
                // It is renewed, or another one.
                (start + 20, AddressObtained, STAY),
                (start + 45, NoAddress, Leave),
            ];
            check(&mut state, &steps);
            assert_eq!(state, RadioState::AsSetUp);
        }
    }
}
