//! Parameters by name: their own, and those that ArduPilot 4.7 gave to some.

use heapless::String;

use super::parameters::whole_number;
use super::{MAX_NAME_LENGTH, ParameterId, VehicleParameter};

/// Names of ArduPilot 4.7 for parameters that have those of 4.6 here.
pub(super) const NEWER_NAMES: [(&str, VehicleParameter); 4] = [
    ("MAV_SYSID", VehicleParameter::SysidThismav),
    ("MAV1_EXTRA1", VehicleParameter::Sr0Extra1),
    ("MAV1_PARAMS", VehicleParameter::Sr0Params),
    (SKIPPED_CHECKS, VehicleParameter::ArmingCheck),
];

/// The only one with a coding of its own: the checks to skip instead of those to do.
const SKIPPED_CHECKS: &str = "ARMING_SKIPCHK";

/// `ARMING_CHECK`: bit 0 stands for every check, and each check has a bit.
const ALL_CHECKS: i32 = 1;
const EACH_CHECK: i32 = 1 << 6 | 1 << 8 | 1 << 10;

/// `ARMING_SKIPCHK` that skips every check.
const SKIP_ALL: i32 = -1;

/// A parameter by one of its names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NamedParameter {
    /// The parameter.
    pub id: ParameterId,
    newer_name: Option<&'static str>,
}

impl NamedParameter {
    /// The parameter with this name, case-insensitive.
    pub fn from_name(name: &[u8]) -> Option<Self> {
        let is_meant = |newer: &&(&str, _)| newer.0.as_bytes().eq_ignore_ascii_case(name);
        let newer = NEWER_NAMES.iter().find(is_meant);
        match newer {
            Some((newer_name, parameter)) => Some(Self {
                id: ParameterId::from(*parameter),
                newer_name: Some(newer_name),
            }),
            None => ParameterId::from_name(name).map(Self::from),
        }
    }

    /// This name.
    pub fn name(&self) -> String<MAX_NAME_LENGTH> {
        match self.newer_name {
            Some(newer_name) => String::try_from(newer_name).unwrap_or_default(),
            None => self.id.name(),
        }
    }

    /// Whether it is a name of ArduPilot 4.7, which no list has.
    pub fn is_newer(&self) -> bool {
        self.newer_name.is_some()
    }

    /// The parameter's value for one under this name. NaN and infinity are kept, to be out of range.
    pub fn to_own(&self, value: f32) -> f32 {
        if self.newer_name != Some(SKIPPED_CHECKS) || !value.is_finite() {
            return value;
        }
        let skipped = whole_number(value) as i32 & EACH_CHECK;
        let own = match EACH_CHECK & !skipped {
            EACH_CHECK => ALL_CHECKS,
            rest => rest,
        };
        own as f32
    }

    /// The value under this name for the parameter's.
    pub fn from_own(&self, own: f32) -> f32 {
        if self.newer_name != Some(SKIPPED_CHECKS) {
            return own;
        }
        let own = own as i32;
        let skipped = match own & EACH_CHECK {
            _ if own & ALL_CHECKS != 0 => 0,
            0 => SKIP_ALL,
            rest => EACH_CHECK & !rest,
        };
        skipped as f32
    }
}

impl From<ParameterId> for NamedParameter {
    fn from(id: ParameterId) -> Self {
        Self { id, newer_name: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    // Requirement: AP-29
    fn skipped_checks_are_the_rest_of_those_to_do() {
        let named = NamedParameter::from_name(b"arming_skipchk").expect("a name");
        for (skipped, checks, read) in [
            (0.0, 1.0, 0.0),
            (64.0, 1280.0, 64.0),
            (256.0, 1088.0, 256.0),
            (1024.0, 320.0, 1024.0),
            (320.0, 1024.0, 320.0),
            (1088.0, 256.0, 1088.0),
            (1280.0, 64.0, 1280.0),
            (1344.0, 0.0, -1.0),
            (-1.0, 0.0, -1.0),
            // Checks that are unknown here.
            (1.0, 1.0, 0.0),
            (65.0, 1280.0, 64.0),
            (-65.0, 64.0, 1280.0),
            (-1345.0, 1.0, 0.0),
            (524_288.0, 1.0, 0.0),
            (1e10, 0.0, -1.0),
            (-1e10, 1.0, 0.0),
        ] {
            assert_eq!(named.to_own(skipped), checks, "{skipped}");
            assert_eq!(named.from_own(checks), read, "{checks}");
        }
        assert!(named.to_own(f32::NAN).is_nan());
        assert_eq!(named.to_own(f32::INFINITY), f32::INFINITY);
    }

    #[test]
    fn every_other_name_has_the_parameters_value() {
        for (name, parameter) in NEWER_NAMES {
            assert_eq!(
                ParameterId::from_name(name.as_bytes()),
                None,
                "{name} is in a table"
            );
            let named = NamedParameter::from_name(name.as_bytes()).expect("a name");
            assert_eq!((named.id, named.name().as_str()), (parameter.into(), name));
            if name != SKIPPED_CHECKS {
                assert_eq!((named.to_own(7.0), named.from_own(7.0)), (7.0, 7.0));
            }
        }
        let own = NamedParameter::from_name(b"batt2_monitor").expect("a name");
        assert_eq!((own.name().as_str(), own.is_newer()), ("BATT2_MONITOR", false));
    }
}
