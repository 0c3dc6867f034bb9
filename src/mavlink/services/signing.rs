//! SETUP_SIGNING (256): another key, or none any more.

use super::DISARM_FIRST;
use crate::mavlink::dialect::MavSeverity;
use crate::mavlink::event::{Event, SetupRefused, SigningChange};
use crate::mavlink::replies::Replies;
use crate::mavlink::requests::SetUpSigning;
use crate::mavlink::signing::{LinkKind, Signing};
use crate::time::Instant;
use crate::vehicle::ArmState;

impl SigningChange {
    /// What is announced when it is in flash.
    pub fn text(self) -> &'static str {
        match self {
            Self::KeySet => "Signing key set",
            Self::KeyRemoved => "Signing key removed: commands are accepted from anyone",
        }
    }
}

impl SetupRefused {
    /// What its sender gets as an answer.
    fn text(self) -> &'static str {
        match self {
            Self::NotDirect => "Signing is set up by USB only",
            Self::Armed => DISARM_FIRST,
            Self::BadTime => "Signing not set up: bad timestamp",
        }
    }
}

/// Does what SETUP_SIGNING asks for. MAVLink has no acknowledgement of it, so a text says why it was refused.
pub(in crate::mavlink) fn set_up(
    request: &SetUpSigning,
    link: LinkKind,
    arm_state: ArmState,
    signing: &mut Signing,
    now: Instant,
    mut replies: Replies<'_>,
) -> Event {
    match change(request, link, arm_state, signing, now) {
        Ok(change) => Event::SigningSetUp(change),
        Err(refused) => {
            replies.say(MavSeverity::MAV_SEVERITY_WARNING, refused.text());
            Event::SigningRefused(refused)
        }
    }
}

fn change(
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
