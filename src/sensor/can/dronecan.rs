//! The node on the bus: what is received, what is sent, and when.

use super::allocation::{Allocatee, Allocator, Answer, Random, Request, fnv};
use super::bus::{Acceptance, acceptance};
use super::event::{CanEvent, CanNotice, ChargerPower};
use super::frame::{CanFrame, Direction, Identifier, NodeId, Priority, Tail};
use super::messages::{
    ALLOCATION, Allocation, BatteryAux, BatteryInfo, ChargerReading, DataType, NODE_INFO, NODE_STATUS,
    NodeStatus, OUTPUT_ENABLE, parse_controller, parse_output_enable, parse_temperature,
};
use super::nodes::{NodeInfo, Nodes};
use super::packs::{CanPacks, ChargerRequest};
use super::setup::{CanSettings, CanSetup, TemperatureMessages};
use super::transfers::Assembler;
use super::transfers::{Outgoing, Transfer};
use crate::announce::{Announce, Severity};
use crate::log::{info, warn};
use crate::memory::identity::FirmwareHash;
use crate::time::{Cadence, Instant};

/// Time between status messages, in microseconds (`MAX_BROADCASTING_PERIOD_MS` of `NodeStatus`).
const STATUS_US: u64 = 1_000_000;

/// A node on a DroneCAN bus, without the bus: frames that were received go in, frames to be sent come out.
#[derive(Debug)]
pub struct DroneCan {
    assembler: Assembler,
    node: Node,
}

#[derive(Debug)]
struct Node {
    setup: CanSetup,
    firmware_hash: Option<FirmwareHash>,
    started: Instant,
    role: Role,
    packs: CanPacks,
    temperatures: TemperatureMessages,
    nodes: Nodes,
    outgoing: Outgoing,
    status: Cadence,
    /// Count status messages, and those about ids.
    status_count: u8,
    allocation_count: u8,
    /// Announced once.
    has_announced_same_id: bool,
    has_announced_no_id: bool,
}

/// Source of the own id, and ids given to other nodes.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is no heap, and one of it exists")]
enum Role {
    /// It has no id yet.
    Asking(Allocatee),
    /// It has its id from another node.
    Given(NodeId),
    /// It has an id of its own, and gives others theirs.
    Giving(NodeId, Allocator),
}

impl Role {
    fn id(&self) -> Option<NodeId> {
        match self {
            Self::Asking(_) => None,
            Self::Given(id) | Self::Giving(id, _) => Some(*id),
        }
    }
}

/// A transfer that was received.
struct Received<'a> {
    identifier: Identifier,
    priority: Priority,
    transfer_id: u8,
    payload: &'a [u8],
}

impl DroneCan {
    /// A node that starts at `now`.
    pub fn new(setup: CanSetup, now: Instant) -> Self {
        Self {
            assembler: Assembler::EMPTY,
            node: Node::new(setup, now),
        }
    }

    /// Takes a received frame.
    // Not inlined, so that a board's linker script can name it: frames may come every 130 µs.
    #[inline(never)]
    pub fn receive(&mut self, frame: &CanFrame, now: Instant, mut deliver: impl FnMut(CanEvent)) {
        let Some(identifier) = Identifier::parse(frame.id()) else {
            return;
        };
        let own_id = self.node.role.id();
        if own_id.is_some() && identifier.source() == own_id {
            self.node.announce_same_id(&mut deliver);
            return;
        }
        let Some(data_type) = DataType::of(identifier, own_id) else {
            return;
        };
        let tail = frame.data().last().map(|last| Tail(*last));
        let Some(tail) = tail.filter(|tail| tail.is_whole() || identifier.source().is_some()) else {
            // Without an id transfers of several frames of different nodes look the same.
            return;
        };
        let key = Identifier::key(frame.id());
        if let Some(payload) = self.assembler.push(key, data_type.crc(), frame.data(), now) {
            let received = Received {
                identifier,
                priority: Priority::of(frame.id()),
                transfer_id: tail.transfer_id(),
                payload,
            };
            // A payload that is too short is left out.
            let _ = self.node.receive(data_type, &received, now, &mut deliver);
        }
    }

    /// Has to be called every 100 ms at the latest: takes over settings, announces lost nodes, sends what is due.
    pub fn poll(&mut self, settings: &CanSettings, now: Instant, mut deliver: impl FnMut(CanEvent)) {
        self.node.poll(settings, now, &mut deliver);
    }

    /// The next frame to be sent, the oldest first. Those with the same identifier have to leave in this order.
    pub fn next_frame(&mut self) -> Option<CanFrame> {
        self.node.outgoing.next()
    }

