//! The start: what was read from flash and retained memory, what it announces, and how the board is wired.

use heapless::Vec;

use super::announcement::Announcement;
use super::broadcast::Broadcast;
use super::packs::Packs;
use super::saving::SigningSave;
use super::{Autopilot, Work};
use crate::battery::{MAX_PACKS, PackMemory};
use crate::log::{info, warn};
use crate::mavlink::{Signing, SigningTrouble};
use crate::parameter::{Parameters, SaveFailures, VehicleParameter, serial_baud};
use crate::sensor;
use crate::storage::StorageError;
use crate::vehicle::{Vehicle, VehicleStatus};

/// Everything known before the tasks start.
#[derive(Debug)]
pub struct Start {
    /// The parameters.
    pub parameters: Parameters,
    /// Where they come from.
    pub parameter_load: ParameterLoad,
    /// The signing key and its time.
    pub signing: Signing,
    /// What was retained of the packs over a reset.
    pub packs: Option<[PackMemory; MAX_PACKS]>,
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

impl Start {
    /// A start with these parameters, without a key, and with nothing retained.
    pub fn with_parameters(parameters: Parameters) -> Self {
        Self {
            parameters,
            parameter_load: ParameterLoad::Loaded,
            signing: Signing::off(),
            packs: None,
        }
    }
}

impl Autopilot {
    /// The autopilot at boot; nothing has been measured yet.
    // Inlined, it would take several times its size of the caller's stack.
    #[inline(never)]
    pub fn new(start: Start) -> Self {
        let mut autopilot = Self {
            packs: Packs::new(&start.parameters),
            parameters: start.parameters,
            vehicle: Vehicle::new(),
            signing: start.signing,
            load_permille: 0,
            start_notices: Vec::new(),
            broadcast: Broadcast::default(),
            save_failures: SaveFailures::default(),
            signing_save: SigningSave::default(),
            logged_status: VehicleStatus::default(),
            work: Work::empty(),
        };
        if let Some(memory) = &start.packs {
            autopilot.packs.restore(memory);
            info!("battery: consumption kept over the reset");
        }
        autopilot.report_start(start.parameter_load);
        autopilot
    }

    fn report_start(&mut self, load: ParameterLoad) {
        match load {
            ParameterLoad::Loaded => info!("parameters loaded"),
            ParameterLoad::Skipped => self.notice(Announcement::DefaultParameters),
            ParameterLoad::Damaged(error) => {
                warn!("parameter storage: {:?}", error);
                self.notice(Announcement::ParametersDamaged);
            }
        }
        if self.signing.has_lost_key() {
            warn!("{}", SigningTrouble::KeyLost.text());
        }
        if self.packs.are_failsafes_off(&self.parameters) {
            self.notice(Announcement::FailsafesOff);
        }
    }

    /// Announces something about the start to every ground station, also to those that connect later.
    fn notice(&mut self, announcement: Announcement<'static>) {
        // There is room for every notice.
        let _ = self.start_notices.push(announcement);
        self.announce(announcement);
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
