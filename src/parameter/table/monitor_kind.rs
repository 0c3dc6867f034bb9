//! Kinds of battery monitors, the values of `BATT_MONITOR`.

use super::range::{Meaning, means};

/// Longest time without a reading of a pack that is read in each sampling tick, or reported as often, in microseconds: a tick.
pub(crate) const TICK_TIMEOUT_US: u64 = 100_000;

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
    /// Part on the I2C or SPI bus.
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

/// Kind of fuel sensor. None of them shows that it is broken: without pulses an engine seems to stand, and an open input is some level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum FuelKind {
    /// Flow sensor with a fixed volume per pulse.
    Flow,
    /// Level sensor with a pulse-width output.
    LevelPwm,
    /// Level sensor with an analog output.
    LevelAnalog,
}

/// Kind of part on the I2C or SPI bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum PartKind {
    /// A battery with a gauge of its own.
    SmartBattery,
    /// The battery of 3D Robotics' Solo.
    Solo,
    /// SUI's battery of three cells.
    Sui3Cells,
    /// SUI's battery of six cells.
    Sui6Cells,
    /// NeoDesign's battery.
    NeoDesign,
    /// Maxell's battery.
    Maxell,
    /// Rotoye's Batmon.
    Rotoye,
    /// Texas Instruments' INA226, INA228 and their like; which one it is shows its identification.
    Ina2xx,
    /// Texas Instruments' INA239, at the SPI bus.
    Ina239,
    /// Analog Devices' LTC2946.
    Ltc2946,
    /// Analog Devices' AD7091R-5: four more analog pins.
    Ad7091r5,
    /// Texas Instruments' INA3221: three packs on one chip.
    Ina3221,
    /// Texas Instruments' BQ76952: monitor of a stack of up to 16 cells.
    Bq76952,
    /// Parrot's motor board of the Bebop.
    Bebop,
}

/// Input of the board that a kind of monitor is read by, as far as it has to be set up or other sensors use its pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MonitorInput {
    /// An analog pin, the I2C bus, a link or other packs.
    AlwaysThere,
    /// The pulse input, GP17, which is also the interrupt line of the CAN controller.
    Pulses,
    /// The SPI bus, whose chip select GP22 may also be a transceiver's driver enable.
    Spi,
    /// The second serial port, with a protocol that measures this kind. The protocol has a time-out of its own.
    SerialLine,
    /// The CAN bus.
    Can,
    /// Motor controllers on the serial line or the CAN bus.
    Controllers,
}

/// A row for each kind: ArduPilot's number and name, the kind, its input, and the longest time without a reading, in
/// microseconds.
macro_rules! monitor_kinds {
    ($($number:literal $name:literal $kind:ident $(($group:ident::$member:ident))?: $input:ident, $timeout_us:expr;)+) => {
        /// Values of `BATT_MONITOR`.
        pub(super) const MONITOR_CHOICES: &[(i32, Meaning)] = &[(0, means("Disabled")), $(($number, means($name)),)+];

        impl MonitorKind {
            /// Every kind.
            pub const ALL: &'static [Self] = &[$(Self::$kind $(($group::$member))?,)+];

            /// The kind with this number; `None` for 0, disabled.
            pub fn from_number(number: i32) -> Option<Self> {
                match number {
                    $($number => Some(Self::$kind $(($group::$member))?),)+
                    _ => None,
                }
            }

            /// ArduPilot's number, in `BATT_MONITOR`.
            pub const fn number(self) -> i32 {
                match self {
                    $(Self::$kind $(($group::$member))? => $number,)+
                }
            }

            pub(crate) const fn input(self) -> MonitorInput {
                match self {
                    $(Self::$kind $(($group::$member))? => MonitorInput::$input,)+
                }
            }

            /// Longest time without a reading, in microseconds; a protocol on the serial line may have a longer one.
            pub(crate) const fn timeout_us(self) -> u64 {
                match self {
                    $(Self::$kind $(($group::$member))? => $timeout_us,)+
                }
            }
        }
    };
}