    /// Filters for the hardware. They change when the node has got its id from another one, and with thermometers.
    pub fn acceptance(&self) -> Acceptance {
        acceptance(self.node.role.id(), self.node.temperatures)
    }

    /// The own id; `None` until another node has given one.
    pub fn node_id(&self) -> Option<NodeId> {
        self.node.role.id()
    }

    /// Received transfers that were begun and are lost: a frame is missing or damaged, or too many came at a time.
    pub fn lost_transfers(&self) -> u32 {
        self.assembler.lost()
    }

    /// Transfers that were not sent, since too many frames waited.
    pub fn dropped_transfers(&self) -> u32 {
        self.node.outgoing.dropped()
    }
}

impl Node {
    fn new(setup: CanSetup, now: Instant) -> Self {
        let role = match setup.node_id {
            Some(id) => Role::Giving(id, Allocator::new(id, now)),
            None => {
                let random = Random::seeded(fnv(&setup.unique_id));
                Role::Asking(Allocatee::new(setup.unique_id, random, now))
            }
        };
        Self {
            setup,
            firmware_hash: None,
            started: now,
            role,
            packs: CanPacks::EMPTY,
            temperatures: TemperatureMessages::Ignored,
            nodes: Nodes::default(),
            outgoing: Outgoing::EMPTY,
            status: Cadence::starting_at(now, STATUS_US),
            status_count: 0,
            allocation_count: 0,
            has_announced_same_id: false,
            has_announced_no_id: false,
        }
    }

    fn receive(
        &mut self,
        data_type: DataType,
        received: &Received,
        now: Instant,
        deliver: &mut impl FnMut(CanEvent),
    ) -> Option<()> {
        let payload = received.payload;
        if data_type == DataType::Allocation {
            self.allocate(
                received.identifier.source(),
                &Allocation::parse(payload)?,
                now,
                deliver,
            );
            return Some(());
        }
        let source = received.identifier.source()?;
        match data_type {
            DataType::Allocation => {}
            DataType::NodeStatus => {
                let status = NodeStatus::parse(payload)?;
                let health = self.packs.health(source, status.is_critical, now);
                for notice in self.nodes.report(source, &status, now).into_iter().chain(health) {
                    announce(notice, deliver);
                }
            }
            DataType::Controller => {
                let (index, reading) = parse_controller(payload)?;
                deliver(CanEvent::Controller(index, reading));
            }
            DataType::BatteryInfo => self
                .packs
                .battery(source, &BatteryInfo::parse(payload)?, now, deliver),
            DataType::BatteryAux => self.packs.aux(source, &BatteryAux::parse(payload)?, now),
            DataType::Charger => self
                .packs
                .charger(source, &ChargerReading::parse(payload)?, now, deliver),
            DataType::Temperature => {
                let (device_id, temperature_c) = parse_temperature(payload)?;
                deliver(CanEvent::Temperature(device_id, temperature_c));
            }
            DataType::NodeInfoRequest => self.answer_node_info(source, received, now),
            DataType::OutputEnableResponse => {
                let power = if parse_output_enable(payload)? {
                    ChargerPower::On
                } else {
                    ChargerPower::Off
                };
                self.packs.charger_answer(source, received.transfer_id, power);
            }
        }
        Some(())
    }

    fn poll(&mut self, settings: &CanSettings, now: Instant, deliver: &mut impl FnMut(CanEvent)) {
        self.firmware_hash = settings.firmware_hash;
        self.packs.set_up(settings, now);
        self.temperatures = settings.temperatures;
        if let Role::Asking(allocatee) = &mut self.role
            && let Some(request) = allocatee.poll(now)
        {
            self.ask_for_id(&request);
        }
        while let Some(notice) = self.nodes.next_lost(now) {
            announce(notice, deliver);
        }
        if let Some(own_id) = self.role.id() {
            self.send_status(own_id, now);
            let outgoing = &mut self.outgoing;
            self.packs.switch_chargers(now, deliver, |request| {
                send_switch_request(outgoing, own_id, &request)
            });
        }
    }

