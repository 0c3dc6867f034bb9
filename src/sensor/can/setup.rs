//! Settings of the node and its packs.

use heapless::Vec;

use super::NodeId;
use super::event::ChargerPower;
use super::messages::UNIQUE_ID_BYTES;
use crate::memory::identity::{BoardId, FirmwareHash, Identity};
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{BatteryParameter, PackParameters, Parameters, VehicleParameter};
use crate::sensor::thermometer::has_can_thermometer;
use crate::vehicle::ArmState;

/// Bytes behind the board's id in its unique id, which is longer.
const UNIQUE_ID_END: [u8; UNIQUE_ID_BYTES - BoardId::BYTES] = *b"roverbat";

/// Set-up of the node; it takes effect at a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanSetup {
    /// The own id (`CAN_D1_UC_NODE`); `None` is given by another node.
    pub node_id: Option<NodeId>,
    /// Distinguishes this node from all others.
    pub unique_id: [u8; UNIQUE_ID_BYTES],
}

impl CanSetup {
    /// From the parameters; `None` while `CAN_P1_DRIVER` is 0.
    pub fn from_parameters(parameters: &Parameters, identity: &Identity) -> Option<Self> {
        if parameters.get_whole(VehicleParameter::CanP1Driver) == 0 {
            return None;
        }
        let node_id = parameters.get_whole(VehicleParameter::CanD1UcNode);
        Some(Self {
            node_id: u8::try_from(node_id).ok().and_then(NodeId::new),
            unique_id: unique_id(identity.board_id),
        })
    }
}

fn unique_id(board_id: Option<BoardId>) -> [u8; UNIQUE_ID_BYTES] {
    let BoardId(start) = board_id.unwrap_or(BoardId([0; BoardId::BYTES]));
    let mut id = [0; UNIQUE_ID_BYTES];
    for (to, from) in id.iter_mut().zip(start.into_iter().chain(UNIQUE_ID_END)) {
        *to = from;
    }
    id
}

/// Settings that may change at any time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CanSettings {
    /// The packs that are DroneCAN, in the order of their instances.
    pub packs: Vec<CanPack, MAX_PACKS>,
    /// Whether the rover is armed: a charger may be switched by it.
    pub arm_state: ArmState,
    /// All chargers are to be switched so, once.
    pub switched: Option<ChargerPower>,
    /// Messages of thermometers.
    pub temperatures: TemperatureMessages,
    /// The program's hash; `None` for the first moments after a start, while it is computed.
    pub firmware_hash: Option<FirmwareHash>,
}

/// Whether messages of thermometers are wanted. They pass the controller's filters with many others, such as commands for motor
/// controllers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TemperatureMessages {
    /// No thermometer is on the bus.
    #[default]
    Ignored,
    /// One is.
    Wanted,
}

/// Settings of a pack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CanPack {
    /// The pack.
    pub pack: Pack,
    /// Id of its battery (`BATT_SERIAL_NUM`), for a charger the node's id; `None` is any.
    pub battery_id: Option<i32>,
    /// Factor of the reported current (`BATT_CURR_MULT`).
    pub current_multiplier: f32,
    /// Options of a pack (`BATT_OPTIONS`).
    pub options: CanOptions,
}

/// The bits of `BATT_OPTIONS` that matter here, as in ArduPilot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CanOptions(i32);

impl CanOptions {
    /// The charge that the battery reports is ignored: it is counted here.
    pub const IGNORE_CHARGE: Self = Self(1);
    /// A charger's reading is that of its input.
    pub const CHARGER_INPUT: Self = Self(1 << 1);
    /// A charger is switched off at disarming.
    pub const OFF_AT_DISARM: Self = Self(1 << 2);
    /// A charger is switched on at arming.
    pub const ON_AT_ARM: Self = Self(1 << 3);
    /// A charger is switched off when it is found.
    pub const OFF_AT_BOOT: Self = Self(1 << 4);
    /// A charger is switched on when it is found.
    pub const ON_AT_BOOT: Self = Self(1 << 5);
    /// BatteryInfoAux may come from another node.
    pub const SPLIT_AUX: Self = Self(1 << 7);
    /// Another node takes the place of one that is lost.
    pub const DYNAMIC_NODE: Self = Self(1 << 10);

    /// From the parameter's bits.
    pub fn from_bits(bits: i32) -> Self {
        Self(bits)
    }

    /// Whether this option is set.
    pub fn has(self, option: Self) -> bool {
        self.0 & option.0 != 0
    }
}

impl CanSettings {
    /// From the live parameters of the packs that are DroneCAN since boot, and what is known of the board.
    pub fn new(
        packs: impl IntoIterator<Item = Pack>,
        parameters: &Parameters,
        identity: &Identity,
        arm_state: ArmState,
    ) -> Self {
        let mut settings = Self {
            packs: Vec::new(),
            arm_state,
            switched: None,
            temperatures: if has_can_thermometer(parameters) {
                TemperatureMessages::Wanted
            } else {
                TemperatureMessages::Ignored
            },
            firmware_hash: identity.firmware_hash,
        };
        for pack in packs {
            // There is room for all packs.
            let _ = settings
                .packs
                .push(CanPack::from_parameters(parameters.pack(pack)));
        }
        settings
    }
}

impl CanPack {
    fn from_parameters(parameters: PackParameters<'_>) -> Self {
        let battery_id = parameters.get_whole(BatteryParameter::SerialNum);
        Self {
            pack: parameters.pack,
            battery_id: Some(battery_id).filter(|id| *id >= 0),
            current_multiplier: parameters.get(BatteryParameter::CurrMult),
            options: CanOptions::from_bits(parameters.get_whole(BatteryParameter::Options)),
        }
    }

    /// Whether it takes the readings of a battery with this id.
    pub(super) fn takes(&self, battery_id: u8) -> bool {
        self.battery_id
            .is_none_or(|wanted| wanted == i32::from(battery_id))
    }
}
