//! What the tasks tell each other.

use core::cell::{Cell, RefCell};

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use heapless::Vec;

use crate::battery::BatteryState;
use crate::mavlink::SystemState;
use crate::mavlink::dialect::MavSeverity;
use crate::parameter::{ParameterId, Parameters};

/// Things said about the start; one each for the parameters and the reset would do.
const MAX_NOTICES: usize = 4;

/// Something every ground station should know about the start.
pub type Notice = (MavSeverity, &'static str);

/// The values that more than one task uses.
///
/// All tasks run on one executor and none is interrupted by another, so plain cells guard them.
pub struct Shared {
    battery: Cell<BatteryState>,
    samples: Cell<u32>,
    load_permille: Cell<u16>,
    parameters: RefCell<Parameters>,
    notices: RefCell<Vec<Notice, MAX_NOTICES>>,
    /// Parameters have to be written to flash.
    pub(super) to_save: Signal<NoopRawMutex, ()>,
    /// Everything stored has to be forgotten.
    pub(super) to_clear: Cell<bool>,
    pub(super) storage_busy: Cell<bool>,
    /// A ground station asks for a restart.
    pub(super) to_reboot: Signal<NoopRawMutex, ()>,
}

impl Shared {
    /// Nothing measured yet, and these parameters.
    pub fn new(parameters: Parameters) -> Self {
        Self {
            battery: Cell::new(BatteryState::default()),
            samples: Cell::new(0),
            load_permille: Cell::new(0),
            parameters: RefCell::new(parameters),
            notices: RefCell::new(Vec::new()),
            to_save: Signal::new(),
            to_clear: Cell::new(false),
            storage_busy: Cell::new(false),
            to_reboot: Signal::new(),
        }
    }

    /// What is known of the pack.
    pub fn battery(&self) -> BatteryState {
        self.battery.get()
    }

    /// Publishes what is known of the pack after one more sampling tick.
    pub(super) fn publish_battery(&self, state: BatteryState) {
        self.battery.set(state);
        self.samples.set(self.samples.get().wrapping_add(1));
    }

    /// How many sampling ticks there have been.
    pub fn samples(&self) -> u32 {
        self.samples.get()
    }

    /// Uses the parameters. It must not wait in there.
    pub(super) fn with_parameters<R>(&self, use_them: impl FnOnce(&mut Parameters) -> R) -> R {
        use_them(&mut self.parameters.borrow_mut())
    }

    /// The live value of a parameter.
    pub fn parameter(&self, id: impl Into<ParameterId>) -> f32 {
        self.with_parameters(|parameters| parameters.get(id))
    }

    /// The live value of a parameter that is a whole number.
    pub fn whole_parameter(&self, id: impl Into<ParameterId>) -> i32 {
        self.with_parameters(|parameters| parameters.get_whole(id))
    }

    /// Busy share of the processor over the last second, in tenths of a percent.
    pub fn load_permille(&self) -> u16 {
        self.load_permille.get()
    }

    pub(super) fn publish_load(&self, load_permille: u16) {
        self.load_permille.set(load_permille);
    }

    /// What telemetry reports at this moment, apart from a link's own counters.
    pub(super) fn system_state(&self) -> SystemState {
        SystemState {
            battery: self.battery(),
            load_permille: self.load_permille(),
            ..SystemState::default()
        }
    }

    /// Tells every ground station that connects.
    pub fn notice(&self, severity: MavSeverity, text: &'static str) {
        // One too many is not worth more than the log, where it stands anyway.
        let _ = self.notices.borrow_mut().push((severity, text));
    }

    pub(super) fn notices(&self) -> Vec<Notice, MAX_NOTICES> {
        self.notices.borrow().clone()
    }

    /// Whether a value that was set is not in flash yet.
    pub(super) fn has_unsaved(&self) -> bool {
        self.storage_busy.get()
            || self.to_clear.get()
            || self.with_parameters(|parameters| parameters.next_unsaved().is_some())
    }
}
