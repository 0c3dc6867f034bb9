//! Switching a solar charger, as ArduPilot does.

use super::event::ChargerPower;
use super::setup::CanOptions;
use crate::time::Instant;
use crate::vehicle::ArmState;

/// A charger that has not confirmed is asked again after this time, in microseconds.
const RETRY_US: u64 = 1_000_000;

/// State of a pack's charger.
#[derive(Debug)]
pub(super) struct Charger {
    arm_state: ArmState,
    wanted: Option<Wanted>,
}

#[derive(Debug)]
struct Wanted {
    power: ChargerPower,
    /// Id of the latest request; `None` before the first.
    transfer_id: Option<u8>,
    /// When the next request is due.
    due: Instant,
}

/// A request that is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SwitchRequest {
    pub power: ChargerPower,
    /// The charger has not confirmed it yet.
    pub is_repeated: bool,
}

impl Charger {
    /// It is found: at the rover's start, as a rule.
    pub fn found(options: CanOptions) -> Self {
        let power = if options.has(CanOptions::ON_AT_BOOT) {
            Some(ChargerPower::On)
        } else if options.has(CanOptions::OFF_AT_BOOT) {
            Some(ChargerPower::Off)
        } else {
            None
        };
        Self {
            arm_state: ArmState::Disarmed,
            wanted: power.map(Wanted::new),
        }
    }

    /// A ground station switches it.
    pub fn switch(&mut self, power: ChargerPower) {
        self.wanted = Some(Wanted::new(power));
    }

    /// The request to send now, with this id.
    pub fn poll(
        &mut self,
        options: CanOptions,
        arm_state: ArmState,
        transfer_id: u8,
        now: Instant,
    ) -> Option<SwitchRequest> {
        let before = core::mem::replace(&mut self.arm_state, arm_state);
        match (before, arm_state) {
            (ArmState::Disarmed, ArmState::Armed) if options.has(CanOptions::ON_AT_ARM) => {
                self.wanted = Some(Wanted::new(ChargerPower::On));
            }
            (ArmState::Armed, ArmState::Disarmed) if options.has(CanOptions::OFF_AT_DISARM) => {
                self.wanted = Some(Wanted::new(ChargerPower::Off));
            }
            _ => {}
        }
        let wanted = self.wanted.as_mut()?;
        if now < wanted.due {
            return None;
        }
        wanted.due = now.after_us(RETRY_US);
        let before = wanted.transfer_id.replace(transfer_id);
        Some(SwitchRequest {
            power: wanted.power,
            is_repeated: before.is_some(),
        })
    }

    /// Takes the answer to the request with this id: what the output is now.
    pub fn confirm(&mut self, transfer_id: u8, power: ChargerPower) {
        let is_done = |wanted: &Wanted| wanted.power == power && wanted.transfer_id == Some(transfer_id);
        if self.wanted.as_ref().is_some_and(is_done) {
            self.wanted = None;
        }
    }
}

impl Wanted {
    fn new(power: ChargerPower) -> Self {
        Self {
            power,
            transfer_id: None,
            due: Instant::EPOCH,
        }
    }
}
