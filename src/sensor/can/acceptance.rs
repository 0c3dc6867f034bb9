//! Which frames a controller has to let through.

use super::NodeId;
use super::messages::{ALLOCATION, BATTERY_AUX, BATTERY_INFO, CONTROLLER};

/// Frames that a controller lets through: those whose identifier is `id` in all bits of `mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acceptance {
    /// Bits of the identifier.
    pub id: u32,
    /// Which of them have to agree, of 29.
    pub mask: u32,
}

/// The lowest two bits of the type, and whether it is a service: all that an anonymous message has.
const LOWEST_TYPE_BITS: u32 = 0x380;

/// Type of a message, and that it is none of a service.
const TYPE: u32 = 0x00ff_ff80;

/// Bit of a service, and where its destination stands.
const SERVICE: u32 = 0x80;
const DESTINATION_SHIFT: u32 = 8;

/// For six filters: the first two have a mask in common, the other four another one, as in the MCP2515.
///
/// The first lets messages through that have the lowest two type bits of Allocation, which are also those of NodeStatus
/// and of a charger; the second services for nodes whose lowest two id bits are ours.
pub(super) fn acceptance(own_id: Option<NodeId>) -> [Acceptance; 6] {
    let messages = u32::from(ALLOCATION & 3) << 8;
    let services = own_id.map(|id| u32::from(id.number() & 3) << DESTINATION_SHIFT | SERVICE);
    let low = |id| Acceptance {
        id,
        mask: LOWEST_TYPE_BITS,
    };
    let typed = |type_id: u16| Acceptance {
        id: u32::from(type_id) << 8,
        mask: TYPE,
    };
    [
        low(messages),
        low(services.unwrap_or(messages)),
        typed(BATTERY_INFO),
        typed(BATTERY_AUX),
        typed(CONTROLLER),
        // There is no further one: a filter can't be left out.
        typed(CONTROLLER),
    ]
}
