//! What measures a pack.

/// What measures a pack; the numbers are those of `BATT_MONITOR`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum MonitorKind {
    /// A divider on an analog pin.
    AnalogVoltage = 3,
    /// A divider and a current sensor on analog pins.
    AnalogVoltageAndCurrent = 4,
    /// The other packs together.
    Sum = 10,
    /// A divider on an analog pin, and a current reckoned from the throttle.
    SyntheticCurrent = 25,
    /// A current sensor on an analog pin.
    AnalogCurrent = 31,
}

impl MonitorKind {
    /// The kind with this number; `None` for 0, a pack that is not monitored.
    pub fn from_number(number: i32) -> Option<Self> {
        [
            Self::AnalogVoltage,
            Self::AnalogVoltageAndCurrent,
            Self::Sum,
            Self::SyntheticCurrent,
            Self::AnalogCurrent,
        ]
        .into_iter()
        .find(|kind| *kind as i32 == number)
    }

    pub(super) fn reads_voltage_pin(self) -> bool {
        match self {
            Self::AnalogVoltage | Self::AnalogVoltageAndCurrent | Self::SyntheticCurrent => true,
            Self::AnalogCurrent | Self::Sum => false,
        }
    }

    pub(super) fn reads_current_pin(self) -> bool {
        match self {
            Self::AnalogVoltageAndCurrent | Self::AnalogCurrent => true,
            Self::AnalogVoltage | Self::SyntheticCurrent | Self::Sum => false,
        }
    }
}
