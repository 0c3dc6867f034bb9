//! Messages and services: their data types, and their fields as far as they are used.

use heapless::Vec;

use super::NodeId;
use super::assembler::SignatureCrc;
use super::bits::BitReader;
use super::frame::{Direction, Identifier};
use crate::battery::{CellVoltages, MAX_CELLS, Name, Supply};
use crate::numbers::round_to_i32;
use crate::sensor::ControllerReading;

/// Bytes of a node's unique id.
pub(super) const UNIQUE_ID_BYTES: usize = 16;

/// `uavcan.protocol.dynamic_node_id.Allocation`.
pub(super) const ALLOCATION: u16 = 1;
/// `uavcan.protocol.NodeStatus`.
pub(super) const NODE_STATUS: u16 = 341;
/// `uavcan.equipment.esc.Status`.
pub(super) const CONTROLLER: u16 = 1034;
/// `uavcan.equipment.power.BatteryInfo`.
pub(super) const BATTERY_INFO: u16 = 1092;
/// `ardupilot.equipment.power.BatteryInfoAux`.
pub(super) const BATTERY_AUX: u16 = 20004;
/// `mppt.Stream`.
pub(super) const CHARGER: u16 = 20009;
/// The service `uavcan.protocol.GetNodeInfo`.
pub(super) const NODE_INFO: u8 = 1;
/// The service `mppt.OutputEnable`.
pub(super) const OUTPUT_ENABLE: u8 = 240;

/// What is received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DataType {
    Allocation,
    NodeStatus,
    Controller,
    BatteryInfo,
    BatteryAux,
    Charger,
    NodeInfoRequest,
    OutputEnableResponse,
}

impl DataType {
    /// The type of a frame; `None` if it is for others, or of no use.
    pub fn of(identifier: Identifier, own_id: Option<NodeId>) -> Option<Self> {
        match identifier {
            // Nothing else is sent without an id.
            Identifier::Anonymous { type_bits, .. } => {
                (u16::from(type_bits) == ALLOCATION & 3).then_some(Self::Allocation)
            }
            Identifier::Message { type_id, .. } => match type_id {
                ALLOCATION => Some(Self::Allocation),
                NODE_STATUS => Some(Self::NodeStatus),
                CONTROLLER => Some(Self::Controller),
                BATTERY_INFO => Some(Self::BatteryInfo),
                BATTERY_AUX => Some(Self::BatteryAux),
                CHARGER => Some(Self::Charger),
                _ => None,
            },
            Identifier::Service {
                type_id,
                direction,
                destination,
                ..
            } => match (type_id, direction) {
                _ if Some(destination) != own_id => None,
                (NODE_INFO, Direction::Request) => Some(Self::NodeInfoRequest),
                (OUTPUT_ENABLE, Direction::Response) => Some(Self::OutputEnableResponse),
                _ => None,
            },
        }
    }

    /// Of its signature, as PyPI `dronecan` 1.0.27 computes it from the definitions.
    pub const fn crc(self) -> SignatureCrc {
        SignatureCrc::of(match self {
            Self::Allocation => 0x0b2a_8126_20a1_1d40,
            Self::NodeStatus => 0x0f08_68d0_c1a7_c6f1,
            Self::Controller => 0xa9af_28ae_a2fb_b254,
            Self::BatteryInfo => 0x249c_2654_8a71_1966,
            Self::BatteryAux => 0x7d7f_49fc_7548_4882,
            Self::Charger => 0xdd70_96b2_55fb_6358,
            Self::NodeInfoRequest => 0xee46_8a81_21c4_6a9e,
            Self::OutputEnableResponse => 0xea25_1f2a_6dd1_d8a5,
        })
    }
}

/// What a node says of itself, each second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NodeStatus {
    pub uptime_s: u32,
    pub presence: Presence,
}

/// Whether a node goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Presence {
    Staying,
    /// It is about to switch off.
    Leaving,
}

impl NodeStatus {
    pub const BYTES: usize = 7;

