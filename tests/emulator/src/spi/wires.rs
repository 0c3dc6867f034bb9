//! The wires outside the chip: the devices on them, and what went over them.

use super::super::attached::Attached;
use super::super::clock::{Cycle, NEVER};
use super::device::{SpiClock, SpiDevice};

/// What a device exchanged from its select to the end of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SpiTransaction {
    /// The pin that selected it.
    pub select: usize,
    pub start: Cycle,
    pub end: Cycle,
    pub written: Vec<u8>,
    pub read: Vec<u8>,
}

struct Slot {
    select: usize,
    /// The pin that its interrupt output leads to.
    interrupt: Option<usize>,
    device: Box<dyn SpiDevice>,
    under_way: Option<SpiTransaction>,
}

impl Slot {
    fn is_wanted(&self, low_pins: u32) -> bool {
        low_pins >> self.select & 1 != 0
    }

    fn begin(&mut self, now: Cycle) {
        self.device.select();
        self.under_way = Some(SpiTransaction {
            select: self.select,
            start: now,
            end: now,
            written: Vec::new(),
            read: Vec::new(),
        });
    }

    fn end(&mut self, now: Cycle) -> Option<SpiTransaction> {
        self.device.deselect();
        let transaction = self.under_way.take()?;
        Some(SpiTransaction {
            end: now,
            ..transaction
        })
    }
}

#[derive(Clone)]
pub struct Wires {
    slots: Attached<Vec<Slot>>,
    floating: u8,
    log: Vec<SpiTransaction>,
}

impl Default for Wires {
    fn default() -> Self {
        Self {
            slots: Attached::default(),
            floating: 0xff,
            log: Vec::new(),
        }
    }
}

impl Wires {
    pub fn attach(&mut self, select: usize, interrupt: Option<usize>, device: Box<dyn SpiDevice>) {
        self.detach(select);
        self.slots.get_or_default().push(Slot {
            select,
            interrupt,
            device,
            under_way: None,
        });
    }

    pub fn detach(&mut self, select: usize) {
        if let Some(slots) = self.slots.get_mut() {
            slots.retain(|slot| slot.select != select);
        }
    }

    pub fn set_floating(&mut self, byte: u8) {
        self.floating = byte;
    }

    pub fn floating(&self) -> u8 {
        self.floating
    }

    pub fn take_log(&mut self) -> Vec<SpiTransaction> {
        std::mem::take(&mut self.log)
    }

    fn slots(&self) -> impl Iterator<Item = &Slot> {
        self.slots.get().into_iter().flatten()
    }

    pub fn would_change(&self, low_pins: u32) -> bool {
        let changes = |slot: &Slot| slot.is_wanted(low_pins) != slot.under_way.is_some();
        self.slots().any(changes)
    }

    pub fn select(&mut self, low_pins: u32, now: Cycle) {
        for slot in self.slots.get_mut().into_iter().flatten() {
            match (slot.is_wanted(low_pins), slot.under_way.is_some()) {
                (true, false) => slot.begin(now),
                (false, true) => self.log.extend(slot.end(now)),
                _ => {}
            }
        }
    }

    pub fn advance(&mut self, now: Cycle) {
        let slots = self.slots.get_mut().into_iter().flatten();
        slots.for_each(|slot| slot.device.advance(now));
    }

    pub fn next_event(&self) -> Cycle {
        let events = self.slots().map(|slot| slot.device.next_event());
        events.min().unwrap_or(NEVER)
    }

    /// Pins that interrupt outputs drive, each with its level.
    pub fn interrupt_levels(&self) -> impl Iterator<Item = (usize, bool)> {
        let level = |slot: &Slot| Some((slot.interrupt?, slot.device.interrupt_level()?));
        self.slots().filter_map(level)
    }

    /// Two that drive the line against each other: a zero wins.
    pub fn exchange(&mut self, byte: u8, clock: SpiClock) -> u8 {
        let mut line = None;
        for slot in self.slots.get_mut().into_iter().flatten() {
            if let Some(transaction) = &mut slot.under_way {
                let driven = slot.device.exchange(byte, clock);
                transaction.written.push(byte);
                transaction.read.push(driven.unwrap_or(self.floating));
                line = driven.map(|driven| driven & line.unwrap_or(0xff)).or(line);
            }
        }
        line.unwrap_or(self.floating)
    }
}
