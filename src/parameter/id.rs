//! Parameter identifiers: names, flash keys, order.

use core::iter;

use heapless::String;

#[cfg(not(target_os = "none"))]
use super::table::SimulationParameter;
use super::table::{
    BatteryParameter, GroundStationParameter, Parameter, StickParameter, THERMOMETER_COUNT,
    TemperatureSensor, ThermometerParameter, VehicleParameter,
};
use crate::pack::{MAX_PACKS, Pack};

/// Maximum length of a parameter's name in MAVLink.
pub const MAX_NAME_LENGTH: usize = 16;

/// Keys reserved per pack.
const KEYS_PER_PACK: u16 = 128;

/// Keys reserved per thermometer.
const KEYS_PER_THERMOMETER: u16 = 16;

/// Default `BATT_MONITOR` of the first pack: the board's divider. The other packs are disabled by default.
const FIRST_PACK_MONITOR: f32 = 3.0;

/// Number of parameters, including hidden ones.
pub const PARAMETER_COUNT: usize = VARIABLE_COUNT + GroundStationParameter::COUNT;

/// Number of those that are not constant. The constants come last.
pub(super) const VARIABLE_COUNT: usize = SIMULATION_START + SIMULATION_COUNT;

/// Number of the first parameter of the packs.
const BATTERY_START: usize = THERMOMETER_START + THERMOMETER_COUNT * ThermometerParameter::COUNT;

/// Number of the first parameter of the thermometers.
const THERMOMETER_START: usize = VehicleParameter::COUNT + StickParameter::COUNT;

/// Number of the first simulator parameter.
const SIMULATION_START: usize = BATTERY_START + MAX_PACKS * BatteryParameter::COUNT;

#[cfg(target_os = "none")]
const SIMULATION_COUNT: usize = 0;
#[cfg(not(target_os = "none"))]
const SIMULATION_COUNT: usize = SimulationParameter::COUNT;

const FIRST_CONSTANT: ParameterId = ParameterId::GroundStation(GroundStationParameter::FIRST);

/// The parameter that follows those of the packs.
#[cfg(target_os = "none")]
const AFTER_PACKS: ParameterId = FIRST_CONSTANT;
#[cfg(not(target_os = "none"))]
const AFTER_PACKS: ParameterId = ParameterId::Simulation(SimulationParameter::FIRST);

/// Identifies a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ParameterId {
    /// Of the vehicle.
    Vehicle(VehicleParameter),
    /// Of the driver's sticks.
    Stick(StickParameter),
    /// Of a thermometer.
    Thermometer(TemperatureSensor, ThermometerParameter),
    /// Of a pack.
    Battery(Pack, BatteryParameter),
    /// Of the simulated pack.
    #[cfg(not(target_os = "none"))]
    Simulation(SimulationParameter),
    /// A constant for ground stations.
    GroundStation(GroundStationParameter),
}

impl ParameterId {
    /// All parameters including hidden ones: the vehicle's, the sticks', the thermometers', each pack's, the simulator's, the constants, each in the
    /// order of its table.
    pub fn all() -> impl Iterator<Item = Self> {
        iter::successors(Some(Self::Vehicle(VehicleParameter::FIRST)), |id| id.next())
    }

    /// The next one in [`Self::all`].
    // Inlined, the code would be repeated at every search.
    #[inline(never)]
    fn next(self) -> Option<Self> {
        let next = match self {
            Self::Vehicle(parameter) => parameter
                .next()
                .map_or(Self::Stick(StickParameter::FIRST), Self::Vehicle),
            Self::Stick(parameter) => parameter.next().map_or(
                ThermometerParameter::FIRST.of(TemperatureSensor::First),
                Self::Stick,
            ),
            Self::Thermometer(sensor, parameter) => match (parameter.next(), sensor.next()) {
                (Some(next), _) => next.of(sensor),
                (None, Some(next)) => ThermometerParameter::FIRST.of(next),
                (None, None) => BatteryParameter::FIRST.of(Pack::First),
            },
            Self::Battery(pack, parameter) => match (parameter.next(), pack.next()) {
                (Some(next), _) => next.of(pack),
                (None, Some(next)) => BatteryParameter::FIRST.of(next),
                (None, None) => AFTER_PACKS,
            },
            #[cfg(not(target_os = "none"))]
            Self::Simulation(parameter) => parameter.next().map_or(FIRST_CONSTANT, Self::Simulation),
            Self::GroundStation(parameter) => return parameter.next().map(Self::GroundStation),
        };
        Some(next)
    }

