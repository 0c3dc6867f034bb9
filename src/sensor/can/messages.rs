//! Messages and services: their data types, and their fields as far as they are used, as DSDL packs them.

use heapless::Vec;

use super::NodeId;
use super::frame::{Direction, Identifier};
use super::transfers::SignatureCrc;
use crate::battery::{CellVoltages, Name, Supply};
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
/// `uavcan.equipment.device.Temperature`.
pub(super) const TEMPERATURE: u16 = 1110;
/// `ardupilot.equipment.power.BatteryInfoAux`.
pub(super) const BATTERY_AUX: u16 = 20004;
/// `mppt.Stream`.
pub(super) const CHARGER: u16 = 20009;
/// The service `uavcan.protocol.GetNodeInfo`.
pub(super) const NODE_INFO: u8 = 1;
/// The service `mppt.OutputEnable`.
pub(super) const OUTPUT_ENABLE: u8 = 240;

/// A received message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DataType {
    Allocation,
    NodeStatus,
    Controller,
    BatteryInfo,
    BatteryAux,
    Charger,
    Temperature,
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
                TEMPERATURE => Some(Self::Temperature),
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
            Self::Temperature => 0x7026_1c28_a941_44c6,
            Self::NodeInfoRequest => 0xee46_8a81_21c4_6a9e,
            Self::OutputEnableResponse => 0xea25_1f2a_6dd1_d8a5,
        })
    }
}

/// Status that a node sends each second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NodeStatus {
    pub uptime_s: u32,
    /// It reports a fatal malfunction of its own.
    pub is_critical: bool,
    /// It is about to switch off.
    pub is_leaving: bool,
}

impl NodeStatus {
    pub const BYTES: usize = 7;

    /// `HEALTH_CRITICAL`.
    const CRITICAL: u8 = 3;

    /// `MODE_OFFLINE`.
    const OFFLINE: u8 = 7;

    pub fn parse(payload: &[u8]) -> Option<Self> {
        let mut reader = BitReader::new(payload);
        let uptime_s = reader.unsigned(32)?;
        let health = reader.byte(2)?;
        let mode = reader.byte(3)?;
        // Sub-mode and the vendor's code.
        reader.skip(3 + 16)?;
        Some(Self {
            uptime_s,
            is_critical: health == Self::CRITICAL,
            is_leaving: mode == Self::OFFLINE,
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
    /// Standard deviation of the state of charge. Senders that do not know it have 0.
    pub deviation_pct: Option<u8>,
    pub model: Name,
}

/// In percentages of seven bits.
const UNKNOWN_PCT: u8 = 127;

impl BatteryInfo {
    pub fn parse(payload: &[u8]) -> Option<Self> {
        let mut reader = BitReader::new(payload);
        let percentage = |value: u8| (value != UNKNOWN_PCT).then_some(value.min(100));
        let temperature_k = reader.known()?;
        let voltage_v = reader.voltage_v()?;
        let current_a = reader.known()?;
        let _average_power_w = reader.known()?;
        let remaining_wh = reader.known()?;
        let full_wh = reader.known()?;
        let _hours_to_full = reader.known()?;
        let flags = reader.unsigned(11)? as u16;
        let state_of_health_pct = percentage(reader.byte(7)?);
        let state_of_charge_pct = percentage(reader.byte(7)?);
        let deviation_pct = percentage(reader.byte(7)?).filter(|percent| *percent > 0);
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
            deviation_pct,
            // The last array of a message has no length: it goes on to the end.
            model: Name::from_ascii(reader.rest()),
        })
    }
}

/// Facts that a battery reports beside its reading. `None` is unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BatteryAux {
    pub battery_id: u8,
    pub cells: CellVoltages,
    pub cycle_count: u16,
    pub over_discharges: u16,
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
        let over_discharges = reader.word()?;
        let _max_current_a = reader.known()?;
        let nominal_v = reader.known()?;
        let is_powering_off = reader.byte(1)? == 1;
        Some(Self {
            battery_id: reader.byte(8)?,
            cells,
            cycle_count,
            over_discharges,
            nominal_v,
            supply: if is_powering_off {
                Supply::PoweringOff
            } else {
                Supply::On
            },
        })
    }
}