    /// `MODE_OFFLINE`.
    const OFFLINE: u8 = 7;

    pub fn parse(payload: &[u8]) -> Option<Self> {
        let mut reader = BitReader::new(payload);
        let uptime_s = reader.unsigned(32)?;
        let _health = reader.byte(2)?;
        let mode = reader.byte(3)?;
        // Sub-mode and the vendor's code.
        reader.skip(3 + 16)?;
        Some(Self {
            uptime_s,
            presence: if mode == Self::OFFLINE {
                Presence::Leaving
            } else {
                Presence::Staying
            },
        })
    }

    /// Of a node that works: health, mode, sub-mode and code are 0.
    pub fn of_working_node(uptime_s: u32) -> [u8; Self::BYTES] {
        let [a, b, c, d] = uptime_s.to_le_bytes();
        [a, b, c, d, 0, 0, 0]
    }
}

/// The reading of a battery. `None` is unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BatteryInfo {
    pub battery_id: u8,
    pub temperature_k: Option<f32>,
    pub voltage_v: Option<f32>,
    pub current_a: Option<f32>,
    pub remaining_wh: Option<f32>,
    pub full_wh: Option<f32>,
    /// `status_flags`.
    pub flags: u16,
    pub state_of_health_pct: Option<u8>,
    pub state_of_charge_pct: Option<u8>,
    pub model: Name,
}

/// In percentages of seven bits.
const UNKNOWN_PCT: u8 = 127;

impl BatteryInfo {
    pub fn parse(payload: &[u8]) -> Option<Self> {
        let mut reader = BitReader::new(payload);
        let percentage = |value: u8| Some(value).filter(|value| *value != UNKNOWN_PCT);
        let temperature_k = reader.known()?;
        let voltage_v = reader.known()?;
        let current_a = reader.known()?;
        let _average_power_w = reader.known()?;
        let remaining_wh = reader.known()?;
        let full_wh = reader.known()?;
        let _hours_to_full = reader.known()?;
        let flags = reader.unsigned(11)? as u16;
        let state_of_health_pct = percentage(reader.byte(7)?);
        let state_of_charge_pct = percentage(reader.byte(7)?);
        let _deviation_pct = reader.byte(7)?;
        let battery_id = reader.byte(8)?;
        let _model_instance = reader.unsigned(32)?;
        Some(Self {
            battery_id,
            temperature_k,
            voltage_v,
            current_a,
            remaining_wh,
            full_wh,
            flags,
            state_of_health_pct,
            state_of_charge_pct,
            // The last array of a message has no length: it goes on to the end.
            model: Name::from_ascii(reader.rest()),
        })
    }
}

/// What a battery reports beside its reading. `None` is unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BatteryAux {
    pub battery_id: u8,
    pub cells: CellVoltages,
    pub cycle_count: u16,
    pub nominal_v: Option<f32>,
    pub supply: Supply,
}

impl BatteryAux {
    /// Timestamp, in microseconds.
    const TIMESTAMP_BITS: usize = 56;

    pub fn parse(payload: &[u8]) -> Option<Self> {
        let mut reader = BitReader::new(payload);
        reader.skip(Self::TIMESTAMP_BITS)?;
        let cells = cells(&mut reader)?;
        let cycle_count = reader.word()?;
        let _over_discharge_count = reader.word()?;
        let _max_current_a = reader.known()?;
        let nominal_v = reader.known()?;
        let is_powering_off = reader.byte(1)? == 1;
        Some(Self {
            battery_id: reader.byte(8)?,
            cells,
            cycle_count,
            nominal_v,
            supply: if is_powering_off {
                Supply::PoweringOff
            } else {
                Supply::On
            },
        })
    }
}

/// The voltage of each cell; none if one of them is unknown, or if there are more than are shown: their number counts.
fn cells(reader: &mut BitReader) -> Option<CellVoltages> {
    let mut millivolts: Vec<u16, MAX_CELLS> = Vec::new();
    let mut is_known = true;
    for _ in 0..reader.byte(8)? {
        let cell = reader.known()?.and_then(millivolts_of);
        is_known &= cell.is_some_and(|cell| millivolts.push(cell).is_ok());
    }
    Some(if is_known {
        CellVoltages::from_millivolts(&millivolts)
    } else {
        CellVoltages::NONE
    })
}

