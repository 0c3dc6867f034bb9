//! Kinds of battery monitors.

use super::{FuelKind, PartKind};
use crate::parameter::{BatteryParameter, Meaning, Pack, Parameters, means};

/// Kind of battery monitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum MonitorKind {
    /// Voltage divider on an analog pin.
    AnalogVoltage,
    /// Voltage divider and current sensor on analog pins.
    AnalogVoltageAndCurrent,
    /// Sum of other packs.
    Sum,
    /// Voltage divider on an analog pin, and a current estimated from the throttle.
    SyntheticCurrent,
    /// Current sensor on an analog pin.
    AnalogCurrent,
    /// ESC telemetry.
    Esc,
    /// Fuel sensor.
    Fuel(FuelKind),
    /// Part on the I2C bus.
    Bus(PartKind),
}

/// Values of `BATT_MONITOR`: ArduPilot's numbers.
pub const MONITOR_CHOICES: &[(i32, Meaning)] = &monitor_choices();

const DISABLED: (i32, Meaning) = (0, means("Disabled"));

/// Kinds other than parts on the I2C bus.
const OWN: [(MonitorKind, i32, Meaning); 9] = [
    (MonitorKind::AnalogVoltage, 3, means("Analog Voltage Only")),
    (
        MonitorKind::AnalogVoltageAndCurrent,
        4,
        means("Analog Voltage and Current"),
    ),
    (MonitorKind::Esc, 9, means("ESC")),
    (MonitorKind::Sum, 10, means("Sum Of Selected Monitors")),
    (MonitorKind::Fuel(FuelKind::Flow), 11, means("FuelFlow")),
    (MonitorKind::Fuel(FuelKind::LevelPwm), 12, means("FuelLevelPWM")),
    (
        MonitorKind::Fuel(FuelKind::LevelAnalog),
        24,
        means("FuelLevelAnalog"),
    ),
    (
        MonitorKind::SyntheticCurrent,
        25,
        means("Synthetic Current and Analog Voltage"),
    ),
    (MonitorKind::AnalogCurrent, 31, means("Analog Current Only")),
];

const CHOICES: usize = 1 + OWN.len() + PartKind::ALL.len();

const fn monitor_choices() -> [(i32, Meaning); CHOICES] {
    let mut choices = [DISABLED; CHOICES];
    let mut place = 1;
    // A `for` loop can't be evaluated at compile time.
    let mut own = 0;
    while own < OWN.len() {
        choices[place] = (OWN[own].1, OWN[own].2);
        (own, place) = (own + 1, place + 1);
    }
    let mut part = 0;
    while part < PartKind::ALL.len() {
        choices[place] = (PartKind::ALL[part].number(), means(PartKind::ALL[part].label()));
        (part, place) = (part + 1, place + 1);
    }
    choices
}

impl MonitorKind {
    /// The kind set by a pack's `BATT_MONITOR`; `None` if disabled.
    pub fn of(parameters: &Parameters, pack: Pack) -> Option<Self> {
        Self::from_number(parameters.get_whole(BatteryParameter::Monitor.of(pack)))
    }

    /// The kind with this number; `None` for 0, disabled.
    pub fn from_number(number: i32) -> Option<Self> {
        let own = OWN.into_iter().find(|(_, own, _)| *own == number);
        own.map(|(kind, ..)| kind)
            .or_else(|| PartKind::from_number(number).map(Self::Bus))
    }

    pub(super) fn reads_voltage_pin(self) -> bool {
        match self {
            Self::AnalogVoltage | Self::AnalogVoltageAndCurrent | Self::SyntheticCurrent => true,
            Self::AnalogCurrent | Self::Sum | Self::Esc | Self::Fuel(_) | Self::Bus(_) => false,
        }
    }

    pub(super) fn reads_current_pin(self) -> bool {
        match self {
            Self::AnalogVoltageAndCurrent | Self::AnalogCurrent => true,
            Self::AnalogVoltage
            | Self::SyntheticCurrent
            | Self::Sum
            | Self::Esc
            | Self::Fuel(_)
            | Self::Bus(_) => false,
        }
    }
}

/// Whether any pack uses the pulse input.
pub fn needs_pulses(parameters: &Parameters) -> bool {
    let has_pulses = |kind| matches!(kind, MonitorKind::Fuel(FuelKind::Flow | FuelKind::LevelPwm));
    kinds(parameters).any(has_pulses)
}

/// Whether any pack uses ESC telemetry.
pub fn needs_esc(parameters: &Parameters) -> bool {
    kinds(parameters).any(|kind| kind == MonitorKind::Esc)
}

pub(super) fn kinds(parameters: &Parameters) -> impl Iterator<Item = MonitorKind> {
    Pack::ALL
        .into_iter()
        .filter_map(|pack| MonitorKind::of(parameters, pack))
}