/// The voltage of each cell; none if one of them is unknown: their number counts.
fn cells(reader: &mut BitReader) -> Option<CellVoltages> {
    let mut cells = CellVoltages::NONE;
    let mut is_known = true;
    for _ in 0..reader.byte(8)? {
        match reader.known()?.and_then(millivolts_of) {
            Some(cell_mv) => cells.push(cell_mv),
            None => is_known = false,
        }
    }
    Some(if is_known { cells } else { CellVoltages::NONE })
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
            voltage_v: reader.voltage_v()?,
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
        voltage_v: reader.voltage_v()?,
        current_a: reader.known()?,
        temperature_c: celsius(reader.known()?),
        ..ControllerReading::default()
    };
    let _rpm = reader.unsigned(18)?;
    let _power_pct = reader.byte(7)?;
    Some((reader.byte(5)?, reading))
}

/// Id of a device, and its temperature in degrees Celsius if that is known.
pub(super) fn parse_temperature(payload: &[u8]) -> Option<(u16, f32)> {
    let mut reader = BitReader::new(payload);
    Some((reader.word()?, celsius(reader.known()?)?))
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
    /// Of a request: its part of the unique id is the first one.
    pub is_first: bool,
    /// The unique id, or the part of it that is known or sent.
    pub unique_id: Vec<u8, UNIQUE_ID_BYTES>,
}

impl Allocation {
    /// The longest message.
    pub const BYTES: usize = 1 + UNIQUE_ID_BYTES;

    pub fn parse(payload: &[u8]) -> Option<Self> {
        let (first, unique_id) = payload.split_first()?;
        Some(Self {
            node_id: NodeId::new(first >> 1),
            is_first: first & 1 == 1,
            unique_id: Vec::from_slice(unique_id).ok()?,
        })
    }

    pub fn to_bytes(&self) -> Vec<u8, { Self::BYTES }> {
        let node_id = self.node_id.map_or(0, NodeId::number);
        let first = node_id << 1 | u8::from(self.is_first);
        let mut bytes = Vec::new();
        // They all fit.
        let _ = bytes.push(first);
        let _ = bytes.extend_from_slice(&self.unique_id);
        bytes
    }
}

/// Reads the fields of a message one after the other. A field is little-endian by bytes; what is left of it in its last byte
/// comes from the highest bit on. (DroneCAN specification, 3. Data serialization.)
struct BitReader<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl<'a> BitReader<'a> {
    /// From the first field.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0 }
    }

    /// The next field, of up to 32 bits; `None` behind the end, here and below.
    pub fn unsigned(&mut self, bits: usize) -> Option<u32> {
        let mut value = 0;
        for start in (0..bits).step_by(8) {
            value |= u32::from(self.part((bits - start).min(8))?) << start;
        }
        Some(value)
    }

    /// The next byte, or fewer bits.
    pub fn byte(&mut self, bits: usize) -> Option<u8> {
        self.unsigned(bits).map(|value| value as u8)
    }

    /// The next number of 16 bits.
    pub fn word(&mut self) -> Option<u16> {
        self.unsigned(16).map(|value| value as u16)
    }

    /// The next float of 16 bits, which may be infinite or NaN.
    fn float16(&mut self) -> Option<f32> {
        self.word().map(from_half)
    }

    /// The next float of 16 bits; `None` inside if it is not finite, which means unknown.
    pub fn known(&mut self) -> Option<Option<f32>> {
        self.float16()
            .map(|value| Some(value).filter(|value| value.is_finite()))
    }

    /// The next voltage; a negative one is as unknown as one that is not a number.
    pub fn voltage_v(&mut self) -> Option<Option<f32>> {
        self.known()
            .map(|voltage_v| voltage_v.filter(|voltage_v| *voltage_v >= 0.0))
    }

    /// Leaves out the next bits.
    pub fn skip(&mut self, bits: usize) -> Option<()> {
        self.position += bits;
        (self.position <= 8 * self.bytes.len()).then_some(())
    }

    /// The rest, from a whole byte on.
    pub fn rest(self) -> &'a [u8] {
        self.bytes.get(self.position.div_ceil(8)..).unwrap_or(&[])
    }

    /// At most 8 bits, the highest first.
    fn part(&mut self, bits: usize) -> Option<u8> {
        let start = self.position;
        self.skip(bits)?;
        let first = *self.bytes.get(start / 8)?;
        let second = self.bytes.get(start / 8 + 1).copied().unwrap_or(0);
        let both = u16::from_be_bytes([first, second]);
        Some(((both << (start % 8)) >> (16 - bits)) as u8)
    }
}

