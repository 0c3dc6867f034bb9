//! SETUP_SIGNING (256): another key, or none any more.

use core::fmt;

use super::{Context, DISARM_FIRST};
use crate::announce::{Announce, Severity};
use crate::mavlink::event::{Event, SetupRefused, SigningChange};
use crate::mavlink::requests::SetUpSigning;
use crate::mavlink::signing::LinkKind;
use crate::vehicle::ArmState;

impl Announce for SigningChange {
    fn severity(&self) -> Severity {
        Severity::Info
    }
}

impl fmt::Display for SigningChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::KeySet => "Signing key set",
            Self::KeyRemoved => "Signing key removed: commands are accepted from anyone",
        })
    }
}

impl SetupRefused {
    /// The answer to its sender.
    fn text(self) -> &'static str {
        match self {
            Self::NotDirect => "Signing is set up by USB only",
            Self::Armed => DISARM_FIRST,
            Self::BadTime => "Signing not set up: bad timestamp",
        }
    }
}

/// Does what SETUP_SIGNING asks for. MAVLink has no acknowledgement of it, so a text says why it was refused.
pub fn set_up(request: &SetUpSigning, context: &mut Context<'_>) -> Event {
    match change(request, context) {
        Ok(change) => Event::SigningSetUp(change),
        Err(refused) => {
            context.outbox.say(Severity::Warning, refused.text());
            Event::SigningRefused(refused)
        }
    }
}

fn change(request: &SetUpSigning, context: &mut Context<'_>) -> Result<SigningChange, SetupRefused> {
    if context.link != LinkKind::Direct {
        return Err(SetupRefused::NotDirect);
    }
    if context.changeable.vehicle.arm_state() == ArmState::Armed {
        return Err(SetupRefused::Armed);
    }
    let time = request.time.ok_or(SetupRefused::BadTime)?;
    let change = match request.key {
        Some(_) => SigningChange::KeySet,
        None => SigningChange::KeyRemoved,
    };
    let signing = &mut *context.changeable.signing;
    signing.set_up(request.key.clone(), time, context.now);
    Ok(change)
}