    /// The parameter with this flash key.
    pub fn from_key(key: u16) -> Option<Self> {
        Self::all().find(|id| id.key() == key)
    }

    /// The parameter with this name, case-insensitive as in ArduPilot.
    pub fn from_name(name: &[u8]) -> Option<Self> {
        let of_pack = |pack: Pack| {
            let parameter = BatteryParameter::from_name(strip_prefix(name, pack.prefix())?)?;
            Some(parameter.of(pack))
        };
        let of_thermometer = |sensor: TemperatureSensor| {
            let parameter = ThermometerParameter::from_name(strip_prefix(name, sensor.prefix())?)?;
            Some(parameter.of(sensor))
        };
        let found = VehicleParameter::from_name(name)
            .map(Self::Vehicle)
            .or_else(|| StickParameter::from_name(name).map(Self::Stick))
            .or_else(|| GroundStationParameter::from_name(name).map(Self::GroundStation))
            .or_else(|| TemperatureSensor::ALL.into_iter().find_map(of_thermometer))
            .or_else(|| Pack::ALL.into_iter().find_map(of_pack));
        #[cfg(not(target_os = "none"))]
        let found = found.or_else(|| SimulationParameter::from_name(name).map(Self::Simulation));
        found
    }

    /// The full name, with the pack's or thermometer's prefix.
    pub fn name(self) -> String<MAX_NAME_LENGTH> {
        let mut name = String::new();
        // Every name fits, as a test proves.
        let _ = name.push_str(self.prefix());
        let _ = name.push_str(self.row().name);
        name
    }

    fn prefix(self) -> &'static str {
        match self {
            Self::Battery(pack, _) => pack.prefix(),
            Self::Thermometer(sensor, _) => sensor.prefix(),
            _ => "",
        }
    }

    /// Position in [`Self::all`].
    pub(super) fn number(self) -> usize {
        match self {
            Self::Vehicle(parameter) => parameter as usize,
            Self::Stick(parameter) => VehicleParameter::COUNT + parameter as usize,
            Self::Thermometer(sensor, parameter) => {
                THERMOMETER_START + sensor as usize * ThermometerParameter::COUNT + parameter as usize
            }
            Self::Battery(pack, parameter) => {
                BATTERY_START + pack as usize * BatteryParameter::COUNT + parameter as usize
            }
            #[cfg(not(target_os = "none"))]
            Self::Simulation(parameter) => SIMULATION_START + parameter as usize,
            Self::GroundStation(parameter) => VARIABLE_COUNT + parameter.number(),
        }
    }

    /// Its row in the table.
    pub fn row(self) -> &'static Parameter {
        match self {
            Self::Vehicle(parameter) => parameter.row(),
            Self::Stick(parameter) => parameter.row(),
            Self::Thermometer(_, parameter) => parameter.row(),
            Self::Battery(_, parameter) => parameter.row(),
            #[cfg(not(target_os = "none"))]
            Self::Simulation(parameter) => parameter.row(),
            Self::GroundStation(parameter) => parameter.row(),
        }
    }

    /// Flash key, 0 if it is constant.
    pub fn key(self) -> u16 {
        match self {
            Self::Battery(pack, parameter) => {
                parameter.row().key + KEYS_PER_PACK * u16::from(pack.instance())
            }
            Self::Thermometer(sensor, parameter) => {
                parameter.row().key + KEYS_PER_THERMOMETER * sensor as u16
            }
            _ => self.row().key,
        }
    }

    /// Default value, in the parameter's unit.
    pub fn default_value(self) -> f32 {
        match self {
            Self::Battery(Pack::First, BatteryParameter::Monitor) => FIRST_PACK_MONITOR,
            _ => self.row().default,
        }
    }
}