monitor_kinds! {
    3 "Analog Voltage Only" AnalogVoltage: AlwaysThere, TICK_TIMEOUT_US;
    4 "Analog Voltage and Current" AnalogVoltageAndCurrent: AlwaysThere, TICK_TIMEOUT_US;
    9 "ESC" Esc: Controllers, TICK_TIMEOUT_US;
    10 "Sum Of Selected Monitors" Sum: AlwaysThere, TICK_TIMEOUT_US;
    11 "FuelFlow" Fuel(FuelKind::Flow): Pulses, TICK_TIMEOUT_US;
    12 "FuelLevelPWM" Fuel(FuelKind::LevelPwm): Pulses, TICK_TIMEOUT_US;
    24 "FuelLevelAnalog" Fuel(FuelKind::LevelAnalog): AlwaysThere, TICK_TIMEOUT_US;
    25 "Synthetic Current and Analog Voltage" SyntheticCurrent: AlwaysThere, TICK_TIMEOUT_US;
    // As in ArduPilot (`AP_BATTMONITOR_UAVCAN_TIMEOUT_MICROS`).
    8 "DroneCAN-BatteryInfo" Can: Can, 5_000_000;
    17 "Generator-Elec" GeneratorElectrical: SerialLine, TICK_TIMEOUT_US;
    18 "Generator-Fuel" GeneratorFuel: SerialLine, TICK_TIMEOUT_US;
    23 "Torqeedo" Torqeedo: SerialLine, TICK_TIMEOUT_US;
    27 "EFI" Efi: SerialLine, TICK_TIMEOUT_US;
    // Over a longer interval the current would not be integrated without a gap.
    29 "Scripting, by a companion computer" External: AlwaysThere, 2_000_000;
    31 "Analog Current Only" AnalogCurrent: AlwaysThere, TICK_TIMEOUT_US;
    7 "SMBus-Generic" Bus(PartKind::SmartBattery): AlwaysThere, TICK_TIMEOUT_US;
    5 "Solo" Bus(PartKind::Solo): AlwaysThere, TICK_TIMEOUT_US;
    13 "SMBUS-SUI3" Bus(PartKind::Sui3Cells): AlwaysThere, TICK_TIMEOUT_US;
    14 "SMBUS-SUI6" Bus(PartKind::Sui6Cells): AlwaysThere, TICK_TIMEOUT_US;
    15 "NeoDesign" Bus(PartKind::NeoDesign): AlwaysThere, TICK_TIMEOUT_US;
    16 "SMBus-Maxell" Bus(PartKind::Maxell): AlwaysThere, TICK_TIMEOUT_US;
    19 "Rotoye" Bus(PartKind::Rotoye): AlwaysThere, TICK_TIMEOUT_US;
    21 "INA2XX" Bus(PartKind::Ina2xx): AlwaysThere, TICK_TIMEOUT_US;
    26 "INA239_SPI" Bus(PartKind::Ina239): Spi, TICK_TIMEOUT_US;
    22 "LTC2946" Bus(PartKind::Ltc2946): AlwaysThere, TICK_TIMEOUT_US;
    28 "AD7091R5" Bus(PartKind::Ad7091r5): AlwaysThere, TICK_TIMEOUT_US;
    30 "INA3221" Bus(PartKind::Ina3221): AlwaysThere, TICK_TIMEOUT_US;
    32 "TIBQ76952-I2C" Bus(PartKind::Bq76952): AlwaysThere, TICK_TIMEOUT_US;
    6 "Bebop" Bus(PartKind::Bebop): AlwaysThere, TICK_TIMEOUT_US;
}

impl MonitorKind {
    /// Whether the voltage is read at an analog pin.
    pub fn reads_voltage_pin(self) -> bool {
        matches!(
            self,
            Self::AnalogVoltage | Self::AnalogVoltageAndCurrent | Self::SyntheticCurrent
        )
    }

    /// Whether the voltage at a pin is converted by `BATT_VOLT_MULT` and `BATT_VLT_OFFSET`.
    pub fn uses_divider(self) -> bool {
        self.reads_voltage_pin() || self == Self::Bus(PartKind::Ad7091r5)
    }

    /// Whether the current is read at an analog pin.
    pub fn reads_current_pin(self) -> bool {
        matches!(self, Self::AnalogVoltageAndCurrent | Self::AnalogCurrent)
    }

    /// Whether readings may have a voltage.
    pub fn may_measure_voltage(self) -> bool {
        !matches!(
            self,
            Self::AnalogCurrent | Self::Fuel(_) | Self::GeneratorFuel | Self::Efi
        )
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_a_number_of_its_own() {
        for kind in MonitorKind::ALL {
            assert_eq!(MonitorKind::from_number(kind.number()), Some(*kind));
        }
        assert_eq!(MonitorKind::from_number(0), None, "disabled");
    }
}
