//! Permissions of unsigned messages, by link.

use crate::parameter::{Parameters, VehicleParameter};

/// The kind of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum LinkKind {
    /// A cable to a person who has the vehicle in hand: USB, and TCP in the simulator. The only kind on which
    /// signing can be set up.
    Direct,
    /// Anyone near is at the other end: the telemetry port, and UDP in the simulator.
    Radio,
    /// Anyone in the same Wi-Fi network is at the other end: UDP and TCP on the board.
    Wifi,
}

impl LinkKind {
    /// The link's number in our signatures.
    pub(super) fn number(self) -> u8 {
        match self {
            Self::Radio => 0,
            Self::Direct => 1,
            Self::Wifi => 2,
        }
    }
}

/// Permissions of the station at the other end of a link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Access {
    /// All that its kind of link allows.
    #[default]
    Full,
    /// Full access, by the age of what it sends: the vehicle's own web page, which states its time.
    Page,
    /// It hears what is sent, and nothing that it sends is obeyed or answered without the right signature: a web page of
    /// someone else, in a browser that reaches the vehicle.
    Listen,
}

/// Messages that are accepted without a right signature while there is a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AcceptUnsigned {
    /// Nothing, but what a radio reports of itself.
    Nothing,
    /// Requests that only read.
    Requests,
    /// Everything, as if there were no key.
    Everything,
}

impl AcceptUnsigned {
    /// The owner's choice for this kind of link (`SIGN_UART_ALLOW`, `SIGN_USB_ALLOW`,
    /// `SIGN_WIFI_ALLOW`).
    pub fn on(link: LinkKind, parameters: &Parameters) -> Self {
        let chosen = parameters.get_whole(match link {
            LinkKind::Radio => VehicleParameter::SignUartAllow,
            LinkKind::Direct => VehicleParameter::SignUsbAllow,
            LinkKind::Wifi => VehicleParameter::SignWifiAllow,
        });
        match chosen {
            2 => Self::Everything,
            1 => Self::Requests,
            // The table has no other value.
            _ => Self::Nothing,
        }
    }
}

/// Whether a frame was sent by a holder of the key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::mavlink) enum Authenticity {
    /// There is no key to prove it with.
    Unprotected,
    /// It is signed with our key and was never heard before.
    Proven,
    /// It is signed with our key and was never heard before, by a sender heard since the start, but over a minute old: it may stop the rover.
    Late,
    /// It is signed with our key, and too old to be obeyed.
    TooOld,
    /// It is signed with our key, and not later than the latest frame of its ids: by a second station with the same ids, whose
    /// frames take longer, or recorded. It may stop the rover if it is a minute old at most, and later than what it would stop.
    Overtaken {
        /// It was signed after the last arming.
        may_disarm: bool,
        /// It was signed after the last change to Manual.
        may_hold: bool,
    },
    /// It is signed with our key, and one of the latest frames once more.
    Repeated,
    /// Not signed, or with another key.
    Unproven,
}

/// The greatest effect of a received message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::mavlink) enum Effect {
    /// It says how the radio is doing. Radios have no key: ArduPilot takes it unsigned, too.
    RadioReport,
    /// It is answered and nothing else.
    Reads,
    /// Something is different afterwards.
    Changes,
}

/// Whether a message may have its effect.
pub(in crate::mavlink) fn is_permitted(
    effect: Effect,
    authenticity: Authenticity,
    accepted: AcceptUnsigned,
) -> bool {
    match authenticity {
        Authenticity::Unprotected | Authenticity::Proven => true,
        Authenticity::Late
        | Authenticity::TooOld
        | Authenticity::Overtaken { .. }
        | Authenticity::Repeated
        | Authenticity::Unproven => match (effect, accepted) {
            (Effect::RadioReport, _) | (_, AcceptUnsigned::Everything) => true,
            (Effect::Reads, AcceptUnsigned::Requests) => true,
            (Effect::Reads, AcceptUnsigned::Nothing) => false,
            (Effect::Changes, AcceptUnsigned::Requests | AcceptUnsigned::Nothing) => false,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unproven_messages_have_the_effects_that_the_link_accepts_and_proven_ones_all() {
        let of_each = |authenticity, accepted| {
            [Effect::RadioReport, Effect::Reads, Effect::Changes]
                .map(|effect| is_permitted(effect, authenticity, accepted))
        };
        for (accepted, permitted) in [
            (AcceptUnsigned::Everything, [true; 3]),
            (AcceptUnsigned::Requests, [true, true, false]),
            (AcceptUnsigned::Nothing, [true, false, false]),
        ] {
            for authenticity in [
                Authenticity::Late,
                Authenticity::TooOld,
                Authenticity::Overtaken {
                    may_disarm: true,
                    may_hold: true,
                },
                Authenticity::Repeated,
                Authenticity::Unproven,
            ] {
                assert_eq!(
                    of_each(authenticity, accepted),
                    permitted,
                    "{authenticity:?} {accepted:?}"
                );
            }
            for authenticity in [Authenticity::Unprotected, Authenticity::Proven] {
                assert_eq!(of_each(authenticity, accepted), [true; 3], "{authenticity:?}");
            }
        }
    }
}
