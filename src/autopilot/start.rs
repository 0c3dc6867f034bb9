//! The start: what was read from flash, and what it announces.

use core::ops::Range;

use crate::announce::announced_text;
use crate::crash::{CrashRecord, RunEnd};
use crate::log::{info, warn};
use crate::mavlink::{Signing, SigningTrouble};
use crate::memory::flash_chip::RegisterWear;
use crate::memory::identity::Identity;
use crate::parameter::Parameters;
use crate::wifi::Radio;

/// Everything that is read from flash before the tasks start.
#[derive(Debug)]
pub struct Start {
    /// The parameters.
    pub parameters: Parameters,
    /// Their source.
    pub parameter_load: ParameterLoad,
    /// The signing key and its time.
    pub signing: Signing,
    /// Which board and program it is.
    pub identity: Identity,
    /// The wear by writing a page to the flash chip.
    pub flash_wear: RegisterWear,
    /// Whether the board has a Wi-Fi radio.
    pub radio: Radio,
    /// The end of the run before this one.
    pub run_end: RunEnd,
    /// Whether it ended by a crash.
    pub has_crashed: bool,
    /// The latest crash, of that run or an earlier one.
    pub crash: Option<CrashRecord>,
    /// Address range of the program, for the call sites of a crash.
    pub program_code: Range<u32>,
    /// Number of runs in a row that crashed during the radio's turn.
    pub radio_crashes: u8,
}

/// Result of loading the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterLoad {
    /// Stored values were loaded. Whether some could not be is in [`Parameters::trouble`].
    Loaded,
    /// This many of them under keys of another version, which are kept.
    Unknown(u16),
    /// All but perhaps the last: power was lost while it was stored.
    Interrupted,
    /// They were not read, after repeated quick resets.
    Skipped,
}

impl Default for Start {
    // Not inlined: see `in_place`.
    #[inline(never)]
    fn default() -> Self {
        Self {
            parameter_load: ParameterLoad::Loaded,
            signing: Signing::off(),
            identity: Identity::default(),
            flash_wear: RegisterWear::None,
            radio: Radio::Absent,
            run_end: RunEnd::Complete,
            has_crashed: false,
            crash: None,
            program_code: 0..0,
            radio_crashes: 0,
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

    /// Logs the result of the start.
    pub(super) fn log(&self) {
        if self.signing.has_lost_key() {
            warn!("{}", announced_text(&SigningTrouble::KeyLost).as_str());
        }
        match self.parameter_load {
            ParameterLoad::Loaded => info!("parameters loaded"),
            ParameterLoad::Skipped => warn!("{}", announced_text(&ParameterLoad::Skipped).as_str()),
            ParameterLoad::Unknown(_) | ParameterLoad::Interrupted => {}
        }
    }
}