    fn allocate(
        &mut self,
        source: Option<NodeId>,
        allocation: &Allocation,
        now: Instant,
        deliver: &mut impl FnMut(CanEvent),
    ) {
        match (&mut self.role, source) {
            (Role::Asking(allocatee), None) => allocatee.give_way(now),
            (Role::Asking(allocatee), Some(_)) => {
                if let Some(id) = allocatee.answer(allocation, now) {
                    self.role = Role::Given(id);
                    self.status = Cadence::starting_at(now, STATUS_US);
                    announce(CanNotice::OwnId(id), deliver);
                }
            }
            (Role::Giving(own_id, allocator), None) => {
                let nodes = &self.nodes;
                let is_on_bus = |id| nodes.is_full() || nodes.has(id);
                let answer = allocator.request(allocation, now, is_on_bus);
                let own_id = *own_id;
                if let Some(answer) = answer {
                    self.give_id(own_id, &answer, deliver);
                }
            }
            // Answers of another node that gives ids.
            (Role::Given(_), _) | (Role::Giving(..), Some(_)) => {}
        }
    }

    fn give_id(&mut self, own_id: NodeId, answer: &Answer, deliver: &mut impl FnMut(CanEvent)) {
        let allocation = match answer {
            Answer::Continue(allocation) => allocation,
            Answer::Assigned(id, allocation) => {
                announce(CanNotice::Assigned(*id), deliver);
                allocation
            }
            Answer::NoIdLeft => {
                if !self.has_announced_no_id {
                    self.has_announced_no_id = true;
                    announce(CanNotice::NoIdLeft, deliver);
                }
                return;
            }
        };
        self.send_allocation(
            Identifier::Message {
                type_id: ALLOCATION,
                source: own_id,
            },
            allocation,
        );
    }

    fn ask_for_id(&mut self, request: &Request) {
        self.send_allocation(
            Identifier::Anonymous {
                type_bits: ALLOCATION as u8 & 3,
                discriminator: request.discriminator,
            },
            &request.allocation,
        );
    }

    fn send_allocation(&mut self, identifier: Identifier, allocation: &Allocation) {
        self.outgoing.send(&Transfer {
            identifier,
            priority: Priority::LOW,
            transfer_id: self.allocation_count,
            crc: DataType::Allocation.crc(),
            payload: &allocation.to_bytes(),
        });
        self.allocation_count = self.allocation_count.wrapping_add(1);
    }

    fn send_status(&mut self, source: NodeId, now: Instant) {
        if !self.status.take(now) {
            return;
        }
        self.outgoing.send(&Transfer {
            identifier: Identifier::Message {
                type_id: NODE_STATUS,
                source,
            },
            priority: Priority::LOW,
            transfer_id: self.status_count,
            crc: DataType::NodeStatus.crc(),
            payload: &NodeStatus::of_working_node(self.uptime_s(now)),
        });
        self.status_count = self.status_count.wrapping_add(1);
    }

    fn answer_node_info(&mut self, destination: NodeId, request: &Received, now: Instant) {
        let Some(source) = self.role.id() else {
            return;
        };
        let info = NodeInfo {
            uptime_s: self.uptime_s(now),
            unique_id: self.setup.unique_id,
            firmware_hash: self.firmware_hash,
        };
        self.outgoing.send(&Transfer {
            identifier: Identifier::Service {
                type_id: NODE_INFO,
                direction: Direction::Response,
                destination,
                source,
            },
            // An answer is as urgent as its request, and has its count.
            priority: request.priority,
            transfer_id: request.transfer_id,
            crc: DataType::NodeInfoRequest.crc(),
            payload: &info.to_bytes(),
        });
    }

    fn announce_same_id(&mut self, deliver: &mut impl FnMut(CanEvent)) {
        if let Some(id) = self.role.id().filter(|_| !self.has_announced_same_id) {
            self.has_announced_same_id = true;
            announce(CanNotice::SameId(id), deliver);
        }
    }

    fn uptime_s(&self, now: Instant) -> u32 {
        (now.us_since(self.started) / 1_000_000) as u32
    }
}

fn send_switch_request(outgoing: &mut Outgoing, source: NodeId, request: &ChargerRequest) {
    // Bit 1 is enable, bit 0 disable.
    let switch = match request.power {
        ChargerPower::On => 0b10,
        ChargerPower::Off => 0b01,
    };
    outgoing.send(&Transfer {
        identifier: Identifier::Service {
            type_id: OUTPUT_ENABLE,
            direction: Direction::Request,
            destination: request.node,
            source,
        },
        priority: Priority::LOW,
        transfer_id: request.transfer_id,
        crc: DataType::OutputEnableResponse.crc(),
        payload: &[switch],
    });
}

fn announce(notice: CanNotice, deliver: &mut impl FnMut(CanEvent)) {
    match notice.severity() {
        Severity::Info => info!("{}", notice),
        _ => warn!("{}", notice),
    }
    deliver(CanEvent::Announce(notice));
}
