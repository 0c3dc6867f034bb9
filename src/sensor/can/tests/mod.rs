//! The node as a bus sees it: a node, and what other nodes send.

mod golden;
mod limits;
mod nodes;
mod packs;
mod transfers;

use crate::battery::Measurement;
use crate::pack::Pack;
use crate::sensor::can::frame::{Identifier, Priority};
use crate::sensor::can::messages::{BATTERY_AUX, BATTERY_INFO, CHARGER, CONTROLLER, DataType, NODE_STATUS};
use crate::sensor::can::transfers::{Outgoing, Transfer};
use crate::sensor::{
    CanEvent, CanFrame, CanNotice, CanOptions, CanPack, CanSettings, CanSetup, DroneCan, NodeId,
};
use crate::time::Instant;

pub const OWN_ID: u8 = 10;
pub const POLL_US: u64 = 100_000;

pub fn node(number: u8) -> NodeId {
    NodeId::new(number).expect("an id")
}

pub fn setup(node_id: Option<u8>) -> CanSetup {
    CanSetup {
        node_id: node_id.map(node),
        unique_id: core::array::from_fn(|index| index as u8 + 1),
    }
}

/// A pack that takes any battery.
pub fn pack(pack: Pack) -> CanPack {
    CanPack {
        pack,
        battery_id: None,
        current_multiplier: 1.0,
        options: CanOptions::default(),
    }
}

/// The node under test, and what it has delivered.
pub struct CanBench {
    pub can: DroneCan,
    pub settings: CanSettings,
    pub now: Instant,
    pub events: Vec<CanEvent>,
}

impl CanBench {
    pub fn with_packs(packs: &[CanPack]) -> Self {
        Self::new(setup(Some(OWN_ID)), packs)
    }

    pub fn new(setup: CanSetup, packs: &[CanPack]) -> Self {
        let now = Instant::from_micros(1_000_000);
        let mut bench = Self {
            can: DroneCan::new(setup, now),
            settings: CanSettings {
                packs: packs.iter().copied().collect(),
                ..CanSettings::default()
            },
            now,
            events: Vec::new(),
        };
        bench.poll();
        bench
    }

    pub fn poll(&mut self) {
        let Self {
            can,
            settings,
            now,
            events,
        } = self;
        can.poll(settings, *now, |event| events.push(event));
    }

    pub fn receive(&mut self, frames: &[CanFrame]) {
        let Self { can, now, events, .. } = self;
        for frame in frames {
            can.receive(frame, *now, |event| events.push(event));
        }
    }

    /// Polls every 100 ms.
    pub fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms * 1000 / POLL_US {
            self.now = self.now.after_us(POLL_US);
            self.poll();
        }
    }

    /// Runs, while these frames come each second.
    pub fn run_with(&mut self, seconds: u64, frames: &[CanFrame]) {
        for _ in 0..seconds {
            self.receive(frames);
            self.run_ms(1000);
        }
    }

    /// What it has sent.
    pub fn sent(&mut self) -> Vec<CanFrame> {
        std::iter::from_fn(|| self.can.next_frame()).collect()
    }

    /// What it has sent of this service or message, by the identifier's bits without the priority.
    pub fn sent_of(&mut self, key: u32) -> Vec<CanFrame> {
        let is_wanted = |frame: &CanFrame| Identifier::key(frame.id()) == key;
        self.sent().into_iter().filter(is_wanted).collect()
    }

    pub fn take_notices(&mut self) -> Vec<CanNotice> {
        let of = |event: CanEvent| match event {
            CanEvent::Announce(notice) => Some(notice),
            _ => None,
        };
        self.events.drain(..).filter_map(of).collect()
    }

    pub fn take_readings(&mut self) -> Vec<(Pack, Measurement)> {
        let of = |event: CanEvent| match event {
            CanEvent::Reading(pack, reading) => Some((pack, reading)),
            _ => None,
        };
        self.events.drain(..).filter_map(of).collect()
    }

    /// The only reading.
    pub fn take_reading(&mut self) -> Measurement {
        let readings = self.take_readings();
        assert_eq!(readings.len(), 1, "{readings:?}");
        readings[0].1
    }

    /// Packs and voltages of the readings.
    pub fn take_voltages(&mut self) -> Vec<(Pack, f32)> {
        let of = |(pack, reading): (Pack, Measurement)| Some((pack, reading.voltage_v?));
        self.take_readings().into_iter().filter_map(of).collect()
    }
}

/// Bits of fields, as DSDL packs them.
#[derive(Default)]
pub struct Fields(Vec<bool>);

impl Fields {
    pub fn bits(mut self, value: u64, bits: usize) -> Self {
        for start in (0..bits).step_by(8) {
            let part = (start..bits.min(start + 8)).rev();
            self.0.extend(part.map(|bit| value >> bit & 1 == 1));
        }
        self
    }

