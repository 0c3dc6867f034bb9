//! What the owner asks for.

use super::evidence::{Evidence, Trial};
use crate::memory::identity::FirmwareHash;

/// Whether a part that is run on request only is run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Part {
    /// It is not.
    #[default]
    Skip,
    /// It is.
    Run,
}

/// What a multimeter at the pack shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Multimeter {
    /// There is none.
    #[default]
    None,
    /// The owner is asked.
    Ask,
    /// This many volts.
    Shows(f32),
}

/// What is done with the exact `BATT_VOLT_MULT`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Calibrate {
    /// It is in the report.
    #[default]
    Offer,
    /// It is set.
    Apply,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plan {
    /// Provoke a fault.
    pub fault: Part,
    /// Turn the wheels.
    pub motors: Part,
    /// Compare the voltage.
    pub multimeter: Multimeter,
    /// Calibrate it.
    pub calibrate: Calibrate,
    /// The firmware's hash, if it has to be a certain one.
    pub firmware_hash: Option<FirmwareHash>,
}

impl Plan {
    /// What is known before anything is done.
    pub(super) fn nothing_yet(&self) -> Evidence {
        Evidence {
            expected_hash: self.firmware_hash,
            fault: asked(self.fault == Part::Run),
            motors: asked(self.motors == Part::Run),
            calibration: asked(self.multimeter != Multimeter::None),
            ..Evidence::default()
        }
    }
}

fn asked<T>(is_asked: bool) -> Trial<T> {
    if is_asked {
        Trial::NotReached
    } else {
        Trial::NotAsked
    }
}
