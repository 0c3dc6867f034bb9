//! Which values the parameters of the sticks may have beside each other.

use super::stick_channel::{StickChannel, StickChannels};
use super::table::sticks::LEAST_TRAVEL_US;
use super::{ParameterId, Parameters, Range, StickParameter};
use crate::memory::save_state::SaveState;
use StickParameter::*;

/// Channels of the axes.
const AXES: [StickParameter; 4] = [RcmapRoll, RcmapPitch, RcmapThrottle, RcmapYaw];

/// Shortest, neutral and longest pulse of each channel that has parameters.
const PULSES: [[StickParameter; 3]; 4] = [
    [Rc1Min, Rc1Trim, Rc1Max],
    [Rc2Min, Rc2Trim, Rc2Max],
    [Rc3Min, Rc3Trim, Rc3Max],
    [Rc4Min, Rc4Trim, Rc4Max],
];

/// Directions of these channels.
const DIRECTIONS: [StickParameter; 4] = [Rc1Reversed, Rc2Reversed, Rc3Reversed, Rc4Reversed];

impl Parameters {
    /// The channels of the sticks, as they are set now.
    pub fn stick_channels(&self) -> StickChannels {
        self.stick_channels
    }

    /// Stores a live value, and what follows from it.
    pub(super) fn store(&mut self, id: ParameterId, value: f32) {
        self.values.set(id, value);
        // Read 50 times a second, from ten parameters.
        if matches!(id, ParameterId::Stick(_)) {
            self.stick_channels = StickChannels {
                throttle: self.channel_of(RcmapThrottle),
                steering: self.channel_of(RcmapRoll),
            };
        }
    }

    /// Channels 5 to 8 have no parameters, and the defaults of the others.
    fn channel_of(&self, axis: StickParameter) -> StickChannel {
        // The table's range is 1 to 8.
        let index = (self.get_whole(axis) - 1) as u8;
        let of_channel = PULSES.iter().zip(DIRECTIONS).nth(usize::from(index));
        let Some((pulses, direction)) = of_channel else {
            return StickChannel::with_defaults(index);
        };
        let [shortest_us, neutral_us, longest_us] = pulses.map(|id| self.get(id) as u16);
        StickChannel {
            index,
            shortest_us,
            neutral_us,
            longest_us,
            is_reversed: self.get(direction) != 0.0,
        }
    }

    /// The values that a parameter can be set to: those of its table, of a channel's pulses only those that leave 100 µs to each
    /// side of the neutral one.
    pub fn valid_range(&self, id: ParameterId) -> Range {
        let in_table = id.row().range;
        let (ParameterId::Stick(id), Range::Between(lowest, highest)) = (id, in_table) else {
            return in_table;
        };
        let Some([min, trim, max]) = PULSES.into_iter().find(|pulses| pulses.contains(&id)) else {
            return in_table;
        };
        if id == min {
            Range::Between(lowest, self.get(trim) - LEAST_TRAVEL_US)
        } else if id == trim {
            Range::Between(self.get(min) + LEAST_TRAVEL_US, self.get(max) - LEAST_TRAVEL_US)
        } else {
            Range::Between(self.get(trim) + LEAST_TRAVEL_US, highest)
        }
    }

    /// The other axis that has this channel, if `id` is the channel of an axis.
    pub(super) fn axis_with_channel(&self, id: ParameterId, channel: f32) -> Option<StickParameter> {
        let ParameterId::Stick(axis) = id else { return None };
        let mut others = AXES.into_iter().filter(|other| *other != axis);
        if AXES.contains(&axis) {
            others.find(|other| self.get(*other) == channel)
        } else {
            None
        }
    }

