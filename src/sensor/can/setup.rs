//! What the bus and its packs are set to, and the controller with them: filters and bit timing.

use heapless::Vec;

use super::messages::{ALLOCATION, BATTERY_AUX, BATTERY_INFO, CONTROLLER, UNIQUE_ID_BYTES};
use super::{CanReport, NodeId};
use crate::memory::identity::{BoardId, FirmwareHash, Identity};
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{BatteryParameter, Parameters, VehicleParameter};
use crate::vehicle::ArmState;

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

/// The type of a message, and the bit that it is not a service.
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

/// Quanta of a bit after which a controller samples it at 87.5 %, where DroneCAN wants it.
const USUAL_QUANTA: u32 = 16;

/// At least this many quanta make a bit (MCP2515 data sheet DS20001801, 5.1). With two for phase segment 2 it is sampled at 75 %.
const FEWEST_QUANTA: u32 = 8;

/// A quantum is two or more periods of the crystal, by a prescaler of 1 to 64 (DS20001801, 5.1).
const PERIODS: u32 = 2;
const HIGHEST_PRESCALER: u32 = 64;

/// How a bit on the bus is divided, for a controller whose quanta are multiples of two periods of its crystal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    quanta: u8,
    prescaler: u8,
}

impl BitTiming {
    /// The timing of bits at `bit_rate` with a crystal of `crystal_mhz`; `None` if the crystal is too slow for that rate, or
    /// their ratio is odd.
    pub fn new(crystal_mhz: u32, bit_rate: u32) -> Option<Self> {
        let quantum_periods = crystal_mhz.checked_mul(1_000_000 / PERIODS)?;
        let whole = quantum_periods.checked_rem(bit_rate)? == 0;
        let periods = quantum_periods.checked_div(bit_rate).filter(|_| whole)?;
        let quanta = match periods {
            FEWEST_QUANTA => FEWEST_QUANTA,
            _ if periods.is_multiple_of(USUAL_QUANTA) => USUAL_QUANTA,
            _ => return None,
        };
        let prescaler = periods / quanta;
        (1..=HIGHEST_PRESCALER).contains(&prescaler).then_some(Self {
            quanta: quanta as u8,
            prescaler: prescaler as u8,
        })
    }

    /// The timing that the parameters call for; `None` if the bus is not in use.
    ///
    /// # Errors
    /// The crystal is too slow for the bit rate.
    pub fn from_parameters(parameters: &Parameters) -> Result<Option<Self>, CanReport> {
        let whole = |parameter: VehicleParameter| parameters.get_whole(parameter).unsigned_abs();
        if whole(VehicleParameter::CanP1Driver) == 0 {
            return Ok(None);
        }
        let timing = Self::new(
            whole(VehicleParameter::CanP1Crystal),
            whole(VehicleParameter::CanP1Bitrate),
        );
        timing.map(Some).ok_or(CanReport::ImpossibleBitRate)
    }

    /// Quanta of a bit, 8 or 16: the first synchronises, the last two are phase segment 2.
    pub fn quanta(self) -> u8 {
        self.quanta
    }

    /// Double periods of the crystal in a quantum, 1 to 64.
    pub fn prescaler(self) -> u8 {
        self.prescaler
    }
}

/// What follows the board's id in its unique id, which is longer.
const UNIQUE_ID_END: [u8; UNIQUE_ID_BYTES - BoardId::BYTES] = *b"roverbat";

/// How the node is set up; it takes effect at a start.
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
    /// The program's hash; `None` for the first moments after a start, while it is computed.
    pub firmware_hash: Option<FirmwareHash>,
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
    /// What is done differently (`BATT_OPTIONS`).
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
            firmware_hash: identity.firmware_hash,
        };
        for pack in packs {
            // There is room for all packs.
            let _ = settings.packs.push(CanPack::from_parameters(parameters, pack));
        }
        settings
    }
}

impl CanPack {
    fn from_parameters(parameters: &Parameters, pack: Pack) -> Self {
        let battery_id = parameters.get_whole(BatteryParameter::SerialNum.of(pack));
        Self {
            pack,
            battery_id: Some(battery_id).filter(|id| *id >= 0),
            current_multiplier: parameters.get(BatteryParameter::CurrMult.of(pack)),
            options: CanOptions::from_bits(parameters.get_whole(BatteryParameter::Options.of(pack))),
        }
    }

    /// Whether it takes the readings of a battery with this id.
    pub(super) fn takes(&self, battery_id: u8) -> bool {
        self.battery_id
            .is_none_or(|wanted| wanted == i32::from(battery_id))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_rate_of_the_parameter_has_its_timing() {
        for (crystal_mhz, bit_rate, expected) in [
            (16, 1_000_000, Some((8, 1))),
            (16, 500_000, Some((16, 1))),
            (16, 250_000, Some((16, 2))),
            (16, 125_000, Some((16, 4))),
            (8, 1_000_000, None),
            (8, 500_000, Some((8, 1))),
            (8, 250_000, Some((16, 1))),
            (8, 125_000, Some((16, 2))),
        ] {
            let timing = BitTiming::new(crystal_mhz, bit_rate);
            let timing = timing.map(|timing| (timing.quanta(), timing.prescaler()));
            assert_eq!(timing, expected, "{crystal_mhz} MHz, {bit_rate} bit/s");
        }
    }

    #[test]
    fn a_slow_crystal_is_refused_with_the_reason() {
        let mut parameters = Parameters::defaults();
        assert_eq!(BitTiming::from_parameters(&parameters), Ok(None));
        parameters.set(VehicleParameter::CanP1Driver, 1.0).unwrap();
        assert_eq!(
            BitTiming::from_parameters(&parameters),
            Ok(BitTiming::new(16, 1_000_000))
        );
        parameters.set(VehicleParameter::CanP1Crystal, 8.0).unwrap();
        assert_eq!(
            BitTiming::from_parameters(&parameters),
            Err(CanReport::ImpossibleBitRate)
        );
        parameters.set(VehicleParameter::CanP1Bitrate, 500_000.0).unwrap();
        assert_eq!(
            BitTiming::from_parameters(&parameters),
            Ok(BitTiming::new(8, 500_000))
        );
    }

    proptest! {
        /// Whatever is set, there is a timing of exactly that rate or none.
        #[test]
        fn timing_is_exact(crystal_mhz: u32, bit_rate: u32) {
            if let Some(timing) = BitTiming::new(crystal_mhz, bit_rate) {
                let periods = u64::from(timing.quanta()) * u64::from(timing.prescaler()) * 2;
                prop_assert_eq!(periods * u64::from(bit_rate), u64::from(crystal_mhz) * 1_000_000);
                prop_assert!((1..=64).contains(&timing.prescaler()) && [8, 16].contains(&timing.quanta()));
            }
        }
    }
}
