//! The channels of the sticks, by parameters that have to fit each other.

use super::stick_channel::StickChannels;
use super::table::sticks::LEAST_TRAVEL_US;
use super::{Parameters, StickParameter};
use StickParameter::*;

/// Parameters that have to fit each other.
type Group = [StickParameter; 4];

/// The channels of the axes, then what each channel means, as they stand in the table.
const GROUPS: &[Group] = StickParameter::ALL.as_chunks().0;

/// Axes that may not have the same channel. Pitch and yaw, which have no function, may.
const AXES: [(StickParameter, StickParameter); 5] = [
    (RcmapThrottle, RcmapRoll),
    (RcmapThrottle, RcmapPitch),
    (RcmapThrottle, RcmapYaw),
    (RcmapRoll, RcmapPitch),
    (RcmapRoll, RcmapYaw),
];

impl Parameters {
    /// The channels of the sticks, as they are in force.
    pub fn stick_channels(&self) -> StickChannels {
        self.sticks.in_force()
    }

    /// Parameters of the throttle's and the steering's channel that do not fit each other, in pairs.
    pub fn stick_misfits(&self) -> impl Iterator<Item = (StickParameter, StickParameter)> {
        let channels = [RcmapThrottle, RcmapRoll].map(|axis| self.get_whole(axis) as usize);
        let groups = GROUPS.iter().enumerate();
        let concerned = groups.filter(move |(number, _)| *number == 0 || channels.contains(number));
        concerned.filter_map(|(_, group)| self.misfit(group))
    }

    /// The first two of a group that do not fit each other.
    fn misfit(&self, group: &Group) -> Option<(StickParameter, StickParameter)> {
        let [min, max, trim, _] = *group;
        if min == RcmapRoll {
            return AXES.into_iter().find(|(a, b)| self.get(*a) == self.get(*b));
        }
        let has_travel = |(shorter, longer)| self.get(longer) - self.get(shorter) >= LEAST_TRAVEL_US;
        [(min, trim), (trim, max)]
            .into_iter()
            .find(|pair| !has_travel(*pair))
    }

