//! The node on the bus. It says nothing yet, and hears nothing.

use core::fmt;

use super::frame::CanFrame;
use crate::battery::{ArmState, Measurement, ReadError};
use crate::identity::Identity;
use crate::pack::Pack;
use crate::parameter::{Parameters, VehicleParameter};
use crate::sensor::ControllerReading;
use crate::time::Instant;

/// Frames that a controller lets through: those whose identifier is `id` in all bits of `mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acceptance {
    /// Bits of the identifier.
    pub id: u32,
    /// Which of them have to agree, of 29.
    pub mask: u32,
}

/// What comes from the bus.
#[derive(Clone, Debug, PartialEq)]
pub enum CanEvent {
    /// A reading of a pack, or why there is none.
    Reading(Pack, Result<Measurement, ReadError>),
    /// A reading of the motor controller with this index, 0 to 31.
    Controller(u8, ControllerReading),
    /// Something to announce.
    Announce(CanNotice),
}

/// Something of the bus that ground stations are informed of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanNotice {
    /// This board has no id left for a node.
    NoIdLeft,
}

impl CanNotice {
    /// Whether something does not work.
    pub fn is_fault(&self) -> bool {
        true
    }
}

impl fmt::Display for CanNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("CAN: no node id left to assign")
    }
}

/// How the node is set up; it takes effect at a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanSetup;

impl CanSetup {
    /// From the parameters; `None` while `CAN_P1_DRIVER` is 0.
    pub fn from_parameters(parameters: &Parameters, _: &Identity) -> Option<Self> {
        (parameters.get_whole(VehicleParameter::CanP1Driver) != 0).then_some(Self)
    }
}

/// Settings that may change at any time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CanSettings {
    /// Whether the rover is armed.
    pub arm_state: ArmState,
}

impl CanSettings {
    /// From the live parameters.
    pub fn from_parameters(_: &Parameters, arm_state: ArmState) -> Self {
        Self { arm_state }
    }
}

/// The node on the bus.
#[derive(Debug)]
pub struct DroneCan;

impl DroneCan {
    /// The node at its start.
    pub fn new(_: CanSetup, _: Instant) -> Self {
        Self
    }

    /// Takes a frame.
    pub fn receive(&mut self, _: &CanFrame, _: Instant, _: impl FnMut(CanEvent)) {}

    /// What is due; at least every 100 ms.
    pub fn poll(&mut self, _: &CanSettings, _: Instant, _: impl FnMut(CanEvent)) {}

    /// What has to be sent next.
    pub fn next_frame(&mut self) -> Option<CanFrame> {
        None
    }

    /// What has to be let through.
    pub fn acceptance(&self) -> [Acceptance; 6] {
        [Acceptance { id: 0, mask: 0 }; 6]
    }
}
