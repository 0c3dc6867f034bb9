//! What a test has soldered to the pins, now and at times to come.

use std::collections::BTreeMap;

use super::super::clock::{Cycle, NEVER};
use super::PINS;

/// What the wire at a pin does to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinWire {
    Low,
    High,
    /// It ends in the air: the pad's pulls decide.
    Open,
}

/// A train of pulses: high from the first rise on, low in between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulses {
    pub first_rise: Cycle,
    pub high: Cycle,
    pub period: Cycle,
    pub count: u64,
}

impl Pulses {
    /// The levels one after the other, each with the time from which it is there.
    pub fn changes(self) -> impl Iterator<Item = (Cycle, PinWire)> {
        assert!(
            self.high > 0 && self.high < self.period,
            "a pulse is high for a part of its period: {self:?}"
        );
        (0..self.count).flat_map(move |number| {
            let rise = self.first_rise + number * self.period;
            [(rise, PinWire::High), (rise + self.high, PinWire::Low)]
        })
    }
}

#[derive(Clone, Default)]
pub struct Wires {
    /// Pins a wire drives, and drives high: one bit each.
    pub connected: u32,
    pub high: u32,
    to_come: BTreeMap<Cycle, Vec<(usize, PinWire)>>,
}

impl Wires {
    pub fn connect(&mut self, pin: usize, wire: PinWire) {
        assert!(pin < PINS, "there is no GP{pin}");
        let pin = 1 << pin;
        self.connected &= !pin;
        self.high &= !pin;
        match wire {
            PinWire::Low => self.connected |= pin,
            PinWire::High => (self.connected, self.high) = (self.connected | pin, self.high | pin),
            PinWire::Open => {}
        }
    }

    pub fn schedule(&mut self, at: Cycle, pin: usize, wire: PinWire) {
        assert!(pin < PINS, "there is no GP{pin}");
        self.to_come.entry(at).or_default().push((pin, wire));
    }

    /// The changes of the earliest moment that has come.
    pub fn take_due(&mut self, now: Cycle) -> Option<Vec<(usize, PinWire)>> {
        let earliest = self.to_come.first_entry()?;
        (*earliest.key() <= now).then(|| earliest.remove())
    }

    pub fn next_change(&self) -> Cycle {
        self.to_come.keys().next().copied().unwrap_or(NEVER)
    }
}
