//! Failsafes: levels of the packs, actions, and what is announced of them.

use core::fmt;

use crate::announce::{Announce, Severity};
use battery_gauge::FailsafeLevel;

use crate::parameter::{BatteryParameter, PackParameters};

/// The parameter of a level's action.
fn action_parameter(level: FailsafeLevel) -> Option<BatteryParameter> {
    match level {
        FailsafeLevel::None => None,
        FailsafeLevel::Unhealthy => Some(BatteryParameter::FsUnhAct),
        FailsafeLevel::Low => Some(BatteryParameter::FsLowAct),
        FailsafeLevel::Critical => Some(BatteryParameter::FsCrtAct),
    }
}

/// Failsafe action of a low (`BATT_FS_LOW_ACT`), critical (`BATT_FS_CRT_ACT`) or unhealthy (`BATT_FS_UNH_ACT`) pack, with ArduPilot Rover's names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum FailsafeAction {
    /// 0: announce only.
    Warn,
    /// 6: loiter; without a position, Hold.
    LoiterOrHold,
    /// 4: return along the track; without a position, Hold.
    SmartRtlOrHold,
    /// 3: return along the track; without a position, Hold.
    SmartRtl,
    /// 1: return to launch; without a position, Hold.
    Rtl,
    /// 2: enter Hold.
    Hold,
    /// 5: disarm until a restart or a battery reset.
    Terminate,
}

/// Effect of an action without a position, in increasing severity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effect {
    /// Nothing: it is announced only.
    #[default]
    None,
    /// The rover enters Hold.
    Hold,
    /// The rover is disarmed, and stays so.
    Terminate,
}

impl FailsafeAction {
    /// The action with this ArduPilot number.
    pub fn from_number(number: i32) -> Option<Self> {
        Some(match number {
            0 => Self::Warn,
            1 => Self::Rtl,
            2 => Self::Hold,
            3 => Self::SmartRtl,
            4 => Self::SmartRtlOrHold,
            5 => Self::Terminate,
            6 => Self::LoiterOrHold,
            _ => return None,
        })
    }

    /// The most severe of the actions set for these levels of a pack; of equally severe ones that of the last level.
    pub fn from_parameters(pack: PackParameters<'_>, levels: &[FailsafeLevel]) -> Self {
        let actions = levels.iter().map(|level| Self::of_level(pack, *level));
        actions.max_by_key(|action| action.effect()).unwrap_or(Self::Warn)
    }

    fn of_level(pack: PackParameters<'_>, level: FailsafeLevel) -> Self {
        let Some(parameter) = action_parameter(level) else {
            return Self::Warn;
        };
        Self::from_number(pack.get_whole(parameter)).unwrap_or(Self::Warn)
    }

    /// The level whose action this parameter chooses, if a pack at `level` has reached it. A lost pack reaches no threshold, and a
    /// higher level does not say that it was lost.
    pub fn level_of(parameter: BatteryParameter, level: FailsafeLevel) -> Option<FailsafeLevel> {
        let levels: &[FailsafeLevel] = match level {
            FailsafeLevel::Critical => &[FailsafeLevel::Low, FailsafeLevel::Critical],
            _ => &[level],
        };
        let mut levels = levels.iter().copied();
        levels.find(|level| action_parameter(*level) == Some(parameter))
    }

    /// Its effect without a position.
    pub(super) fn effect(self) -> Effect {
        match self {
            Self::Warn => Effect::None,
            Self::LoiterOrHold | Self::SmartRtlOrHold | Self::SmartRtl | Self::Rtl | Self::Hold => {
                Effect::Hold
            }
            Self::Terminate => Effect::Terminate,
        }
    }

    /// Whether it needs a position.
    pub fn needs_position(self) -> bool {
        match self {
            Self::Warn | Self::Hold | Self::Terminate => false,
            Self::LoiterOrHold | Self::SmartRtlOrHold | Self::SmartRtl | Self::Rtl => true,
        }
    }
}