    /// Sets channels whose parameters do not fit each other to their defaults, which are saved then, and returns whether there were any.
    ///
    /// Each change was valid when it was made, but a loss of power may have left only the later ones in flash.
    pub fn mend_sticks(&mut self) -> bool {
        let fits = |id: &StickParameter| {
            let value = self.get(*id);
            self.valid_range((*id).into()).contains(value)
                && self.axis_with_channel((*id).into(), value).is_none()
        };
        let groups: [&[StickParameter]; 5] = [&AXES, &PULSES[0], &PULSES[1], &PULSES[2], &PULSES[3]];
        let damaged = groups.map(|group| !group.iter().all(fits));
        for (group, _) in groups.iter().zip(damaged).filter(|(_, is_damaged)| *is_damaged) {
            for id in group.iter().map(|id| ParameterId::from(*id)) {
                self.store(id, id.default_value());
                self.save_states.set(id, SaveState::New);
            }
        }
        damaged.contains(&true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::Refused;
    use proptest::prelude::*;

    #[test]
    fn pulses_are_positions_by_the_channels_parameters() {
        let mut parameters = Parameters::defaults();
        let steering = parameters.stick_channels().steering;
        assert_eq!(
            (steering, parameters.stick_channels().throttle),
            (StickChannel::STEERING, StickChannel::THROTTLE)
        );
        let positions = [0, 1000, 1250, 1500, 1900, 2000, 2200].map(|us| steering.position(us));
        assert_eq!(positions, [-1000, -1000, -500, 0, 800, 1000, 1000]);
        for (id, value) in [(RcmapThrottle, 5.0), (RcmapRoll, 3.0)] {
            parameters.set(id, value).unwrap();
        }
        for (id, value) in [
            (Rc3Min, 1100.0),
            (Rc3Max, 1900.0),
            (Rc3Trim, 1600.0),
            (Rc3Reversed, 1.0),
        ] {
            parameters.set(id, value).unwrap();
        }
        let steering = parameters.stick_channels().steering;
        let positions = [1100, 1350, 1600, 1750, 1900].map(|us| steering.position(us));
        assert_eq!(positions, [1000, 500, 0, -500, -1000]);
        let pulses = [1, 2, 3, 4, 5, 6, 7, 8];
        assert_eq!(steering.pulse_of(&pulses), Some(3));
        assert_eq!(parameters.stick_channels().throttle.pulse_of(&pulses), Some(5));
        assert_eq!(parameters.stick_channels().throttle.position(1900), 800);
    }

    #[test]
    fn two_axes_on_one_channel_are_refused() {
        let mut parameters = Parameters::defaults();
        assert_eq!(
            parameters.set(RcmapRoll, 3.0),
            Err(Refused::ChannelTaken(RcmapThrottle))
        );
        assert_eq!(parameters.set(RcmapRoll, 1.0), Ok(()));
        assert_eq!(parameters.set(RcmapThrottle, 5.0), Ok(()));
        assert_eq!(parameters.set(RcmapRoll, 3.0), Ok(()));
        assert_eq!(parameters.set(RcmapThrottle, 1.0), Ok(()));
    }

    #[test]
    fn pulses_keep_100_us_to_each_side_of_the_neutral_one() {
        let mut parameters = Parameters::defaults();
        for (id, refused) in [
            (Rc1Min, [799.0, 1401.0]),
            (Rc1Trim, [1099.0, 1901.0]),
            (Rc1Max, [1599.0, 2201.0]),
        ] {
            for value in refused {
                assert_eq!(parameters.set(id, value), Err(Refused::OutOfRange), "{value}");
            }
        }
        for (id, value) in [(Rc1Min, 1400.0), (Rc1Max, 1600.0), (Rc1Trim, 1500.0)] {
            assert_eq!(parameters.set(id, value), Ok(()), "{value}");
        }
    }

    #[test]
    fn what_a_power_cut_left_half_saved_is_at_its_default_and_saved() {
        let mut parameters = Parameters::defaults();
        for (id, value) in [(Rc2Min, 1700.0), (Rc1Max, 1900.0), (RcmapYaw, 5.0)] {
            parameters.restore(id.row().key, value).unwrap();
        }
        assert!(parameters.mend_sticks());
        let values = [Rc2Min, Rc1Max, RcmapYaw].map(|id| parameters.get(id));
        assert_eq!(values, [1000.0, 1900.0, 5.0]);
        assert!(parameters.next_unsaved().is_some());
        assert!(!parameters.mend_sticks());
        parameters.restore(RcmapRoll.row().key, 5.0).unwrap();
        assert!(parameters.mend_sticks());
        assert_eq!(AXES.map(|id| parameters.get(id)), [1.0, 2.0, 3.0, 4.0]);
    }

    proptest! {
        #[test]
        fn whatever_is_set_every_position_is_in_range_and_the_neutral_pulse_is_0(
            changes in prop::collection::vec((0..StickParameter::COUNT, 0.0f32..2300.0), 0..60),
            pulse_us: u16,
        ) {
            let mut parameters = Parameters::defaults();
            for (number, value) in changes {
                let id = StickParameter::ALL[number];
                let value = if value < 300.0 { value / 30.0 } else { value };
                let _ = parameters.set(id, value);
            }
            for channel in [parameters.stick_channels().steering, parameters.stick_channels().throttle] {
                prop_assert!((-1000..=1000).contains(&channel.position(pulse_us)));
                prop_assert_eq!(channel.position(channel.neutral_us), 0);
                prop_assert_eq!(channel.position(channel.shortest_us).abs(), 1000);
                prop_assert_eq!(channel.position(channel.longest_us).abs(), 1000);
            }
            prop_assert_ne!(parameters.stick_channels().steering.index, parameters.stick_channels().throttle.index);
            prop_assert!(!parameters.mend_sticks());
        }
    }
}
