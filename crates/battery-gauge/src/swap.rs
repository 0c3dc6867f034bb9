//! Detection of a swapped pack.

use crate::LoadState;
use crate::rest::Rest;

/// Minimum loss of contact for a swap, in seconds.
const MIN_CONTACT_LOSS_S: f32 = 1.0;

/// Relative change of the resting voltage that still is the same pack: 0.25 V of a lithium cell, more than a cell
/// recovers after a heavy load once its voltage is stable.
const MAX_RECOVERY: f32 = 0.08;

/// Consecutive readings that confirm a changed serial number: half a second at 10 Hz.
const CONFIRMING_READINGS: u8 = 5;

/// Certainty of a swap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Replacement {
    /// The pack rests at more than the previous one can recover to, or has another serial number.
    Certain,
    /// The pack rests at another voltage. A poor contact looks the same, so a failsafe stays latched.
    Likely,
}

/// Whether the charge may be that of another pack, or read from another voltage, until the pack rests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Doubt {
    #[default]
    None,
    /// The contact was lost, for too short a time to put another pack in.
    ShortLoss,
    /// Another pack may have been put in with the load off.
    ContactLoss,
    /// The voltage has another scale.
    Rescaled,
}

/// A rest that ends a doubt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AtRest {
    Replaced(Replacement),
    /// By this resting voltage, in volts, the same, or another one at a similar voltage.
    Similar(f32),
    /// The charge was read from another voltage than this one, in volts.
    Rescaled(f32),
}

/// Detects a swap by the resting voltage after a loss of contact, with the load off. Without a loss of contact a rising
/// voltage is recovery from load.
#[derive(Clone, Copy, Debug)]
pub struct SwapDetector {
    rest: Rest,
    doubt: Doubt,
    /// Duration without contact since the pack was last at rest, in seconds.
    contact_loss_s: f32,
    /// The latest resting voltage since the load is off, in volts.
    resting_v: Option<f32>,
    /// The maximum of these and of the last voltage under load, in volts: a lower bound of the pack's charge.
    highest_v: Option<f32>,
}

impl SwapDetector {
    pub const fn new() -> Self {
        Self {
            rest: Rest::new(),
            doubt: Doubt::None,
            contact_loss_s: 0.0,
            resting_v: None,
            highest_v: None,
        }
    }

    /// There was no pack voltage for `dt_s` seconds.
    pub fn lose_contact(&mut self, dt_s: f32, load_state: LoadState) {
        match load_state {
            LoadState::Off => {
                self.rest.reset();
                self.contact_loss_s += dt_s;
                self.doubt = match self.doubt {
                    Doubt::Rescaled => Doubt::Rescaled,
                    Doubt::None | Doubt::ShortLoss if self.contact_loss_s <= MIN_CONTACT_LOSS_S => {
                        Doubt::ShortLoss
                    }
                    _ => Doubt::ContactLoss,
                };
            }
            LoadState::On => self.clear_rest(),
        }
    }

    /// Processes a reading of a connected pack. A pack is not swapped under load: a lost voltage is a bad contact
    /// then, and a stable one may be under load.
    pub fn update(
        &mut self,
        dt_s: f32,
        voltage_v: f32,
        current_a: Option<f32>,
        load_state: LoadState,
    ) -> Option<AtRest> {
        if load_state == LoadState::On {
            self.clear_rest();
            self.highest_v = Some(voltage_v);
            return None;
        }
        let resting_v = self.rest.update(dt_s, voltage_v, current_a)?;
        let contact_was_lost = core::mem::take(&mut self.contact_loss_s) > MIN_CONTACT_LOSS_S;
        let otherwise = match core::mem::take(&mut self.doubt) {
            Doubt::None | Doubt::ShortLoss => None,
            Doubt::ContactLoss => Some(AtRest::Similar(resting_v)),
            Doubt::Rescaled => Some(AtRest::Rescaled(resting_v)),
        };
        let Some(before_v) = self.resting_v.replace(resting_v) else {
            return otherwise;
        };
        let highest_v = self
            .highest_v
            .map_or(before_v, |highest_v| highest_v.max(before_v));
        self.highest_v = Some(highest_v);
        let is_swapped = contact_was_lost && (resting_v - before_v).abs() > MAX_RECOVERY * before_v;
        if !is_swapped {
            return otherwise;
        }
        let replacement = if resting_v > highest_v * (1.0 + MAX_RECOVERY) {
            Replacement::Certain
        } else {
            Replacement::Likely
        };
        Some(AtRest::Replaced(replacement))
    }

    /// Whether the charge is in doubt until the pack rests.
    pub fn doubt(&self) -> Doubt {
        self.doubt
    }

    /// The voltage has another scale from here on.
    pub fn rescale(&mut self) {
        self.doubt = Doubt::Rescaled;
    }

    /// The resting voltage, if the pack is at rest.
    pub fn resting_v(&self) -> Option<f32> {
        self.rest.voltage_v()
    }

    /// Continues with the doubt that was retained over a restart.
    pub fn restore(&mut self, doubt: Doubt) {
        self.doubt = doubt;
    }

    /// The owner says what the charge of this pack is.
    pub fn end_doubt(&mut self) {
        self.doubt = Doubt::None;
    }

    /// Forgets the voltages of the previous pack.
    pub fn reset(&mut self) {
        self.clear_rest();
        self.doubt = Doubt::None;
        self.highest_v = None;
    }

    #[inline(never)]
    fn clear_rest(&mut self) {
        self.rest.reset();
        self.contact_loss_s = 0.0;
        if self.doubt == Doubt::ShortLoss {
            self.doubt = Doubt::None;
        }
        self.resting_v = None;
    }
}

/// Serial number of a smart battery, debounced against misreadings.
#[derive(Clone, Copy, Debug, Default)]
pub struct SerialNumber {
    known: Option<i32>,
    /// A different one, and its consecutive readings with the load off.
    candidate: Option<(i32, u8)>,
}

impl SerialNumber {
    /// Continues with the number that was retained over a restart.
    pub fn restore(&mut self, known: Option<i32>) {
        self.known = known;
    }

    /// The number to retain over a restart.
    pub fn known(&self) -> Option<i32> {
        self.known
    }

    /// Processes the serial number of a reading, if it has one.
    pub fn update(&mut self, serial_number: Option<i32>, load_state: LoadState) -> Option<Replacement> {
        let before = self.candidate.take();
        let known = *self.known.get_or_insert(serial_number?);
        let read = serial_number.filter(|read| *read != known && load_state == LoadState::Off)?;
        let readings = match before {
            Some((candidate, readings)) if candidate == read => readings.saturating_add(1),
            _ => 1,
        };
        if readings < CONFIRMING_READINGS {
            self.candidate = Some((read, readings));
            return None;
        }
        self.known = Some(read);
        Some(Replacement::Certain)
    }

    /// A read failed: readings before and after are not consecutive.
    pub fn read_failed(&mut self) {
        self.candidate = None;
    }

    /// Whether a reading may be of the known battery.
    pub fn matches(&self, serial_number: Option<i32>) -> bool {
        serial_number.is_none() || serial_number == self.known
    }
}
