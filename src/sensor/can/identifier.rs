//! Identifiers of frames: what is sent, its sender and its receiver.
//!
//! | bits | message | anonymous message | service |
//! |---|---|---|---|
//! | 28 to 24 | priority | priority | priority |
//! | 23 to 16 | type, high byte | discriminator, high byte | type |
//! | 15 | type | discriminator | 1 for a request |
//! | 14 to 8 | type | 6 bits of discriminator; 9 and 8: type, lowest two bits | destination |
//! | 7 | 0 | 0 | 1 |
//! | 6 to 0 | source | 0 | source |
//!
//! DroneCAN specification, 4. CAN bus transport layer.

use super::NodeId;

/// Without the priority, which may differ between the transfers of a source and type.
const KEY: u32 = 0x00ff_ffff;

const SERVICE: u32 = 1 << 7;
const REQUEST: u32 = 1 << 15;

/// How urgent a transfer is, 0 the most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Priority(u8);

impl Priority {
    /// Of status messages and requests, as ArduPilot's `CANARD_TRANSFER_PRIORITY_LOW`.
    pub const LOW: Self = Self(24);

    /// That of a frame.
    pub fn of(id: u32) -> Self {
        Self((id >> 24) as u8 & 0x1f)
    }
}

/// Which half of a service a transfer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Request,
    Response,
}

/// What a frame belongs to, without its priority.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Identifier {
    /// A message to all.
    Message { type_id: u16, source: NodeId },
    /// A message of a node that has no id yet.
    Anonymous {
        /// Lowest two bits of the type.
        type_bits: u8,
        /// Distinguishes nodes that send at the same time, 14 bits.
        discriminator: u16,
    },
    /// A request or response.
    Service {
        type_id: u8,
        direction: Direction,
        destination: NodeId,
        source: NodeId,
    },
}

impl Identifier {
    /// From a frame's identifier; `None` if it is impossible.
    pub fn parse(id: u32) -> Option<Self> {
        let source = NodeId::new(id as u8 & 0x7f);
        if id & SERVICE != 0 {
            return Some(Self::Service {
                type_id: (id >> 16) as u8,
                direction: if id & REQUEST != 0 {
                    Direction::Request
                } else {
                    Direction::Response
                },
                destination: NodeId::new((id >> 8) as u8 & 0x7f)?,
                source: source?,
            });
        }
        Some(match source {
            Some(source) => Self::Message {
                type_id: (id >> 8) as u16,
                source,
            },
            None => Self::Anonymous {
                type_bits: (id >> 8) as u8 & 3,
                discriminator: (id >> 10) as u16 & 0x3fff,
            },
        })
    }

    /// A frame's identifier.
    pub fn with_priority(self, Priority(priority): Priority) -> u32 {
        let lower = match self {
            Self::Message { type_id, source } => u32::from(type_id) << 8 | u32::from(source.number()),
            Self::Anonymous {
                type_bits,
                discriminator,
            } => u32::from(discriminator & 0x3fff) << 10 | u32::from(type_bits & 3) << 8,
            Self::Service {
                type_id,
                direction,
                destination,
                source,
            } => {
                let request = if direction == Direction::Request {
                    REQUEST
                } else {
                    0
                };
                let nodes = u32::from(destination.number()) << 8 | u32::from(source.number());
                u32::from(type_id) << 16 | request | SERVICE | nodes
            }
        };
        u32::from(priority) << 24 | lower
    }

    /// Who sent it; `None` if anonymous.
    pub fn source(self) -> Option<NodeId> {
        match self {
            Self::Message { source, .. } | Self::Service { source, .. } => Some(source),
            Self::Anonymous { .. } => None,
        }
    }

    /// What all transfers of the same source and type have in common.
    pub fn key(id: u32) -> u32 {
        id & KEY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn node(number: u8) -> NodeId {
        NodeId::new(number).unwrap()
    }

    /// Identifiers as PyPI `dronecan` 1.0.27 makes them (`transport.Transfer.message_id`).
    #[test]
    fn identifiers_have_type_source_and_destination() {
        for (id, expected) in [
            (
                0x1004_442a,
                Identifier::Message {
                    type_id: 1092,
                    source: node(42),
                },
            ),
            (
                0x1848_d100,
                Identifier::Anonymous {
                    type_bits: 1,
                    discriminator: 0x1234,
                },
            ),
            (
                0x18f0_a18a,
                Identifier::Service {
                    type_id: 240,
                    direction: Direction::Request,
                    destination: node(33),
                    source: node(10),
                },
            ),
            (
                0x18f0_0aa1,
                Identifier::Service {
                    type_id: 240,
                    direction: Direction::Response,
                    destination: node(10),
                    source: node(33),
                },
            ),
        ] {
            assert_eq!(Identifier::parse(id), Some(expected));
            assert_eq!(expected.with_priority(Priority::of(id)), id);
        }
    }

    #[test]
    fn services_without_source_or_destination_are_impossible() {
        assert_eq!(
            Identifier::parse(0x18f0_8a80 | 0x21),
            Identifier::parse(0x18f0_8aa1)
        );
        assert_eq!(Identifier::parse(0x18f0_8a80), None, "no source");
        assert_eq!(Identifier::parse(0x18f0_80a1), None, "no destination");
    }

    proptest! {
        #[test]
        fn what_is_parsed_is_the_same_identifier(id in 0u32..1 << 29) {
            if let Some(identifier) = Identifier::parse(id) {
                prop_assert_eq!(identifier.with_priority(Priority::of(id)), id);
            }
        }
    }
}