/// An IEEE 754 float of 16 bits.
fn from_half(half: u16) -> f32 {
    /// The difference between the exponents' offsets.
    const REBIAS: u32 = 127 - 15;
    /// The smallest number above zero, 2 to the power of -24.
    const SMALLEST: f32 = 5.960_464_5e-8;
    let sign = u32::from(half & 0x8000) << 16;
    let exponent = u32::from(half >> 10 & 0x1f);
    let fraction = u32::from(half & 0x3ff);
    let magnitude = match exponent {
        0 => (fraction as f32 * SMALLEST).to_bits(),
        0x1f => f32::INFINITY.to_bits() | fraction << 13,
        _ => (exponent + REBIAS) << 23 | fraction << 13,
    };
    f32::from_bits(sign | magnitude)
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn halves_have_the_values_of_the_standard() {
        // IEEE 754-2008, binary16: one, -2, the largest, the smallest normal and subnormal, zeros, infinities.
        for (half, value) in [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0400, 2f32.powi(-14)),
            (0x0001, 2f32.powi(-24)),
            (0x83ff, -1023.0 * 2f32.powi(-24)),
            (0x0000, 0.0),
            (0x7c00, f32::INFINITY),
            (0xfc00, f32::NEG_INFINITY),
        ] {
            assert_eq!(from_half(half), value, "{half:#x}");
        }
        assert!(from_half(0x7e00).is_nan() && from_half(0xfc01).is_nan());
        assert!(from_half(0x8000).is_sign_negative());
    }

    #[test]
    fn odd_fields_span_bytes() {
        // 1025 in 11 bits, then 97 in 7: bytes of the golden BatteryInfo in `messages.rs`.
        let mut reader = BitReader::new(&[0x01, 0x98, 0x68]);
        assert_eq!(reader.unsigned(11), Some(1025));
        assert_eq!(reader.unsigned(7), Some(97));
        assert_eq!(reader.unsigned(7), None, "six bits are left");
    }

    /// The bits of a field, in the order in which they are sent.
    fn written(value: u32, bits: usize) -> Vec<bool> {
        (0..bits)
            .step_by(8)
            .flat_map(|start| (start..bits.min(start + 8)).rev())
            .map(|bit| value >> bit & 1 == 1)
            .collect()
    }

    fn packed(bits: &[bool]) -> Vec<u8> {
        let byte = |eight: &[bool]| {
            let bits = eight.iter().enumerate();
            bits.map(|(place, bit)| u8::from(*bit) << (7 - place)).sum()
        };
        bits.chunks(8).map(byte).collect()
    }

    proptest! {
        #[test]
        fn fields_are_read_as_they_were_written(fields in prop::collection::vec((any::<u32>(), 1usize..33), 1..20)) {
            let fields: Vec<(u32, usize)> = fields
                .into_iter()
                .map(|(value, bits)| ((u64::from(value) & ((1 << bits) - 1)) as u32, bits))
                .collect();
            let all: Vec<bool> = fields.iter().flat_map(|(value, bits)| written(*value, *bits)).collect();
            let bytes = packed(&all);
            let mut reader = BitReader::new(&bytes);
            for (value, bits) in fields {
                prop_assert_eq!(reader.unsigned(bits), Some(value));
            }
            prop_assert_eq!(reader.unsigned(8), None);
        }
    }
}
