//! The wires, and what the nodes at them make of each other.

use std::cell::{RefCell, RefMut};
use std::collections::VecDeque;
use std::rc::Rc;

use super::super::clock::{Cycle, NEVER};
use super::super::random::Random;
use super::confinement::ErrorState;
use super::frame::INTERMISSION_BITS;
use super::node::CanNode;
use super::{CanFrame, Confinement};

/// An error flag and its delimiter (3.1.3), without an echo of the flag, and the intermission.
const ERROR_FRAME_BITS: u64 = 6 + 8 + INTERMISSION_BITS;
/// What an error-passive sender waits before it sends again (3.1.5).
const SUSPEND_BITS: u64 = 8;
/// An occurrence of recessive bits, as bus-off and a node that joins wait for: also what is behind each frame.
const OCCURRENCE_BITS: u64 = 11;
/// On a wire that is stuck, errors count again after this many bits (rule 6).
const STUCK_BITS: u64 = 8;
/// From the CRC delimiter on, a frame has no error but a missing acknowledge here.
const BITS_BEHIND_ACKNOWLEDGE: u64 = 8 + INTERMISSION_BITS;
/// A bit that is longer or shorter by more than this part can't be understood.
const BIT_TOLERANCE: Cycle = 100;
const MOST_RECORDS: usize = 65_536;

/// What the wires do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CanWires {
    #[default]
    Sound,
    /// Cut between all nodes: each one hears itself only.
    Open,
    /// CANH and CANL touch each other: no dominant bit can be seen.
    Shorted,
    /// Dominant for good: a transceiver is broken.
    StuckDominant,
}

/// How an attempt to send has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanOutcome {
    Sent,
    /// No other node has acknowledged it.
    NotAcknowledged,
    /// An error was noticed, and an error frame sent.
    Error,
}

/// An attempt to send.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanRecord {
    pub start: Cycle,
    pub end: Cycle,
    pub frame: CanFrame,
    pub outcome: CanOutcome,
}

pub type SharedCanBus = Rc<RefCell<CanBus>>;

type Shared = Rc<RefCell<dyn CanNode>>;

struct Place {
    node: Shared,
    /// It may not send before: it is error-passive and has just sent.
    suspended_until: Cycle,
    /// Whether it waits for recessive bits, and since when those count that were not counted yet.
    is_waiting: bool,
    recessive_from: Cycle,
}

struct Transmission {
    /// Those that send it: more than one if they send the same.
    senders: Vec<usize>,
    record: CanRecord,
}

/// The bus. It is behind the present unless [`Self::advance`] was called for it.
pub struct CanBus {
    places: Vec<Place>,
    now: Cycle,
    /// Nodes may send from here on.
    idle_from: Cycle,
    transmission: Option<Transmission>,
    wires: CanWires,
    stuck_step: Cycle,
    noise_share: f64,
    random: Random,
    records: VecDeque<CanRecord>,
}

impl CanBus {
    /// A bus without nodes. The seed decides which frames noise corrupts.
    pub fn new(seed: u64) -> SharedCanBus {
        Rc::new(RefCell::new(Self {
            places: Vec::new(),
            now: 0,
            idle_from: 0,
            transmission: None,
            wires: CanWires::Sound,
            stuck_step: NEVER,
            noise_share: 0.0,
            random: Random::new(seed),
            records: VecDeque::new(),
        }))
    }

    /// Connects a node, which a test keeps a hand on.
    pub fn attach(&mut self, node: Rc<RefCell<dyn CanNode>>) {
        self.places.push(Place {
            node,
            suspended_until: 0,
            is_waiting: false,
            recessive_from: 0,
        });
    }

    // ----- Faults -------------------------------------------------------------------------------

    /// Changes what the wires do, from now on.
    pub fn set_wires(&mut self, wires: CanWires) {
        if wires == self.wires {
            return;
        }
        self.wires = wires;
        self.count_recessive();
        self.count_recessive_from(self.now);
        self.stuck_step = NEVER;
        if wires == CanWires::StuckDominant {
            self.break_off();
            self.stuck_step = self.now + STUCK_BITS * self.bit();
        } else {
            self.idle_from = self.idle_from.max(self.now + OCCURRENCE_BITS * self.bit());
        }
    }

    /// Corrupts this share of all attempts, by chance.
    pub fn set_noise(&mut self, share: f64) {
        self.noise_share = share;
    }

    // ----- What has happened --------------------------------------------------------------------

    /// Attempts to send since this was asked last, at most the last 65536.
    pub fn take_records(&mut self) -> Vec<CanRecord> {
        self.records.drain(..).collect()
    }

    // ----- Time ---------------------------------------------------------------------------------

    /// Everything that is due up to and including `now` happens.
    pub fn advance(&mut self, now: Cycle) {
        loop {
            self.note_waiting();
            let at = self.next_event();
            if at > now {
                break;
            }
            self.now = self.now.max(at);
            self.step();
        }
        self.now = self.now.max(now);
    }

