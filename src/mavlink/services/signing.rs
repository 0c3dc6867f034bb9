//! SETUP_SIGNING (256): another key, or none any more.

use super::DISARM_FIRST;
use crate::battery::ArmState;
use crate::mavlink::requests::SetUpSigning;
use crate::mavlink::signing::{LinkKind, Signing};
use crate::time::Instant;

/// What a ground station has set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum SigningChange {
    /// A key.
    KeySet,
    /// That there is none any more.
    KeyRemoved,
}

impl SigningChange {
    /// What is announced when it is in flash.
    pub fn text(self) -> &'static str {
        match self {
            Self::KeySet => "Signing key set",
            Self::KeyRemoved => "Signing key removed: commands are accepted from anyone",
        }
    }
}

/// Why nothing was set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum SetupRefused {
    /// The key would have been heard by everyone near.
    NotDirect,
    /// The initial timestamp has more than 48 bits.
    BadTime,
    /// Flash may have no space for the key that is erased, and can't get any while the rover may be moving.
    Armed,
}

impl SetupRefused {
    /// What its sender gets as an answer.
    pub fn text(self) -> &'static str {
        match self {
            Self::NotDirect => "Signing is set up by USB only",
            Self::Armed => DISARM_FIRST,
            Self::BadTime => "Signing not set up: bad timestamp",
        }
    }
}

/// Does what SETUP_SIGNING asks for.
pub(in crate::mavlink) fn set_up(
    request: &SetUpSigning,
    link: LinkKind,
    arm_state: ArmState,
    signing: &mut Signing,
    now: Instant,
) -> Result<SigningChange, SetupRefused> {
    if link != LinkKind::Direct {
        return Err(SetupRefused::NotDirect);
    }
    if arm_state == ArmState::Armed {
        return Err(SetupRefused::Armed);
    }
    let time = request.time.ok_or(SetupRefused::BadTime)?;
    let change = match request.key {
        Some(_) => SigningChange::KeySet,
        None => SigningChange::KeyRemoved,
    };
    signing.set_up(request.key.clone(), time, now);
    Ok(change)
}
