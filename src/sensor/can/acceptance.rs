//! Which frames a controller has to let through.

use super::NodeId;
use super::messages::{ALLOCATION, BATTERY_AUX, BATTERY_INFO, CONTROLLER};

/// What a controller lets through: frames that pass the filters of one of its two receive buffers.
///
/// A frame for the first buffer goes to the second while the first is full. A frame for the second is lost while that is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acceptance {
    /// Filters of the first buffer.
    pub first: CanFilters<2>,
    /// Filters of the second buffer.
    pub second: CanFilters<4>,
}

/// Filters of a receive buffer. A frame passes if its identifier is extended and agrees with one of `ids` in all bits of `mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanFilters<const N: usize> {
    /// Bits that have to agree, of 29.
    pub mask: u32,
    /// Identifiers.
    pub ids: [u32; N],
}

/// Type of a message, and that it is none of a service.
const TYPE: u32 = 0x00ff_ff80;

/// In which bits of the identifier BatteryInfo and BatteryInfoAux differ.
const BATTERY_BITS: u32 = ((BATTERY_INFO ^ BATTERY_AUX) as u32) << TYPE_SHIFT;

/// The lowest two bits of the type, and whether it is a service: all that an anonymous message has.
const LOWEST_TYPE_BITS: u32 = 0x380;

/// Where the type of a message stands.
const TYPE_SHIFT: u32 = 8;

/// Bit of a service, and where its destination stands.
const SERVICE: u32 = 0x80;
const DESTINATION_SHIFT: u32 = 8;

/// What is used.
///
/// What comes often, and in transfers of several frames, has both buffers: batteries, both messages by one filter, and motor
/// controllers. This lets StaticPressure (1028), gnss.Fix (1060) and BatteryContinuous (20010) through as well, but no commands
/// for motor controllers. What is left has the second: messages with the lowest two type bits of Allocation, which are also those
/// of NodeStatus and of a charger, and services for nodes with the lowest two bits of the own id.
pub(super) fn acceptance(own_id: Option<NodeId>) -> Acceptance {
    let messages = u32::from(ALLOCATION & 3) << TYPE_SHIFT;
    let services = own_id.map(|id| u32::from(id.number() & 3) << DESTINATION_SHIFT | SERVICE);
    let services = services.unwrap_or(messages);
    Acceptance {
        first: CanFilters {
            mask: TYPE & !BATTERY_BITS,
            ids: [BATTERY_INFO, CONTROLLER].map(|type_id| u32::from(type_id) << TYPE_SHIFT),
        },
        second: CanFilters {
            mask: LOWEST_TYPE_BITS,
            // A filter can't be left out.
            ids: [messages, services, messages, services],
        },
    }
}

impl<const N: usize> CanFilters<N> {
    /// Whether a frame with this extended identifier passes.
    #[cfg(test)]
    pub fn pass(&self, id: u32) -> bool {
        self.ids.iter().any(|own| (own ^ id) & self.mask == 0)
    }
}
