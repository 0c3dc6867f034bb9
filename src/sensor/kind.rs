//! Kinds of battery monitors.

use super::{FuelKind, PartKind};
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, Parameters};

/// For how long a pack may be without a reading that is taken in each sampling tick, or reported as often, in microseconds: a
/// tick.
pub(super) const TICK_TIMEOUT_US: u64 = 100_000;

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
    /// Another component of the vehicle, such as a companion computer.
    External,
    /// Fuel sensor.
    Fuel(FuelKind),
    /// Part on the I2C bus.
    Bus(PartKind),
    /// Node on the CAN bus.
    Can,
    /// Generator on the serial line, its electrical output.
    GeneratorElectrical,
    /// Generator on the serial line, its fuel.
    GeneratorFuel,
    /// Torqeedo motor on the serial line.
    Torqeedo,
    /// Engine control unit on the serial line.
    Efi,
}

/// Values of `BATT_MONITOR` for kinds other than parts on the I2C bus: ArduPilot's numbers.
const OWN: [(MonitorKind, i32); 15] = [
    (MonitorKind::AnalogVoltage, 3),
    (MonitorKind::AnalogVoltageAndCurrent, 4),
    (MonitorKind::Can, 8),
    (MonitorKind::Esc, 9),
    (MonitorKind::Sum, 10),
    (MonitorKind::Fuel(FuelKind::Flow), 11),
    (MonitorKind::Fuel(FuelKind::LevelPwm), 12),
    (MonitorKind::GeneratorElectrical, 17),
    (MonitorKind::GeneratorFuel, 18),
    (MonitorKind::Torqeedo, 23),
    (MonitorKind::Fuel(FuelKind::LevelAnalog), 24),
    (MonitorKind::SyntheticCurrent, 25),
    (MonitorKind::Efi, 27),
    (MonitorKind::External, 29),
    (MonitorKind::AnalogCurrent, 31),
];

impl MonitorKind {
    /// The kind set by a pack's `BATT_MONITOR`; `None` if disabled.
    pub fn of(parameters: &Parameters, pack: Pack) -> Option<Self> {
        Self::from_number(parameters.get_whole(BatteryParameter::Monitor.of(pack)))
    }

    /// The kind with this number; `None` for 0, disabled.
    pub fn from_number(number: i32) -> Option<Self> {
        let own = OWN.into_iter().find(|(_, own)| *own == number);
        own.map(|(kind, _)| kind)
            .or_else(|| PartKind::from_number(number).map(Self::Bus))
    }

    /// Whether the voltage is read at an analog pin.
    pub fn reads_voltage_pin(self) -> bool {
        matches!(
            self,
            Self::AnalogVoltage | Self::AnalogVoltageAndCurrent | Self::SyntheticCurrent
        )
    }

    pub(super) fn reads_current_pin(self) -> bool {
        matches!(self, Self::AnalogVoltageAndCurrent | Self::AnalogCurrent)
    }

    /// Whether every reading has a voltage: one without is a failed reading.
    pub fn measures_voltage(self) -> bool {
        match self {
            Self::AnalogVoltage
            | Self::AnalogVoltageAndCurrent
            | Self::SyntheticCurrent
            | Self::Esc
            | Self::External
            | Self::Can
            | Self::Torqeedo => true,
            // Its pins are set one by one, so it may measure a current alone.
            Self::Bus(part) => part != PartKind::Ad7091r5,
            // The members of a sum may all be without a voltage, and a small fuel cell reports a share alone.
            Self::Sum
            | Self::GeneratorElectrical
            | Self::AnalogCurrent
            | Self::Fuel(_)
            | Self::GeneratorFuel
            | Self::Efi => false,
        }
    }
}

/// Whether any pack uses the pulse input.
pub fn needs_pulses(parameters: &Parameters) -> bool {
    let has_pulses = |kind| matches!(kind, MonitorKind::Fuel(FuelKind::Flow | FuelKind::LevelPwm));
    kinds(parameters).any(has_pulses)
}

/// Whether any pack is measured by a part at the SPI bus.
pub fn needs_spi(parameters: &Parameters) -> bool {
    kinds(parameters).any(|kind| matches!(kind, MonitorKind::Bus(part) if part.is_at_spi()))
}

fn kinds(parameters: &Parameters) -> impl Iterator<Item = MonitorKind> {
    Pack::ALL
        .into_iter()
        .filter_map(|pack| MonitorKind::of(parameters, pack))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::Range;

    #[test]
    fn parameter_accepts_every_kind_and_no_other() {
        let Range::OneOf(choices) = BatteryParameter::Monitor.row().range else {
            panic!("a list of kinds");
        };
        let own = OWN.into_iter().map(|(_, number)| number);
        let parts = PartKind::ALL.iter().map(|kind| kind.number());
        let mut numbers: Vec<i32> = [0].into_iter().chain(own).chain(parts).collect();
        numbers.sort_unstable();
        let mut accepted: Vec<i32> = choices.iter().map(|(number, _)| *number).collect();
        accepted.sort_unstable();
        assert_eq!(accepted, numbers);
    }
}
