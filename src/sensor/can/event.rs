//! Events of the bus, for the packs and for ground stations.

use core::fmt;

use super::NodeId;
use crate::announce::{Announce, Limit, Severity};
use crate::battery::Measurement;
use crate::pack::Pack;
use crate::sensor::ControllerReading;

/// An event of the bus.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "delivered at once, never kept")]
pub enum CanEvent {
    /// A reading of a pack.
    Reading(Pack, Measurement),
    /// A reading of the motor controller with this index, 0 to 31.
    Controller(u8, ControllerReading),
    /// The temperature of the device with this id, in degrees Celsius.
    Temperature(u16, f32),
    /// Something to announce.
    Announce(CanNotice),
}

/// Something of the bus that ground stations are informed of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum CanNotice {
    /// A node is heard for the first time, or again.
    Appeared(NodeId),
    /// A node has been silent for 3 s, or has switched off.
    Lost(NodeId),
    /// A node has restarted.
    Restarted(NodeId),
    /// This board has its id from another node.
    OwnId(NodeId),
    /// Another node has the id of this board.
    SameId(NodeId),
    /// A node has its id from this board.
    Assigned(NodeId),
    /// This board has no id left for a node.
    NoIdLeft,
    /// A node measures the pack from now on.
    Source(Pack, NodeId),
    /// A node that measures the pack reports a fatal malfunction of its own.
    Critical(Pack, NodeId),
    /// The pack's charger is switched.
    Charger(Pack, ChargerPower),
}

/// State of a charger's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ChargerPower {
    /// It feeds.
    On,
    /// It does not.
    Off,
}

impl CanNotice {
    /// The pack that it is about, if it is about one.
    fn pack(&self) -> Option<Pack> {
        match self {
            Self::Source(pack, _) | Self::Critical(pack, _) | Self::Charger(pack, _) => Some(*pack),
            _ => None,
        }
    }
}

impl Announce for CanNotice {
    fn severity(&self) -> Severity {
        Severity::of_fault(matches!(
            self,
            Self::Lost(_) | Self::Restarted(_) | Self::SameId(_) | Self::NoIdLeft | Self::Critical(..)
        ))
    }

    fn limit(&self) -> Limit {
        Limit::of(self).of_pack(self.pack())
    }
}

impl fmt::Display for CanNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Appeared(node) => write!(f, "CAN node {} found", node.number()),
            Self::Lost(node) => write!(f, "CAN node {} lost", node.number()),
            Self::Restarted(node) => write!(f, "CAN node {} restarted", node.number()),
            Self::OwnId(node) => write!(f, "CAN node id {} assigned to this board", node.number()),
            Self::SameId(node) => write!(f, "CAN node id {} used twice", node.number()),
            Self::Assigned(node) => write!(f, "CAN node id {} assigned", node.number()),
            Self::NoIdLeft => f.write_str("CAN: no node id left to assign"),
            Self::Source(pack, node) => {
                write!(
                    f,
                    "Battery {} measured by CAN node {}",
                    pack.number(),
                    node.number()
                )
            }
            Self::Critical(pack, node) => {
                write!(
                    f,
                    "Battery {} CAN node {} reports critical health",
                    pack.number(),
                    node.number()
                )
            }
            Self::Charger(pack, ChargerPower::On) => {
                write!(f, "Battery {} charger switched on", pack.number())
            }
            Self::Charger(pack, ChargerPower::Off) => {
                write!(f, "Battery {} charger switched off", pack.number())
            }
        }
    }
}