    /// Brings the group of a parameter into force that was set, or loaded from flash.
    pub(super) fn follow_sticks(&mut self, written: StickParameter) {
        let mut groups = (0..).zip(GROUPS);
        let Some((number, group)) = groups.find(|(_, group)| group.contains(&written)) else {
            return;
        };
        let fits = self.misfit(group).is_none();
        if !fits && self.unsaved.contains(written.into()) {
            return;
        }
        let values = group.map(|id| if fits { self.get(id) } else { id.row().default } as u16);
        if number == 0 {
            [self.sticks.steering, _, self.sticks.throttle, _] = values.map(|number| number as u8);
        } else if let Some(channel) = self.sticks.channels.get_mut(number - 1) {
            let reversed;
            [
                channel.shortest_us,
                channel.longest_us,
                channel.neutral_us,
                reversed,
            ] = values;
            channel.is_reversed = reversed != 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::Refused;
    use crate::parameter::stick_channel::StickChannel;
    use proptest::prelude::*;

    #[test]
    fn pulses_are_positions_by_the_channels_parameters() {
        let mut parameters = Parameters::defaults();
        let steering = parameters.stick_channels().steering;
        assert_eq!(
            (steering, parameters.stick_channels().throttle),
            (StickChannel::STEERING, StickChannel::THROTTLE)
        );
        let positions = [800, 1000, 1250, 1500, 1900, 2000, 2200].map(|us| steering.position(us));
        assert_eq!(positions, [-1000, -1000, -500, 0, 800, 1000, 1000].map(Some));
        for (id, value) in [
            (RcmapThrottle, 5.0),
            (RcmapRoll, 3.0),
            (Rc3Min, 1100.0),
            (Rc3Max, 1900.0),
            (Rc3Trim, 1600.0),
            (Rc3Reversed, 1.0),
        ] {
            parameters.set(id, value).unwrap();
        }
        let steering = parameters.stick_channels().steering;
        let positions = [1100, 1350, 1600, 1750, 1900].map(|us| steering.position(us));
        assert_eq!(positions, [1000, 500, 0, -500, -1000].map(Some));
        let pulses = [1, 2, 3, 4, 5, 6, 7, 8];
        assert_eq!(steering.pulse_of(&pulses), Some(3));
        assert_eq!(parameters.stick_channels().throttle.pulse_of(&pulses), Some(5));
        assert_eq!(parameters.stick_channels().throttle.position(1900), Some(800));
    }

    fn misfits(parameters: &Parameters) -> Vec<(StickParameter, StickParameter)> {
        parameters.stick_misfits().collect()
    }

    #[test]
    fn two_axes_on_one_channel_are_taken_and_do_not_fit() {
        let mut parameters = Parameters::defaults();
        let before = parameters.stick_channels();
        assert_eq!(parameters.set(RcmapRoll, 3.0), Ok(()));
        assert_eq!(misfits(&parameters), [(RcmapThrottle, RcmapRoll)]);
        assert_eq!(parameters.stick_channels(), before);
        assert_eq!(parameters.set(RcmapThrottle, 1.0), Ok(()));
        assert_eq!(misfits(&parameters), []);
        let swapped = StickChannels {
            throttle: before.steering,
            steering: before.throttle,
        };
        assert_eq!(parameters.stick_channels(), swapped);
    }

    #[test]
    fn pulses_keep_100_us_to_each_side_of_the_neutral_one_or_do_not_fit() {
        for (id, misfit, fits) in [
            (Rc1Min, 1401.0, 1400.0),
            (Rc1Trim, 1099.0, 1100.0),
            (Rc1Trim, 1901.0, 1900.0),
            (Rc1Max, 1599.0, 1600.0),
        ] {
            let mut parameters = Parameters::defaults();
            let before = parameters.stick_channels();
            assert_eq!(parameters.set(id, misfit), Ok(()), "{misfit}");
            assert_eq!(misfits(&parameters).len(), 1, "{misfit}");
            assert_eq!(parameters.stick_channels(), before, "{misfit}");
            assert_eq!(parameters.set(id, fits), Ok(()), "{fits}");
            assert_eq!(misfits(&parameters), [], "{fits}");
            assert_ne!(parameters.stick_channels(), before, "{fits}");
        }
        for (id, value) in [
            (Rc1Min, 799.0),
            (Rc1Min, 2001.0),
            (Rc1Trim, 899.0),
            (Rc1Max, 2201.0),
        ] {
            let set = Parameters::defaults().set(id, value);
            assert_eq!(set, Err(Refused::OutOfRange), "{value}");
        }
    }

    #[test]
    fn what_a_power_cut_left_half_saved_drives_by_its_defaults_and_is_kept() {
        let stored = [
            (Rc2Min, 1700.0),
            (Rc1Max, 1900.0),
            (RcmapYaw, 5.0),
            (RcmapRoll, 5.0),
        ];
        for turn in 0..stored.len() {
            let mut parameters = Parameters::defaults();
            let mut loaded = stored;
            loaded.rotate_left(turn);
            for (id, value) in loaded {
                parameters.restore(id.row().key, value).unwrap();
            }
            assert_eq!(misfits(&parameters), [(RcmapRoll, RcmapYaw)]);
            let StickChannels { throttle, steering } = parameters.stick_channels();
            assert_eq!((throttle, steering.index), (StickChannel::THROTTLE, 0));
            assert_eq!(steering.longest_us, 1900);
            assert_eq!(
                stored.map(|(id, _)| parameters.get(id)),
                stored.map(|(_, value)| value)
            );
            assert_eq!(parameters.next_unsaved(), None);
            // The second half.
            parameters.set(RcmapYaw, 2.0).unwrap();
            parameters.set(RcmapPitch, 1.0).unwrap();
            assert_eq!(parameters.stick_channels().steering.index, 4);
            parameters.set(RcmapRoll, 6.0).unwrap();
            parameters.set(RcmapThrottle, 2.0).unwrap();
            let expected = [(RcmapThrottle, RcmapYaw), (Rc2Min, Rc2Trim)];
            assert_eq!(misfits(&parameters), expected);
        }
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
                if misfits(&parameters).is_empty() {
                    let channels = parameters.stick_channels();
                    prop_assert_eq!(f32::from(channels.throttle.number()), parameters.get(RcmapThrottle));
                    prop_assert_eq!(f32::from(channels.steering.number()), parameters.get(RcmapRoll));
                }
            }
            for channel in [parameters.stick_channels().steering, parameters.stick_channels().throttle] {
                let is_valid = |position| (-1000..=1000).contains(&position);
                prop_assert!(channel.position(pulse_us).is_none_or(is_valid));
                prop_assert_eq!(channel.position(channel.neutral_us), Some(0));
                for full_us in [channel.shortest_us, channel.longest_us] {
                    prop_assert_eq!(channel.position(full_us).map(i16::abs), Some(1000));
                }
            }
            prop_assert_ne!(parameters.stick_channels().steering.index, parameters.stick_channels().throttle.index);
        }
    }
}
