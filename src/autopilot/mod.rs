//! The core: owns parameters, packs, vehicle and signing, and takes every decision between them.
//!
//! [`Autopilot`] does no I/O and reads no clock. Tasks (or a program with one loop, or a test) hand it times, readings
//! and received bytes; it hands out pins to read, motor outputs, messages and values to save. What other tasks have to do
//! after a call is in [`Work`].

mod announcement;
mod broadcast;
mod channel;
mod driving;
mod links;
mod packs;
mod saving;
mod start;
mod work;

use heapless::Vec;

pub use announcement::{ANNOUNCEMENT_BYTES, Announcement, AnnouncementText};
pub use channel::Channel;
pub use driving::Outputs;
pub use packs::{SamplingProgress, SamplingTick};
pub use start::{ParameterLoad, Start, Wiring};
pub use work::Work;

use broadcast::Broadcast;
use packs::Packs;
use saving::SigningSave;

use crate::battery::BatteryState;
use crate::log::info;
use crate::mavlink::{Signing, SystemState};
use crate::parameter::{Pack, Parameters, SaveFailures};
use crate::vehicle::{Vehicle, VehicleStatus};

/// Announcements about the start that are repeated to every ground station: parameters and failsafes.
const MAX_START_NOTICES: usize = 2;

/// The autopilot without its hardware, links and clock.
///
/// Times are microseconds since an arbitrary epoch, on the board since boot.
#[derive(Debug)]
pub struct Autopilot {
    parameters: Parameters,
    packs: Packs,
    vehicle: Vehicle,
    signing: Signing,
    load_permille: u16,
    start_notices: Vec<Announcement<'static>, MAX_START_NOTICES>,
    broadcast: Broadcast,
    save_failures: SaveFailures,
    signing_save: SigningSave,
    /// The vehicle's status in the latest log line.
    logged_status: VehicleStatus,
    work: Work,
}

impl Autopilot {
    /// The live parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The live parameters, for a program that sets them itself.
    pub fn parameters_mut(&mut self) -> &mut Parameters {
        &mut self.parameters
    }

    /// The vehicle.
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// The state of a pack.
    pub fn battery(&self, pack: Pack) -> &BatteryState {
        self.packs.state(pack)
    }

    /// Sampling ticks so far, modulo 2^32.
    pub fn samples(&self) -> u32 {
        self.packs.ticks()
    }

    /// Busy share of the processor over the last second, in tenths of a percent.
    pub fn load_permille(&self) -> u16 {
        self.load_permille
    }

    /// Sets the busy share of the processor over the last second, in tenths of a percent.
    pub fn set_load(&mut self, load_permille: u16) {
        self.load_permille = load_permille;
    }

    /// Everything telemetry reports now, apart from a link's own counters.
    pub fn system_state(&self) -> SystemState<'_> {
        SystemState {
            batteries: self.packs.states(),
            vehicle: self.vehicle.status(),
            load_permille: self.load_permille,
            ..SystemState::default()
        }
    }

    /// Announces something to all connected ground stations, once.
    pub fn announce(&mut self, announcement: Announcement<'_>) {
        info!("announced: {}", announcement.text().as_str());
        self.broadcast.add(&announcement);
        self.work |= Work::ANNOUNCED;
    }

    /// What other tasks have to do since the last call.
    pub fn take_work(&mut self) -> Work {
        core::mem::take(&mut self.work)
    }
}
