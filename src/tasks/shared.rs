//! Data shared between tasks.

use core::cell::{Cell, RefCell};

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use heapless::Vec;

use super::announcements::{Announcements, Listener};
use crate::battery::{BatteryState, MAX_PACKS, Measurement, PackStatus, ReadError};
use crate::mavlink::dialect::MavSeverity;
use crate::mavlink::{Signing, SigningChange, SigningTrouble, SystemState};
use crate::parameter::{Pack, ParameterId, Parameters, save_failure_text};
use crate::sensor::{Pulses, Samples};
use crate::vehicle::Vehicle;

/// Texts about the start; one each for the parameters, the signing key and the failsafes would do.
const MAX_START_NOTICES: usize = 4;

/// Something that is reported to every ground station, whenever it connects.
type Notice = (MavSeverity, &'static str);

/// The values that more than one task uses.
///
/// All tasks run on one executor and none is interrupted by another, so plain cells guard them.
pub struct Shared {
    batteries: RefCell<[BatteryState; MAX_PACKS]>,
    battery_resets: [Cell<Option<f32>>; MAX_PACKS],
    bus_samples: [Cell<Samples>; MAX_PACKS],
    pulses: Cell<Pulses>,
    samples: Cell<u32>,
    load_permille: Cell<u16>,
    parameters: RefCell<Parameters>,
    vehicle: RefCell<Vehicle>,
    signing: RefCell<Signing>,
    start_notices: Cell<Vec<Notice, MAX_START_NOTICES>>,
    announcements: Announcements,
    /// The outputs to the motors may have changed.
    pub(super) to_drive: Signal<NoopRawMutex, ()>,
    /// Parameters have to be written to flash.
    pub(super) to_save: Signal<NoopRawMutex, ()>,
    /// Another signing key has to be written to flash.
    pub(super) to_save_signing: Signal<NoopRawMutex, SigningChange>,
    /// A ground station asks for a restart.
    pub(super) to_reboot: Signal<NoopRawMutex, ()>,
    /// A ground station gave a sign of life.
    pub(super) ground_station_heard: Signal<NoopRawMutex, ()>,
}

impl Shared {
    /// Nothing measured yet, these parameters, and what is known of signing.
    // Inlined, it would take several times its size of the caller's stack.
    #[inline(never)]
    pub fn new(parameters: &Parameters, signing: Signing) -> Self {
        Self {
            batteries: in_place(|| states_at_boot(parameters)),
            battery_resets: [const { Cell::new(None) }; MAX_PACKS],
            bus_samples: [const { Cell::new(Samples::new()) }; MAX_PACKS],
            pulses: Cell::new(Pulses::NONE),
            samples: Cell::new(0),
            load_permille: Cell::new(0),
            parameters: in_place(|| parameters.clone()),
            vehicle: RefCell::new(Vehicle::new()),
            signing: RefCell::new(signing),
            start_notices: Cell::new(Vec::new()),
            announcements: Announcements::new(),
            to_drive: Signal::new(),
            to_save: Signal::new(),
            to_save_signing: Signal::new(),
            to_reboot: Signal::new(),
            ground_station_heard: Signal::new(),
        }
    }

    /// What is known of the pack `instance` (0 to 8).
    pub fn battery(&self, instance: u8) -> BatteryState {
        let pack = Pack::from_instance(instance);
        pack.map_or(BatteryState::UNKNOWN, |pack| {
            self.with_system_state(|state| *state.battery(pack))
        })
    }

    /// Publishes what is known of the pack `instance` (0 to 8).
    pub(super) fn publish_battery(&self, instance: u8, state: &BatteryState) {
        if let Some(published) = self.batteries.borrow_mut().get_mut(usize::from(instance)) {
            *published = *state;
        }
    }

    /// Asks for the charge of the packs in `mask` (one bit for each instance) to be taken as `percent` of a full pack.
    pub(super) fn request_battery_reset(&self, mask: u16, percent: f32) {
        for (instance, reset) in self.battery_resets.iter().enumerate() {
            if mask & 1 << instance != 0 {
                reset.set(Some(percent));
            }
        }
    }

    /// The charge the pack `instance` (0 to 8) has to be taken to have, in percent, if that was asked for since the last
    /// call.
    pub fn take_battery_reset(&self, instance: u8) -> Option<f32> {
        self.battery_resets.get(usize::from(instance))?.take()
    }

    /// One more reading of a pack by its part on the bus, or why there is none.
    pub(super) fn add_sample(&self, pack: Pack, reading: Result<Measurement, ReadError>) {
        if let Some(cell) = self.bus_samples.get(usize::from(pack.instance())) {
            let mut samples = cell.get();
            samples.add(reading);
            cell.set(samples);
        }
    }

    /// The readings of a pack's part on the bus since the last call; `None` before it has been asked.
    pub(super) fn take_samples(&self, pack: Pack) -> Option<Result<Measurement, ReadError>> {
        let cell = self.bus_samples.get(usize::from(pack.instance()))?;
        let mut samples = cell.get();
        let reading = samples.take();
        cell.set(samples);
        reading
    }

    /// What was measured of the pulses on their pin so far.
    pub(super) fn pulses(&self) -> Pulses {
        self.pulses.get()
    }

    pub(super) fn publish_pulses(&self, pulses: Pulses) {
        self.pulses.set(pulses);
    }

    /// One more sampling tick is over, whatever the number of packs.
    pub(super) fn count_sample(&self) {
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

    /// Uses the vehicle. It must not wait in there.
    pub(super) fn with_vehicle<R>(&self, use_it: impl FnOnce(&mut Vehicle) -> R) -> R {
        use_it(&mut self.vehicle.borrow_mut())
    }

    /// Uses what is known of signing. It must not wait in there.
    pub(super) fn with_signing<R>(&self, use_it: impl FnOnce(&mut Signing) -> R) -> R {
        use_it(&mut self.signing.borrow_mut())
    }

    /// The live value of a parameter, in the parameter's unit.
    pub fn parameter(&self, id: impl Into<ParameterId>) -> f32 {
        self.with_parameters(|parameters| parameters.get(id))
    }

    /// The live value of a parameter that is a whole number, in the parameter's unit.
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

    /// Uses what telemetry reports at this moment, apart from a link's own counters. It must not wait in there.
    pub(super) fn with_system_state<R>(&self, use_it: impl FnOnce(&SystemState<'_>) -> R) -> R {
        let vehicle = self.with_vehicle(|vehicle| vehicle.status());
        use_it(&SystemState {
            batteries: &*self.batteries.borrow(),
            vehicle,
            load_permille: self.load_permille(),
            ..SystemState::default()
        })
    }

    /// Reports something about the start to every ground station, also to those that connect later.
    pub fn notice(&self, severity: MavSeverity, text: &'static str) {
        let mut notices = self.start_notices.take();
        // One too many is not worth more than the log, where it stands anyway.
        let _ = notices.push((severity, text));
        self.start_notices.set(notices);
        self.announce(severity, text);
    }

    /// Announces to every ground station that is connected, once. What is longer than [`ANNOUNCEMENT_BYTES`] is cut off.
    ///
    /// [`ANNOUNCEMENT_BYTES`]: super::ANNOUNCEMENT_BYTES
    pub fn announce(&self, severity: MavSeverity, text: &str) {
        self.announcements.publish(severity, text);
    }

    /// Listens to what is announced from now on.
    pub(super) fn announcements(&self) -> Listener<'_> {
        self.announcements.listen()
    }

    /// What a ground station that connects now has to know: about the start, and what can't be saved or trusted while that
    /// lasts.
    pub(super) fn notices(&self) -> impl Iterator<Item = Notice> + use<> {
        let notices = self.start_notices.take();
        self.start_notices.set(notices.clone());
        let unsaved = self.with_parameters(|parameters| parameters.save_failure());
        let trouble = self.with_signing(|signing| signing.trouble());
        let texts = [unsaved.map(save_failure_text), trouble.map(SigningTrouble::text)];
        let critical = |text| (MavSeverity::MAV_SEVERITY_CRITICAL, text);
        notices
            .into_iter()
            .chain(texts.into_iter().flatten().map(critical))
    }

    /// Whether a value that was set still has to be written to flash. What could not be written and waits for its retry
    /// does not count.
    pub(super) fn has_unsaved(&self) -> bool {
        self.with_signing(|signing| signing.is_key_unsaved())
            || self.with_parameters(|parameters| parameters.next_unsaved().is_some())
    }
}

/// A cell that is built where it stays. Inlined, it would be built on the stack, beside all the others, and copied.
#[inline(never)]
fn in_place<T>(content: impl FnOnce() -> T) -> RefCell<T> {
    RefCell::new(content())
}

/// Before the first sample nothing is known of the packs, but which are monitored.
fn states_at_boot(parameters: &Parameters) -> [BatteryState; MAX_PACKS] {
    let mut states = [BatteryState::default(); MAX_PACKS];
    for (pack, state) in Pack::ALL.into_iter().zip(&mut states) {
        if !parameters.is_monitored(pack) {
            state.status = PackStatus::Disabled;
        }
    }
    states
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reset_is_taken_once_by_each_pack_it_names() {
        let shared = Shared::new(&Parameters::defaults(), Signing::off());
        shared.request_battery_reset(0b1_0000_0101, 100.0);
        shared.request_battery_reset(0b1, 56.0);
        let taken = || (0..=9).map(|instance| shared.take_battery_reset(instance));
        let mut expected = [None; 10];
        (expected[0], expected[2], expected[8]) = (Some(56.0), Some(100.0), Some(100.0));
        assert!(taken().eq(expected));
        assert!(taken().all(|reset| reset.is_none()));
    }

    #[test]
    fn the_packs_are_published_by_their_instance() {
        let shared = Shared::new(&Parameters::defaults(), Signing::off());
        assert_eq!(shared.battery(0).status, PackStatus::Unknown);
        assert_eq!(shared.battery(1).status, PackStatus::Disabled);
        let state = BatteryState {
            status: PackStatus::Healthy,
            voltage_v: Some(11.1),
            ..BatteryState::default()
        };
        shared.publish_battery(8, &state);
        shared.publish_battery(9, &state);
        assert_eq!(shared.battery(8), state);
        assert_eq!(shared.battery(9), BatteryState::default());
        shared.with_system_state(|state| assert!(state.reported().eq([Pack::First, Pack::Ninth])));
    }
}