    /// When [`Self::advance`] is needed next.
    pub fn next_event(&self) -> Cycle {
        if let Some(transmission) = &self.transmission {
            return transmission.record.end;
        }
        if self.wires == CanWires::StuckDominant {
            return self.stuck_step;
        }
        self.next_start().min(self.next_return())
    }

    fn step(&mut self) {
        if let Some(transmission) = self.transmission.take() {
            self.finish(transmission);
        } else if self.wires == CanWires::StuckDominant {
            self.suffer_dominant_bits();
        } else {
            self.count_recessive();
            self.start();
        }
    }

    fn node(&self, place: usize) -> RefMut<'_, dyn CanNode> {
        self.places[place].node.borrow_mut()
    }

    /// Attached nodes that are neither off nor joining, with the length of their bits.
    fn present(&self) -> impl Iterator<Item = (usize, Cycle)> {
        self.places.iter().enumerate().filter_map(|(number, place)| {
            let node = place.node.borrow();
            let bit = node.attachment().filter(|_| node.confinement().is_present())?;
            Some((number, bit))
        })
    }

    /// Of any node: they are meant to agree.
    fn bit(&self) -> Cycle {
        let bit = |place: &Place| place.node.borrow().attachment();
        self.places
            .iter()
            .find_map(bit)
            .unwrap_or(super::bit_time(1_000_000))
    }

    // ----- Nodes that wait ----------------------------------------------------------------------

    /// One that is switched on, or off the bus, counts from now on.
    fn note_waiting(&mut self) {
        for place in &mut self.places {
            let node = place.node.borrow();
            let is_waiting = node.attachment().is_some() && node.confinement().awaited() > 0;
            if is_waiting && !place.is_waiting {
                place.recessive_from = self.now;
            }
            place.is_waiting = is_waiting;
        }
    }

    /// When a node has seen enough recessive bits to take part (again).
    fn next_return(&self) -> Cycle {
        let due = |place: &Place| {
            let node = place.node.borrow();
            let bit = node.attachment()?;
            let awaited = node.confinement().awaited();
            let from = if place.is_waiting {
                place.recessive_from
            } else {
                self.now
            };
            (awaited > 0).then(|| from + awaited * OCCURRENCE_BITS * bit)
        };
        let earliest = self.places.iter().filter_map(due).min();
        earliest.map_or(NEVER, |at| at.max(self.now))
    }

    /// The wires were recessive up to now: that counts for those who wait for it.
    fn count_recessive(&mut self) {
        for place in self.places.iter_mut().filter(|place| place.is_waiting) {
            let mut node = place.node.borrow_mut();
            let Some(bit) = node.attachment() else {
                continue;
            };
            let occurrence = OCCURRENCE_BITS * bit;
            let occurrences = self.now.saturating_sub(place.recessive_from) / occurrence;
            place.recessive_from += occurrences * occurrence;
            node.confinement_mut().saw_recessive(occurrences);
            node.state_changed(self.now);
        }
    }

    fn count_recessive_from(&mut self, from: Cycle) {
        self.places
            .iter_mut()
            .for_each(|place| place.recessive_from = from);
    }

    // ----- A frame ------------------------------------------------------------------------------

    /// Whether a node has something to send, and from when on it may.
    fn start_of(&self, place: usize) -> Option<Cycle> {
        let ready = self.node(place).ready_from()?;
        let allowed = self.idle_from.max(self.places[place].suspended_until);
        Some(ready.max(allowed).max(self.now))
    }

    fn next_start(&self) -> Cycle {
        let starts = self.present().filter_map(|(place, _)| self.start_of(place));
        starts.min().unwrap_or(NEVER)
    }

    fn start(&mut self) {
        let due: Vec<_> = self
            .present()
            .filter(|&(place, _)| self.start_of(place).is_some_and(|at| at <= self.now))
            .filter_map(|(place, bit)| Some((place, bit, self.node(place).begin(self.now)?)))
            .collect();
        let Some(strongest) = due.iter().map(|(_, _, frame)| frame.priority()).min() else {
            return;
        };
        let (senders, losers): (Vec<_>, Vec<_>) = due
            .into_iter()
            .partition(|(_, _, frame)| frame.priority() == strongest);
        for (place, _, _) in losers {
            self.node(place).lost_arbitration(self.now);
        }
        let (_, bit, frame) = senders[0].clone();
        let is_one = senders.iter().all(|(_, _, other)| *other == frame);
        let senders: Vec<_> = senders.into_iter().map(|(place, _, _)| place).collect();
        let outcome = match is_one {
            true => self.outcome(&senders, bit),
            false => CanOutcome::Error,
        };
        let end = self.now + self.length(&frame, outcome) * bit;
        self.transmission = Some(Transmission {
            senders,
            record: CanRecord {
                start: self.now,
                end,
                frame,
                outcome,
            },
        });
    }

    fn length(&self, frame: &CanFrame, outcome: CanOutcome) -> u64 {
        let bits = frame.bits();
        match outcome {
            CanOutcome::Sent => bits,
            CanOutcome::NotAcknowledged => bits - BITS_BEHIND_ACKNOWLEDGE + ERROR_FRAME_BITS,
            CanOutcome::Error if self.wires == CanWires::Shorted => 1 + ERROR_FRAME_BITS,
            CanOutcome::Error => bits / 2 + ERROR_FRAME_BITS,
        }
    }

    fn outcome(&mut self, senders: &[usize], bit: Cycle) -> CanOutcome {
        let is_noisy = self.noise_share > 0.0 && self.random.unit() < self.noise_share;
        if is_noisy || self.wires == CanWires::Shorted {
            return CanOutcome::Error;
        }
        let others: Vec<_> = self
            .present()
            .filter(|(place, _)| !senders.contains(place) && self.wires == CanWires::Sound)
            .collect();
        let (fits, misfits): (Vec<_>, Vec<_>) =
            others.into_iter().partition(|&(_, other)| is_alike(other, bit));
        let is_active = |place: usize| self.node(place).confinement().state() == ErrorState::Active;
        if misfits.iter().any(|&(place, _)| is_active(place)) {
            return CanOutcome::Error;
        }
        match fits.is_empty() && senders.len() == 1 {
            true => CanOutcome::NotAcknowledged,
            false => CanOutcome::Sent,
        }
    }

    fn finish(&mut self, Transmission { senders, record }: Transmission) {
        let bit = self.bit_of_sender(&senders);
        let present: Vec<_> = self.present().collect();
        for (place, own_bit) in present {
            if senders.contains(&place) {
                self.finish_sender(place, &record, bit);
            } else if self.wires != CanWires::Open {
                self.finish_receiver(place, &record, is_alike(own_bit, bit));
            }
        }
        self.idle_from = record.end;
        self.count_recessive_from(record.end - OCCURRENCE_BITS * bit);
        if self.records.len() == MOST_RECORDS {
            self.records.pop_front();
        }
        self.records.push_back(record);
    }

    /// One that is gone meanwhile had the same.
    fn bit_of_sender(&self, senders: &[usize]) -> Cycle {
        let bit = senders.iter().find_map(|place| self.node(*place).attachment());
        bit.unwrap_or_else(|| self.bit())
    }

    fn finish_sender(&mut self, place: usize, record: &CanRecord, bit: Cycle) {
        let end = record.end;
        let was_passive = {
            let mut node = self.node(place);
            let is_passive = node.confinement().state() == ErrorState::Passive;
            match record.outcome {
                CanOutcome::Sent => {
                    node.confinement_mut().sent();
                    node.sent(end);
                }
                // Rule 3, exception 1: alone at the bus it stays error-passive.
                CanOutcome::NotAcknowledged if is_passive => node.failed(end),
                CanOutcome::NotAcknowledged | CanOutcome::Error => {
                    node.confinement_mut().transmit_failed();
                    node.failed(end);
                }
            }
            is_passive
        };
        if was_passive {
            self.places[place].suspended_until = end + SUSPEND_BITS * bit;
        }
    }

    fn finish_receiver(&self, place: usize, record: &CanRecord, understands: bool) {
        let mut node = self.node(place);
        match record.outcome {
            CanOutcome::Sent if understands => {
                node.confinement_mut().received();
                node.received(&record.frame, record.end);
            }
            _ => {
                node.confinement_mut().receive_failed();
                node.disturbed(record.end);
            }
        }
    }

    // ----- A wire that is stuck -----------------------------------------------------------------

    /// The frame that is being sent is not.
    fn break_off(&mut self) {
        if let Some(mut transmission) = self.transmission.take() {
            transmission.record.outcome = CanOutcome::Error;
            transmission.record.end = self.now;
            self.finish(transmission);
            self.count_recessive_from(self.now);
        }
    }

    /// Receivers count errors until they are at the end of the counter.
    fn suffer_dominant_bits(&mut self) {
        let present: Vec<_> = self.present().collect();
        let before: Vec<_> = self.counters(&present);
        for &(place, _) in &present {
            let mut node = self.node(place);
            node.confinement_mut().saw_dominant_bits();
            node.disturbed(self.now);
        }
        let is_over = self.counters(&present) == before;
        self.count_recessive_from(self.now);
        self.stuck_step = match is_over {
            true => NEVER,
            false => self.now + STUCK_BITS * self.bit(),
        };
    }

    fn counters(&self, places: &[(usize, Cycle)]) -> Vec<u16> {
        let count = |place: usize| Confinement::receive_errors(self.node(place).confinement());
        places.iter().map(|(place, _)| count(*place)).collect()
    }
}

fn is_alike(bit: Cycle, other: Cycle) -> bool {
    bit.abs_diff(other) * BIT_TOLERANCE <= bit
}
