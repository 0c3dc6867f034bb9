//! What the tasks tell each other.

use core::cell::{Cell, RefCell};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use portable_atomic::{AtomicU16, AtomicU32, Ordering};

use super::Link;
use crate::battery::BatteryState;
use crate::mavlink::SystemState;
use crate::parameter::{ParameterId, Parameters};

/// The values that more than one task uses. Each has one writer.
pub struct Shared {
    battery: Mutex<CriticalSectionRawMutex, Cell<BatteryState>>,
    parameters: Mutex<CriticalSectionRawMutex, RefCell<Parameters>>,
    load_permille: AtomicU16,
    samples: AtomicU32,
}

impl Shared {
    /// Nothing measured yet, every parameter at its default.
    pub fn new() -> Self {
        Self {
            battery: Mutex::new(Cell::new(BatteryState::default())),
            parameters: Mutex::new(RefCell::new(Parameters::defaults())),
            load_permille: AtomicU16::new(0),
            samples: AtomicU32::new(0),
        }
    }

    /// What is known of the pack.
    pub fn battery(&self) -> BatteryState {
        self.battery.lock(Cell::get)
    }

    /// Publishes what is known of the pack after one more sampling tick.
    pub(super) fn publish_battery(&self, state: BatteryState) {
        self.battery.lock(|battery| battery.set(state));
        // One writer, so load and store need not be one operation (the Cortex-M0+ has none).
        let samples = self.samples.load(Ordering::Relaxed);
        self.samples.store(samples.wrapping_add(1), Ordering::Relaxed);
    }

    /// How many sampling ticks there have been.
    pub fn samples(&self) -> u32 {
        self.samples.load(Ordering::Relaxed)
    }

    /// The live value of a parameter.
    pub fn parameter(&self, id: ParameterId) -> f32 {
        self.parameters.lock(|parameters| parameters.borrow().get(id))
    }

    /// Busy share of the processor over the last second, in tenths of a percent.
    pub fn load_permille(&self) -> u16 {
        self.load_permille.load(Ordering::Relaxed)
    }

    pub(super) fn publish_load(&self, load_permille: u16) {
        self.load_permille.store(load_permille, Ordering::Relaxed);
    }

    /// What telemetry over `link` reports at this moment.
    pub(super) fn system_state(&self, link: &Link) -> SystemState {
        SystemState {
            battery: self.battery(),
            load_permille: self.load_permille(),
            link: link.statistics(),
        }
    }
}

impl Default for Shared {
    fn default() -> Self {
        Self::new()
    }
}
