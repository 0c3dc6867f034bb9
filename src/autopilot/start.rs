//! The start: what was read from flash, and what it announces.

use heapless::Vec;

use super::announcement::Announcement;
use crate::battery::PackSettings;
use crate::log::{info, warn};
use crate::mavlink::{Signing, SigningTrouble};
use crate::pack::Pack;
use crate::parameter::Parameters;
use crate::storage::StorageError;

/// Announcements about the start that are repeated to every ground station that connects: parameters and failsafes.
pub(super) type StartNotices = Vec<Announcement<'static>, 2>;

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

    /// Logs the result of the start, and returns what ground stations have to know of it when they connect.
    #[inline(never)]
    pub(super) fn notices(&self) -> StartNotices {
        let load = match self.parameter_load {
            ParameterLoad::Loaded => {
                info!("parameters loaded");
                None
            }
            ParameterLoad::Skipped => {
                warn!("{}", Announcement::DefaultParameters.text().as_str());
                Some(Announcement::DefaultParameters)
            }
            ParameterLoad::Damaged(error) => {
                warn!("parameter storage: {:?}", error);
                Some(Announcement::ParametersDamaged)
            }
        };
        if self.signing.has_lost_key() {
            warn!("{}", SigningTrouble::KeyLost.text());
        }
        let failsafes = are_failsafes_off(&self.parameters).then_some(Announcement::FailsafesOff);
        if failsafes.is_some() {
            info!("battery failsafes are off");
        }
        let mut notices = Vec::new();
        for notice in load.into_iter().chain(failsafes) {
            // There is room for both.
            let _ = notices.push(notice);
        }
        notices
    }
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
