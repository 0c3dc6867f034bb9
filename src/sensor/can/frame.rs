//! Frames on the CAN bus: ids of nodes, identifiers, data, and the last byte, which says where in a transfer they belong.
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

use core::num::NonZeroU8;

/// Highest node id (DroneCAN specification, 4. CAN bus transport layer).
const HIGHEST: u8 = 127;

/// Id of a node, unique on the bus: 1 to 127.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodeId(NonZeroU8);

impl NodeId {
    /// The id with this number; `None` for 0, which stands for a node without an id, and above 127.
    pub fn new(number: u8) -> Option<Self> {
        NonZeroU8::new(number).filter(|_| number <= HIGHEST).map(Self)
    }

    /// The number, 1 to 127.
    pub fn number(self) -> u8 {
        self.0.get()
    }
}

#[cfg(target_os = "none")]
impl defmt::Format for NodeId {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}", self.number());
    }
}

/// Most bytes of data in a frame.
pub const FRAME_BYTES: usize = 8;

/// A data frame with an extended identifier, the only kind that DroneCAN uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanFrame {
    id: u32,
    length: u8,
    data: [u8; FRAME_BYTES],
}

impl CanFrame {
    /// A frame; `None` if the identifier has more than 29 bits or there are more than [`FRAME_BYTES`] bytes.
    pub fn new(id: u32, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; FRAME_BYTES];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        (id < 1 << 29).then_some(Self {
            id,
            length: data.len() as u8,
            data: bytes,
        })
    }

    /// Identifier, of 29 bits.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// Data, at most [`FRAME_BYTES`].
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.length)).unwrap_or(&self.data)
    }
}

/// Without the priority, which may differ between the transfers of a source and type.
const KEY: u32 = 0x00ff_ffff;

const SERVICE: u32 = 1 << 7;
const REQUEST: u32 = 1 << 15;

/// Priority of a transfer, 0 the most urgent.
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

/// The transfer of a frame, without its priority.
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

    /// Its sender; `None` if anonymous.
    pub fn source(self) -> Option<NodeId> {
        match self {
            Self::Message { source, .. } | Self::Service { source, .. } => Some(source),
            Self::Anonymous { .. } => None,
        }
    }

    /// Key of all transfers of the same source and type.
    pub fn key(id: u32) -> u32 {
        id & KEY
    }
}

const START: u8 = 1 << 7;
const END: u8 = 1 << 6;
const TOGGLE: u8 = 1 << 5;
const TRANSFER_ID: u8 = 0x1f;

/// The last byte of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tail(pub u8);

impl Tail {
    /// Of the frame with this index in a transfer; counts of transfers wrap.
    pub fn of_frame(index: usize, frames: usize, transfer_id: u8) -> Self {
        let start = if index == 0 { START } else { 0 };
        let end = if index + 1 == frames { END } else { 0 };
        let toggle = if index % 2 == 1 { TOGGLE } else { 0 };
        Self(start | end | toggle | transfer_id & TRANSFER_ID)
    }

    /// Whether a transfer starts with it.
    pub fn is_start(self) -> bool {
        self.0 & START != 0
    }

    /// Whether a transfer ends with it.
    pub fn is_end(self) -> bool {
        self.0 & END != 0
    }

    /// Whether it is all of a transfer.
    pub fn is_whole(self) -> bool {
        self.is_start() && self.is_end()
    }

    /// Alternates from frame to frame, from `false` on.
    pub fn toggle(self) -> bool {
        self.0 & TOGGLE != 0
    }

    /// Distinguishes a transfer from the ones before, 0 to 31.
    pub fn transfer_id(self) -> u8 {
        self.0 & TRANSFER_ID
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn ids_are_1_to_127() {
        let valid: Vec<u8> = (0..=u8::MAX)
            .filter_map(NodeId::new)
            .map(NodeId::number)
            .collect();
        assert_eq!(valid, (1..=127).collect::<Vec<u8>>());
    }

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