impl fmt::Display for FailsafeAction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Warn => "Warning",
            Self::LoiterOrHold => "Loiter",
            Self::SmartRtlOrHold | Self::SmartRtl => "SmartRTL",
            Self::Rtl => "RTL",
            Self::Hold => "Hold",
            Self::Terminate => "Terminate",
        })
    }
}

/// A state change without an operator's request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum VehicleEvent {
    /// A failsafe action needs a position; the rover enters Hold instead.
    NeedsPosition(FailsafeAction),
    /// A failsafe has terminated the drive: disarmed and locked.
    Terminated,
    /// Control inputs have timed out: Hold.
    ControlsTimedOut,
    /// Heartbeats of ground stations have timed out: Hold.
    GroundStationsTimedOut,
}

impl Announce for VehicleEvent {
    fn severity(&self) -> Severity {
        match self {
            Self::Terminated => Severity::Critical,
            _ => Severity::Warning,
        }
    }
}

impl fmt::Display for VehicleEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NeedsPosition(action) => write!(f, "{action} needs a position: Hold"),
            Self::Terminated => f.write_str("Terminated by battery failsafe"),
            Self::ControlsTimedOut => f.write_str("Radio Failsafe: Hold"),
            Self::GroundStationsTimedOut => f.write_str("GCS Failsafe: Hold"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::Pack;
    use crate::parameter::Parameters;

    #[test]
    // Requirement: AP-19
    fn actions_have_ardupilots_numbers() {
        let texts = "Warning RTL Hold SmartRTL SmartRTL Terminate Loiter".split(' ');
        for (number, text) in (0..).zip(texts) {
            let action = FailsafeAction::from_number(number).expect("an action");
            assert_eq!(action.to_string(), text);
        }
        for number in [-1, 7, i32::MAX] {
            assert_eq!(FailsafeAction::from_number(number), None);
        }
    }

    fn set(parameters: &mut Parameters, pack: Pack, low: f32, critical: f32) {
        for (parameter, number) in [
            (BatteryParameter::FsLowAct, low),
            (BatteryParameter::FsCrtAct, critical),
        ] {
            parameters.set(parameter.of(pack), number).expect("in range");
        }
    }

    #[test]
    fn each_level_of_each_pack_has_its_action() {
        let mut parameters = Parameters::defaults();
        set(&mut parameters, Pack::Second, 2.0, 5.0);
        let action = |pack, level| FailsafeAction::from_parameters(parameters.pack(pack), &[level]);
        for (pack, level, expected) in [
            (Pack::Second, FailsafeLevel::Low, FailsafeAction::Hold),
            (Pack::Second, FailsafeLevel::Critical, FailsafeAction::Terminate),
            (Pack::Second, FailsafeLevel::Unhealthy, FailsafeAction::Warn),
            (Pack::First, FailsafeLevel::Critical, FailsafeAction::Warn),
        ] {
            assert_eq!(action(pack, level), expected, "{pack:?} {level:?}");
        }
    }

    #[test]
    fn of_several_levels_the_most_severe_action_counts() {
        for (low, critical, expected) in [
            (2.0, 0.0, FailsafeAction::Hold),
            (0.0, 2.0, FailsafeAction::Hold),
            (5.0, 2.0, FailsafeAction::Terminate),
            (2.0, 5.0, FailsafeAction::Terminate),
            // Both hold: what is announced is the worst level's.
            (2.0, 1.0, FailsafeAction::Rtl),
            (1.0, 2.0, FailsafeAction::Hold),
        ] {
            let mut parameters = Parameters::defaults();
            set(&mut parameters, Pack::Ninth, low, critical);
            let levels = [FailsafeLevel::Low, FailsafeLevel::Critical];
            let action = FailsafeAction::from_parameters(parameters.pack(Pack::Ninth), &levels);
            assert_eq!(action, expected, "{low} {critical}");
        }
    }
}
