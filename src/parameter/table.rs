//! Every parameter there is.

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Which parameter this row describes.
    pub id: ParameterId,
    /// Its name in ArduPilot 4.6, at most 16 characters.
    pub name: &'static str,
    /// The value it has until somebody sets it.
    pub default: f32,
    /// The smallest value it takes.
    pub min: f32,
    /// The largest value it takes.
    pub max: f32,
    /// The unit of its value, empty for a plain number.
    pub unit: &'static str,
    /// What it does, for its owner.
    pub description: &'static str,
}

/// The name of a parameter in code; its number is its row in [`TABLE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ParameterId {
    /// `SYSID_THISMAV`
    SysidThismav,
    /// `SR0_EXTRA1`
    Sr0Extra1,
    /// `BATT_VOLT_MULT`
    BattVoltMult,
}

impl ParameterId {
    /// Every parameter, in the order of the table.
    pub const ALL: [Self; PARAMETER_COUNT] = [Self::SysidThismav, Self::Sr0Extra1, Self::BattVoltMult];
}

pub(super) const PARAMETER_COUNT: usize = 3;

/// Every parameter there is.
pub static TABLE: [Parameter; PARAMETER_COUNT] = [
    Parameter {
        id: ParameterId::SysidThismav,
        name: "SYSID_THISMAV",
        default: 1.0,
        min: 1.0,
        max: 255.0,
        unit: "",
        description: "MAVLink system id of this vehicle",
    },
    Parameter {
        id: ParameterId::Sr0Extra1,
        name: "SR0_EXTRA1",
        default: 2.0,
        min: 0.0,
        max: 50.0,
        unit: "Hz",
        description: "Rate of SYS_STATUS and of each BATTERY_STATUS; 0 sends none",
    },
    Parameter {
        id: ParameterId::BattVoltMult,
        name: "BATT_VOLT_MULT",
        default: 3.95,
        min: 0.1,
        max: 100.0,
        unit: "",
        description: "Pack voltage divided by the voltage at the pin",
    },
];
