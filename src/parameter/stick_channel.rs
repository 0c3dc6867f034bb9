//! The channels of the sticks, and what their pulses mean.

use super::table::sticks::{LONGEST_US, SHORTEST_US};

/// The channel of an axis, and what its pulses mean.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct StickChannel {
    /// From 0 for the first channel.
    pub(super) index: u8,
    pub(super) shortest_us: u16,
    pub(super) neutral_us: u16,
    pub(super) longest_us: u16,
    pub(super) is_reversed: bool,
}

impl StickChannel {
    /// The default of the steering.
    pub const STEERING: Self = Self::with_defaults(0);

    /// The default of the throttle.
    pub const THROTTLE: Self = Self::with_defaults(2);

    /// A channel that has no parameters.
    pub(super) const fn with_defaults(index: u8) -> Self {
        Self {
            index,
            shortest_us: 1000,
            neutral_us: 1500,
            longest_us: 2000,
            is_reversed: false,
        }
    }

    /// Its number, from 1 (`RC1`).
    pub fn number(&self) -> u8 {
        self.index + 1
    }

    /// Its pulse among those of all channels, in microseconds.
    pub fn pulse_of(&self, pulses_us: &[u16]) -> Option<u16> {
        pulses_us.get(usize::from(self.index)).copied()
    }

    /// The stick's position for a pulse, from −1000 to 1000; a pulse beyond the shortest or longest is full deflection. `None` of one
    /// that no receiver sends.
    pub fn position(&self, pulse_us: u16) -> Option<i16> {
        if !(SHORTEST_US as u16..=LONGEST_US as u16).contains(&pulse_us) {
            return None;
        }
        // `clamp` would be a panicking path.
        let pulse_us = pulse_us.max(self.shortest_us).min(self.longest_us);
        let deflection_us = i32::from(pulse_us) - i32::from(self.neutral_us);
        let travel_us = if deflection_us < 0 {
            self.neutral_us.saturating_sub(self.shortest_us)
        } else {
            self.longest_us.saturating_sub(self.neutral_us)
        };
        // At least 100 µs, as the parameters fit each other.
        let position = deflection_us * 1000 / i32::from(travel_us.max(1));
        Some((if self.is_reversed { -position } else { position }) as i16)
    }
}

/// The channels of both sticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StickChannels {
    /// `RCMAP_THROTTLE`.
    pub throttle: StickChannel,
    /// `RCMAP_ROLL`.
    pub steering: StickChannel,
}

impl Default for StickChannels {
    fn default() -> Self {
        Self {
            throttle: StickChannel::THROTTLE,
            steering: StickChannel::STEERING,
        }
    }
}

/// Values of the sticks' parameters in force: of a group that does not fit the last ones that did, after a start the defaults.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sticks {
    /// Numbers of the channels.
    pub(super) throttle: u8,
    pub(super) steering: u8,
    pub(super) channels: [StickChannel; 4],
}

impl Sticks {
    pub fn defaults() -> Self {
        Self {
            throttle: StickChannel::THROTTLE.number(),
            steering: StickChannel::STEERING.number(),
            channels: [0, 1, 2, 3].map(StickChannel::with_defaults),
        }
    }

    pub fn in_force(&self) -> StickChannels {
        StickChannels {
            throttle: self.channel(self.throttle),
            steering: self.channel(self.steering),
        }
    }

    /// Channels 5 to 8 have no parameters, and the defaults of the others.
    fn channel(&self, number: u8) -> StickChannel {
        // The table's range is 1 to 8.
        let index = number.saturating_sub(1);
        let channel = self.channels.get(usize::from(index)).copied();
        channel.unwrap_or(StickChannel::with_defaults(index))
    }
}