impl From<StickParameter> for ParameterId {
    fn from(parameter: StickParameter) -> Self {
        Self::Stick(parameter)
    }
}

impl From<VehicleParameter> for ParameterId {
    fn from(parameter: VehicleParameter) -> Self {
        Self::Vehicle(parameter)
    }
}

#[cfg(not(target_os = "none"))]
impl From<SimulationParameter> for ParameterId {
    fn from(parameter: SimulationParameter) -> Self {
        Self::Simulation(parameter)
    }
}

impl BatteryParameter {
    /// This parameter of `pack`.
    pub fn of(self, pack: Pack) -> ParameterId {
        ParameterId::Battery(pack, self)
    }
}

impl ThermometerParameter {
    /// This parameter of `sensor`.
    pub fn of(self, sensor: TemperatureSensor) -> ParameterId {
        ParameterId::Thermometer(sensor, self)
    }
}

/// `name` without `prefix`, case-insensitive.
fn strip_prefix<'a>(name: &'a [u8], prefix: &str) -> Option<&'a [u8]> {
    let (begin, rest) = name.split_at_checked(prefix.len())?;
    begin.eq_ignore_ascii_case(prefix.as_bytes()).then_some(rest)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::parameter::Access;

    #[test]
    fn names_and_keys_are_unique_and_found() {
        let (mut names, mut keys) = (HashSet::new(), HashSet::new());
        for (number, id) in ParameterId::all().enumerate() {
            let name = id.name();
            assert_eq!(id.number(), number, "{name}");
            assert_eq!(name.len(), id.prefix().len() + id.row().name.len(), "{name}");
            assert_eq!(ParameterId::from_name(name.as_bytes()), Some(id));
            assert_eq!(ParameterId::from_name(name.to_lowercase().as_bytes()), Some(id));
            if id.row().access != Access::Constant {
                assert!(keys.insert(id.key()), "{name}: key {} twice", id.key());
                assert_eq!(ParameterId::from_key(id.key()), Some(id), "{name}");
            }
            assert!(names.insert(name.clone()), "{name} twice");
        }
        assert_eq!(names.len(), PARAMETER_COUNT);
    }

    #[test]
    fn keys_of_packs_do_not_overlap() {
        let first = BatteryParameter::Monitor.row().key;
        for parameter in BatteryParameter::ALL {
            let key = parameter.row().key;
            assert!((first..first + KEYS_PER_PACK).contains(&key), "{parameter:?}");
        }
        for parameter in VehicleParameter::ALL {
            assert!(parameter.row().key < first, "{parameter:?}");
        }
    }

    #[test]
    // Requirement: AP-1
    fn released_names_and_keys_are_unchanged() {
        for (name, key) in [
            ("SYSID_THISMAV", 1),
            ("SERIAL0_BAUD", 2),
            ("SR0_EXTRA1", 3),
            ("SR0_PARAMS", 4),
            ("PARAM_CHECKED", 52),
            ("MOT_DRV_VOLT", 53),
            ("BATT_MONITOR", 64),
            ("BATT_VOLT_PIN", 65),
            ("BATT_VOLT_MULT", 66),
            ("BATT_VLT_OFFSET", 67),
            ("BATT_CAPACITY", 68),
            ("BATT_WATT_MAX", 84),
            ("ARMING_CHECK", 5),
            ("FS_TIMEOUT", 6),
            ("MOT_SLEWRATE", 7),
            ("BATT_FS_LOW_ACT", 85),
            ("BATT_FS_CRT_ACT", 86),
            ("BATT_ARM_VOLT", 87),
            ("BATT_ARM_MAH", 88),
            ("BATT2_MONITOR", 192),
            ("BATT9_WATT_MAX", 1108),
        ] {
            let id = ParameterId::from_name(name.as_bytes()).expect(name);
            assert_eq!(id.key(), key, "{name}");
        }
    }

    #[test]
    fn only_the_first_pack_is_enabled_by_default() {
        let monitors = Pack::ALL.map(|pack| BatteryParameter::Monitor.of(pack).default_value());
        assert_eq!(monitors, [3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }
}