fn millivolts_of(voltage_v: f32) -> Option<u16> {
    u16::try_from(round_to_i32(voltage_v * 1000.0)).ok()
}

/// The reading of a solar charger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChargerReading {
    /// Bits of `mppt.Stream`.
    pub faults: u8,
    pub temperature_c: f32,
    pub input: Side,
    pub output: Side,
}

/// Voltage and current at one side of a charger. `None` is unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Side {
    pub voltage_v: Option<f32>,
    pub current_a: Option<f32>,
}

impl ChargerReading {
    pub fn parse(payload: &[u8]) -> Option<Self> {
        let mut reader = BitReader::new(payload);
        Some(Self {
            faults: reader.byte(8)?,
            temperature_c: f32::from(reader.byte(8)?.cast_signed()),
            input: Side::parse(&mut reader)?,
            output: Side::parse(&mut reader)?,
        })
    }
}

impl Side {
    fn parse(reader: &mut BitReader) -> Option<Self> {
        let side = Self {
            voltage_v: reader.known()?,
            current_a: reader.known()?,
        };
        let _power_w = reader.known()?;
        Some(side)
    }
}

/// 0 °C.
const CELSIUS_OFFSET_K: f32 = 273.15;

/// From kelvin to degrees Celsius. 0 K, and less, is unknown.
pub(super) fn celsius(temperature_k: Option<f32>) -> Option<f32> {
    temperature_k
        .filter(|temperature_k| *temperature_k > 0.0)
        .map(|temperature_k| temperature_k - CELSIUS_OFFSET_K)
}

/// Index and reading of a motor controller.
pub(super) fn parse_controller(payload: &[u8]) -> Option<(u8, ControllerReading)> {
    let mut reader = BitReader::new(payload);
    let _error_count = reader.unsigned(32)?;
    let reading = ControllerReading {
        voltage_v: reader.known()?,
        current_a: reader.known()?,
        temperature_c: celsius(reader.known()?),
        drawn_mah: None,
    };
    let _rpm = reader.unsigned(18)?;
    let _power_pct = reader.byte(7)?;
    Some((reader.byte(5)?, reading))
}

/// Whether a charger's output is on now.
pub(super) fn parse_output_enable(payload: &[u8]) -> Option<bool> {
    let mut reader = BitReader::new(payload);
    reader.skip(7)?;
    Some(reader.byte(1)? == 1)
}

/// A step of giving a node an id.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Allocation {
    /// The id that is given, or wanted; `None` is not given yet, or any.
    pub node_id: Option<NodeId>,
    /// In a request.
    pub part: UniqueIdPart,
    /// The unique id, or the part of it that is known or sent.
    pub unique_id: Vec<u8, UNIQUE_ID_BYTES>,
}

/// Which part of a unique id a request has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum UniqueIdPart {
    First,
    Later,
}

impl Allocation {
    /// The longest message.
    pub const BYTES: usize = 1 + UNIQUE_ID_BYTES;

    pub fn parse(payload: &[u8]) -> Option<Self> {
        let (first, unique_id) = payload.split_first()?;
        Some(Self {
            node_id: NodeId::new(first >> 1),
            part: if first & 1 == 1 {
                UniqueIdPart::First
            } else {
                UniqueIdPart::Later
            },
            unique_id: Vec::from_slice(unique_id).ok()?,
        })
    }

    pub fn to_bytes(&self) -> Vec<u8, { Self::BYTES }> {
        let node_id = self.node_id.map_or(0, NodeId::number);
        let first = node_id << 1 | u8::from(self.part == UniqueIdPart::First);
        let mut bytes = Vec::new();
        // They all fit.
        let _ = bytes.push(first);
        let _ = bytes.extend_from_slice(&self.unique_id);
        bytes
    }
}
