//! Outputs of the vehicle over time.

use std::cell::RefCell;

use embassy_time::Instant;
use rover_battmon::vehicle::{Indication, Indicators, Motors, SideDrives};

/// Each output that was set, with the time since the latest power-up in µs.
#[derive(Debug)]
pub struct History<T>(RefCell<Vec<(u64, T)>>);

impl<T> Default for History<T> {
    fn default() -> Self {
        Self(RefCell::default())
    }
}

impl<T: Copy + Default> History<T> {
    /// All of them.
    pub fn all(&self) -> Vec<(u64, T)> {
        self.0.borrow().clone()
    }

    /// The present output.
    pub fn latest(&self) -> T {
        self.0
            .borrow()
            .last()
            .map_or_else(T::default, |(_, output)| *output)
    }

    fn add(&self, output: T) {
        self.0.borrow_mut().push((Instant::now().as_micros(), output));
    }
}

impl Motors for &History<SideDrives> {
    fn drive(&mut self, drives: SideDrives) {
        self.add(drives);
    }
}

impl Indicators for &History<Indication> {
    fn show(&mut self, indication: Indication) {
        self.add(indication);
    }
}