    /// A float that 16 bits can represent.
    pub fn half(self, value: f32) -> Self {
        /// The difference between the exponents' offsets.
        const REBIAS: u32 = 127 - 15;
        let bits = value.to_bits();
        let sign = bits >> 16 & 0x8000;
        let half = match value {
            0.0 => sign,
            _ if value.is_nan() => 0x7e00,
            _ => sign | ((bits >> 23 & 0xff) - REBIAS) << 10 | bits >> 13 & 0x3ff,
        };
        self.bits(half.into(), 16)
    }

    pub fn bytes(self) -> Vec<u8> {
        let byte = |eight: &[bool]| {
            let bits = eight.iter().enumerate();
            bits.map(|(place, bit)| u8::from(*bit) << (7 - place)).sum()
        };
        self.0.chunks(8).map(byte).collect()
    }
}

/// What a battery sends.
#[derive(Clone, Copy, Debug)]
pub struct Battery {
    pub node: u8,
    pub battery_id: u8,
    pub temperature_k: f32,
    pub voltage_v: f32,
    pub current_a: f32,
    pub remaining_wh: f32,
    pub full_wh: f32,
    pub flags: u16,
    pub health_pct: u8,
    pub charge_pct: u8,
}

impl Battery {
    /// 12 V, 2 A, 50 %.
    pub const fn new(node: u8, battery_id: u8) -> Self {
        Self {
            node,
            battery_id,
            temperature_k: 300.0,
            voltage_v: 12.0,
            current_a: 2.0,
            remaining_wh: 30.0,
            full_wh: 60.0,
            flags: 1,
            health_pct: 127,
            charge_pct: 50,
        }
    }

    pub fn frames(&self, transfer_id: u8) -> Vec<CanFrame> {
        let payload = Fields::default()
            .half(self.temperature_k)
            .half(self.voltage_v)
            .half(self.current_a)
            .half(0.0)
            .half(self.remaining_wh)
            .half(self.full_wh)
            .half(0.0)
            .bits(self.flags.into(), 11)
            .bits(self.health_pct.into(), 7)
            .bits(self.charge_pct.into(), 7)
            .bits(0, 7)
            .bits(self.battery_id.into(), 8)
            .bits(0, 32)
            .bytes();
        message(
            self.node,
            BATTERY_INFO,
            DataType::BatteryInfo,
            transfer_id,
            &payload,
        )
    }

    /// BatteryInfoAux of the same battery.
    pub fn aux(&self, cells_v: &[f32], nominal_v: f32) -> Vec<CanFrame> {
        let mut fields = Fields::default().bits(0, 56).bits(cells_v.len() as u64, 8);
        for cell_v in cells_v {
            fields = fields.half(*cell_v);
        }
        let payload = fields
            .bits(17, 16)
            .bits(0, 16)
            .half(0.0)
            .half(nominal_v)
            .bits(0, 1)
            .bits(self.battery_id.into(), 8)
            .bytes();
        message(self.node, BATTERY_AUX, DataType::BatteryAux, 0, &payload)
    }
}

/// A charger's reading: 40 V and 1 A in, 24 V and 2 A out.
pub fn charger(node: u8, faults: u8) -> Vec<CanFrame> {
    let payload = Fields::default()
        .bits(faults.into(), 8)
        .bits(30, 8)
        .half(40.0)
        .half(1.0)
        .half(40.0)
        .half(24.0)
        .half(2.0)
        .half(48.0)
        .bytes();
    message(node, CHARGER, DataType::Charger, 0, &payload)
}

/// The status of a motor controller: 12 V, and a current of as many amperes as its index.
pub fn controller(node: u8, index: u8, transfer_id: u8) -> Vec<CanFrame> {
    let payload = Fields::default()
        .bits(0, 32)
        .half(12.0)
        .half(index.into())
        .half(300.0)
        .bits(0, 18)
        .bits(0, 7)
        .bits(index.into(), 5)
        .bytes();
    message(node, CONTROLLER, DataType::Controller, transfer_id, &payload)
}

pub fn status(node: u8, uptime_s: u32, mode: u8) -> Vec<CanFrame> {
    status_with(node, uptime_s, 0, mode)
}

pub fn status_with(node: u8, uptime_s: u32, health: u8, mode: u8) -> Vec<CanFrame> {
    let payload = Fields::default()
        .bits(uptime_s.into(), 32)
        .bits(health.into(), 2)
        .bits(mode.into(), 3)
        .bits(0, 19)
        .bytes();
    message(node, NODE_STATUS, DataType::NodeStatus, 0, &payload)
}

pub fn message(
    source: u8,
    type_id: u16,
    data_type: DataType,
    transfer_id: u8,
    payload: &[u8],
) -> Vec<CanFrame> {
    let mut outgoing = Outgoing::EMPTY;
    outgoing.send(&Transfer {
        identifier: Identifier::Message {
            type_id,
            source: node(source),
        },
        priority: Priority::LOW,
        transfer_id,
        crc: data_type.crc(),
        payload,
    });
    std::iter::from_fn(|| outgoing.next()).collect()
}
