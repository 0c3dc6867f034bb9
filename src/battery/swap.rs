//! Whether another pack was put in.

use super::failsafe::ArmState;
use super::rest::Rest;

/// A pack that was without contact for longer may have been changed, in seconds.
const GONE_S: f32 = 1.0;

/// A pack that rests within this share of its voltage before is the same one: 0.25 V of a lithium cell, more than a cell
/// that was driven hard still recovers once its voltage has come to rest.
const RECOVERY: f32 = 0.08;

/// A changed serial number counts when it was read so often in a row: half a second at 10 Hz.
const SERIAL_READINGS: u8 = 5;

/// Another pack stands in the place of the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Replacement {
    /// It rests higher than the pack before can recover to, or has another serial number.
    Certain,
    /// It rests at another voltage. A poor contact may look alike, so nothing is held less against the pack.
    Likely,
}

/// Recognises another pack by the voltage at which it rests after a loss of contact, while disarmed. Without a loss of
/// contact a voltage that rises is a pack that recovers from its load.
#[derive(Clone, Copy, Debug)]
pub(super) struct SwapDetector {
    rest: Rest,
    /// How long there was no contact since the pack has rested, in seconds.
    gone_s: f32,
    /// The latest voltage at rest since the rover was disarmed, in volts.
    resting_v: Option<f32>,
    /// The highest of them and of the last one while armed, in volts: at least so full is the pack before.
    highest_v: Option<f32>,
}

impl SwapDetector {
    pub const fn new() -> Self {
        Self {
            rest: Rest::new(),
            gone_s: 0.0,
            resting_v: None,
            highest_v: None,
        }
    }

    /// There was no voltage of a pack for `dt_s` seconds.
    pub fn lose_contact(&mut self, dt_s: f32, arm_state: ArmState) {
        match arm_state {
            ArmState::Disarmed => {
                self.rest.restart();
                self.gone_s += dt_s;
            }
            ArmState::Armed => self.forget_rest(),
        }
    }

    /// Takes a reading of a connected pack. The pack of an armed rover is not changed: a voltage that comes and goes there
    /// is a bad contact, and one that stands still may do so under a load.
    pub fn update(
        &mut self,
        dt_s: f32,
        voltage_v: f32,
        current_a: Option<f32>,
        arm_state: ArmState,
    ) -> Option<Replacement> {
        if arm_state == ArmState::Armed {
            self.forget_rest();
            self.highest_v = Some(voltage_v);
            return None;
        }
        let resting_v = self.rest.update(dt_s, voltage_v, current_a)?;
        let was_gone = core::mem::take(&mut self.gone_s) > GONE_S;
        let before_v = self.resting_v.replace(resting_v)?;
        let highest_v = self
            .highest_v
            .map_or(before_v, |highest_v| highest_v.max(before_v));
        self.highest_v = Some(highest_v);
        let is_other = was_gone && (resting_v - before_v).abs() > RECOVERY * before_v;
        let replacement = if resting_v > highest_v * (1.0 + RECOVERY) {
            Replacement::Certain
        } else {
            Replacement::Likely
        };
        is_other.then_some(replacement)
    }

    /// The voltage at which the pack rests now, if it does.
    pub fn resting_v(&self) -> Option<f32> {
        self.rest.voltage_v()
    }

    /// What is known of voltages is of another pack.
    pub fn forget(&mut self) {
        self.forget_rest();
        self.highest_v = None;
    }

    #[inline(never)]
    fn forget_rest(&mut self) {
        self.rest.restart();
        self.gone_s = 0.0;
        self.resting_v = None;
    }
}

/// Follows the serial number of a smart battery. One that is misread is no other battery.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SerialNumber {
    known: Option<i32>,
    /// Another one, and how often it was read in a row while disarmed.
    candidate: Option<(i32, u8)>,
}

impl SerialNumber {
    /// Takes the serial number of a reading, if it has one.
    pub fn update(&mut self, serial_number: Option<i32>, arm_state: ArmState) -> Option<Replacement> {
        let before = self.candidate.take();
        let known = *self.known.get_or_insert(serial_number?);
        let read = serial_number.filter(|read| *read != known && arm_state == ArmState::Disarmed)?;
        let readings = match before {
            Some((candidate, readings)) if candidate == read => readings.saturating_add(1),
            _ => 1,
        };
        if readings < SERIAL_READINGS {
            self.candidate = Some((read, readings));
            return None;
        }
        self.known = Some(read);
        Some(Replacement::Certain)
    }

    /// A reading failed: what was read before and is read after is not in a row.
    pub fn miss(&mut self) {
        self.candidate = None;
    }

    /// Whether this may be a reading of the known battery.
    pub fn fits(&self, serial_number: Option<i32>) -> bool {
        serial_number.is_none() || serial_number == self.known
    }
}
