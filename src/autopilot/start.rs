//! The start: what was read from flash and retained memory, what it announces, and how the board is wired.

use heapless::Vec;

use super::announcement::Announcement;
use super::broadcast::Broadcast;
use super::packs::Packs;
use super::saving::SigningSave;
use super::{Autopilot, MAX_START_NOTICES, Work};
use crate::battery::PackSettings;
use crate::log::{info, warn};
use crate::mavlink::{Signing, SigningTrouble};
use crate::parameter::{Pack, Parameters, SaveFailures, VehicleParameter, serial_baud};
use crate::sensor;
use crate::storage::StorageError;
use crate::vehicle::{Vehicle, VehicleStatus};

/// Everything that is read from flash before the tasks start.
#[derive(Debug)]
pub struct Start {
    /// The parameters.
    pub parameters: Parameters,
    /// Where they come from.
    pub parameter_load: ParameterLoad,
    /// The signing key and its time.
    pub signing: Signing,
}

/// Result of loading the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterLoad {
    /// All stored values were loaded.
    Loaded,
    /// Some of them could not be read.
    Damaged(StorageError),
    /// They were not read, after repeated quick resets.
    Skipped,
}

/// Peripherals that the parameters call for. Those that are not used stay untouched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wiring {
    /// Baud rate of the telemetry port (`SERIAL0_BAUD`).
    pub telemetry_baud: u32,
    /// Clock of the I2C bus, in hertz.
    pub i2c_clock_hz: u32,
    /// Whether a pack uses ESC telemetry.
    pub uses_esc: bool,
    /// Whether a pack uses the pulse input.
    pub uses_pulses: bool,
}

impl Default for Start {
    // Not inlined: see `in_place`.
    #[inline(never)]
    fn default() -> Self {
        Self {
            parameter_load: ParameterLoad::Loaded,
            signing: Signing::off(),
            parameters: Parameters::defaults(),
        }
    }
}

impl Start {
    /// A start with these parameters and without a key.
    pub fn with_parameters(parameters: Parameters) -> Self {
        Self {
            parameters,
            ..Self::default()
        }
    }
}

impl Autopilot {
    /// The autopilot at boot; nothing has been measured yet.
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(start: &Start) -> Self {
        Self {
            start_notices: report(start),
            signing: in_place(|| start.signing.clone()),
            parameters: in_place(|| start.parameters.clone()),
            vehicle: in_place(Vehicle::new),
            load_permille: 0,
            save_failures: SaveFailures::default(),
            signing_save: SigningSave::default(),
            logged_status: VehicleStatus::default(),
            work: Work::empty(),
            broadcast: Broadcast::new(),
            packs: Packs::new(&start.parameters),
        }
    }

    /// The peripherals that the parameters call for.
    pub fn wiring(&self) -> Wiring {
        let parameters = &self.parameters;
        Wiring {
            telemetry_baud: serial_baud(parameters.get_whole(VehicleParameter::Serial0Baud)),
            i2c_clock_hz: sensor::bus_clock_hz(parameters),
            uses_esc: sensor::needs_esc(parameters),
            uses_pulses: sensor::needs_pulses(parameters),
        }
    }
}

/// A part that is built where it stays. Inlined, it would be built on the stack and copied.
#[inline(never)]
pub(super) fn in_place<T>(content: impl FnOnce() -> T) -> T {
    content()
}

/// Logs the result of the start, and returns what ground stations have to know of it when they connect.
#[inline(never)]
fn report(start: &Start) -> Vec<Announcement<'static>, MAX_START_NOTICES> {
    let load = match start.parameter_load {
        ParameterLoad::Loaded => {
            info!("parameters loaded");
            None
        }
        ParameterLoad::Skipped => {
            warn!("parameters not loaded");
            Some(Announcement::DefaultParameters)
        }
        ParameterLoad::Damaged(error) => {
            warn!("parameter storage: {:?}", error);
            Some(Announcement::ParametersDamaged)
        }
    };
    if start.signing.has_lost_key() {
        warn!("{}", SigningTrouble::KeyLost.text());
    }
    let failsafes = are_failsafes_off(&start.parameters).then_some(Announcement::FailsafesOff);
    let mut notices = Vec::new();
    for notice in load.into_iter().chain(failsafes) {
        info!("{}", notice.text().as_str());
        // There is room for both.
        let _ = notices.push(notice);
    }
    notices
}

/// Whether packs are monitored, and none of them has a failsafe threshold.
fn are_failsafes_off(parameters: &Parameters) -> bool {
    let is_off = |pack: &Pack| {
        PackSettings::from_parameters(parameters, *pack)
            .failsafe
            .is_disabled()
    };
    let mut monitored = Pack::ALL
        .into_iter()
        .filter(|pack| parameters.is_monitored(*pack))
        .peekable();
    monitored.peek().is_some() && monitored.all(|pack| is_off(&pack))
}
